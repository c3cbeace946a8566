// SPDX-License-Identifier: Apache-2.0
#include "capture/reconstruct/luma_place.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>

#include "capture/reconstruct/luma_rows.h"

namespace relievo {
namespace {

constexpr float kBreak = 0.12F;  // change of luma over two columns, of its sum, at which a surface ends

}  // namespace

std::array<float, 3> luma_weights(const std::array<double, 9>& colour_matrix) {
  const Eigen::Matrix3d m =
      Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(colour_matrix.data());
  const Eigen::RowVector3d rec601(0.299, 0.587, 0.114);
  const Eigen::RowVector3f weights = (rec601 * m.inverse()).cast<float>();
  return {weights[0], weights[1], weights[2]};
}

LumaPlacer::LumaPlacer(const std::array<double, 9>& colour_matrix) : weights_(luma_weights(colour_matrix)) {
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
  for (auto* row : {&out.contrast_, &out.luma_contrast_, &out.brightest_, &out.darkest_})
    row->resize(columns);
  out.stride_ = columns + 2 * LumaView::kMargin;
  out.ratios_.resize(4 * out.stride_);
  out.ends_.assign(columns + 2 * LumaView::kMargin, 1);
  if (width < 2 * kLumaReach_px) return;
  const float* red = image.line(line);
  const float* white = image.white_line(line);
  const auto row = [&](std::size_t i) { return out.ratios_.data() + i * out.stride_ + LumaView::kMargin; };
  kernels.ratios({red, red + width, red + 2 * width, white}, width, weights_, kDarkSum,
                 {row(0), row(1), row(2), row(3)});
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

void LumaPlacer::places(const LumaLine& line, float share, const LumaQuery* queries, std::size_t count,
                        LumaPlace* out) const {
  luma_kernels().places(line.view(), {weights_, share}, queries, static_cast<int>(count), out);
}

LumaPlace LumaPlacer::place(const DifferenceImage& image, int line, float share,
                            const LumaQuery& query) const {
  const int width = image.width;
  const int first = first_around(query.own_px, width);
  const float* red = image.line(line) + first;
  return place({red, red + width, red + 2 * width, image.white_line(line) + first}, first, width, share,
               query);
}

/// Of `rows` a window's columns are read, and one more of white on either side where the line has it.
LumaPlace LumaPlacer::place(const LightRows& rows, int first, int width, float share,
                            const LumaQuery& query) const {
  constexpr int kColumns = LumaWindow::kColumns;
  constexpr int kMargin = LumaView::kMargin;
  static_assert(kColumns > 2 * kLumaReach_px);
  std::array<std::array<float, kColumns + 2 * kMargin>, 4> ratios;
  std::array<std::uint8_t, kColumns + 2 * kMargin> ends;
  ends.fill(1);
  for (auto& row : ratios) row.fill(0);
  const LumaKernels& kernels = luma_kernels();
  const auto row = [&](std::size_t i) { return ratios[i].data() + kMargin; };
  kernels.ratios(rows, kColumns, weights_, kDarkSum, {row(0), row(1), row(2), row(3)});
  const int begin = first == 0 ? 1 : 0;
  const int end = first + kColumns == width ? kColumns - 1 : kColumns;
  kernels.ends(rows.white + begin, end - begin, kBreak, kDarkSum, ends.data() + kMargin + begin);
  LumaPlace out;
  kernels.places({first, row(0), row(1), row(2), row(3), ends.data() + kMargin}, {weights_, share}, &query, 1,
                 &out);
  return out;
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
