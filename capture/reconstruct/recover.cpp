// SPDX-License-Identifier: Apache-2.0
#include "capture/reconstruct/recover.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "capture/reconstruct/column_grid.h"

namespace relievo {
namespace {

constexpr float kNone = std::numeric_limits<float>::quiet_NaN();
constexpr int kMargin = 3;

// Three neighbours in line predict a fourth; how well, in pixels, was measured on simulated scenes.
constexpr float kAcross_px = 0.08F;      // from boundaries beside it
constexpr float kAlong_px = 0.08F;       // from lines above or below
constexpr float kBend = 0.5F;            // more for each pixel that the three are out of line
constexpr float kWorst_px = 0.2F;        // beyond which it is no prediction
constexpr float kAgree = 3.F;            // standard deviations between luma's place and the prediction
constexpr float kLeastAgree_px = 0.25F;  // but at least
constexpr float kOtherSlide_px = 0.5F;   // between its places under both slides
constexpr float kContrasty = 0.1F;       // contrast of the scene that may be a surface's end
constexpr float kContradicts_px = 1.F;   // between a detected boundary's places under both slides
constexpr float kMoves_px = 2.5F;        // where the scene moves
constexpr float kWidest_px = 40.F;       // of a stripe
constexpr float kDoubtful_px = 0.5F;     // standard deviation beyond which a doubted boundary is given up
constexpr float kGoesOn_px = 0.5F;       // from one line to the next
constexpr float kConfirms_px = 0.4F;     // between its place and luma's under either slide
constexpr float kLeastRoom_px = 2.F;     // to other boundaries on the line
constexpr float kSamePlace_px = 1.F;     // and an edge so near is the boundary's own

bool known(float x) {
  return x == x;
}

}  // namespace

const float* Recovery::row(int line) const {
  return columns_.data() + static_cast<std::size_t>(line + kMargin) * stride_ + kMargin;
}

void Recovery::reset(int boundaries, int lines) {
  const std::size_t stride = static_cast<std::size_t>(boundaries) + 2 * kMargin;
  const std::size_t cells = stride * static_cast<std::size_t>(lines + 2 * kMargin);
  if (boundaries == boundaries_ && columns_.size() == cells) return;
  boundaries_ = boundaries;
  stride_ = stride;
  columns_.assign(cells, kNone);  // what lies around the lines stays so
  doubted_.assign(cells, kNone);
}

/// The columns of a line's boundaries, `with_doubted` those of doubted ones as well.
void Recovery::fill_line(const SequenceResult& result, const EdgeImage& edges, int line, bool with_doubted,
                         std::vector<float>& grid) const {
  float* columns = grid.data() + static_cast<std::size_t>(line + kMargin) * stride_ + kMargin;
  std::fill_n(columns, boundaries_, kNone);
  for (std::uint32_t e = edges.line_start[static_cast<std::size_t>(line)];
       e < edges.line_start[static_cast<std::size_t>(line) + 1]; ++e) {
    const std::int16_t b = result.boundary[e] < 0 && with_doubted ? result.doubted[e] : result.boundary[e];
    if (b >= 0) columns[b] = edges.edges[e].column_px;
  }
}

/// From the straightest three neighbours; others that agree with it count, too.
Recovery::Prediction Recovery::predict(View8 slide, int line, int boundary) const {
  std::array<Prediction, 4> all{};
  std::size_t count = 0;
  const auto add = [&](float a, float b, float c, float sigma_px) {
    const float bend = a - 2 * b + c;
    if (!known(bend)) return;
    all[count++] = {goes_on_to(a, b, c), sigma_px + kBend * std::fabs(bend)};
  };
  const float* here = row(line);
  add(here[boundary - 1], here[boundary - 2], here[boundary - 3], kAcross_px);
  add(here[boundary + 1], here[boundary + 2], here[boundary + 3], kAcross_px);
  const auto at = [&](int l) { return row(line + l)[boundary]; };
  // Only along the same surface: a line beside a step is easily a mixture.
  if (known(at(-1)) && same_surface(slide, line, line - 1, at(-1))) add(at(-1), at(-2), at(-3), kAlong_px);
  if (known(at(1)) && same_surface(slide, line, line + 1, at(1))) add(at(1), at(2), at(3), kAlong_px);
  if (count == 0) return {kNone, 0};
  const Prediction best =
      *std::min_element(all.begin(), all.begin() + static_cast<std::ptrdiff_t>(count),
                        [](const Prediction& a, const Prediction& b) { return a.sigma_px < b.sigma_px; });
  float weights = 0;
  float sum = 0;
  for (std::size_t i = 0; i < count; ++i) {
    const float off = all[i].column_px - best.column_px;
    const float variance = all[i].sigma_px * all[i].sigma_px;
    if (off * off > kAgree * kAgree * (variance + best.sigma_px * best.sigma_px)) continue;
    weights += 1 / variance;
    sum += all[i].column_px / variance;
  }
  return {sum / weights, 1 / std::sqrt(weights)};
}

/// The decoded edge at a place, if there is one.
std::optional<std::uint32_t> Recovery::edge_at(const EdgeImage& edges, const SequenceResult& result, int line,
                                               float column_px) {
  for (std::uint32_t e = edges.line_start[static_cast<std::size_t>(line)];
       e < edges.line_start[static_cast<std::size_t>(line) + 1]; ++e)
    if (result.boundary[e] >= 0 && std::fabs(edges.edges[e].column_px - column_px) < kSamePlace_px) return e;
  return std::nullopt;
}

void Recovery::recover_line(const RecoveryView& view, const Refiner& refiner, const EdgeImage& edges,
                            int line, SequenceResult& result, std::vector<RecoveredBoundary>& out) const {
  const float* here = row(line);
  const std::size_t of_line = out.size();
  for (int b = 0; b < boundaries_; ++b) {
    if (known(here[b])) continue;
    const Prediction p = predict(view.slide, line, b);
    if (!(p.sigma_px <= kWorst_px) || !known(p.column_px)) continue;
    const float left = known(here[b - 1]) ? p.column_px - here[b - 1] : 100;
    const float right = known(here[b + 1]) ? here[b + 1] - p.column_px : 100;
    if (left < kLeastRoom_px || right < kLeastRoom_px) continue;
    const Refiner::Place place = refiner.find(view.shown, line, p.column_px,
                                              {left, right, view.shown_colours[static_cast<std::size_t>(b)]});
    if (!place.found) continue;
    if (view.other != nullptr) {
      const Refiner::Place other = refiner.find(
          *view.other, line, place.column_px, {left, right, view.other_colours[static_cast<std::size_t>(b)]});
      if (!other.found || std::fabs(other.column_px - place.column_px) > kOtherSlide_px) continue;
    }
    const float off = std::fabs(place.column_px - p.column_px);
    const float own_variance = place.sigma_px * place.sigma_px;
    const float variance = p.sigma_px * p.sigma_px;
    if (off > std::max(kLeastAgree_px, kAgree * std::sqrt(variance + own_variance))) continue;
    if (const auto same = edge_at(edges, result, line, place.column_px)) {
      // It was taken for another boundary, from no surface of which it goes on.
      const int taken_for = result.boundary[*same];
      const auto near = [&](int next) { return std::fabs(here[next] - here[taken_for]) < kWidest_px; };
      if (!near(taken_for - 1) && !near(taken_for + 1)) result.boundary[*same] = static_cast<std::int16_t>(b);
      continue;
    }
    const float weight = 1 / own_variance;
    const float weights = weight + 1 / variance;
    const RecoveredBoundary found{line, b, (weight * place.column_px + p.column_px / variance) / weights,
                                  1 / std::sqrt(weights), 0};
    // Two surfaces may both seem to go on there.
    const auto other = std::find_if(
        out.begin() + static_cast<std::ptrdiff_t>(of_line), out.end(),
        [&](const RecoveredBoundary& r) { return std::fabs(r.column_px - found.column_px) < kSamePlace_px; });
    if (other == out.end()) {
      out.push_back(found);
    } else if (found.sigma_px < other->sigma_px) {
      *other = found;
    }
  }
}

void Recovery::check_line(const RecoveryView& view, const Refiner& refiner, const EdgeImage& edges, int line,
                          SequenceResult& result) const {
  const float* here = row(line);
  for (std::uint32_t e = edges.line_start[static_cast<std::size_t>(line)];
       e < edges.line_start[static_cast<std::size_t>(line) + 1]; ++e) {
    const int b = result.boundary[e];
    if (b < 0 || edges.edges[e].contrast < kContrasty) continue;
    const float column = here[b];
    const float left = column - here[b - 1];
    const float right = here[b + 1] - column;
    if (left > 0 && left < kWidest_px && right > 0 && right < kWidest_px) continue;
    const auto sides = [](float px) { return px > 0 && px < kWidest_px ? px : kWidest_px; };
    const Refiner::Place other =
        refiner.find(*view.other, line, column,
                     {sides(left), sides(right), view.other_colours[static_cast<std::size_t>(b)]});
    // Where the scene moves, the other slide saw the boundary elsewhere.
    const float near_px = result.still[e] ? kContradicts_px : kMoves_px;
    if (!other.visible || (other.found && std::fabs(other.column_px - column) < near_px)) continue;
    result.doubted[e] = std::exchange(result.boundary[e], std::int16_t{-1});
  }
}

/// A doubted boundary is there after all where luma shows it under both slides at its place, and its
/// neighbour above or below goes on from it.
void Recovery::settle_doubts(const RecoveryView& view, const Refiner& refiner, const EdgeImage& edges,
                             int line, SequenceResult& result) const {
  const auto at = [&](int l, int b) {
    return doubted_[static_cast<std::size_t>(l + kMargin) * stride_ + kMargin + static_cast<std::size_t>(b)];
  };
  for (std::uint32_t e = edges.line_start[static_cast<std::size_t>(line)];
       e < edges.line_start[static_cast<std::size_t>(line) + 1]; ++e) {
    const int b = result.doubted[e];
    if (b < 0) continue;
    const Edge& edge = edges.edges[e];
    const float column = edge.column_px;
    if (edge.sigma_px > kDoubtful_px) continue;
    const bool above = !edge.above_differs && std::fabs(at(line - 1, b) - column) < kGoesOn_px;
    const bool below = !edge.below_differs && std::fabs(at(line + 1, b) - column) < kGoesOn_px;
    if (!above && !below) continue;
    const auto confirms = [&](const DifferenceImage& image, std::array<Primary, 2> colours) {
      const Refiner::Place place = refiner.find(image, line, column, {kWidest_px, kWidest_px, colours});
      return place.found && std::fabs(place.column_px - column) < kConfirms_px;
    };
    const auto i = static_cast<std::size_t>(b);
    if (confirms(view.shown, view.shown_colours[i]) && confirms(*view.other, view.other_colours[i]))
      result.boundary[e] = static_cast<std::int16_t>(b);
  }
}

void Recovery::recover(const RecoveryView& view, const Refiner& refiner, const EdgeImage& edges,
                       SequenceResult& result, WorkerPool& pool, std::vector<RecoveredBoundary>& out) {
  reset(static_cast<int>(view.shown_colours.size()), edges.lines);
  if (view.other != nullptr) {
    pool.for_shares(edges.line_start, [&](int begin, int end, int) {
      for (int line = begin; line < end; ++line) {
        fill_line(result, edges, line, false, columns_);
        fill_line(result, edges, line, true, doubted_);
      }
    });
    pool.for_shares(edges.line_start, [&](int begin, int end, int) {
      for (int line = begin; line < end; ++line) {
        check_line(view, refiner, edges, line, result);
        settle_doubts(view, refiner, edges, line, result);
      }
    });
  }
  pool.for_shares(edges.line_start, [&](int begin, int end, int) {
    for (int line = begin; line < end; ++line) fill_line(result, edges, line, false, columns_);
  });
  found_.resize(static_cast<std::size_t>(pool.workers()));
  for (auto& found : found_) found.clear();
  pool.for_ranges(edges.lines, [&](int begin, int end, int worker) {
    for (int line = begin; line < end; ++line)
      recover_line(view, refiner, edges, line, result, found_[static_cast<std::size_t>(worker)]);
  });
  out.clear();
  for (const auto& found : found_) out.insert(out.end(), found.begin(), found.end());
}

}  // namespace relievo
