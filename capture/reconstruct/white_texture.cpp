// SPDX-License-Identifier: Apache-2.0
#include "capture/reconstruct/white_texture.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <utility>

#include "base/fit_image.h"
#include "capture/pattern/schedule.h"
#include "capture/reconstruct/rows.h"
#include "capture/reconstruct/texture.h"
#include "capture/reconstruct/white_rows.h"

namespace relievo {
namespace {

constexpr int kBeside_px = 3;           // from a boundary to where its sides' colours are pure
constexpr float kLeastStep = 12;        // grey levels of a primary that a boundary must switch
constexpr std::size_t kLeastSeen = 50;  // boundaries that must tell of a primary
constexpr int kEvery = 4;               // boundaries looked at: one in so many of a line,
constexpr int kEveryQuickly = 64;
constexpr int kEachLine = 29;   // others than on the one above, so many to the left
constexpr float kSame = 0.01F;  // gains nearer 1 are noise
constexpr float kMostGain = 2;

float mix(const std::array<float, 9>& m, std::size_t row, const float* rgb) {
  return m[3 * row] * rgb[0] + m[3 * row + 1] * rgb[1] + m[3 * row + 2] * rgb[2];
}

}  // namespace

WhiteTexture::WhiteTexture(const std::array<double, 9>& colour_matrix, const CameraResponse& response,
                           bool quickly, int line_stride)
    : response_(response),
      line_stride_(line_stride),
      quickly_(quickly),
      every_(quickly ? kEveryQuickly : kEvery) {
  using Matrix = Eigen::Matrix<double, 3, 3, Eigen::RowMajor>;
  const Matrix inverse = Eigen::Map<const Matrix>(colour_matrix.data()).inverse();
  for (std::size_t i = 0; i < 9; ++i) {
    matrix_[i] = static_cast<float>(colour_matrix[i]);
    inverse_[i] = static_cast<float>(inverse.data()[i]);
  }
}

/// Median over boundaries of how much less a primary becomes in the slide for what more it becomes in the
/// complement, where it is switched. An edge of the scene there changes both alike and is as often on one
/// side.
void WhiteTexture::measure_gains(const CapturedFrame& frame, const DecodedGrid& grid, WorkerPool& pool) {
  for (RankedSample& r : ratios_) r.reset(pool.workers());
  const DetectionLines rows(frame, line_stride_);
  pool.for_ranges(grid.lines(), [&](int begin, int end, int worker) {
    for (int line = begin; line < end; ++line) measure_ratios(rows, grid, line, worker);
  });
  level_ = false;
  for (std::size_t c = 0; c < 3; ++c) {
    gains_[c] = 1;
    if (ratios_[c].size() < kLeastSeen) continue;
    const float middle = ratios_[c].median(1);
    if (std::fabs(middle - 1) < kSame) continue;
    gains_[c] = std::clamp(middle, 1 / kMostGain, kMostGain);
    level_ = true;
  }
  if (!level_) return;
  for (std::size_t i = 0; i < 3; ++i) {
    for (std::size_t j = 0; j < 3; ++j) {
      float sum = 0;
      for (std::size_t k = 0; k < 3; ++k) sum += inverse_[3 * i + k] * gains_[k] * matrix_[3 * k + j];
      levelled_[3 * i + j] = sum;
    }
  }
}

/// Of every every_-th boundary on a line.
void WhiteTexture::measure_ratios(const DetectionLines& rows, const DecodedGrid& grid, int line, int worker) {
  const View8 slides = rows.slide();
  const View8 complements = rows.complement();
  if (line >= std::min(slides.height, complements.height)) return;
  const float* column_px = grid.column_px(line);
  const std::uint8_t* interpolated = grid.interpolated(line);
  for (int b = every_ - 1 - (kEachLine * line + every_ - 1) % every_; b < grid.boundaries(); b += every_) {
    if (!(column_px[b] >= 0) || (interpolated != nullptr && interpolated[b] != 0)) continue;
    const int x = static_cast<int>(column_px[b] + 0.5F);
    if (x < kBeside_px || x + kBeside_px >= slides.width) continue;
    const std::uint8_t* slide = slides.row(line);
    const std::uint8_t* complement = complements.row(line);
    std::array<float, 3> slide_step{};
    std::array<float, 3> complement_step{};
    for (std::size_t c = 0; c < 3; ++c) {
      const std::size_t left = 3 * static_cast<std::size_t>(x - kBeside_px) + c;
      const std::size_t right = 3 * static_cast<std::size_t>(x + kBeside_px) + c;
      slide_step[c] = static_cast<float>(slide[right] - slide[left]);
      complement_step[c] = static_cast<float>(complement[right] - complement[left]);
    }
    for (std::size_t c = 0; c < 3; ++c) {
      const float s = mix(matrix_, c, slide_step.data());
      const float k = mix(matrix_, c, complement_step.data());
      if (std::fabs(s) > kLeastStep && std::fabs(k) > kLeastStep && (s > 0) != (k > 0))
        ratios_[c].of(worker).push_back(-s / k);
    }
  }
}

void WhiteTexture::level(float* row, int width) const {
  for (int x = 0; x < width; ++x) {
    float* p = row + 3 * x;
    const std::array<float, 3> rgb{p[0], p[1], p[2]};
    for (std::size_t c = 0; c < 3; ++c) p[c] = mix(levelled_, c, rgb.data());
  }
}

void WhiteTexture::store_sum(const Scratch& scratch, int samples, std::uint8_t* to) const {
  const float* own = scratch.own.data();
  const float* other = scratch.other.data();
  if (response_.is_straight()) return white_kernels().store_sum(own, other, samples, to);
  for (int i = 0; i < samples; ++i) to[i] = response_.value_of(own[i] + other[i]);
}

void WhiteTexture::progressive_row(const CapturedFrame& frame, int y, Scratch& scratch, Image8& out) const {
  const int width = frame.picture.width();
  response_.light_of(frame.picture.row(y), 3 * width, scratch.own.data());
  response_.light_of(frame.complement.row(y), 3 * width, scratch.other.data());
  level(scratch.other.data(), width);
  store_sum(scratch, 3 * width, out.row(y));
}

void WhiteTexture::interlaced_row(const CapturedFrame& frame, int y, Scratch& scratch, Image8& out) const {
  const Image8& picture = frame.picture;
  const int width = picture.width();
  const int height = picture.height();
  const std::uint8_t* own = picture.row(y);
  const std::uint8_t* above = picture.row(y > 0 ? y - 1 : y + 1);
  const std::uint8_t* below = picture.row(y + 1 < height ? y + 1 : y - 1);
  // A row above or below is of the other field, but the next ones are of this one: the more alike they are,
  // the more what lies between belongs to the same surface. At the picture's edge only one is there.
  const bool inside = y >= 2 && y + 2 < height;
  const std::uint8_t* field_above = picture.row(inside ? y - 2 : y);
  const std::uint8_t* field_below = picture.row(inside ? y + 2 : y);
  if (!level_ && response_.is_straight()) {
    row_kernels().weave_rows({own, above, below, field_above, field_below}, 3 * width,
                             scratch.differences.data(), out.row(y));
    return;
  }
  const auto light = [&](const std::uint8_t* row, std::vector<float>& to) {
    response_.light_of(row, 3 * width, to.data());
    return to.data();
  };
  white_kernels().other_field(
      {own, field_above, field_below, light(above, scratch.own), light(below, scratch.beside)}, 3 * width,
      {scratch.above.data() + 1, scratch.below.data() + 1}, scratch.other.data());
  light(own, scratch.own);
  if (level_)
    level(y % 2 == first_row(frame.field_order, 0) ? scratch.other.data() : scratch.own.data(), width);
  store_sum(scratch, 3 * width, out.row(y));
}

void WhiteTexture::make(const SeenFrame& seen, const DecodedGrid& grid, WorkerPool& pool, Image8& out) {
  measure_gains(seen.light, grid, pool);
  const CapturedFrame& frame = seen.captured;
  const int width = frame.picture.width();
  const int height = frame.picture.height();
  if (height < 2 || (!level_ && (quickly_ || frame.scan == Scan::kProgressive))) {
    add_fields(frame, response_, pool, out);
    return;
  }
  fit_image(width, height, 3, out);
  scratch_.resize(static_cast<std::size_t>(pool.workers()));
  for (Scratch& s : scratch_) {
    const std::size_t samples = static_cast<std::size_t>(width) * 3;
    s.above.resize(samples + 2);
    s.below.resize(samples + 2);
    s.own.resize(samples);
    s.other.resize(samples);
    s.beside.resize(samples);
    s.differences.resize(2 * (samples + 2));
  }
  pool.for_ranges(height, [&](int begin, int end, int worker) {
    Scratch& scratch = scratch_[static_cast<std::size_t>(worker)];
    for (int y = begin; y < end; ++y) {
      if (frame.scan == Scan::kProgressive) {
        progressive_row(frame, y, scratch, out);
      } else {
        interlaced_row(frame, y, scratch, out);
      }
    }
  });
}

}  // namespace relievo
