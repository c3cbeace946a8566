// SPDX-License-Identifier: Apache-2.0
#include "capture/reconstruct/line_steps.h"

#include <algorithm>
#include <cmath>
#include <utility>

namespace relievo {
namespace {

// Correlation of what the light does on both lines, over a block and those beside it. Other stripes have 0 on
// average; where one of the rows shows the other surface, and also belongs to the next pair of lines, .7;
// stripes eight columns wide that lean by half a column a row, .7.
constexpr float kAlike = 0.6F;
constexpr float kPerCorrelation = 100;  // of LineStepFinder::unlike_
constexpr float kLit = 12;  // grey levels, root mean square of slide less complement: less shows no stripes

/// How unlike a block of one line is to the next line's, as LineStepFinder::unlike_.
std::uint8_t unlike(const PairProducts* about) {
  const float across = static_cast<float>(about[-1].across + about[0].across + about[1].across);
  const float here = static_cast<float>(about[-1].here + about[0].here + about[1].here);
  const float next = static_cast<float>(about[-1].next + about[0].next + about[1].next);
  constexpr float kLeast = kLit * kLit * 3 * 3 * LineSteps::kBlock_px;  // three channels of three blocks
  if (std::min(here, next) <= kLeast) return 0;
  const float correlation = across / std::sqrt(here * next);
  return static_cast<std::uint8_t>(correlation < kAlike ? 1 + kPerCorrelation * (kAlike - correlation) : 0);
}

}  // namespace

void LineStepFinder::find(const DetectionLines& rows, WorkerPool& pool, LineSteps& out) {
  const int lines = rows.own.height;
  out.blocks = rows.own.width / LineSteps::kBlock_px;
  const auto blocks = static_cast<std::size_t>(out.blocks);
  const auto row = [&](std::vector<std::uint8_t>& of_lines, int line) {
    return of_lines.data() + static_cast<std::size_t>(line) * blocks;
  };
  unlike_.resize(static_cast<std::size_t>(lines + 2) * blocks);
  out.below.resize(static_cast<std::size_t>(lines) * blocks);
  out.has_below.resize(static_cast<std::size_t>(lines));
  products_.resize(static_cast<std::size_t>(pool.workers()));
  for (auto& products : products_) products.assign(blocks + 2, {});  // with nothing beside the first and last
  std::fill_n(row(unlike_, 0), blocks, std::uint8_t{0});
  std::fill_n(row(unlike_, lines + 1), blocks, std::uint8_t{0});
  pool.for_ranges(lines, [&](int begin, int end, int worker) {
    std::vector<PairProducts>& products = products_[static_cast<std::size_t>(worker)];
    for (int line = begin; line < end; ++line) {
      std::uint8_t* here = row(unlike_, line + 1);
      std::uint8_t& any = out.has_below[static_cast<std::size_t>(line)];
      any = 0;
      std::fill_n(here, blocks, std::uint8_t{0});
      if (line + 1 == lines) continue;
      // Without the row between, which may show either.
      row_kernels().pair_products(
          {rows.own.row(line), rows.other_above(line), rows.own.row(line + 1), rows.other_below(line + 1)},
          out.blocks, products.data() + 1);
      for (std::size_t k = 0; k < blocks; ++k) any |= here[k] = unlike(products.data() + 1 + k);
    }
  });
  // Of several lines in a row the most unlike: the others have rows of both surfaces.
  pool.for_ranges(lines, [&](int begin, int end, int) {
    for (int line = begin; line < end; ++line) {
      std::uint8_t* below = row(out.below, line);
      std::uint8_t& has_below = out.has_below[static_cast<std::size_t>(line)];
      std::fill_n(below, blocks, std::uint8_t{0});
      if (std::exchange(has_below, std::uint8_t{0}) == 0) continue;
      const std::uint8_t* here = row(unlike_, line + 1);
      for (std::size_t k = 0; k < blocks; ++k) {
        below[k] = here[k] > (here - blocks)[k] && here[k] >= here[k + blocks] ? 1 : 0;
        has_below |= below[k];
      }
    }
  });
}

}  // namespace relievo
