// SPDX-License-Identifier: Apache-2.0
#include "capture/reconstruct/quick_place.h"

#include <algorithm>
#include <cmath>

#include "capture/reconstruct/place_rules.h"
#include "capture/reconstruct/refine.h"

namespace relievo {

using namespace place_rules;

namespace {

constexpr float kAlways_px = 0.03F;          // standard deviation of any zero crossing, beside noise
constexpr float kLumaFrom = 0.08F;           // contrast from which on luma is asked
constexpr float kUsualColourBias_px = 0.7F;  // where too little of a frame tells it
constexpr std::size_t kLeastSeen = 50;
constexpr int kShareEvery = 5;  // edges and lines that tell the ambient light
constexpr int kBorder_px = 8;   // from the picture's edge, where nothing is looked at
constexpr float kDark = kDarkSum * QuickKernels::kScale;
constexpr float kPerUnit = 1.F / QuickKernels::kScale;
static_assert(kBorder_px > kLumaReach_px && kBorder_px > QuickKernels::kAround);

}  // namespace

/// False where the boundary's colours do not differ in luma.
bool QuickPlacer::look_at_luma(const QuadImage& image, int line, const std::array<Primary, 2>& colours,
                               const Edge& edge, Seen& out) const {
  const int first = LumaPlacer::first_around(edge.column_px, image.width);
  const std::int16_t* quads = image.line(line) + 4 * first;
  const std::int16_t* white = image.luma_line(line);
  LumaWindow window;
  for (std::size_t x = 0; x < window.red.size(); ++x) {
    window.red[x] = kPerUnit * static_cast<float>(quads[4 * x]);
    window.green[x] = kPerUnit * static_cast<float>(quads[4 * x + 1]);
    window.blue[x] = kPerUnit * static_cast<float>(quads[4 * x + 2]);
  }
  for (int x = 0; x < static_cast<int>(window.white.size()); ++x) {
    const int column = std::clamp(first + x - 1, 0, image.width - 1);
    window.white[static_cast<std::size_t>(x)] = kPerUnit * static_cast<float>(white[column]);
  }
  // A reach is a little more than half the way to the next edge.
  const LumaQuery query{edge.column_px, {2 * edge.left_reach_px, 2 * edge.right_reach_px, colours, true}};
  const LumaPlace luma = placer_.place(window, first, image.width, share_, query);
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
      edge.at_step = std::fabs(steepest_place_px(image.luma_line(line), centre, QuickKernels::kAround) -
                               edge.column_px) < kStepNear_px;
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
  const std::array<float, 3>& luma = placer_.weights();
  share_ = projected_share(placer_, result, colours, edges, image.width, kShareEvery, [&](int line, int x) {
    const std::int16_t* d = image.line(line) + 4 * x;
    return (luma[0] * d[0] + luma[1] * d[1] + luma[2] * d[2]) /
           (static_cast<float>(image.luma_line(line)[x]) + kDark);
  });
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
      by_contrast_.size() < kLeastSeen ? kUsualColourBias_px : drawn_by_contrast_px(by_contrast_.median(0));
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
