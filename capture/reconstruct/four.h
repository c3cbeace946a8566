// SPDX-License-Identifier: Apache-2.0
// Four numbers that are added, multiplied and compared at once wherever the processor can. See also eight.h.
#pragma once

#include <cstdint>

namespace relievo {

using Four = float __attribute__((vector_size(16)));
using FourInts = std::int32_t __attribute__((vector_size(16)));  // as a mask: 0 or -1

}  // namespace relievo
