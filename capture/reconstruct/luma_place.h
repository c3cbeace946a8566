// SPDX-License-Identifier: Apache-2.0
// Where luma has a boundary whose code is known: luma is sharp where colour is blurred, and the code tells
// which levels it steps between. Difference over sum is the projected light's own, whatever the surface.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <vector>

#include "base/pattern.h"
#include "capture/reconstruct/field_difference.h"
#include "capture/reconstruct/luma_rows.h"

namespace relievo {

constexpr float kDarkSum = 3;         // grey levels of the fields' sum, below which ratios are noise
constexpr int kContrastReach_px = 4;  // how far a step in the scene draws an edge
constexpr int kLumaContrast_px = 2;   // and its place in luma

/// A whole line's; memory is kept from line to line.
class LumaLine {
 public:
  LumaView view() const {
    const auto row = [this](std::size_t i) { return ratios_.data() + i * stride_ + LumaView::kMargin; };
    return {0, row(0), row(1), row(2), row(3), ends_.data() + LumaView::kMargin};
  }
  /// Of the scene in white light around a column, 0..1, on this line and those beside it; columns within
  /// kLumaReach_px of the picture's edge have none.
  float contrast(int column) const { return contrast_[static_cast<std::size_t>(column)]; }
  /// The same as near as spoils luma's place.
  float luma_contrast(int column) const { return luma_contrast_[static_cast<std::size_t>(column)]; }

 private:
  friend class LumaPlacer;
  std::size_t stride_ = 0;
  std::vector<float> ratios_;  // rows of a LumaView, stride_ apart
  std::vector<float> contrast_, luma_contrast_, brightest_, darkest_;
  std::vector<std::uint8_t> ends_;
};

/// The columns about a place that it is told by. White has one more on either side, of no meaning where the
/// line ends there.
struct LumaWindow {
  static constexpr int kColumns = 16;
  std::array<float, kColumns> red, green, blue;
  std::array<float, kColumns + 2> white;
};

/// Weights of the difference's channels in the luma of the captured colours. The matrix must have an inverse.
std::array<float, 3> luma_weights(const std::array<double, 9>& colour_matrix);

/// Constant; any thread.
class LumaPlacer {
 public:
  /// `colour_matrix` must have an inverse: luma is that of the captured colours, not of the calibrated ones.
  explicit LumaPlacer(const std::array<double, 9>& colour_matrix);

  /// Of the difference image's channels.
  const std::array<float, 3>& weights() const { return weights_; }
  /// Ratio that a primary has in light that is the projector's alone.
  float ratio(Primary colour) const { return ratio_[colour]; }

  /// `wide_stripes`: stripes are so wide that what is dark over two pixels only is speckle.
  void read_line(const DifferenceImage& image, int line, bool wide_stripes, LumaLine& out) const;

  /// Where luma has each of `count` boundaries of a line that was read. `share` of what the frame shows is
  /// the projector's light.
  void places(const LumaLine& line, float share, const LumaQuery* queries, std::size_t count,
              LumaPlace* out) const;

  /// The same for one on any line of LumaWindow::kColumns or more, of which only those around are read.
  LumaPlace place(const DifferenceImage& image, int line, float share, const LumaQuery& query) const;

  /// The first column of a window about a column of a line of `width`.
  static int first_around(float column_px, int width) {
    return std::clamp(static_cast<int>(column_px + 0.5F) - LumaWindow::kColumns / 2, 0,
                      width - LumaWindow::kColumns);
  }
  /// The same of those columns alone, from `first` = first_around() on.
  LumaPlace place(const LumaWindow& window, int first, int width, float share, const LumaQuery& query) const {
    return place({window.red.data(), window.green.data(), window.blue.data(), window.white.data() + 1}, first,
                 width, share, query);
  }

  /// Standard deviation of a place, from noise.
  float sigma_px(const DifferenceImage& image, int line, const LumaPlace& place) const {
    const int x = std::clamp(static_cast<int>(place.column_px + 0.5F), 0, image.width - 1);
    return sigma_px(image.noise_at(line, x), image.white_line(line)[x], place);
  }
  /// The same where a value of the difference has the standard deviation `noise` and the sum is `white`.
  float sigma_px(float noise, float white, const LumaPlace& place) const {
    return kLumaFactor * (noise * size_ / (white + kDarkSum)) / place.slope;
  }

 private:
  LumaPlace place(const LightRows& rows, int first, int width, float share, const LumaQuery& query) const;

  static constexpr float kLumaFactor = 1.3F;  // the middle level is itself measured

  std::array<float, 3> weights_;
  std::array<float, 8> ratio_;
  float size_;  // of weights_, the root of the sum of squares
};

/// 0..1, of the scene in white light on a line and those beside it, `around_px` (kContrastReach_px or
/// kLumaContrast_px) to each side of a column.
float contrast_around(const DifferenceImage& image, int line, int column, int around_px, bool wide_stripes);

}  // namespace relievo
