// SPDX-License-Identifier: Apache-2.0
// How fast this machine reads memory: the bound that the reconstruction is held against.
#pragma once

#include "bench/report.h"

namespace relievo::bench {

/// Bytes a second at which `threads` threads together read a buffer larger than the last cache, measured
/// several times; its max is the machine's, since whatever else runs can only slow a reading down. Takes
/// memory: one and a half last caches, 64 MiB at least and a quarter of the free memory at most.
Spread measure_read_bandwidth(int threads);

}  // namespace relievo::bench
