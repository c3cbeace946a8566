// SPDX-License-Identifier: Apache-2.0
// Eight numbers at once, for kernels that are compiled for several sets of instructions; a processor with
// narrower registers takes several for them. Vectors are passed by reference: how they would be by value
// depends on the set.
#pragma once

#include <cstdint>
#include <cstring>

namespace relievo {

using Eight = float __attribute__((vector_size(32)));
using EightInts = std::int32_t __attribute__((vector_size(32)));  // as a mask: 0 or -1
using EightBytes = std::uint8_t __attribute__((vector_size(8)));

#define RELIEVO_INLINE [[gnu::always_inline]] inline

RELIEVO_INLINE void load(const float* from, Eight& to) {
  std::memcpy(&to, from, sizeof to);
}
RELIEVO_INLINE void store(const Eight& from, float* to) {
  std::memcpy(to, &from, sizeof from);
}
RELIEVO_INLINE void load(const std::uint8_t* from, EightInts& to) {
  EightBytes bytes;
  std::memcpy(&bytes, from, sizeof bytes);
  to = __builtin_convertvector(bytes, EightInts);
}
RELIEVO_INLINE void store(const EightInts& from, std::uint8_t* to) {
  const EightBytes bytes = __builtin_convertvector(from, EightBytes);
  std::memcpy(to, &bytes, sizeof bytes);
}

}  // namespace relievo
