// SPDX-License-Identifier: Apache-2.0
#include "capture/reconstruct/refine.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>

namespace relievo {
namespace {

constexpr int kReach_px = 7;  // samples looked at on each side

constexpr int kContrastReach_px = 4;  // how far a step in the scene draws an edge
constexpr int kContrastLines = 1;     // the low-pass across lines reaches as far
constexpr float kDark = 3;            // grey levels of the fields' sum, below which ratios are noise
// Standard deviation in pixels that the scene's contrast, 0..1, adds. Zero crossings keep their place on
// texture but are blurred as colour is; luma is sharp but takes the texture for light.
constexpr float kColourBias_px = 0.9F;
constexpr float kLumaBias_px = 1.F;
constexpr float kApartShare = 0.6F;     // of the distance between luma's and colour's place
constexpr float kApartNoise = 2.5F;     // beyond so many standard deviations of it
constexpr float kNoLuma_px = 0.1F;      // where luma shows no step
constexpr float kLumaFactor = 1.3F;     // the middle level is itself measured
constexpr float kLevelSlack = 0.1F;     // of a side's luma ratio about what the code tells
constexpr float kStepContrast = 0.12F;  // a step of the scene that is one
constexpr float kStepNear_px = 0.7F;

/// True where the steepest place of a step of `white` around `column_px` is there.
bool steepest_at(const float* white, int centre, float column_px) {
  float brightest = 0;
  float darkest = 1e9F;
  float steepest = -1;
  int at = 0;
  for (int x = centre - kContrastReach_px; x <= centre + kContrastReach_px; ++x) {
    brightest = std::max(brightest, white[x]);
    darkest = std::min(darkest, white[x]);
    const float rise = std::fabs(white[x] - white[x - 1]);
    if (rise > steepest) {
      steepest = rise;
      at = x;
    }
  }
  if (brightest - darkest < kStepContrast * (brightest + darkest + kDark)) return false;
  const float before = std::fabs(white[at - 1] - white[at - 2]);
  const float after = std::fabs(white[at + 1] - white[at]);
  const float bend = before - 2 * steepest + after;
  const float place = static_cast<float>(at) - 0.5F +
                      (bend < 0 ? std::clamp(0.5F * (before - after) / bend, -0.5F, 0.5F) : 0);
  return std::fabs(place - column_px) < kStepNear_px;
}

}  // namespace

Refiner::Refiner(const std::array<double, 9>& colour_matrix) {
  const Eigen::Matrix3d m =
      Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(colour_matrix.data());
  const Eigen::RowVector3d rec601(0.299, 0.587, 0.114);
  const Eigen::RowVector3d weights = rec601 * m.inverse();
  for (int i = 0; i < 3; ++i) luma_[static_cast<std::size_t>(i)] = static_cast<float>(weights[i]);
  for (std::size_t c = 0; c < 8; ++c) {
    ratio_[c] =
        ((c & 1 ? luma_[0] : -luma_[0]) + (c & 2 ? luma_[1] : -luma_[1]) + (c & 4 ? luma_[2] : -luma_[2])) /
        (luma_[0] + luma_[1] + luma_[2]);
  }
}

void Refiner::refine_edge(const DifferenceImage& image, int line, const Sides& sides, Edge& edge) const {
  const int centre = static_cast<int>(std::lround(edge.column_px));
  if (centre < kReach_px || centre + kReach_px >= image.width) return;
  const float* d = image.line(line);
  const float* white = image.white_line(line);
  float brightest = 0;
  float darkest = 1e9F;
  for (int l = std::max(0, line - kContrastLines); l <= std::min(image.lines - 1, line + kContrastLines);
       ++l) {
    const float* w = image.white_line(l);
    for (int x = centre - kContrastReach_px; x <= centre + kContrastReach_px; ++x) {
      brightest = std::max(brightest, w[x]);
      darkest = std::min(darkest, w[x]);
    }
  }
  edge.at_step = steepest_at(white, centre, edge.column_px);
  edge.contrast = (brightest - darkest) / (brightest + darkest + kDark);
  // The ratio of difference and sum is that of the projected light alone, whatever the surface.
  std::array<float, 2 * kReach_px + 1> y{};
  for (int i = 0; i <= 2 * kReach_px; ++i) {
    const int x = centre - kReach_px + i;
    y[static_cast<std::size_t>(i)] =
        (luma_[0] * d[x] + luma_[1] * d[image.width + x] + luma_[2] * d[2 * image.width + x]) /
        (white[x] + kDark);
  }
  const auto at = [&](int x) { return y[static_cast<std::size_t>(x - centre + kReach_px)]; };
  const auto level = [&](float from, float to, float expected) {
    const int first = std::clamp(static_cast<int>(std::lround(from)), centre - kReach_px, centre + kReach_px);
    const int last = std::clamp(static_cast<int>(std::lround(to)), first, centre + kReach_px);
    float sum = 0;
    for (int x = first; x <= last; ++x) sum += at(x);
    return std::clamp(sum / static_cast<float>(last - first + 1), expected - kLevelSlack,
                      expected + kLevelSlack);
  };
  const float own = edge.column_px;
  const float l = level(own - std::clamp(sides.free_left_px - 2.F, 2.F, 5.F), own - 2.F, sides.ratio_left);
  const float r = level(own + 2.F, own + std::clamp(sides.free_right_px - 2.F, 2.F, 5.F), sides.ratio_right);
  const float middle = 0.5F * (l + r);
  // Nearest crossing of the middle level, in the direction of the step.
  float best = 1e9F;
  float slope = 0;
  float column = 0;
  for (int x = centre - 3; x < centre + 3; ++x) {
    const float a = at(x) - middle;
    const float b = at(x + 1) - middle;
    if ((a > 0) == (b > 0) || (b > a) != (r > l)) continue;
    const float place = static_cast<float>(x) - a / (b - a);
    if (std::fabs(place - own) < best) {
      best = std::fabs(place - own);
      slope = std::fabs(b - a);
      column = place;
    }
  }
  const float colour_bias = kColourBias_px * edge.contrast;
  const float w_colour = 1 / (edge.sigma_px * edge.sigma_px + colour_bias * colour_bias);
  float w_luma = 0;
  float luma_noise_px = 0;
  float pure_weight = 1 / (edge.sigma_px * edge.sigma_px);
  if (best <= 2.5F) {
    const float noise = image.noise *
                        std::sqrt(luma_[0] * luma_[0] + luma_[1] * luma_[1] + luma_[2] * luma_[2]) /
                        (white[centre] + kDark);
    const float sigma = kLumaFactor * noise / slope;
    const float luma_bias = kLumaBias_px * edge.contrast;
    pure_weight += 1 / (sigma * sigma);
    luma_noise_px = std::sqrt(sigma * sigma + edge.sigma_px * edge.sigma_px);
    w_luma = 1 / (sigma * sigma + luma_bias * luma_bias);
    edge.column_px = (w_luma * column + w_colour * own) / (w_luma + w_colour);
  }
  // Where the two disagree by more than they should, neither is as good as it looks.
  const float apart = w_luma > 0
                          ? kApartShare * std::max(0.F, std::fabs(column - own) - kApartNoise * luma_noise_px)
                          : kNoLuma_px;
  edge.sigma_px = std::sqrt(1 / (w_luma + w_colour) + apart * apart);
  edge.noise_px = 1 / std::sqrt(pure_weight);
}

/// Share of the projector's light in what the frame shows: the rest is ambient. The median of the luma steps
/// over those that white light alone would show.
float Refiner::projected_share(const DifferenceImage& image, const SequenceResult& result,
                               const std::vector<std::array<Primary, 2>>& colours,
                               const EdgeImage& edges) const {
  constexpr int kBins = 64;
  constexpr int kSide_px = 3;
  constexpr std::uint32_t kEvery = 5;
  std::array<std::uint32_t, kBins> histogram{};
  std::uint32_t total = 0;
  for (int line = 0; line < edges.lines; ++line) {
    const float* d = image.line(line);
    const float* white = image.white_line(line);
    for (std::uint32_t e = edges.line_start[static_cast<std::size_t>(line)];
         e < edges.line_start[static_cast<std::size_t>(line) + 1]; e += kEvery) {
      if (result.boundary[e] < 0) continue;
      const auto [left, right] = colours[static_cast<std::size_t>(result.boundary[e])];
      const float step = ratio_[right] - ratio_[left];
      const int centre = static_cast<int>(std::lround(edges.edges[e].column_px));
      if (std::fabs(step) < 0.5F || centre < kSide_px || centre + kSide_px >= image.width) continue;
      const auto ratio = [&](int x) {
        return (luma_[0] * d[x] + luma_[1] * d[image.width + x] + luma_[2] * d[2 * image.width + x]) /
               (white[x] + kDark);
      };
      const float share = (ratio(centre + kSide_px) - ratio(centre - kSide_px)) / step;
      ++histogram[static_cast<std::size_t>(std::clamp(share, 0.F, 0.999F) * kBins)];
      ++total;
    }
  }
  std::uint32_t seen = 0;
  for (std::size_t i = 0; i < kBins; ++i) {
    seen += histogram[i];
    if (total > 0 && seen * 2 >= total) return (static_cast<float>(i) + 0.5F) / kBins;
  }
  return 1;
}

void Refiner::refine(const DifferenceImage& image, const SequenceResult& result,
                     const std::vector<std::array<Primary, 2>>& colours, WorkerPool& pool,
                     EdgeImage& edges) const {
  const float share = projected_share(image, result, colours, edges);
  pool.for_ranges(edges.lines, [&](int begin_line, int end_line, int) {
    for (int line = begin_line; line < end_line; ++line) {
      const std::uint32_t begin = edges.line_start[static_cast<std::size_t>(line)];
      const std::uint32_t end = edges.line_start[static_cast<std::size_t>(line) + 1];
      float left_neighbour = -100;
      for (std::uint32_t e = begin; e < end; ++e) {
        Edge& edge = edges.edges[e];
        const float own = edge.column_px;
        const float right_neighbour = e + 1 < end ? edges.edges[e + 1].column_px : own + 100;
        if (result.boundary[e] >= 0) {
          const auto [left, right] = colours[static_cast<std::size_t>(result.boundary[e])];
          refine_edge(
              image, line,
              {own - left_neighbour, right_neighbour - own, share * ratio_[left], share * ratio_[right]},
              edge);
        }
        left_neighbour = own;
      }
    }
  });
}

}  // namespace relievo
