// SPDX-License-Identifier: Apache-2.0
// Which variants of a kernel table run on this machine.
#pragma once

#include <vector>

namespace relievo {

/// The reference first and the best last. `avx2` is left out where the processor lacks it.
template <typename Kernels>
std::vector<Kernels> variants(const Kernels& portable) {
  return {portable};
}
#if defined(__x86_64__)
template <typename Kernels>
std::vector<Kernels> variants(const Kernels& portable, const Kernels& avx2) {
  std::vector<Kernels> out{portable};
  if (__builtin_cpu_supports("avx2")) out.push_back(avx2);
  return out;
}
#endif

}  // namespace relievo
