// SPDX-License-Identifier: Apache-2.0
// Eight numbers at once, for kernels that are compiled for several sets of instructions; a processor with
// narrower registers takes several for them. Vectors are passed by reference: how they would be by value
// depends on the set.
#pragma once

#include <cmath>
#include <cstdint>
#include <cstring>

namespace relievo {

using Eight = float __attribute__((vector_size(32)));
using EightInts = std::int32_t __attribute__((vector_size(32)));  // as a mask: 0 or -1
using FourLongs = std::int64_t __attribute__((vector_size(32)));

#define RELIEVO_INLINE [[gnu::always_inline]] inline

RELIEVO_INLINE void load(const float* from, Eight& to) {
  std::memcpy(&to, from, sizeof to);
}
RELIEVO_INLINE void store(const Eight& from, float* to) {
  std::memcpy(to, &from, sizeof from);
}
/// At once only in files that leave errno alone (CMakeLists.txt).
RELIEVO_INLINE void take_root(Eight& v) {
  float values[8];
  store(v, values);
  for (float& value : values) value = std::sqrt(value);
  load(values, v);
}
/// Numbers from 0 to 255. Compilers convert them one by one.
RELIEVO_INLINE void store(const EightInts& from, std::uint8_t* to) {
  FourLongs pairs;
  std::memcpy(&pairs, &from, sizeof pairs);
  pairs = (pairs | pairs >> 24) & 0xffff;
  const std::int64_t all = pairs[0] | pairs[1] << 16 | pairs[2] << 32 | pairs[3] << 48;
  std::memcpy(to, &all, sizeof all);
}

/// Masks in rows of bits: place 0 is the lowest bit of the first byte.
constexpr EightInts kBitOfEight = {1, 2, 4, 8, 16, 32, 64, 128};
RELIEVO_INLINE void spread(int bits, EightInts& mask) {
  mask = (kBitOfEight & bits) != 0;
}
RELIEVO_INLINE std::uint8_t gather(const EightInts& mask) {
  const EightInts bits = mask & kBitOfEight;
  FourLongs pairs;
  std::memcpy(&pairs, &bits, sizeof pairs);
  const std::int64_t both = pairs[0] | pairs[1] | pairs[2] | pairs[3];
  return static_cast<std::uint8_t>(both | both >> 32);
}
inline bool bit_of(const std::uint8_t* row, int place) {
  return (row[place / 8] >> (place % 8) & 1) != 0;
}

}  // namespace relievo
