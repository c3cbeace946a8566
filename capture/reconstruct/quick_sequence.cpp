// SPDX-License-Identifier: Apache-2.0
#include "capture/reconstruct/quick_sequence.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>
#include <optional>

#include "capture/reconstruct/sequence_rules.h"

namespace relievo {

using namespace sequence_rules;

namespace {

// As edges.cpp has them.
constexpr float kNoiseFactor = 4;
constexpr float kLeastRise = 2;
constexpr float kMaxReach_px = 6;
constexpr float kReachShare = 0.55F;  // of the way to the next edge
constexpr float kNoiseOfSign = 2;
constexpr float kDoubt = 0.5F * QuickKernels::kScale;
constexpr float kSettledGain = 2.F;        // of the edge from which a search starts
constexpr float kLean_px = 2.5F;           // how far a boundary moves from one line to the next
constexpr float kCompleteEvidence = 2.2F;  // gain for a boundary that a neighbouring line predicts
constexpr float kNone = std::numeric_limits<float>::quiet_NaN();

float doubt_of(const QuadImage& image) {
  return kNoiseOfSign * image.noise + kDoubt;
}

/// Columns beside an edge from half its reach to a whole one away.
QuadSpans spans_of(int width, float column_px, float left_reach_px, float right_reach_px) {
  const auto rounded = [width](float x) { return std::clamp(static_cast<int>(x + 0.5F), 0, width - 1); };
  const int left = rounded(column_px - left_reach_px);
  const int left_last = std::max(left, rounded(column_px - 0.5F * left_reach_px));
  const int right = rounded(column_px + 0.5F * right_reach_px);
  const int right_last = std::max(right, rounded(column_px + right_reach_px));
  return {static_cast<std::int16_t>(left), static_cast<std::int16_t>(right),
          static_cast<std::int16_t>(std::min(QuadSpans::kMost, left_last - left + 1)),
          static_cast<std::int16_t>(std::min(QuadSpans::kMost, right_last - right + 1))};
}

/// `px` further on, as far as the line goes.
QuadSpans moved(const QuadSpans& spans, float px, int width) {
  const int by = static_cast<int>(std::lround(px));
  const auto put = [&](int first, int count) {
    return static_cast<std::int16_t>(std::clamp(first + by, 0, width - count));
  };
  return {put(spans.left_first, spans.left_count), put(spans.right_first, spans.right_count),
          spans.left_count, spans.right_count};
}

/// As RowKernels::side_evidence has it.
SideEvidence evidence(const std::array<float, 4>& sums, int count, float doubt) {
  const float most = std::max({std::fabs(sums[0]), std::fabs(sums[1]), std::fabs(sums[2])});
  const float unit = 1 / (QuickKernels::kClearShare * most + static_cast<float>(count) * doubt);
  const auto of = [&](std::size_t c) { return std::clamp(sums[c] * unit, -1.F, 1.F); };
  return {of(0), of(1), of(2)};
}

struct SidesEvidence {
  SideEvidence left, right;
};
SidesEvidence evidence_of(const QuadSides& sides, const QuadSpans& spans, const QuadImage& image) {
  return {evidence(sides.left, spans.left_count, doubt_of(image)),
          evidence(sides.right, spans.right_count, doubt_of(image))};
}
SidesEvidence evidence_at(const QuadImage& image, int line, const QuadSpans& spans) {
  QuadSides sides;
  quick_kernels().sides(image.line(line), &spans, 1, doubt_of(image), &sides);
  return evidence_of(sides, spans, image);
}

/// Tells the processor that a line comes next: of frames that lie in memory, its edges are too far apart for
/// it to see that coming.
void read_ahead(const std::int16_t* quads, int width) {
  constexpr int kCacheLine = 64 / sizeof(std::int16_t);
  for (int i = 0; i < 4 * width; i += kCacheLine) __builtin_prefetch(quads + i);
}

float reach_px(float gap_px) {
  return std::clamp(kReachShare * gap_px, 1.F, kMaxReach_px);
}

}  // namespace

QuickSequence::QuickSequence(const Pattern& pattern)
    : slides_(slide_colours(pattern)), boundaries_(pattern.boundaries()) {}

std::uint32_t QuickSequence::edges_of_line(const QuadImage& image, int line, Scratch& scratch) {
  const float rise = std::max(kLeastRise * QuickKernels::kScale, kNoiseFactor * image.noise);
  const QuickKernels& kernels = quick_kernels();
  const int crossings =
      kernels.crossings(image.line(line), image.width, static_cast<std::int16_t>(std::min(rise, 32767.F)),
                        scratch.crossings.data());
  return static_cast<std::uint32_t>(
      kernels.gather(image.line(line), scratch.crossings.data(), crossings, scratch.places.data()));
}

/// Of a line's edges, while it is at hand.
void QuickSequence::look_at_sides(const QuadImage& image, int line, std::uint32_t count, Scratch& scratch) {
  Found* found = found_on(line);
  for (std::uint32_t i = 0; i < count; ++i) {
    const float column = scratch.places[i].column_px;
    const float left = i > 0 ? column - scratch.places[i - 1].column_px : 2 * kMaxReach_px;
    const float right = i + 1 < count ? scratch.places[i + 1].column_px - column : 2 * kMaxReach_px;
    scratch.spans[i] = spans_of(image.width, column, reach_px(left), reach_px(right));
  }
  quick_kernels().sides(image.line(line), scratch.spans.data(), static_cast<int>(count), doubt_of(image),
                        scratch.sides.data());
  for (std::uint32_t i = 0; i < count; ++i) {
    found[i] = {scratch.places[i].column_px, scratch.places[i].slope, scratch.spans[i], scratch.sides[i].code,
                scratch.sides[i].clear};
  }
}

std::size_t QuickSequence::find_edges(const CapturedFrame& frame, QuickDifferencer& differencer,
                                      WorkerPool& pool, QuadImage& image) {
  const View8 rows = frame.scan == Scan::kInterlaced ? frame.picture.view().field(0) : frame.picture.view();
  scratch_.resize(static_cast<std::size_t>(pool.threads()));
  most_on_line_ = static_cast<std::size_t>(rows.width) / QuickKernels::kMerge_px + 2;
  for (Scratch& s : scratch_) {
    s.crossings.resize(static_cast<std::size_t>(rows.width));
    s.places.resize(static_cast<std::size_t>(rows.width));
    s.spans.resize(most_on_line_);
    s.sides.resize(most_on_line_);
    s.boundary.resize(most_on_line_);
    s.settled.resize(most_on_line_);
    s.beside.resize(most_on_line_);
  }
  found_.resize(most_on_line_ * static_cast<std::size_t>(rows.height));
  line_start_.assign(static_cast<std::size_t>(rows.height) + 1, 0);
  differencer.difference(frame, pool, image, [&](int begin, int end, int worker) {
    Scratch& scratch = scratch_[static_cast<std::size_t>(worker)];
    for (int line = begin; line < end; ++line) {
      const std::uint32_t count = edges_of_line(image, line, scratch);
      look_at_sides(image, line, count, scratch);
      line_start_[static_cast<std::size_t>(line) + 1] = count;
    }
  });
  for (std::size_t line = 0; line < static_cast<std::size_t>(image.lines); ++line)
    line_start_[line + 1] += line_start_[line];
  return line_start_.back();
}

/// Edges that all channels of both slides tell, where an edge beside them is the boundary beside theirs.
void QuickSequence::settle(const QuickContext& context, const Line& line, Scratch& scratch) const {
  const auto count = static_cast<std::size_t>(line.count);
  std::fill_n(scratch.settled.data(), count, std::uint8_t{0});
  std::fill_n(scratch.boundary.data(), count, std::int16_t{-1});
  if (context.other == nullptr) return;
  const QuadImage& image = *context.other;
  if (line.line + 1 < image.lines) read_ahead(image.line(line.line + 1), image.width);
  for (std::size_t i = 0; i < count; ++i) scratch.spans[i] = line.found[i].spans;
  quick_kernels().sides(image.line(line.line), scratch.spans.data(), line.count, doubt_of(image),
                        scratch.sides.data());
  const std::vector<std::int16_t>& by_code = shown_slide(context).by_code;
  int before = -2;
  for (std::size_t i = 0; i < count; ++i) {
    const Found& own = line.found[i];
    const QuadSides& other = scratch.sides[i];
    const int b =
        own.clear && other.clear ? by_code[static_cast<std::size_t>(own.code * 64 + other.code)] : -1;
    scratch.boundary[i] = static_cast<std::int16_t>(b);
    if (b >= 0 && b == before + 1) scratch.settled[i] = scratch.settled[i - 1] = 1;
    before = b >= 0 ? b : -2;
  }
}

/// What is beside an edge in its frame and, where it stood then, in the other slide's.
QuickSequence::Beside QuickSequence::look_beside(const QuadImage& image, const QuickContext& context,
                                                 int line, const QuadSpans& spans) {
  const auto [left, right] = evidence_at(image, line, spans);
  Beside out{left, right, {}, {}, true};
  float off = 0;
  if (context.same != nullptr) {
    const auto matches = [&](float px) {
      const auto there = evidence_at(*context.same, line, moved(spans, px, image.width));
      return alike(out.left, there.left) && alike(out.right, there.right);
    };
    out.tracked = matches(0);
    for (float px = kSearchStep_px; !out.tracked && off == 0 && px <= kSearch_px; px += kSearchStep_px)
      off = matches(px) ? px : matches(-px) ? -px : 0;
  }
  if (context.other == nullptr) return out;
  const auto there = evidence_at(*context.other, line, moved(spans, context.other_share * off, image.width));
  out.other_left = there.left;
  out.other_right = there.right;
  return out;
}

QuickSequence::Gain QuickSequence::gain(const QuickContext& context, const Beside& beside,
                                        int boundary) const {
  const BoundaryColours& table = shown_slide(context).table;
  const auto b = static_cast<std::size_t>(boundary);
  const auto of = [b](const std::vector<std::int32_t>& colours, const SideEvidence& seen) {
    return agreement(static_cast<Primary>(colours[b]), seen);
  };
  const float left = of(table.left, beside.left);
  const float right = of(table.right, beside.right);
  return {left, right,
          left + right +
              other_gain(of(table.other_left, beside.other_left), of(table.other_right, beside.other_right),
                         beside.tracked)};
}

/// The colours themselves speak for the boundary, not its place in the order alone.
bool QuickSequence::convincing(const QuickContext& context, const Beside& beside, int boundary) const {
  const Gain g = gain(context, beside, boundary);
  return std::min(g.left, g.right) > kLeastSide && g.left + g.right > kLeastOwn &&
         (context.other == nullptr || !beside.tracked || g.all > kLeastGain);
}

/// As SequenceDecoder::decode_line(), between two settled edges, `before` and `behind`; -1 and the line's
/// count stand for its ends.
void QuickSequence::search(const QuickContext& context, const Line& line, int before, int behind,
                           Scratch& scratch) {
  constexpr int kPlaces = kPathCandidates;
  const PathKernels& kernels = path_kernels();
  const BoundaryColours& table = shown_slide(context).table;
  const int begin = std::max(before, 0);
  const int end = std::min(behind + 1, line.count);
  PathCandidates& candidates = scratch.candidates;
  candidates.resize(static_cast<std::size_t>(end - begin));
  BestPath path;
  for (int e = begin; e < end; ++e) {
    const int place = e - begin;
    const int own = place * kPlaces;
    std::int32_t* boundary = candidates.boundary.data() + own;
    float* gains = candidates.gain.data() + own;
    int& used = candidates.used[static_cast<std::size_t>(place)];
    if (e == before || e == behind) {
      used = 1;
      *boundary = scratch.boundary[static_cast<std::size_t>(e)];
      *gains = kSettledGain;
    } else {
      const Beside& beside = scratch.beside[static_cast<std::size_t>(e)];
      const EdgeAgreement seen =
          edge_agreement(beside.left, beside.right, beside.other_left, beside.other_right, beside.tracked);
      used = kernels.choose(table, seen, kGains, boundary, gains);
      doubt_unexpected(context.expected, line.found[e].column_px, used, boundary, gains);
    }
    path.extend(kernels, place, e == behind, candidates);
  }
  for (int e = begin; e < end; ++e)
    if (e != before && e != behind) scratch.boundary[static_cast<std::size_t>(e)] = -1;
  for (std::int32_t a = path.end; a >= 0; a = candidates.from[static_cast<std::size_t>(a)]) {
    const auto e = static_cast<std::size_t>(begin + a / kPlaces);
    if (scratch.settled[e] != 0) continue;
    const std::int32_t b = candidates.boundary[static_cast<std::size_t>(a)];
    if (convincing(context, scratch.beside[e], b)) scratch.boundary[e] = static_cast<std::int16_t>(b);
  }
}

void QuickSequence::write_edges(const QuadImage& image, const Line& line, const Scratch& scratch,
                                EdgeImage& edges, SequenceResult& out) {
  const std::size_t begin = line_start_[static_cast<std::size_t>(line.line)];
  float* seen = seen_px_.data() + static_cast<std::size_t>(line.line) * static_cast<std::size_t>(boundaries_);
  std::fill_n(seen, boundaries_, kNone);
  for (int i = 0; i < line.count; ++i) {
    const auto at = static_cast<std::size_t>(i);
    const Found& f = line.found[i];
    Edge& edge = edges.edges[begin + at];
    edge.column_px = f.column_px;
    edge.slope = f.slope * (1.F / QuickKernels::kScale);
    edge.sigma_px = edge.noise_px = image.noise / f.slope;
    edge.contrast = 0;
    edge.at_step = edge.above_differs = edge.below_differs = false;
    edge.left_reach_px = reach_px(i > 0 ? f.column_px - line.found[i - 1].column_px : 2 * kMaxReach_px);
    edge.right_reach_px =
        reach_px(i + 1 < line.count ? line.found[i + 1].column_px - f.column_px : 2 * kMaxReach_px);
    const std::int16_t b = scratch.boundary[at];
    out.boundary[begin + at] = b;
    out.still[begin + at] = scratch.settled[at] != 0 || (b >= 0 && scratch.beside[at].tracked);
    settled_[begin + at] = scratch.settled[at];
    if (b >= 0) seen[b] = f.column_px;
  }
}

/// What the search found stays where a line above or below, or both edges beside it, agree.
void QuickSequence::drop_unsupported(int line, const EdgeImage& edges, Scratch& scratch,
                                     SequenceResult& out) const {
  const std::uint32_t begin = line_start_[static_cast<std::size_t>(line)];
  const std::uint32_t end = line_start_[static_cast<std::size_t>(line) + 1];
  for (std::uint32_t e = begin; e < end; ++e) {
    const int b = out.boundary[e];
    if (b < 0) continue;
    ++scratch.in_order;
    if (settled_[e] != 0) continue;
    const auto seen = [&](int l, int boundary) {
      return seen_px_[static_cast<std::size_t>(l * boundaries_ + boundary)];
    };
    bool goes_on = false;
    for (const int d : {-1, 1, -2, 2}) {
      if (line + d < 0 || line + d >= edges.lines) continue;
      goes_on |= std::fabs(seen(line + d, b) - edges.edges[e].column_px) <=
                 kLean_px * static_cast<float>(std::abs(d));
    }
    const auto follows = [&](std::uint32_t other, int boundary) {
      return other >= begin && other < end && boundary >= 0 && boundary < boundaries_ &&
             seen(line, boundary) == edges.edges[other].column_px;
    };
    if (goes_on || (follows(e - 1, b - 1) && follows(e + 1, b + 1))) continue;
    out.boundary[e] = -1;
    ++scratch.unsupported;
  }
}

/// What a line did not decode, those beside it predict.
void QuickSequence::complete(const QuadImage& image, const QuickContext& context, int line,
                             const EdgeImage& edges, Scratch& scratch, SequenceResult& out) const {
  const std::uint32_t begin = line_start_[static_cast<std::size_t>(line)];
  const std::uint32_t end = line_start_[static_cast<std::size_t>(line) + 1];
  scratch.taken.assign(static_cast<std::size_t>(boundaries_), 0);
  for (std::uint32_t e = begin; e < end; ++e)
    if (out.boundary[e] >= 0) scratch.taken[static_cast<std::size_t>(out.boundary[e])] = 1;
  for (std::uint32_t e = begin; e < end; ++e) {
    if (out.boundary[e] >= 0) continue;
    const float column = edges.edges[e].column_px;
    std::optional<Beside> beside;
    float nearest = kLean_px;
    int best = -1;
    for (const int from : {line - 1, line + 1}) {
      if (from < 0 || from >= edges.lines) continue;
      const Edge* all = edges.edges.data();
      const Edge* last = all + line_start_[static_cast<std::size_t>(from) + 1];
      const Edge* n =
          std::lower_bound(all + line_start_[static_cast<std::size_t>(from)], last, column - nearest,
                           [](const Edge& other, float column_px) { return other.column_px < column_px; });
      for (; n != last && n->column_px <= column + kLean_px; ++n) {
        const int b = out.boundary[static_cast<std::size_t>(n - all)];
        const float distance = std::fabs(n->column_px - column);
        if (b < 0 || distance >= nearest || scratch.taken[static_cast<std::size_t>(b)] != 0) continue;
        if (!beside) beside = look_beside(image, context, line, found_on(line)[e - begin].spans);
        if (gain(context, *beside, b).all < kCompleteEvidence) continue;
        nearest = distance;
        best = b;
      }
    }
    if (best < 0) continue;
    out.boundary[e] = static_cast<std::int16_t>(best);
    out.still[e] = beside->tracked;
    scratch.taken[static_cast<std::size_t>(best)] = 1;
    ++scratch.completed;
  }
}

void QuickSequence::decode(const QuadImage& image, const QuickContext& context, WorkerPool& pool,
                           EdgeImage& edges, SequenceResult& out) {
  const std::size_t count = line_start_.back();
  edges.lines = image.lines;
  edges.line_start = line_start_;
  edges.edges.resize(count);
  out.boundary.resize(count);
  out.doubted.resize(count);
  out.still.resize(count);
  settled_.resize(count);
  seen_px_.resize(static_cast<std::size_t>(image.lines) * static_cast<std::size_t>(boundaries_));
  for (Scratch& s : scratch_) s.in_order = s.unsupported = s.completed = 0;
  pool.for_shares(line_start_, [&](int begin, int end, int worker) {
    Scratch& scratch = scratch_[static_cast<std::size_t>(worker)];
    for (int l = begin; l < end; ++l) {
      const std::uint32_t first = line_start_[static_cast<std::size_t>(l)];
      const Line line{l, found_on(l), static_cast<int>(line_start_[static_cast<std::size_t>(l) + 1] - first)};
      settle(context, line, scratch);
      int before = -1;
      for (int e = 0; e <= line.count; ++e) {
        if (e < line.count && scratch.settled[static_cast<std::size_t>(e)] == 0) {
          scratch.beside[static_cast<std::size_t>(e)] = look_beside(image, context, l, line.found[e].spans);
          continue;
        }
        if (e > before + 1) search(context, line, before, e, scratch);
        before = e;
      }
      write_edges(image, line, scratch, edges, out);
    }
  });
  // Only now, since lines are asked about those beside them as they were.
  pool.for_shares(line_start_, [&](int begin, int end, int worker) {
    for (int line = begin; line < end; ++line)
      drop_unsupported(line, edges, scratch_[static_cast<std::size_t>(worker)], out);
  });
  // Every second line by what is beside it, then those by these.
  for (const int odd : {0, 1}) {
    pool.for_shares(line_start_, [&](int begin, int end, int worker) {
      for (int line = begin + (begin + odd) % 2; line < end; line += 2)
        complete(image, context, line, edges, scratch_[static_cast<std::size_t>(worker)], out);
    });
  }
  out.counts = {};
  for (const Scratch& s : scratch_) {
    out.counts.in_order += s.in_order;
    out.counts.unsupported += s.unsupported;
    out.counts.completed += s.completed;
  }
  out.score = static_cast<double>(out.counts.in_order);
}

}  // namespace relievo
