// SPDX-License-Identifier: Apache-2.0
#include "capture/reconstruct/luma_place.h"

#include <Eigen/Dense>
#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>

#include "capture/reconstruct/luma_rows.h"

namespace relievo {
namespace {

constexpr int kPlateau_px = 5;        // of the columns, where a side's level is measured: from 2 px on
constexpr float kBreak = 0.12F;       // change of luma over two columns, of its sum, at which a surface ends
constexpr float kFarthest_px = 2.5F;  // between colour's place and luma's
constexpr float kLevelSlack = 0.1F;   // of a side's luma ratio about what the code tells
constexpr float kLumaFactor = 1.3F;   // the middle level is itself measured
static_assert(kPlateau_px < LumaView::kMargin);
static_assert(std::endian::native == std::endian::little, "clear_run() counts bytes from the lowest");

// Red, green, blue and luma at once.
using Four = float __attribute__((vector_size(16)));

Four four_at(const float* p) {
  Four out;
  std::memcpy(&out, p, sizeof out);
  return out;
}

Four size_of(Four v) {
  return v < 0 ? -v : v;
}

/// Of a column that is not negative; a call of std::lround takes ten times as long.
int column_of(float column_px) {
  return static_cast<int>(column_px + 0.5F);
}

/// Columns from the one at `ends` on in a direction (-1 or 1) that show the same surface in the same light,
/// as far as luma tells, kMargin + 1 at most.
int clear_run(const std::uint8_t* ends, int direction) {
  std::uint64_t eight = 0;
  std::memcpy(&eight, direction > 0 ? ends + 1 : ends - 8, sizeof eight);
  return 1 + (direction > 0 ? std::countr_zero(eight) : std::countl_zero(eight)) / 8;
}

}  // namespace

LumaPlacer::LumaPlacer(const std::array<double, 9>& colour_matrix) {
  const Eigen::Matrix3d m =
      Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(colour_matrix.data());
  const Eigen::RowVector3d rec601(0.299, 0.587, 0.114);
  const Eigen::RowVector3d weights = rec601 * m.inverse();
  for (int i = 0; i < 3; ++i) weights_[static_cast<std::size_t>(i)] = static_cast<float>(weights[i]);
  const auto& w = weights_;
  for (std::size_t c = 0; c < 8; ++c)
    ratio_[c] =
        ((c & 1 ? w[0] : -w[0]) + (c & 2 ? w[1] : -w[1]) + (c & 4 ? w[2] : -w[2])) / (w[0] + w[1] + w[2]);
  size_ = std::sqrt(w[0] * w[0] + w[1] * w[1] + w[2] * w[2]);
}

void LumaPlacer::read_line(const DifferenceImage& image, int line, bool wide_stripes, LumaLine& out) const {
  const LumaKernels& kernels = luma_kernels();
  const int width = image.width;
  const auto columns = static_cast<std::size_t>(width);
  for (auto* row : {&out.luma_, &out.contrast_, &out.luma_contrast_, &out.brightest_, &out.darkest_})
    row->resize(columns);
  out.light_.resize(4 * columns);
  out.ends_.assign(columns + 2 * LumaView::kMargin, 1);
  if (width < 2 * kLumaReach_px) return;
  const float* red = image.line(line);
  const float* white = image.white_line(line);
  kernels.ratios({red, red + width, red + 2 * width, white}, width, weights_, kDarkSum, out.light_.data(),
                 out.luma_.data());
  kernels.ends(white + 1, width - 2, kBreak, kDarkSum, out.ends_.data() + LumaView::kMargin + 1);
  const float* above = image.white_line(std::max(0, line - 1));
  const float* below = image.white_line(std::min(image.lines - 1, line + 1));
  kernels.extremes({above + 1, white + 1, below + 1}, width - 2, wide_stripes, out.brightest_.data() + 1,
                   out.darkest_.data() + 1);
  for (const int around : {kContrastReach_px, kLumaContrast_px}) {
    auto& contrasts = around == kContrastReach_px ? out.contrast_ : out.luma_contrast_;
    constexpr int kFirst = kLumaReach_px;
    static_assert(kFirst > kContrastReach_px);
    kernels.contrasts(out.brightest_.data() + kFirst, out.darkest_.data() + kFirst, width - 2 * kFirst,
                      around, kDarkSum, contrasts.data() + kFirst);
  }
}

LumaPlace LumaPlacer::place(const LumaView& view, const LumaSides& sides, float share, float own_px) const {
  const int centre = column_of(own_px);
  const float* luma = view.luma - view.first;
  const float* light = view.light - 4 * view.first;
  const std::uint8_t* ends = view.ends - view.first;
  const Four weights{weights_[0], weights_[1], weights_[2], 0};

  LumaPlace out{.column_px = own_px};
  float place = own_px;
  const auto reach_in = [](float free) { return std::clamp(static_cast<int>(free - 2.F), 2, kPlateau_px); };
  std::array<int, 3> last{};
  for (int round = 0; round < 2; ++round) {
    const std::array reach_of{reach_in(sides.free_left_px + (place - own_px)),
                              reach_in(sides.free_right_px - (place - own_px))};
    const std::array columns{column_of(place), reach_of[0], reach_of[1]};
    if (round > 0 && columns == last) break;  // it would find the same
    last = columns;
    // Plateaus of both sides, and how strong each channel comes back from this surface.
    std::array<float, 2> measured{};
    std::array<int, 2> samples{};
    Four amplitude{};
    for (int s = 0; s < 2; ++s) {
      const int direction = s == 0 ? -1 : 1;
      const int middle = columns[0];
      const int inside = kLumaReach_px + direction * (centre - middle);
      const int furthest =
          std::min({reach_of[static_cast<std::size_t>(s)], clear_run(ends + middle, direction) - 1, inside});
      const int n = std::max(0, furthest - 1);  // from two columns away on
      samples[static_cast<std::size_t>(s)] = n;
      if (n == 0) {
        if (!sides.narrow) continue;
        // Between two steps: the nearest sample still tells the surface's channels, but no level.
        const Four nearest = size_of(four_at(light + 4 * (middle + direction)));
        amplitude = amplitude < nearest ? nearest : amplitude;
        continue;
      }
      Four sum{};
      for (int i = 2; i <= furthest; ++i) sum += four_at(light + 4 * (middle + direction * i));
      const Four mean = sum / static_cast<float>(n);
      measured[static_cast<std::size_t>(s)] = mean[3];
      const Four size = size_of(mean);
      amplitude = amplitude < size ? size : amplitude;
    }
    // Expected levels: this surface's channels under the code's colours. A surface in the projector's white
    // light alone would have `share`.
    const Four parts = weights * amplitude;
    const float total = parts[0] + parts[1] + parts[2];
    if (!(total > 0)) return out;
    const Four levels_of = parts * share / total;
    std::array<float, 2> expected{};
    for (std::size_t s = 0; s < 2; ++s) {
      const Primary colour = sides.colours[s];
      for (int c = 0; c < 3; ++c) expected[s] += (colour >> c & 1) ? levels_of[c] : -levels_of[c];
    }
    std::array<float, 2> levels{};
    for (std::size_t s = 0; s < 2; ++s) {
      const float off = measured[1 - s] - expected[1 - s];
      if (samples[s] > 0) {
        levels[s] = std::clamp(measured[s], expected[s] - kLevelSlack, expected[s] + kLevelSlack);
      } else {
        levels[s] = expected[s] + (samples[1 - s] > 0 ? std::clamp(off, -kLevelSlack, kLevelSlack) : 0);
      }
    }
    const float middle = 0.5F * (levels[0] + levels[1]);
    const bool rising = levels[1] > levels[0];
    float nearest = kFarthest_px;
    bool found = false;
    for (int x = centre - 4; x < centre + 4; ++x) {
      const float a = luma[x] - middle;
      const float b = luma[x + 1] - middle;
      if ((a > 0) == (b > 0) || (b > a) != rising) continue;
      const float column = static_cast<float>(x) - a / (b - a);
      if (std::fabs(column - place) >= nearest) continue;
      nearest = std::fabs(column - place);
      out.column_px = column;
      out.slope = std::fabs(b - a);
      found = true;
    }
    out.rise = levels[1] - levels[0];
    out.found = found;
    if (!found) return out;
    place = out.column_px;
  }
  return out;
}

LumaPlace LumaPlacer::place(const DifferenceImage& image, int line, const LumaSides& sides, float share,
                            float own_px) const {
  constexpr int kColumns = 16;
  constexpr int kMargin = LumaView::kMargin;
  static_assert(kColumns > 2 * kLumaReach_px);
  std::array<float, 4 * kColumns> light;
  std::array<float, kColumns> luma;
  std::array<std::uint8_t, kColumns + 2 * kMargin> ends;
  ends.fill(1);
  const int width = image.width;
  const int first = std::clamp(column_of(own_px) - kColumns / 2, 0, width - kColumns);
  const float* red = image.line(line) + first;
  const float* white = image.white_line(line) + first;
  const LumaKernels& kernels = luma_kernels();
  kernels.ratios({red, red + width, red + 2 * width, white}, kColumns, weights_, kDarkSum, light.data(),
                 luma.data());
  const int begin = first == 0 ? 1 : 0;
  const int end = first + kColumns == width ? kColumns - 1 : kColumns;
  kernels.ends(white + begin, end - begin, kBreak, kDarkSum, ends.data() + kMargin + begin);
  return place({first, light.data(), luma.data(), ends.data() + kMargin}, sides, share, own_px);
}

float LumaPlacer::sigma_px(const DifferenceImage& image, int line, const LumaPlace& place) const {
  const int x = std::clamp(column_of(place.column_px), 0, image.width - 1);
  const float noise = image.noise_at(line, x) * size_ / (image.white_line(line)[x] + kDarkSum);
  return kLumaFactor * noise / place.slope;
}

float contrast_around(const DifferenceImage& image, int line, int column, int around_px, bool wide_stripes) {
  const float* above = image.white_line(std::max(0, line - 1)) + column - around_px;
  const float* here = image.white_line(line) + column - around_px;
  const float* below = image.white_line(std::min(image.lines - 1, line + 1)) + column - around_px;
  constexpr std::size_t kMost = 2 * kContrastReach_px + 1;
  std::array<float, kMost> brightest{}, darkest{};
  float contrast = 0;
  const LumaKernels& kernels = luma_kernels();
  kernels.extremes({above, here, below}, 2 * around_px + 1, wide_stripes, brightest.data(), darkest.data());
  kernels.contrasts(brightest.data() + around_px, darkest.data() + around_px, 1, around_px, kDarkSum,
                    &contrast);
  return contrast;
}

}  // namespace relievo
