// SPDX-License-Identifier: Apache-2.0
#include "capture/reconstruct/render_place.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>

#include "capture/reconstruct/stripe_end.h"

namespace relievo {
namespace {

constexpr float kUnsure_px = 0.08F;  // what is surer than this stays as it is
constexpr std::array<float, 3> kLuma{0.299F, 0.587F, 0.114F};

// How like what is shown a picture is.
constexpr float kOff = 0.12F;          // of the brightness: less is like it, more is another surface's
constexpr float kOffLevel = 4;         // grey levels more
constexpr float kLeastOfLuma = 0.02F;  // a channel of a surface, which blur may leave none
constexpr float kPrior = 0.25F;        // of the square of the distance from the place as it was, pixels

// The places that are tried.
constexpr float kCoarse_px = 0.3F;
constexpr int kFarthest = 5;  // of these to each side
constexpr float kFine_px = 0.1F;
constexpr float kNowhere_px = 30;  // off: it is not there

// Standard deviations, measured on simulated scenes.
constexpr float kOfCurvature = 2.3F;  // over the curvature of the unlikeness
constexpr float kOwn = 1.5F;          // times a place's own
constexpr float kOwnLeast_px = 0.02F;
constexpr float kApart = 0.4F;        // of how much farther apart the two are than they may be
constexpr float kMost_px = 1.F;       // doubt:
constexpr float kUnlikeShare = 0.6F;  // by how unlike it is, of what is usual; the rest is always there
constexpr float kLeastUsual = 0.2F;   // of unlikeness
constexpr float kLeastGain = -0.15F;  // less, and nothing is there

// What was not found, or given up, and the picture shows all the same.
constexpr float kRestoredGain = 0.2F;
constexpr float kRestoredUnlike = 1.8F;  // of what is usual
constexpr float kRestoredOff_px = 0.9F;
constexpr float kRestoredSigma_px = 0.9F;
constexpr float kRestoredMost_px = 0.4F;
constexpr float kLit = 0.08F;         // less projected light than that, and it is in a shadow
constexpr int kLitReach_px = 3;       // to each side, where that is looked for
constexpr float kFromLine_px = 0.4F;  // standard deviation of a place on a line beside,
constexpr float kLean_px = 2.F;       // as far as boundaries lean
constexpr float kRoom_px = 2.5F;      // to the boundaries beside it

/// Of a channel of a primary: -1 or 1.
float sign_of(Primary colour, std::size_t channel) {
  return (colour >> channel & 1) != 0 ? 1.F : -1.F;
}

/// Columns of a line without any low-pass.
struct Sharp {
  using In = RenderedRow::In;
  std::array<In, 3> shown{};  // red, green, blue: slide less complement,
  std::array<In, 3> both{};   // and their sum
};

/// The first RenderedRow::kRead from `first` on.
Sharp read(const DetectionLines& rows, int line, int first) {
  const auto sign = static_cast<float>(rows.sign());
  const std::uint8_t* here = rows.own.row(line) + 3 * first;
  const std::uint8_t* above = rows.other_above(line) + 3 * first;
  const std::uint8_t* below = rows.other_below(line) + 3 * first;
  Sharp out;
  for (std::size_t i = 0; i < RenderedRow::kRead; ++i) {
    for (std::size_t c = 0; c < 3; ++c) {
      const auto a = static_cast<float>(here[3 * i + c]);
      const float b = 0.5F * static_cast<float>(above[3 * i + c] + below[3 * i + c]);
      out.shown[c][i] = sign * (a - b);
      out.both[c][i] = a + b;
    }
  }
  return out;
}

/// On the darker side of a place, by how much the two exposures differ, of what they would in the projector's
/// full light; `gain` is that of ambient light.
float lit(const Sharp& sharp, int first, float place_px, float gain) {
  float least = 1;
  for (const int side : {-1, 1}) {
    float shown = 0;
    float both = 1;
    for (int away = 1; away <= kLitReach_px; ++away) {
      const auto i = static_cast<std::size_t>(std::clamp(
          static_cast<int>(std::lround(place_px)) + side * away - first, 0, RenderedRow::kRead - 1));
      for (std::size_t c = 0; c < 3; ++c) {
        shown += std::fabs(sharp.shown[c][i]);
        both += sharp.both[c][i];
      }
    }
    least = std::min(least, shown / (gain * both));
  }
  return least;
}

float luma_of(const std::array<RenderedRow::In, 3>& rgb, std::size_t i) {
  return kLuma[0] * rgb[0][i] + kLuma[1] * rgb[1][i] + kLuma[2] * rgb[2][i];
}

/// Takes out of `from` what is dropped; returns how many.
std::size_t drop_if(std::vector<RecoveredBoundary>& from, const std::vector<std::uint8_t>& dropped) {
  std::size_t kept = 0;
  for (std::size_t i = 0; i < from.size(); ++i)
    if (dropped[i] == 0) from[kept++] = from[i];
  const std::size_t out = from.size() - kept;
  from.resize(kept);
  return out;
}

}  // namespace

RenderPlacer::RenderPlacer(const std::array<double, 9>& colour_matrix)
    : unlike_(row_comparisons().back().unlike) {
  const Eigen::Matrix3d m =
      Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(colour_matrix.data());
  const Eigen::Matrix3d seen = m.inverse();
  for (std::size_t c = 0; c < 3; ++c)
    for (std::size_t q = 0; q < 3; ++q)
      seen_[c][q] = static_cast<float>(seen(static_cast<Eigen::Index>(c), static_cast<Eigen::Index>(q)));
}

/// False where nothing tells.
bool RenderPlacer::look(const RenderView& view, int line, int boundary, float column_px, Found& out) const {
  constexpr int kColumnsBefore = RenderedRow::kReach_px + RenderedRow::kBlurReach;
  const int first = static_cast<int>(column_px + 0.5F) - kColumnsBefore;
  if (first < 0 || first + RenderedRow::kRead > view.rows.own.width) return false;
  const Sharp sharp = read(view.rows, line, first);

  // The nearest on the line, which may be another surface's, and those that follow in the pattern.
  const Place* here = view.places.line(line);
  float before_px = -1e4F;
  float after_px = 1e4F;
  for (int b = 0; b < view.places.boundaries(); ++b) {
    const float px = here[b].column_px;
    if (b == boundary || !here[b].known()) continue;
    if (px <= column_px) before_px = std::max(before_px, px);
    if (px >= column_px) after_px = std::min(after_px, px);
  }
  const Place &left = here[boundary - 1], &right = here[boundary + 1];
  const bool has_left = left.column_px < column_px;
  const bool has_right = right.column_px > column_px;
  const auto own = static_cast<std::size_t>(boundary);

  // Two fields show the projector's light once and the ambient light twice.
  const float gain = (1 - view.ambient) / (1 + view.ambient);
  std::array<float, 3> of_left, of_rise, of_left_end{}, of_right_end{};  // of the captured channels
  for (std::size_t c = 0; c < 3; ++c) {
    of_left[c] = of_rise[c] = 0;
    for (std::size_t q = 0; q < 3; ++q) {
      const float l = sign_of(view.colours[own][0], q);
      const float r = sign_of(view.colours[own][1], q);
      const float seen = gain * seen_[c][q];
      of_left[c] += seen * l;
      of_rise[c] += seen * (r - l);
      if (has_left) of_left_end[c] += seen * (sign_of(view.colours[own - 1][0], q) - l);
      if (has_right) of_right_end[c] += seen * (sign_of(view.colours[own + 1][1], q) - r);
    }
  }
  RenderedRow row;
  row.first_px = static_cast<float>(first);
  row.blur = blur_;
  std::array<RenderedRow::In, 3> base, rise;
  RenderedRow::In bright;
  for (std::size_t i = 0; i < RenderedRow::kRead; ++i) {
    const float column = row.first_px + static_cast<float>(i);
    const float left_end = has_left ? 1 - behind_end(column - left.column_px) : 0;
    const float right_end = has_right ? behind_end(column - right.column_px) : 0;
    bright[i] = std::max(1.F, luma_of(sharp.both, i));
    for (std::size_t c = 0; c < 3; ++c) {
      const float both = std::max(sharp.both[c][i], kLeastOfLuma * bright[i]);
      base[c][i] = both * (of_left[c] + of_left_end[c] * left_end + of_right_end[c] * right_end);
      rise[c][i] = both * of_rise[c];
    }
    const float luma_base = luma_of(base, i);
    const float luma_rise = luma_of(rise, i);
    for (const std::size_t c : {0, 1}) {
      row.base[c][i] = base[2 * c][i] - luma_base;
      row.rise[c][i] = rise[2 * c][i] - luma_rise;
    }
    if (i < RenderedRow::kBlurReach || i >= RenderedRow::kBlurReach + RenderedRow::kColumns) continue;
    const std::size_t at = i - RenderedRow::kBlurReach;
    row.luma_base[at] = luma_base;
    row.luma_rise[at] = luma_rise;
    row.luma[at] = luma_of(sharp.shown, i);
    for (const std::size_t c : {0, 1}) row.chroma[c][at] = sharp.shown[2 * c][i] - row.luma[at];
    row.scale[at] = 1 / (kOff * bright[i] + kOffLevel);
    row.weight[at] = column > before_px && column < after_px ? 1.F : 0.F;
  }

  const auto cost = [&](float off_px) { return unlike_(row, column_px + off_px) + kPrior * off_px * off_px; };
  // Downhill from the place as it was, and then to the parabolas' lowest places.
  float best = cost(0);
  float best_px = 0;
  float below = cost(-kCoarse_px);
  float above = cost(kCoarse_px);
  for (int i = 1; i < kFarthest && std::min(below, above) < best; ++i) {
    const bool down = below < above;
    best_px += down ? -kCoarse_px : kCoarse_px;
    (down ? above : below) = best;
    best = down ? below : above;
    (down ? below : above) = cost(best_px + (down ? -kCoarse_px : kCoarse_px));
  }
  float curvature = 0;
  float step = kCoarse_px;
  for (int round = 0;; ++round) {
    const float bend = below - 2 * best + above;
    if (bend <= 0) return false;
    best_px += std::clamp(0.5F * (below - above) / bend, -1.F, 1.F) * step;
    curvature = bend / (step * step);
    if (round == 1) break;
    step = kFine_px;
    best = cost(best_px);
    below = cost(best_px - step);
    above = cost(best_px + step);
  }
  float columns = 1e-3F;
  for (const float weight : row.weight) columns += weight;
  const float left_only = unlike_(row, column_px + kNowhere_px);
  const float right_only = unlike_(row, column_px - kNowhere_px);
  const float there = unlike_(row, column_px + best_px);
  out = {best_px, kOfCurvature / curvature, there / columns,
         (std::min(left_only, right_only) - there) / columns, lit(sharp, first, column_px + best_px, gain)};
  return true;
}

/// A place as it was, and as the picture has it; less sure where these are farther apart than the latter is
/// unsure.
Place RenderPlacer::weighed(float column_px, float sigma_px, const Found& found) {
  const float own_weight = 1 / (sigma_px * sigma_px);
  const float weight = 1 / (found.sigma_px * found.sigma_px);
  const float weights = weight + own_weight;
  const float apart = std::max(0.F, std::fabs(found.off_px) - found.sigma_px);
  return {column_px + weight / weights * found.off_px, std::hypot(1 / std::sqrt(weights), kApart * apart)};
}

/// A standard deviation, by how unlike what is shown there is.
float RenderPlacer::doubt(float sigma_px, const Found& found) const {
  return sigma_px * (1 - kUnlikeShare + kUnlikeShare * found.unlike / usual_);
}

/// False where the boundary is to be given up.
bool RenderPlacer::settle(const RenderView& view, int line, int boundary, int worker, float& column_px,
                          float& sigma_px) {
  Found found;
  if (!look(view, line, boundary, column_px, found)) return true;
  unlikes_.of(worker).push_back(found.unlike);
  const Place place = weighed(column_px, kOwn * sigma_px + kOwnLeast_px, found);
  column_px = place.column_px;
  sigma_px = place.sigma_px;
  return found.gain >= kLeastGain && doubt(sigma_px, found) <= kMost_px;
}

bool RenderPlacer::restore(const RenderView& view, const Candidate& candidate,
                           std::vector<RecoveredBoundary>& recovered) const {
  const auto [line, boundary, column_px, sigma_px] = candidate;
  if (view.moving.around(line, column_px) != 0) return false;
  Place* here = view.places.line(line) + boundary;
  // At the end of a surface it may be the end that is seen.
  if (!(column_px - here[-1].column_px > kRoom_px && here[1].column_px - column_px > kRoom_px)) return false;
  Found found;
  if (!look(view, line, boundary, column_px, found)) return false;
  if (found.lit < kLit || found.gain < kRestoredGain || found.unlike > kRestoredUnlike * usual_ ||
      found.sigma_px > kRestoredSigma_px || std::fabs(found.off_px) > kRestoredOff_px)
    return false;
  const Place place = weighed(column_px, sigma_px, found);
  if (doubt(place.sigma_px, found) > kRestoredMost_px) return false;
  *here = place;
  recovered.push_back({line, boundary, place.column_px, place.sigma_px, 0});
  return true;
}

std::size_t RenderPlacer::restore_line(const RenderView& view, int line, const SequenceResult& result,
                                       const EdgeImage& edges,
                                       std::vector<RecoveredBoundary>& recovered) const {
  std::size_t restored = 0;
  const Place* here = view.places.line(line);
  for (std::uint32_t e = edges.line_start[static_cast<std::size_t>(line)];
       e < edges.line_start[static_cast<std::size_t>(line) + 1]; ++e) {
    const int b = result.doubted[e];
    if (b < 0 || result.boundary[e] >= 0 || here[b].known()) continue;
    const float sigma = kOwn * edges.edges[e].sigma_px + kOwnLeast_px;
    restored += restore(view, {line, b, edges.edges[e].column_px, sigma}, recovered);
  }
  for (int b = 0; b < view.places.boundaries(); ++b) {
    if (here[b].known()) continue;
    for (const std::ptrdiff_t next : {-view.places.stride(), view.places.stride()}) {
      const float from = here[b + next].column_px;
      if (!here[b + next].known()) continue;
      const float lean = from - here[b + 2 * next].column_px;
      const float column = std::fabs(lean) < kLean_px ? from + 0.5F * lean : from;
      if (!restore(view, {line, b, column, kFromLine_px}, recovered)) continue;
      ++restored;
      break;
    }
  }
  return restored;
}

RenderCounts RenderPlacer::place(const RenderView& view, WorkerPool& pool, SequenceResult& result,
                                 EdgeImage& edges, std::vector<RecoveredBoundary>& recovered) {
  const float blur = std::max(view.blur_px, 1e-3F);
  float all = 0;
  constexpr int kReach = RenderedRow::kBlurReach;
  for (int k = -kReach; k <= kReach; ++k) {
    float& weight = blur_[static_cast<std::size_t>(k + kReach)];
    weight = std::exp(-0.5F * static_cast<float>(k * k) / (blur * blur));
    all += weight;
  }
  for (float& weight : blur_) weight /= all;

  counts_.assign(static_cast<std::size_t>(pool.workers()), {});
  unlikes_.reset(pool.workers());
  pool.for_shares(edges.line_start, [&](int begin, int end, int worker) {
    RenderCounts& counts = counts_[static_cast<std::size_t>(worker)];
    for (int line = begin; line < end; ++line) {
      for (std::uint32_t e = edges.line_start[static_cast<std::size_t>(line)];
           e < edges.line_start[static_cast<std::size_t>(line) + 1]; ++e) {
        Edge& edge = edges.edges[e];
        if (result.boundary[e] < 0 || edge.sigma_px <= kUnsure_px) continue;
        if (settle(view, line, result.boundary[e], worker, edge.column_px, edge.sigma_px)) {
          ++counts.moved;
        } else {
          result.boundary[e] = -1;
          ++counts.rejected;
        }
      }
    }
  });
  dropped_.assign(recovered.size(), 0);
  pool.for_ranges(static_cast<int>(recovered.size()), [&](int begin, int end, int worker) {
    for (auto i = static_cast<std::size_t>(begin); i < static_cast<std::size_t>(end); ++i) {
      RecoveredBoundary& r = recovered[i];
      if (r.sigma_px <= kUnsure_px) continue;
      ++counts_[static_cast<std::size_t>(worker)].moved;
      dropped_[i] = !settle(view, r.line, r.boundary, worker, r.column_px, r.sigma_px);
    }
  });
  RenderCounts total;
  for (const RenderCounts& c : counts_) {
    total.moved += c.moved;
    total.rejected += c.rejected;
  }
  total.rejected += drop_if(recovered, dropped_);
  usual_ = std::max(kLeastUsual, unlikes_.median(usual_));
  view.places.fill(view.places.boundaries(), pool, result, edges, recovered);
  const int lines = view.places.lines();
  for (int line = 0; line < lines; ++line)
    total.restored += restore_line(view, line, result, edges, recovered);
  return total;
}

}  // namespace relievo
