// SPDX-License-Identifier: Apache-2.0
// What the placers of both decoders (refine.h, quick_place.h) and the differences before them share: how far
// colour and luma are believed, and what a frame tells of its noise and its ambient light.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <optional>
#include <vector>

#include "capture/reconstruct/edges.h"
#include "capture/reconstruct/luma_place.h"
#include "capture/reconstruct/sequence.h"

namespace relievo::place_rules {

inline constexpr float kVarianceOfMedian = 2.198F;  // variance over median of the squares, of normal deviates
// What the scene's contrast, 0..1, adds to a standard deviation. Zero crossings keep their place on texture
// but are blurred as colour is, which the frame itself tells; luma is sharp but its levels are uncertain.
inline constexpr float kLevelShare = 0.16F;          // of the luma ratio
inline constexpr float kLeastColourBias_px = 0.25F;  // of a zero crossing
inline constexpr float kMostColourBias_px = 2.F;
inline constexpr float kDrawnTogether = 1.5F;      // what draws colour draws luma too, the same way
inline constexpr float kApartShare = 0.35F;        // of the distance between luma's and colour's place
inline constexpr float kApartNoise = 2.5F;         // beyond so many standard deviations of it
inline constexpr float kNoLuma_px = 0.1F;          // where luma shows no step, and
inline constexpr float kNoLumaContrast_px = 0.6F;  // times contrast more
inline constexpr float kLeastRise = 0.12F;         // of luma, between the sides of a boundary that luma shows
inline constexpr float kLeastSlope = 0.2F;         // of that, a pixel
inline constexpr float kContrasty = 0.1F;          // contrast by which blur and errors are measured
inline constexpr float kStepContrast = 0.12F;      // a step of the scene that is one
inline constexpr float kStepNear_px = 1.2F;

inline float squared(float v) {
  return v * v;
}

/// Of a column that is not negative; a call of std::lround takes ten times as long.
inline int column_of(float column_px) {
  return static_cast<int>(column_px + 0.5F);
}

/// Where `row` is steepest within `reach` columns of `centre`; two more are read before and one behind.
template <class Sample>
float steepest_place_px(const Sample* row, int centre, int reach) {
  auto steepest = std::abs(row[centre - reach] - row[centre - reach - 1]);
  int at = centre - reach;
  for (int x = at + 1; x <= centre + reach; ++x) {
    const auto rise = std::abs(row[x] - row[x - 1]);
    if (rise <= steepest) continue;
    steepest = rise;
    at = x;
  }
  const auto before = static_cast<float>(std::abs(row[at - 1] - row[at - 2]));
  const auto after = static_cast<float>(std::abs(row[at + 1] - row[at]));
  const float bend = before - 2 * static_cast<float>(steepest) + after;
  return static_cast<float>(at) - 0.5F +
         (bend < 0 ? std::clamp(0.5F * (before - after) / bend, -0.5F, 0.5F) : 0);
}

/// Standard deviation that a contrast of 1 adds to a zero crossing, from the median of the squares of how far
/// luma's and colour's places were apart, over that of the contrast.
inline float drawn_by_contrast_px(float median) {
  return std::clamp(kDrawnTogether * std::sqrt(std::max(0.F, median) * kVarianceOfMedian),
                    kLeastColourBias_px, kMostColourBias_px);
}

/// Quantiles of many values, as exact as its bins are wide.
template <std::size_t kBins>
class BinnedQuantile {
 public:
  /// `bin` may be beyond the last: it is put there.
  void add(std::size_t bin) {
    ++histogram_[std::min(bin, kBins - 1)];
    ++total_;
  }
  /// The middle, in bins, of the bin with the value that `tenths` of all are not above; `none` without
  /// values.
  float at(std::uint32_t tenths, float none) const {
    std::uint32_t seen = 0;
    for (std::size_t i = 0; i < kBins && total_ > 0; ++i) {
      seen += histogram_[i];
      if (seen * 10 >= total_ * tenths) return static_cast<float>(i) + 0.5F;
    }
    return none;
  }

 private:
  std::array<std::uint32_t, kBins> histogram_{};
  std::uint32_t total_ = 0;
};

/// Standard deviation of an image's values, from second differences over lines so far apart that the low-pass
/// leaves them independent. Stripes run across lines, so most places look the same there; the 30 % quantile
/// looks past those that do not. `add(above, here, below, quantile)` puts three lines' second differences
/// into a quantile, in bins of `per_bin`; one line in `every` is asked. Above 0, which nobody could weigh
/// anything by: of an image with too few lines to tell it is what the first bin says.
template <class Image, class Add>
float noise_across_lines(const Image& image, int every, float per_bin, Add add) {
  constexpr int kApart = 3;
  constexpr float kQuantile30 = 0.3853F;  // of |N(0, 1)|
  constexpr float kGain = 2.4495F;        // of [1 -2 1], the square root of 6
  BinnedQuantile<1024> seconds;
  for (int line = 0; line + 2 * kApart < image.lines; line += every)
    add(image.line(line), image.line(line + kApart), image.line(line + 2 * kApart), seconds);
  return seconds.at(3, 0.5F) * per_bin / (kQuantile30 * kGain);
}

/// Share of the projector's light in what is shown beside a boundary at `column_px`, of these colours to the
/// left and right; the rest is ambient. Nothing where luma does not tell it. `ratio(column)` is luma's
/// difference over its sum.
template <class Ratio>
std::optional<float> share_at(const LumaPlacer& placer, const std::array<Primary, 2>& colours,
                              float column_px, int width, Ratio ratio) {
  constexpr int kSide_px = 3;
  const float step = placer.ratio(colours[1]) - placer.ratio(colours[0]);
  const int centre = column_of(column_px);
  if (std::fabs(step) < 0.5F || centre < kSide_px || centre + kSide_px >= width) return std::nullopt;
  return (ratio(centre + kSide_px) - ratio(centre - kSide_px)) / step;
}

/// Of a frame: the median of the luma steps over those that white light alone would show; 1 where nothing
/// tells it. `ratio(line, column)` is luma's difference over its sum. One edge in `every`, of one line in as
/// many, is asked.
template <class Ratio>
float projected_share(const LumaPlacer& placer, const SequenceResult& result,
                      const std::vector<std::array<Primary, 2>>& colours, const EdgeImage& edges, int width,
                      int every, Ratio ratio) {
  constexpr std::size_t kBins = 64;
  BinnedQuantile<kBins> shares;
  for (int line = 0; line < edges.lines; line += every) {
    for (std::uint32_t e = edges.line_start[static_cast<std::size_t>(line)];
         e < edges.line_start[static_cast<std::size_t>(line) + 1]; e += static_cast<std::uint32_t>(every)) {
      if (result.boundary[e] < 0) continue;
      const auto share = share_at(placer, colours[static_cast<std::size_t>(result.boundary[e])],
                                  edges.edges[e].column_px, width, [&](int x) { return ratio(line, x); });
      if (share) shares.add(static_cast<std::size_t>(std::clamp(*share, 0.F, 0.999F) * kBins));
    }
  }
  return shares.at(5, kBins) / kBins;
}

}  // namespace relievo::place_rules
