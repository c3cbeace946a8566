// SPDX-License-Identifier: Apache-2.0
// operator new and delete of a program that works on pictures: what is large lies in huge pages, where the
// system gives them to those that ask (transparent_hugepage: madvise, as many distributions have it). Rows
// that lie pages apart are read side by side, and in a virtual machine each page of 4 kB that the processor
// has to look up anew costs microseconds (docs/BENCHMARKS.md, "The whole chain").
#include <sys/mman.h>

#include <cstdint>
#include <cstdlib>
#include <new>

namespace {

constexpr std::size_t kHugePage = std::size_t{1} << 21;

/// Null where there is no memory.
void* allocate(std::size_t size) noexcept {
  if (size < kHugePage) return std::malloc(size > 0 ? size : 1);
  if (size > SIZE_MAX - kHugePage) return nullptr;
  const std::size_t whole = (size + kHugePage - 1) / kHugePage * kHugePage;
  void* block = std::aligned_alloc(kHugePage, whole);
  if (block != nullptr) madvise(block, whole, MADV_HUGEPAGE);  // refused, it is memory all the same
  return block;
}

void* allocate_or_throw(std::size_t size) {
  for (;;) {
    if (void* block = allocate(size)) return block;
    const std::new_handler handler = std::get_new_handler();
    if (handler == nullptr) throw std::bad_alloc();
    handler();
  }
}

}  // namespace

// All of them, so that memory checkers see what malloc() gave come back to free(). Those for types of a
// larger alignment stay the library's.
void* operator new(std::size_t size) {
  return allocate_or_throw(size);
}
void* operator new[](std::size_t size) {
  return allocate_or_throw(size);
}
void* operator new(std::size_t size, const std::nothrow_t&) noexcept {
  return allocate(size);
}
void* operator new[](std::size_t size, const std::nothrow_t&) noexcept {
  return allocate(size);
}
void operator delete(void* block) noexcept {
  std::free(block);
}
void operator delete[](void* block) noexcept {
  std::free(block);
}
void operator delete(void* block, std::size_t) noexcept {
  std::free(block);
}
void operator delete[](void* block, std::size_t) noexcept {
  std::free(block);
}
