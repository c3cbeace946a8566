// SPDX-License-Identifier: Apache-2.0
// A program's operator new (cli/huge_pages.cpp), as the kernel sees it.
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdint>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <limits>
#include <memory>
#include <new>
#include <string>
#include <vector>

namespace {

/// The flags that /proc/self/smaps has of the memory in which `at` lies: "hg" where huge pages were asked
/// for.
std::string flags_of(const void* at) {
  const auto wanted = reinterpret_cast<std::uintptr_t>(at);
  std::ifstream file("/proc/self/smaps");
  bool inside = false;
  for (std::string line; std::getline(file, line);) {
    std::uintptr_t begin = 0, end = 0;
    if (std::sscanf(line.c_str(), "%lx-%lx ", &begin, &end) == 2) inside = begin <= wanted && wanted < end;
    if (inside && line.starts_with("VmFlags:")) return line + " ";
  }
  return "";
}

TEST(HugePages, AreAskedForWhereMuchIsWanted) {
  if (!std::filesystem::exists("/sys/kernel/mm/transparent_hugepage"))
    GTEST_SKIP() << "this kernel has no transparent huge pages";
  const std::vector<std::uint8_t> picture(1920 * 1080 * 3, 1);
  const std::string flags = flags_of(picture.data() + picture.size() / 2);
  ASSERT_FALSE(flags.empty());
  EXPECT_NE(flags.find(" hg "), std::string::npos) << flags;
  EXPECT_EQ(reinterpret_cast<std::uintptr_t>(picture.data()) % (1U << 21), 0U);
}

TEST(HugePages, MemoryOfAnySizeHoldsWhatIsPutThere) {
  std::vector<std::unique_ptr<std::uint8_t[]>> blocks;
  const std::vector<std::size_t> sizes{0,        1, 24, 100'000, (1U << 21) - 1, 1U << 21, (1U << 21) + 1,
                                       7'000'000};
  for (int round = 0; round < 3; ++round) {
    for (const std::size_t size : sizes) {
      blocks.push_back(std::make_unique_for_overwrite<std::uint8_t[]>(size));
      std::fill_n(blocks.back().get(), size, static_cast<std::uint8_t>(blocks.size()));
    }
    for (std::size_t i = 0; i < blocks.size(); i += 2) blocks[i] = {};  // some come back, in another order
  }
  for (std::size_t i = 1; i < blocks.size(); i += 2) {
    const std::size_t size = sizes[i % sizes.size()];
    EXPECT_EQ(std::count(blocks[i].get(), blocks[i].get() + size, static_cast<std::uint8_t>(i + 1)),
              static_cast<std::ptrdiff_t>(size));
  }
}

TEST(HugePages, MoreThanThereIsThrows) {
  for (const std::size_t size :
       {std::numeric_limits<std::size_t>::max(), std::numeric_limits<std::size_t>::max() / 2}) {
    volatile std::size_t wanted = size;
    EXPECT_THROW(static_cast<void>(::operator new(wanted)), std::bad_alloc);
  }
}

}  // namespace
