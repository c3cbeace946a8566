// SPDX-License-Identifier: Apache-2.0
// What of the entropy coder takes every symbol: as GridKernels, a portable reference and others with the same
// results.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "codec/rans.h"

namespace relievo::rans {

using States = std::array<std::uint32_t, kLanes>;

/// A stream on its way to words, the last symbol first. Words are written from `to` on downwards; the four
/// before the last one may be written, too.
struct StreamJob {
  Rows rows;
  const EncoderSymbol* symbols;
  std::uint16_t* to;
  States states;
};

/// What the level of each symbol costs, by the symbol's count; tables are done so many at a time.
constexpr std::size_t kTablesAtOnce = 8;

struct Kernels {
  const char* name;

  /// A stream of kLanes and one of a single lane, neither of which waits for the other.
  void (*encode)(StreamJob& lanes, StreamJob& single);

  /// Levels of kTablesAtOnce tables; `counts` of one table follow those of another, `symbols` each. See
  /// levels_of().
  void (*levels)(const std::uint32_t* counts, std::size_t symbols, Levels* out);
};

/// Those that run on this machine, the reference first and the best last.
const std::vector<Kernels>& all_kernels();

/// The best that runs on this machine.
const Kernels& kernels();

}  // namespace relievo::rans
