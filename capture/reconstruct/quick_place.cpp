// SPDX-License-Identifier: Apache-2.0
#include "capture/reconstruct/quick_place.h"

#include <algorithm>
#include <cmath>

#include "capture/reconstruct/place_rules.h"
#include "capture/reconstruct/refine.h"

namespace relievo {

using namespace place_rules;

namespace {

constexpr float kAlways_px = 0.02F;          // standard deviation of any zero crossing, beside noise
constexpr float kLumaFrom = 0.08F;           // contrast from which on luma is asked
constexpr float kUsualColourBias_px = 0.7F;  // where too little of a frame tells it
constexpr std::size_t kLeastSeen = 50;
constexpr float kLeastShare = 0.01F;
constexpr int kSampleEvery = 4;  // lines: as many tell enough
constexpr int kShareEvery = 5;   // edges and lines that tell the ambient light
constexpr int kBorder_px = 8;    // from the picture's edge, where nothing is looked at
constexpr float kDark = kDarkSum * QuickKernels::kScale;
constexpr float kPerUnit = 1.F / QuickKernels::kScale;
static_assert(kBorder_px > kLumaReach_px && kBorder_px > QuickKernels::kAround);

}  // namespace

QuickPlacer::QuickPlacer(const std::array<double, 9>& colour_matrix)
    : placer_(quick_matrix(colour_matrix)), drawn_px_(kUsualColourBias_px) {}

/// False where the boundary's colours do not differ in luma.
bool QuickPlacer::look_at_luma(const QuickFrame& frame, int line, const QuickLine& edges, int edge,
                               float contrast, Seen& out) const {
  const QuickImage& image = frame.image;
  const float column_px = edges.edges[edge].column_px;
  const int first = LumaPlacer::first_around(column_px, image.width);
  const QuickRow row = image.row(line);
  const std::int16_t* white = image.luma_line(line);
  LumaWindow window;
  for (std::size_t x = 0; x < window.red.size(); ++x) {
    const std::size_t column = static_cast<std::size_t>(first) + x;
    window.red[x] = kPerUnit * static_cast<float>(row.red[column]);
    window.green[x] = kPerUnit * static_cast<float>(row.green[column]);
    window.blue[x] = kPerUnit * static_cast<float>(row.blue[column]);
  }
  // Where the line ends there is none, and what stands for it has no meaning.
  const std::size_t before = first == 0 ? 1 : 0;
  const std::size_t whites = window.white.size() - (first + LumaWindow::kColumns == image.width ? 1 : 0);
  for (std::size_t x = before; x < whites; ++x)
    window.white[x] = kPerUnit * static_cast<float>(white[static_cast<std::size_t>(first) + x - 1]);
  // A reach is a little more than half the way to the next edge.
  const auto& colours = frame.colours[static_cast<std::size_t>(edges.boundary[edge])];
  const LumaQuery query{column_px,
                        {2 * edges.left_reach_px(edge), 2 * edges.right_reach_px(edge), colours, true}};
  const LumaPlace luma = placer_.place(window, first, image.width, share_, query);
  if (std::fabs(luma.rise) < kLeastRise) return false;
  out.sigma_px = 0;
  if (!luma.found || luma.slope < kLeastSlope * std::fabs(luma.rise)) return true;
  const int x = std::clamp(column_of(luma.column_px), 0, image.width - 1);
  out.column_px = luma.column_px;
  out.sigma_px = placer_.sigma_px(kPerUnit * image.noise, kPerUnit * static_cast<float>(white[x]), luma);
  out.level_px = kLevelShare * contrast / luma.slope;
  return true;
}

/// Marks of what the scene in white light does around a place.
std::uint8_t QuickPlacer::steps_around(const QuickFrame& frame, int line, float column_px) const {
  const float step_px =
      steepest_place_px(frame.image.luma_line(line), column_of(column_px), QuickKernels::kAround);
  std::uint8_t marks = 0;
  if (std::fabs(step_px - column_px) < kStepNear_px) marks |= BoundaryRow::kAtStep;
  if (line > 0 && !same_surface(frame.slide, line, line - 1, column_px)) marks |= BoundaryRow::kAboveDiffers;
  if (line + 1 < frame.slide.height && !same_surface(frame.slide, line, line + 1, column_px))
    marks |= BoundaryRow::kBelowDiffers;
  return marks;
}

void QuickPlacer::place_line(const QuickFrame& frame, int line, const QuickLine& edges, int worker,
                             BoundaryRow& row) {
  const QuickImage& image = frame.image;
  Scratch& scratch = scratch_[static_cast<std::size_t>(worker)];
  quick_kernels().extremes(image.luma_line(std::max(0, line - 1)), image.luma_line(line),
                           image.luma_line(std::min(image.lines - 1, line + 1)), image.width,
                           scratch.brightest.data(), scratch.darkest.data());
  for (int e = 0; e < edges.count; ++e) {
    const int b = edges.boundary[e];
    if (b < 0) continue;
    const QuickEdge& edge = edges.edges[e];
    const float noise_px = image.noise / edge.slope;
    if (row.column_px[b] == row.column_px[b]) {
      ++scratch.twice;
      if (row.noise_px[b] <= noise_px) continue;
    }
    float column_px = edge.column_px;
    float variance = noise_px * noise_px + kAlways_px * kAlways_px;
    std::uint8_t marks = edges.still[e] != 0 ? BoundaryRow::kStill : 0;
    float contrast = 0;
    const int centre = column_of(edge.column_px);
    if (centre >= kBorder_px && centre + kBorder_px < image.width) {
      const auto most = static_cast<float>(scratch.brightest[static_cast<std::size_t>(centre)]);
      const auto least = static_cast<float>(scratch.darkest[static_cast<std::size_t>(centre)]);
      contrast = (most - least) / (most + least + kDark);
    }
    if (contrast < BoundaryRow::kPlainContrast) marks |= BoundaryRow::kPlain;
    if (contrast > kStepContrast) marks |= steps_around(frame, line, edge.column_px);
    const float bias_px = drawn_px_ * contrast;
    variance += bias_px * bias_px;
    Seen seen{};
    if (contrast >= kLumaFrom && look_at_luma(frame, line, edges, e, contrast, seen)) {
      float apart_px = kNoLuma_px + kNoLumaContrast_px * contrast;
      float weight = 1 / variance;
      if (seen.sigma_px > 0) {
        const float luma_variance = seen.sigma_px * seen.sigma_px;
        const float level_variance = seen.level_px * seen.level_px;
        const float off_px = seen.column_px - column_px;
        const float own_variance = noise_px * noise_px + kAlways_px * kAlways_px;
        by_contrast_.of(worker).push_back(
            (off_px * off_px - luma_variance - noise_px * noise_px - level_variance) / (contrast * contrast));
        apart_px = kApartShare *
                   std::max(0.F, std::fabs(off_px) - kApartNoise * std::sqrt(luma_variance + own_variance));
        const float luma_weight = 1 / (luma_variance + level_variance);
        column_px = (luma_weight * seen.column_px + weight * column_px) / (luma_weight + weight);
        weight += luma_weight;
      }
      variance = 1 / weight + apart_px * apart_px;
    }
    row.column_px[b] = column_px;
    row.sigma_px[b] = std::sqrt(variance);
    row.noise_px[b] = noise_px;
    row.marks[b] = marks;
  }
}

void QuickPlacer::tell_share(const QuickFrame& frame, int line, const QuickLine& edges, int worker) {
  const std::array<float, 3>& luma = placer_.weights();
  const QuickRow row = frame.image.row(line);
  const std::int16_t* white = frame.image.luma_line(line);
  const auto ratio = [&](int x) {
    return (luma[0] * row.red[x] + luma[1] * row.green[x] + luma[2] * row.blue[x]) /
           (static_cast<float>(white[x]) + kDark);
  };
  for (int e = 0; e < edges.count; e += kShareEvery) {
    const int b = edges.boundary[e];
    if (b < 0) continue;
    const auto share = share_at(placer_, frame.colours[static_cast<std::size_t>(b)], edges.edges[e].column_px,
                                frame.image.width, ratio);
    if (share) shares_.of(worker).push_back(*share);
  }
}

std::size_t QuickPlacer::place_all(const QuickFrame& frame, QuickSequence& sequence, WorkerPool& pool,
                                   ConsistencyCheck& check) {
  const auto boundaries = static_cast<int>(frame.colours.size());
  check.begin(boundaries, frame.image.lines, pool, kSampleEvery);
  by_contrast_.reset(pool.workers());
  shares_.reset(pool.workers());
  scratch_.resize(static_cast<std::size_t>(pool.workers()));
  for (Scratch& s : scratch_) {
    s.brightest.resize(static_cast<std::size_t>(frame.image.width));
    s.darkest.resize(static_cast<std::size_t>(frame.image.width));
    s.twice = 0;
  }
  pool.for_shares(sequence.line_start(), [&](int begin, int end, int worker) {
    for (int line = begin; line < end; ++line) {
      BoundaryRow row = check.row(line);
      std::fill_n(row.column_px, boundaries, kNoColumn);
      std::fill_n(row.noise_px, boundaries, 0.F);
      const QuickLine edges = sequence.line(line);
      place_line(frame, line, edges, worker, row);
      if (line % kShareEvery == 0) tell_share(frame, line, edges, worker);
      check.shown(line, worker);
    }
  });
  share_ = std::clamp(shares_.median(1), kLeastShare, 1.F);
  drawn_px_ =
      by_contrast_.size() < kLeastSeen ? kUsualColourBias_px : drawn_by_contrast_px(by_contrast_.median(0));
  std::size_t twice = 0;
  for (const Scratch& s : scratch_) twice += s.twice;
  return twice;
}

std::size_t QuickPlacer::place(const QuickFrame& frame, QuickSequence& sequence, WorkerPool& pool,
                               ConsistencyCheck& check) {
  // The first frame has none before it: what it tells of light and blur comes from itself.
  if (!have_before_) place_all(frame, sequence, pool, check);
  have_before_ = true;
  return place_all(frame, sequence, pool, check);
}

}  // namespace relievo
