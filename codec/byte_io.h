// SPDX-License-Identifier: Apache-2.0
// Little-endian numbers in byte buffers, for the formats of this folder. Nothing here throws or reads outside
// its span: a reader that ran over its end stays failed and returns zeros.
#pragma once

#include <bit>
#include <concepts>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <span>
#include <string>
#include <string_view>

#include "base/stream.h"

namespace relievo {

static_assert(std::endian::native == std::endian::little, "relievo's formats are read and written in place");

template <typename T>
concept Scalar = std::integral<T> || std::floating_point<T>;

template <Scalar T>
void append(Bytes& out, T value) {
  const std::size_t at = out.size();
  out.resize(at + sizeof(T));
  std::memcpy(out.data() + at, &value, sizeof(T));
}

inline void append_bytes(Bytes& out, std::span<const std::uint8_t> bytes) {
  out.insert(out.end(), bytes.begin(), bytes.end());
}

/// u32 length, then the bytes.
inline void append_string(Bytes& out, std::string_view text) {
  append(out, static_cast<std::uint32_t>(text.size()));
  out.insert(out.end(), text.begin(), text.end());
}

/// Overwrites a number that is already in the buffer.
template <Scalar T>
void put(Bytes& out, std::size_t at, T value) {
  std::memcpy(out.data() + at, &value, sizeof(T));
}

/// FNV-1a, 32 bits: the ids by which sections name those they build on.
inline std::uint32_t fnv1a(std::span<const std::uint8_t> bytes) {
  std::uint32_t hash = 2166136261U;
  for (const std::uint8_t byte : bytes) hash = (hash ^ byte) * 16777619U;
  return hash;
}

class ByteReader {
 public:
  explicit ByteReader(std::span<const std::uint8_t> bytes) : bytes_(bytes) {}

  bool ok() const { return ok_; }
  std::size_t position() const { return at_; }
  std::size_t remaining() const { return bytes_.size() - at_; }

  template <Scalar T>
  T read() {
    T value{};
    const auto raw = take(sizeof(T));
    if (ok_) std::memcpy(&value, raw.data(), sizeof(T));
    return value;
  }
  /// A view of the next `count` bytes; empty, and failed, where there are fewer.
  std::span<const std::uint8_t> take(std::uint64_t count) {
    if (!ok_ || count > remaining()) {
      ok_ = false;
      return {};
    }
    const auto view = bytes_.subspan(at_, static_cast<std::size_t>(count));
    at_ += static_cast<std::size_t>(count);
    return view;
  }
  std::string read_string() {
    const auto raw = take(read<std::uint32_t>());
    return {raw.begin(), raw.end()};
  }

 private:
  std::span<const std::uint8_t> bytes_;
  std::size_t at_ = 0;
  bool ok_ = true;
};

}  // namespace relievo
