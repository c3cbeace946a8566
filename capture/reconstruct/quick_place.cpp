// SPDX-License-Identifier: Apache-2.0
#include "capture/reconstruct/quick_place.h"

#include <algorithm>
#include <cmath>

#include "capture/reconstruct/refine.h"

namespace relievo {
namespace {

// As refine.cpp has them.
constexpr float kVarianceOfMedian = 2.198F;
constexpr float kLeastColourBias_px = 0.25F;
constexpr float kMostColourBias_px = 2.F;
constexpr float kDrawnTogether = 1.5F;
constexpr float kLevelShare = 0.16F;
constexpr float kApartShare = 0.35F;
constexpr float kApartNoise = 2.5F;
constexpr float kNoLuma_px = 0.1F;
constexpr float kNoLumaContrast_px = 0.6F;
constexpr float kLeastRise = 0.12F;
constexpr float kLeastSlope = 0.2F;
constexpr float kStepContrast = 0.12F;
constexpr float kStepNear_px = 1.2F;
constexpr float kAlways_px = 0.03F;          // standard deviation of any zero crossing, beside noise
constexpr float kLumaFrom = 0.08F;           // contrast from which on luma is asked
constexpr float kUsualColourBias_px = 0.7F;  // where too little of a frame tells it
constexpr std::size_t kLeastSeen = 50;
constexpr int kBorder_px = 8;  // from the picture's edge, where nothing is looked at
constexpr float kDark = kDarkSum * QuickKernels::kScale;
constexpr float kPerUnit = 1.F / QuickKernels::kScale;
static_assert(kBorder_px > kLumaReach_px && kBorder_px > QuickKernels::kAround);

int column_of(float column_px) {
  return static_cast<int>(column_px + 0.5F);
}

/// True where the steepest place of luma around `centre`, which has contrast, is `column_px`.
bool steepest_at(const std::int16_t* luma, int centre, float column_px) {
  int steepest = -1;
  int at = 0;
  for (int x = centre - QuickKernels::kAround; x <= centre + QuickKernels::kAround; ++x) {
    const int rise = std::abs(luma[x] - luma[x - 1]);
    if (rise <= steepest) continue;
    steepest = rise;
    at = x;
  }
  const auto before = static_cast<float>(std::abs(luma[at - 1] - luma[at - 2]));
  const auto after = static_cast<float>(std::abs(luma[at + 1] - luma[at]));
  const float bend = before - 2 * static_cast<float>(steepest) + after;
  const float place = static_cast<float>(at) - 0.5F +
                      (bend < 0 ? std::clamp(0.5F * (before - after) / bend, -0.5F, 0.5F) : 0);
  return std::fabs(place - column_px) < kStepNear_px;
}

}  // namespace

/// As Refiner::projected_share().
float QuickPlacer::projected_share(const QuadImage& image, const SequenceResult& result,
                                   const std::vector<std::array<Primary, 2>>& colours,
                                   const EdgeImage& edges) const {
  constexpr int kBins = 64;
  constexpr int kSide_px = 3;
  constexpr std::uint32_t kEvery = 5;
  constexpr int kEveryLine = 5;
  const std::array<float, 3>& luma = placer_.weights();
  std::array<std::uint32_t, kBins> histogram{};
  std::uint32_t total = 0;
  for (int line = 0; line < edges.lines; line += kEveryLine) {
    const std::int16_t* quads = image.line(line);
    const std::int16_t* white = image.luma_line(line);
    for (std::uint32_t e = edges.line_start[static_cast<std::size_t>(line)];
         e < edges.line_start[static_cast<std::size_t>(line) + 1]; e += kEvery) {
      if (result.boundary[e] < 0) continue;
      const auto [left, right] = colours[static_cast<std::size_t>(result.boundary[e])];
      const float step = placer_.ratio(right) - placer_.ratio(left);
      const int centre = column_of(edges.edges[e].column_px);
      if (std::fabs(step) < 0.5F || centre < kSide_px || centre + kSide_px >= image.width) continue;
      const auto ratio = [&](int x) {
        const std::int16_t* d = quads + 4 * x;
        return (luma[0] * d[0] + luma[1] * d[1] + luma[2] * d[2]) / (static_cast<float>(white[x]) + kDark);
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

/// False where the boundary's colours do not differ in luma.
bool QuickPlacer::look_at_luma(const QuadImage& image, int line, const std::array<Primary, 2>& colours,
                               const Edge& edge, Seen& out) const {
  constexpr auto kColumns = static_cast<std::size_t>(LumaPlacer::kColumns);
  const int first = LumaPlacer::first_around(edge.column_px, image.width);
  const std::int16_t* quads = image.line(line) + 4 * first;
  const std::int16_t* white = image.luma_line(line);
  std::array<std::array<float, kColumns>, 4> rows;
  for (std::size_t x = 0; x < kColumns; ++x) {
    for (std::size_t c = 0; c < 3; ++c) rows[c][x] = kPerUnit * static_cast<float>(quads[4 * x + c]);
    rows[3][x] = kPerUnit * static_cast<float>(white[static_cast<std::size_t>(first) + x]);
  }
  // A reach is a little more than half the way to the next edge.
  const LumaQuery query{edge.column_px, {2 * edge.left_reach_px, 2 * edge.right_reach_px, colours, true}};
  const LumaPlace luma = placer_.place({rows[0].data(), rows[1].data(), rows[2].data(), rows[3].data()},
                                       first, image.width, share_, query);
  if (std::fabs(luma.rise) < kLeastRise) return false;
  out.sigma_px = 0;
  if (!luma.found || luma.slope < kLeastSlope * std::fabs(luma.rise)) return true;
  const int x = std::clamp(column_of(luma.column_px), 0, image.width - 1);
  out.column_px = luma.column_px;
  out.sigma_px = placer_.sigma_px(kPerUnit * image.noise, kPerUnit * static_cast<float>(white[x]), luma);
  out.level_px = kLevelShare * edge.contrast / luma.slope;
  return true;
}

void QuickPlacer::look_at_line(const QuadImage& image, View8 slide, int line, const SequenceResult& result,
                               const std::vector<std::array<Primary, 2>>& colours, int worker,
                               EdgeImage& edges) {
  Scratch& scratch = scratch_[static_cast<std::size_t>(worker)];
  quick_kernels().extremes(image.luma_line(std::max(0, line - 1)), image.luma_line(line),
                           image.luma_line(std::min(image.lines - 1, line + 1)), image.width,
                           scratch.brightest.data(), scratch.darkest.data());
  for (std::uint32_t e = edges.line_start[static_cast<std::size_t>(line)];
       e < edges.line_start[static_cast<std::size_t>(line) + 1]; ++e) {
    if (result.boundary[e] < 0) continue;
    Edge& edge = edges.edges[e];
    const int centre = column_of(edge.column_px);
    if (centre < kBorder_px || centre + kBorder_px >= image.width) continue;
    const auto most = static_cast<float>(scratch.brightest[static_cast<std::size_t>(centre)]);
    const auto least = static_cast<float>(scratch.darkest[static_cast<std::size_t>(centre)]);
    edge.contrast = (most - least) / (most + least + kDark);
    if (edge.contrast > kStepContrast) {
      edge.at_step = steepest_at(image.luma_line(line), centre, edge.column_px);
      edge.above_differs = line > 0 && !same_surface(slide, line, line - 1, edge.column_px);
      edge.below_differs = line + 1 < slide.height && !same_surface(slide, line, line + 1, edge.column_px);
    }
    if (edge.contrast < kLumaFrom) continue;
    Seen seen{e, 0, 0, 0};
    if (!look_at_luma(image, line, colours[static_cast<std::size_t>(result.boundary[e])], edge, seen))
      continue;
    scratch.seen.push_back(seen);
    if (seen.sigma_px <= 0) continue;
    const float apart = seen.column_px - edge.column_px;
    by_contrast_.of(worker).push_back((apart * apart - seen.sigma_px * seen.sigma_px -
                                       edge.sigma_px * edge.sigma_px - seen.level_px * seen.level_px) /
                                      (edge.contrast * edge.contrast));
  }
}

void QuickPlacer::place(const QuadImage& image, View8 slide, const SequenceResult& result,
                        const std::vector<std::array<Primary, 2>>& colours, WorkerPool& pool,
                        EdgeImage& edges) {
  share_ = projected_share(image, result, colours, edges);
  by_contrast_.reset(pool.threads());
  scratch_.resize(static_cast<std::size_t>(pool.threads()));
  for (Scratch& s : scratch_) {
    s.brightest.resize(static_cast<std::size_t>(image.width));
    s.darkest.resize(static_cast<std::size_t>(image.width));
    s.seen.clear();
  }
  pool.for_shares(edges.line_start, [&](int begin, int end, int worker) {
    for (int line = begin; line < end; ++line)
      look_at_line(image, slide, line, result, colours, worker, edges);
  });
  const float drawn_px =
      by_contrast_.size() < kLeastSeen
          ? kUsualColourBias_px
          : std::clamp(kDrawnTogether * std::sqrt(std::max(0.F, by_contrast_.median(0)) * kVarianceOfMedian),
                       kLeastColourBias_px, kMostColourBias_px);
  pool.for_shares(edges.line_start, [&](int begin, int end, int worker) {
    const std::uint32_t last = edges.line_start[static_cast<std::size_t>(end)];
    for (std::uint32_t e = edges.line_start[static_cast<std::size_t>(begin)]; e < last; ++e) {
      Edge& edge = edges.edges[e];
      const float bias = drawn_px * edge.contrast;
      edge.sigma_px = std::sqrt(edge.noise_px * edge.noise_px + kAlways_px * kAlways_px + bias * bias);
    }
    for (const Seen& seen : scratch_[static_cast<std::size_t>(worker)].seen) {
      Edge& edge = edges.edges[seen.edge];
      const float colour_variance = edge.sigma_px * edge.sigma_px;
      float apart = kNoLuma_px + kNoLumaContrast_px * edge.contrast;
      float weight = 1 / colour_variance;
      if (seen.sigma_px > 0) {
        const float luma_variance = seen.sigma_px * seen.sigma_px;
        const float noise =
            std::sqrt(luma_variance + edge.noise_px * edge.noise_px + kAlways_px * kAlways_px);
        apart = kApartShare * std::max(0.F, std::fabs(seen.column_px - edge.column_px) - kApartNoise * noise);
        const float luma_weight = 1 / (luma_variance + seen.level_px * seen.level_px);
        edge.column_px = (luma_weight * seen.column_px + weight * edge.column_px) / (luma_weight + weight);
        weight += luma_weight;
      }
      edge.sigma_px = std::sqrt(1 / weight + apart * apart);
    }
  });
}

}  // namespace relievo
