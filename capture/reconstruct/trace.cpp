// SPDX-License-Identifier: Apache-2.0
#include "capture/reconstruct/trace.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <utility>

namespace relievo {
namespace {

constexpr int kReach = 4;             // lines to each side that tell where a boundary is
constexpr float kLean_px = 2.5F;      // how far a boundary moves from one line to the next
constexpr float kStraight_px = 0.7F;  // of the straight line through its neighbours, one that counts
constexpr int kLeastBeyond = 3;       // lines that continue a boundary past its end
constexpr int kAverage = 3;           // lines to each side that the evidence is averaged over
constexpr int kWindow_px = 6;         // evidence is looked at up to here
constexpr float kSearch_px = 1.6F;    // the boundary is at most so far from where its neighbours predict it
constexpr float kGap_px = 1.5F;       // between a side's evidence and the boundary
constexpr int kLeastBeside = 2;       // lines on each side between which a boundary cannot but go on
constexpr float kOtherSide = 0.3F;    // of agreement on each side with the other slide's frame, beyond an end
constexpr float kSeen = 4.F;          // standard deviations that a side must show
constexpr float kNone = std::numeric_limits<float>::quiet_NaN();

bool known(float x) {
  return x == x;
}

/// Sorts a few values in place and returns the middle one.
template <std::size_t N>
float median(std::array<float, N>& values, std::size_t count) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(count / 2);
  std::nth_element(values.begin(), middle, values.begin() + static_cast<std::ptrdiff_t>(count));
  return *middle;
}

struct Fit {
  float column_px, lean_px;
  int above, below;  // lines that agree
};

/// The straight line through a boundary's places on the lines around `line` but that one. At the median of
/// the slopes and of the offsets, so that a few that are wrong do no harm.
std::optional<Fit> fit_around(const float* columns, int lines, int line) {
  std::array<float, 2 * kReach + 1> x{};
  const auto at = [&](int k) -> float& { return x[static_cast<std::size_t>(k + kReach)]; };
  int count = 0;
  for (int k = -kReach; k <= kReach; ++k) {
    const int l = line + k;
    at(k) = k == 0 || l < 0 || l >= lines ? kNone : columns[l];
    count += known(at(k));
  }
  if (count < kLeastBeyond) return std::nullopt;
  std::array<float, 2 * kReach * kReach> slopes{};
  std::size_t n = 0;
  for (int a = -kReach; a < kReach; ++a) {
    if (!known(at(a))) continue;
    for (int b = a + 1; b <= kReach; ++b) {
      if (!known(at(b)) || n == slopes.size()) continue;
      slopes[n++] = (at(b) - at(a)) / static_cast<float>(b - a);
    }
  }
  const float lean = median(slopes, n);
  if (std::fabs(lean) > kLean_px) return std::nullopt;
  std::array<float, 2 * kReach + 1> offsets{};
  n = 0;
  for (int k = -kReach; k <= kReach; ++k)
    if (known(at(k))) offsets[n++] = at(k) - lean * static_cast<float>(k);
  const float column = median(offsets, n);
  Fit fit{column, lean, 0, 0};
  float sum = 0;
  int agree = 0;
  for (int k = -kReach; k <= kReach; ++k) {
    const float off = at(k) - lean * static_cast<float>(k) - column;
    if (!(std::fabs(off) <= kStraight_px)) continue;
    (k < 0 ? fit.above : fit.below) += 1;
    sum += off;
    ++agree;
  }
  if (agree < kLeastBeyond) return std::nullopt;
  fit.column_px += sum / static_cast<float>(agree);
  return fit;
}

struct Measure {
  float column_px, slope, noise;
};

/// The boundary's place near `fit`, from the difference averaged along it; nothing where the sides do not
/// show its colours.
std::optional<Measure> measure(const DifferenceImage& image, int line, const Fit& fit,
                               std::array<Primary, 2> colours, std::array<float, 2> reach_px,
                               std::array<int, 2> lines) {
  const int width = image.width;
  constexpr int kSamples = 2 * kWindow_px + 1;
  if (fit.column_px < kWindow_px + kLean_px * kAverage + 1 ||
      fit.column_px > static_cast<float>(width) - (kWindow_px + kLean_px * kAverage + 2))
    return std::nullopt;
  std::array<std::array<float, kSamples>, 3> sums{};
  float weights = 0;
  float squares = 0;
  for (int k = lines[0]; k <= lines[1]; ++k) {
    const int l = line + k;
    if (l < 0 || l >= image.lines) continue;
    const float weight = static_cast<float>(kAverage + 1 - std::abs(k));
    const float from = fit.column_px + fit.lean_px * static_cast<float>(k) - kWindow_px;
    const int first = static_cast<int>(from);
    const float part = from - static_cast<float>(first);
    for (int c = 0; c < 3; ++c) {
      const float* d = image.line(l) + c * width + first;
      auto& sum = sums[static_cast<std::size_t>(c)];
      for (int i = 0; i < kSamples; ++i)
        sum[static_cast<std::size_t>(i)] += weight * ((1 - part) * d[i] + part * d[i + 1]);
    }
    weights += weight;
    squares += weight * weight;
  }
  const auto [left, right] = colours;
  std::array<float, kSamples> y{};
  int flips = 0;
  for (int c = 0; c < 3; ++c) {
    const bool l = left & (1 << c);
    const bool r = right & (1 << c);
    if (l == r) continue;
    ++flips;
    for (int i = 0; i < kSamples; ++i)
      y[static_cast<std::size_t>(i)] +=
          (r ? 1.F : -1.F) * sums[static_cast<std::size_t>(c)][static_cast<std::size_t>(i)] / weights;
  }
  if (flips == 0) return std::nullopt;
  // Lines next to each other share half of their noise.
  const float noise = image.noise_at(line, static_cast<int>(fit.column_px)) *
                      std::sqrt(static_cast<float>(flips) * std::min(1.F, 2 * squares / (weights * weights)));
  float best = kSearch_px + 1;
  float slope = 0;
  const auto at = [&](int x) { return y[static_cast<std::size_t>(x + kWindow_px)]; };
  for (int x = -3; x < 3; ++x) {
    const float a = at(x);
    const float b = at(x + 1);
    if (a > 0 || b <= 0) continue;
    const float place = static_cast<float>(x) - a / (b - a);
    if (std::fabs(place) < std::fabs(best)) {
      best = place;
      slope = b - a;
    }
  }
  if (std::fabs(best) > kSearch_px) return std::nullopt;
  // Each channel must be as the colours say, on both sides, or at least not the other way.
  const auto side = [&](int c, float from, float to) {
    const int first = std::clamp(static_cast<int>(std::lround(from)), -kWindow_px, kWindow_px);
    const int last = std::clamp(static_cast<int>(std::lround(to)), first, kWindow_px);
    float sum = 0;
    for (int x = first; x <= last; ++x)
      sum += sums[static_cast<std::size_t>(c)][static_cast<std::size_t>(x + kWindow_px)];
    return sum / (weights * static_cast<float>(last - first + 1));
  };
  for (int s = 0; s < 2; ++s) {
    const Primary colour = s == 0 ? left : right;
    const float reach =
        std::clamp(reach_px[static_cast<std::size_t>(s)], 2.F, static_cast<float>(kWindow_px));
    float total = 0;
    float worst = 1e9F;
    for (int c = 0; c < 3; ++c) {
      const float v = (colour & (1 << c) ? 1.F : -1.F) * (s == 0 ? side(c, best - reach, best - kGap_px)
                                                                 : side(c, best + kGap_px, best + reach));
      total += v;
      worst = std::min(worst, v);
    }
    const float one = noise / std::sqrt(static_cast<float>(flips));
    if (total < kSeen * one * 1.7F || worst < -kSeen * 0.5F * one - 0.1F * total) return std::nullopt;
  }
  return Measure{fit.column_px + best, slope / std::sqrt(static_cast<float>(flips)),
                 noise / std::sqrt(static_cast<float>(flips))};
}

}  // namespace

/// Distance to the next boundary of the pattern on this line or the ones beside it; large where it is
/// unknown.
float Tracer::spacing(int line, int boundary, int side) const {
  const int next = boundary + side;
  if (next < 0 || next >= boundaries_) return 2 * kWindow_px;
  const auto row = [&](int b) {
    return column_.data() + static_cast<std::size_t>(b) * static_cast<std::size_t>(lines_);
  };
  for (const int d : {0, -1, 1, -2, 2, -3, 3, -4, 4}) {
    const int l = line + d;
    if (l < 0 || l >= lines_) continue;
    const float gap = static_cast<float>(side) * (row(next)[l] - row(boundary)[l]);
    if (gap > 0) return gap;
  }
  return 2 * kWindow_px;
}

void Tracer::trace_boundary(const DifferenceImage& image, int boundary, const SequenceDecoder& sequence,
                            const SequenceContext& context, Scratch& scratch) const {
  const std::array<Primary, 2> colours =
      sequence.shown_colours(context.order)[static_cast<std::size_t>(boundary)];
  const std::size_t row = static_cast<std::size_t>(boundary) * static_cast<std::size_t>(lines_);
  auto& columns = scratch.columns;
  columns.assign(column_.begin() + static_cast<std::ptrdiff_t>(row),
                 column_.begin() + static_cast<std::ptrdiff_t>(row) + lines_);
  const auto reaches = [&](int line) {
    return std::array{0.45F * spacing(line, boundary, -1), 0.45F * spacing(line, boundary, 1)};
  };
  const auto visit = [&](int line) {
    float& here = columns[static_cast<std::size_t>(line)];
    if (known(here)) return;
    const bool above = line > 0 && known(columns[static_cast<std::size_t>(line) - 1]);
    const bool below = line + 1 < lines_ && known(columns[static_cast<std::size_t>(line) + 1]);
    if (!above && !below) return;
    const auto fit = fit_around(columns.data(), lines_, line);
    if (!fit) return;
    // Past a boundary's end only what lies further out tells whether it goes on.
    const std::array<int, 2> over{fit->above > 0 && (fit->below == 0) ? 0 : -kAverage,
                                  fit->below > 0 && (fit->above == 0) ? 0 : kAverage};
    const auto m = measure(image, line, *fit, colours, reaches(line), over);
    if (!m) return;
    Added added{line, static_cast<std::int16_t>(boundary), {}};
    added.edge.column_px = m->column_px;
    added.edge.slope = m->slope;
    added.edge.sigma_px = added.edge.noise_px = m->noise / std::max(m->slope, 0.01F);
    const std::array<float, 2> reach = reaches(line);
    added.edge.left_reach_px = std::min(reach[0], static_cast<float>(kWindow_px));
    added.edge.right_reach_px = std::min(reach[1], static_cast<float>(kWindow_px));
    const bool end = fit->above < kLeastBeside || fit->below < kLeastBeside;
    if (end && (image.signal_at(line, static_cast<int>(m->column_px)) == Signal::kStrong ||
                sequence.other_agreement(added.edge, line, boundary, context) < kOtherSide)) {
      return;
    }
    scratch.added.push_back(added);
    here = m->column_px;
  };
  for (int line = 0; line < lines_; ++line) visit(line);
  for (int line = lines_ - 1; line >= 0; --line) visit(line);
}

/// A line's edges and those added to it, from left to right.
void Tracer::merge_line(int line, const SequenceResult& result, const EdgeImage& edges) {
  const auto at = static_cast<std::size_t>(line);
  std::uint32_t from = edges.line_start[at];
  const std::uint32_t last = edges.line_start[at + 1];
  std::size_t added = merged_.line_start[at] - from;  // on the lines above
  for (std::uint32_t to = merged_.line_start[at]; to < merged_.line_start[at + 1]; ++to) {
    const bool take_added = added < added_.size() && added_[added].line == line &&
                            (from == last || added_[added].edge.column_px < edges.edges[from].column_px);
    merged_.edges[to] = take_added ? added_[added].edge : edges.edges[from];
    // Of added ones it is not known.
    merged_still_[to] = take_added || result.still.empty() ? std::uint8_t{0} : result.still[from];
    merged_boundary_[to] = take_added ? added_[added].boundary : result.boundary[from];
    take_added ? void(++added) : void(++from);
  }
}

void Tracer::insert(WorkerPool& pool, SequenceResult& result, EdgeImage& edges) {
  added_.clear();
  for (const Scratch& s : scratch_) added_.insert(added_.end(), s.added.begin(), s.added.end());
  if (added_.empty()) return;
  std::sort(added_.begin(), added_.end(), [](const Added& a, const Added& b) {
    return a.line != b.line                       ? a.line < b.line
           : a.edge.column_px != b.edge.column_px ? a.edge.column_px < b.edge.column_px
                                                  : a.boundary < b.boundary;
  });
  merged_.lines = edges.lines;
  merged_.line_start.assign(edges.line_start.size(), 0);
  for (const Added& a : added_) ++merged_.line_start[static_cast<std::size_t>(a.line) + 1];
  for (std::size_t line = 1; line < merged_.line_start.size(); ++line)
    merged_.line_start[line] += merged_.line_start[line - 1];
  for (std::size_t line = 0; line < merged_.line_start.size(); ++line)
    merged_.line_start[line] += edges.line_start[line];
  merged_.edges.resize(merged_.line_start.back());
  merged_boundary_.resize(merged_.line_start.back());
  merged_still_.resize(merged_.line_start.back());
  pool.for_shares(merged_.line_start, [&](int begin, int end, int) {
    for (int line = begin; line < end; ++line) merge_line(line, result, edges);
  });
  std::swap(merged_, edges);
  std::swap(merged_boundary_, result.boundary);
  std::swap(merged_still_, result.still);
}

std::size_t Tracer::trace(const DifferenceImage& image, const SequenceDecoder& sequence,
                          const SequenceContext& context, WorkerPool& pool, SequenceResult& result,
                          EdgeImage& edges) {
  boundaries_ = static_cast<int>(sequence.shown_colours(context.order).size());
  lines_ = edges.lines;
  const std::size_t cells = static_cast<std::size_t>(boundaries_) * static_cast<std::size_t>(lines_);
  column_.assign(cells, kNone);
  pool.for_shares(edges.line_start, [&](int begin, int end, int) {
    for (int line = begin; line < end; ++line) {
      for (std::uint32_t e = edges.line_start[static_cast<std::size_t>(line)];
           e < edges.line_start[static_cast<std::size_t>(line) + 1]; ++e) {
        if (result.boundary[e] < 0) continue;
        const std::size_t cell =
            static_cast<std::size_t>(result.boundary[e]) * static_cast<std::size_t>(lines_) +
            static_cast<std::size_t>(line);
        column_[cell] = edges.edges[e].column_px;
      }
    }
  });
  scratch_.resize(static_cast<std::size_t>(pool.workers()));
  for (Scratch& s : scratch_) {
    s.added.clear();
  }
  pool.for_ranges(boundaries_, [&](int begin, int end, int worker) {
    for (int b = begin; b < end; ++b)
      trace_boundary(image, b, sequence, context, scratch_[static_cast<std::size_t>(worker)]);
  });
  insert(pool, result, edges);
  return added_.size();
}

}  // namespace relievo
