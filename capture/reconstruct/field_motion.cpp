// SPDX-License-Identifier: Apache-2.0
#include "capture/reconstruct/field_motion.h"

#include <array>
#include <cmath>
#include <cstdlib>

namespace relievo {
namespace {

constexpr int kFurthest_px = 8;  // either way
constexpr int kShifts = 2 * kFurthest_px + 1;
constexpr int kFirstLook_px = 2;  // what holds still leaves more stripes at so far either way
constexpr int kStep_px = 4;       // stripes left over are steps over so many columns
constexpr int kEveryLine = 8;     // of a cell
constexpr int kAround = 1;        // cells on each side that are measured together
constexpr float kUsualWidth = 640;
constexpr float kClearer = 0.85F;  // of the stripes left without a shift, those left with it
constexpr float kStill_px = 0.5F;  // less makes no difference
constexpr float kAlike_px = 1.5F;  // between cells of one surface
constexpr int kSamples = 3 * FieldMotion::kCellWidth;

std::size_t index_of(int shift_px) {
  return static_cast<std::size_t>(shift_px + kFurthest_px);
}

}  // namespace

float FieldMotion::between(int line, float column_px) const {
  const float* row =
      px.data() + static_cast<std::size_t>(line / kCellLines) * static_cast<std::size_t>(cells);
  const int cell = std::clamp(static_cast<int>(column_px) / kCellWidth, 0, cells - 1);
  const float off = column_px - static_cast<float>(cell * kCellWidth + kCellWidth / 2);
  const float own = row[cell];
  const float other = row[std::clamp(off < 0 ? cell - 1 : cell + 1, 0, cells - 1)];
  return std::fabs(other - own) < kAlike_px ? own + std::fabs(off) / kCellWidth * (other - own) : own;
}

float FieldMotion::between_frames(const FieldMotion& before, int line, float column_px, float fields) const {
  const float now = at(line, column_px);
  const float then = before.at(line, column_px - fields * now);
  return fields * (std::fabs(then - now) < kSurface_px ? 0.5F * (now + then) : now);
}

void FieldMotion::of_columns(int line, int count, float* out) const {
  const float* row =
      px.data() + static_cast<std::size_t>(line / kCellLines) * static_cast<std::size_t>(cells);
  for (int cell = 0; cell < cells; ++cell) {
    const int begin = cell * kCellWidth;
    const int end = std::min(begin + kCellWidth, count);
    const bool still =
        row[cell] == 0 && row[std::max(cell - 1, 0)] == 0 && row[std::min(cell + 1, cells - 1)] == 0;
    for (int x = begin; x < end; ++x) out[x] = still ? 0.F : between(line, static_cast<float>(x));
  }
}

std::uint32_t* MotionFinder::costs(int cell_row, int shift_px) {
  return costs_.data() + (static_cast<std::size_t>(cell_row) * kShifts + index_of(shift_px)) *
                             static_cast<std::size_t>(cells_);
}

/// Of a row of cells: what steps the sum has along its lines with the complement `shift_px` further left.
void MotionFinder::residue(View8 slide, View8 complement, int cell_row, int shift_px, Scratch& scratch) {
  std::uint32_t* out = costs(cell_row, shift_px);
  std::fill_n(out, cells_, 0U);
  const int lines = std::min(slide.height, complement.height);
  const int first_line = cell_row * FieldMotion::kCellLines;
  const int last_line = std::min(first_line + FieldMotion::kCellLines, lines);
  // Half of the shift each, so that places are half way.
  const int back = shift_px >= 0 ? shift_px / 2 : -((1 - shift_px) / 2);
  const int on = shift_px - back;
  const int margin = kFurthest_px;
  const int first = 3 * margin;
  const int end = 3 * (slide.width - margin);
  for (int line = first_line + kEveryLine / 2; line < last_line; line += kEveryLine) {
    const std::uint8_t* s = slide.row(line) - 3 * back;
    const std::uint8_t* c = complement.row(line) + 3 * on;
    std::uint8_t* sum = scratch.sum.data();
    std::uint8_t* step = scratch.step.data();
    for (int i = first; i < end; ++i) sum[i] = static_cast<std::uint8_t>((s[i] + c[i] + 1) >> 1);
    constexpr int kHalf = 3 * kStep_px / 2;
    for (int i = first + kHalf; i < end - kHalf; ++i) {
      const std::uint8_t a = sum[i - kHalf];
      const std::uint8_t b = sum[i + kHalf];
      step[i] = static_cast<std::uint8_t>(std::max(a, b) - std::min(a, b));
    }
    for (int cell = 0; cell < cells_; ++cell) {
      const std::uint8_t* p = step + static_cast<std::size_t>(cell) * kSamples;
      std::uint32_t total = 0;
      for (int i = 0; i < kSamples; ++i) total += p[i];
      out[cell] += total;
    }
  }
}

/// Whether a cell of a row has less stripes, or nearly as few, with a shift.
bool MotionFinder::may_move(int cell_row) {
  const std::uint32_t* here = costs(cell_row, 0);
  const std::uint32_t* left = costs(cell_row, -kFirstLook_px);
  const std::uint32_t* right = costs(cell_row, kFirstLook_px);
  for (int cell = 1; cell + 1 < cells_; ++cell) {
    const auto around = [&](const std::uint32_t* c) { return c[cell - 1] + c[cell] + c[cell + 1]; };
    const auto still = static_cast<float>(around(here));
    if (static_cast<float>(std::min(around(left), around(right))) < 1.05F * still) return true;
  }
  return false;
}

void MotionFinder::measure(View8 slide, View8 complement, int cell_row, Scratch& scratch) {
  for (const int shift : {-kFirstLook_px, 0, kFirstLook_px})
    residue(slide, complement, cell_row, shift, scratch);
  const bool all = may_move(cell_row);
  measured_[static_cast<std::size_t>(cell_row)] = all;
  if (!all) return;
  for (int shift = -kFurthest_px; shift <= kFurthest_px; ++shift)
    if (shift != 0 && std::abs(shift) != kFirstLook_px) residue(slide, complement, cell_row, shift, scratch);
}

void MotionFinder::choose(int cell_row, FieldMotion& out) {
  float* px = out.px.data() + static_cast<std::size_t>(cell_row) * static_cast<std::size_t>(cells_);
  std::fill_n(px, cells_, 0.F);
  if (measured_[static_cast<std::size_t>(cell_row)] == 0) return;
  for (int cell = 0; cell < cells_; ++cell) {
    std::array<float, kShifts> total{};
    for (int row = std::max(0, cell_row - kAround); row <= std::min(rows_ - 1, cell_row + kAround); ++row) {
      if (measured_[static_cast<std::size_t>(row)] == 0) continue;
      for (int shift = -kFurthest_px; shift <= kFurthest_px; ++shift) {
        const std::uint32_t* of_row = costs(row, shift);
        for (int c = std::max(0, cell - kAround); c <= std::min(cells_ - 1, cell + kAround); ++c)
          total[index_of(shift)] += static_cast<float>(of_row[c]);
      }
    }
    const auto best = static_cast<std::size_t>(std::min_element(total.begin(), total.end()) - total.begin());
    if (best == 0 || best + 1 == kShifts || !(total[best] < kClearer * total[index_of(0)])) continue;
    const float before = total[best - 1] - total[best];
    const float behind = total[best + 1] - total[best];
    // Stripes left over rise evenly to both sides.
    const float part = 0.5F * (before - behind) / std::max({before, behind, 1.F});
    const float found = static_cast<float>(static_cast<int>(best) - kFurthest_px) + part;
    if (std::fabs(found) < kStill_px) continue;
    px[cell] = found;
    out.moves[static_cast<std::size_t>(cell_row)] = 1;
  }
}

void MotionFinder::find(View8 slide, View8 complement, WorkerPool& pool, FieldMotion& out) {
  out.moves.clear();
  cells_ = (slide.width + FieldMotion::kCellWidth - 1) / FieldMotion::kCellWidth;
  rows_ = (slide.height + FieldMotion::kCellLines - 1) / FieldMotion::kCellLines;
  if (slide.width <= 4 * kFurthest_px) return;
  out.cells = cells_;
  out.scale = std::max(1.F, static_cast<float>(slide.width) / kUsualWidth);
  const std::size_t cells = static_cast<std::size_t>(cells_) * static_cast<std::size_t>(rows_);
  out.px.resize(cells);
  out.moves.assign(static_cast<std::size_t>(rows_), 0);
  costs_.resize(cells * kShifts);
  measured_.resize(static_cast<std::size_t>(rows_));
  scratch_.resize(static_cast<std::size_t>(pool.workers()));
  pool.for_ranges(rows_, [&](int begin, int end, int worker) {
    Scratch& scratch = scratch_[static_cast<std::size_t>(worker)];
    const auto samples = static_cast<std::size_t>(cells_) * kSamples;
    scratch.sum.resize(samples);
    scratch.step.assign(samples, 0);
    for (int row = begin; row < end; ++row) measure(slide, complement, row, scratch);
  });
  pool.for_ranges(rows_, [&](int begin, int end, int) {
    for (int row = begin; row < end; ++row) choose(row, out);
  });
  if (std::none_of(out.moves.begin(), out.moves.end(), [](std::uint8_t m) { return m != 0; }))
    out.moves.clear();
}

}  // namespace relievo
