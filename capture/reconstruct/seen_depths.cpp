// SPDX-License-Identifier: Apache-2.0
#include "capture/reconstruct/seen_depths.h"

#include <algorithm>
#include <cmath>

namespace relievo {
namespace {

constexpr int kEveryLine = 2;
constexpr float kReach_px = 16;  // that a surface comes along the lines from one frame to the next
constexpr float kDeep_px = 3;    // that it moves stripes by

}  // namespace

void SeenDepths::fill(const std::vector<float>& before_px, const std::vector<ColumnRange>& columns,
                      const FieldMotion& motion) {
  scales_.resize(columns.size());
  std::transform(columns.begin(), columns.end(), scales_.begin(), [](const ColumnRange& c) {
    return Scale{c[0], static_cast<float>(kBins) / (c[1] - c[0])};
  });
  cells_ = motion.cells;
  const int boundaries = static_cast<int>(columns.size());
  const int lines = static_cast<int>(before_px.size()) / boundaries;
  rows_ = (lines + FieldMotion::kCellLines - 1) / FieldMotion::kCellLines;
  seen_.assign(static_cast<std::size_t>(rows_ * cells_), {});
  const float* before = before_px.data();
  for (int line = 0; line < lines; line += kEveryLine, before += kEveryLine * boundaries) {
    Depths* row = seen_.data() + static_cast<std::ptrdiff_t>(line / FieldMotion::kCellLines * cells_);
    for (int b = 0; b < boundaries; ++b) {
      const Scale& scale = scales_[static_cast<std::size_t>(b)];
      const float bin = (before[b] - scale.low_px) * scale.bins_a_px;
      const int cell = std::isnan(bin) ? cells_ : static_cast<int>(before[b]) / FieldMotion::kCellWidth;
      if (cell < cells_ && bin >= 0 && bin < kBins) row[cell].set(static_cast<std::size_t>(bin));
    }
  }
  around_.assign(seen_.size(), {});
  const int reach = std::max(1, static_cast<int>(kReach_px * motion.scale) / FieldMotion::kCellWidth);
  for (int row = 0; row < rows_; ++row) {
    for (int cell = 0; cell < cells_; ++cell) {
      Depths& out = around_[static_cast<std::size_t>(row * cells_ + cell)];
      for (int r = std::max(0, row - 1); r <= std::min(rows_ - 1, row + 1); ++r)
        for (int c = std::max(0, cell - reach); c <= std::min(cells_ - 1, cell + reach); ++c)
          out |= seen_[static_cast<std::size_t>(r * cells_ + c)];
    }
  }
}

bool SeenDepths::has(int line, int boundary, float column_px) const {
  const int row = line / FieldMotion::kCellLines;
  const int cell = static_cast<int>(column_px) / FieldMotion::kCellWidth;
  if (row >= rows_ || cell >= cells_) return false;
  const Scale& scale = scales_[static_cast<std::size_t>(boundary)];
  const Depths& depths = around_[static_cast<std::size_t>(row * cells_ + cell)];
  const float first = (column_px - kDeep_px - scale.low_px) * scale.bins_a_px;
  const float last = (column_px + kDeep_px - scale.low_px) * scale.bins_a_px;
  if (!(first < kBins) || !(last >= 0)) return false;
  const auto end = static_cast<std::size_t>(std::min(last, static_cast<float>(kBins - 1)));
  for (auto bin = static_cast<std::size_t>(std::max(first, 0.F)); bin <= end; ++bin)
    if (depths.test(bin)) return true;
  return false;
}

}  // namespace relievo
