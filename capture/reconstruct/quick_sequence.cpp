// SPDX-License-Identifier: Apache-2.0
#include "capture/reconstruct/quick_sequence.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>

#include "capture/reconstruct/sequence_rules.h"

namespace relievo {

using namespace sequence_rules;

namespace {

// Less than the ordered decoder's, which finds weak edges in other ways, too.
constexpr float kNoiseFactor = 3.5F;
// As edges.cpp has them.
constexpr float kLeastRise = 2;
constexpr float kMaxReach_px = 6;
constexpr float kReachShare = 0.55F;       // of the way to the next edge
constexpr float kSideAt = 0.85F;           // of a reach: where a side's own colour is seen best
constexpr float kSettledGain = 2.F;        // of the edge from which a search starts
constexpr float kLean_px = 3;              // how far a boundary moves from one line to the next
constexpr float kCompleteEvidence = 1.9F;  // gain for a boundary that a neighbouring line predicts
constexpr float kNone = std::numeric_limits<float>::quiet_NaN();

/// Columns beside an edge from half its reach to a whole one away.
QuickSpans spans_of(int width, float column_px, float left_reach_px, float right_reach_px) {
  const auto rounded = [width](float x) { return std::clamp(static_cast<int>(x + 0.5F), 0, width - 1); };
  const int left = rounded(column_px - left_reach_px);
  const int left_last = std::max(left, rounded(column_px - 0.5F * left_reach_px));
  const int right = rounded(column_px + 0.5F * right_reach_px);
  const int right_last = std::max(right, rounded(column_px + right_reach_px));
  return {static_cast<std::int16_t>(left), static_cast<std::int16_t>(right),
          static_cast<std::int16_t>(std::min(QuickSpans::kMost, left_last - left + 1)),
          static_cast<std::int16_t>(std::min(QuickSpans::kMost, right_last - right + 1))};
}

/// `px` further on, as far as the line goes.
QuickSpans moved(const QuickSpans& spans, float px, int width) {
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
SidesEvidence evidence_at(const QuickImage& image, int line, const QuickSpans& spans) {
  QuickSides sides;
  quick_kernels().sides(image.row(line), spans, sides);
  return {evidence(sides.left, spans.left_count, image.doubt()),
          evidence(sides.right, spans.right_count, image.doubt())};
}

/// Tells the processor that a line comes next: of frames that lie in memory, its edges are too far apart for
/// it to see that coming.
void read_ahead(const std::uint8_t* codes, int width) {
  constexpr int kCacheLine = 64;
  for (int i = 0; i < width; i += kCacheLine) __builtin_prefetch(codes + i);
}

/// Boundaries of the pattern between those of two settled edges; -1 where they are not in its order, or one
/// of the two is none (-1 or the line's count).
int missing_between(const QuickLine& line, int before, int behind) {
  if (before < 0 || behind >= line.count) return -1;
  return std::max(-1, line.boundary[behind] - line.boundary[before] - 1);
}

float reach_px(float gap_px) {
  return std::clamp(kReachShare * gap_px, 1.F, kMaxReach_px);
}

}  // namespace

float QuickLine::left_reach_px(int i) const {
  return i > 0 ? reach_px(edges[i].column_px - edges[i - 1].column_px) : kMaxReach_px;
}
float QuickLine::right_reach_px(int i) const {
  return i + 1 < count ? reach_px(edges[i + 1].column_px - edges[i].column_px) : kMaxReach_px;
}

QuickSequence::QuickSequence(const Pattern& pattern)
    : slides_(slide_colours(pattern)),
      of_pair_{of_pairs(slides_[0]), of_pairs(slides_[1])},
      boundaries_(pattern.boundaries()) {}

QuickSequence::OfPair QuickSequence::of_pairs(const SlideColours& slide) {
  OfPair out;
  for (std::size_t code = 0; code < 64; ++code) {
    for (std::size_t b = 0; b < slide.colours.size(); ++b) {
      const auto [left, right] = slide.colours[b];
      if (static_cast<std::size_t>(left) * 8 + right == code)
        out.boundary.push_back(static_cast<std::int16_t>(b));
    }
    out.start[code + 1] = static_cast<std::uint32_t>(out.boundary.size());
  }
  return out;
}

/// The most likely boundaries of an edge by all that it shows, at most kPathCandidates, in the pattern's
/// order; where its own colours are clear, of those alone that have them. Returns how many.
int QuickSequence::likely(const QuickContext& context, const QuickLine& line, int edge, const Beside& beside,
                          std::int32_t* boundary, float* gains) const {
  const QuickEdge& own = line.edges[edge];
  if (!own.clear) {
    const EdgeAgreement seen =
        edge_agreement(beside.left, beside.right, beside.other_left, beside.other_right, beside.tracked);
    return path_kernels().choose(shown_slide(context).table, seen, kGains, boundary, gains);
  }
  const OfPair& pairs = of_pair_[context.order == SlideOrder::kNewerIsFirst ? 0 : 1];
  BestCandidates best(boundary, gains);
  for (std::uint32_t i = pairs.start[own.code]; i < pairs.start[own.code + 1]; ++i)
    best.add(pairs.boundary[i], gain(context, beside, pairs.boundary[i]).all - kGains.threshold);
  return best.used();
}

/// Finds them, and looks at their sides while the line is at hand. Returns how many.
std::uint32_t QuickSequence::edges_of_line(const QuickImage& image, int line, Scratch& scratch) {
  const float rise = std::max(kLeastRise * QuickKernels::kScale, kNoiseFactor * image.noise);
  const QuickKernels& kernels = quick_kernels();
  const QuickRow row = image.row(line);
  const int crossings = kernels.crossings(
      row, image.width, static_cast<std::int16_t>(std::min(rise, 32767.F)), scratch.crossings.data());
  const int count = kernels.gather(row, scratch.crossings.data(), crossings, scratch.places.data());
  const std::uint8_t* codes = image.code_line(line);
  const auto last = static_cast<float>(image.width - 1);
  QuickEdge* out = edges_.data() + static_cast<std::size_t>(line) * most_on_line_;
  float left_reach = kMaxReach_px;
  for (int i = 0; i < count; ++i) {
    const QuickPlace& place = scratch.places[static_cast<std::size_t>(i)];
    const float right_reach =
        i + 1 < count ? reach_px(scratch.places[static_cast<std::size_t>(i) + 1].column_px - place.column_px)
                      : kMaxReach_px;
    const auto left =
        static_cast<std::uint16_t>(std::max(place.column_px - kSideAt * left_reach, 0.F) + 0.5F);
    const auto right =
        static_cast<std::uint16_t>(std::min(place.column_px + kSideAt * right_reach, last) + 0.5F);
    left_reach = right_reach;
    const unsigned l = codes[left];
    const unsigned r = codes[right];
    out[i] = {place.column_px,
              place.slope,
              left,
              right,
              static_cast<std::uint8_t>((l & QuickKernels::kSigns) << 3 | (r & QuickKernels::kSigns)),
              (l & r & QuickKernels::kIsClear) != 0};
  }
  return static_cast<std::uint32_t>(count);
}

std::size_t QuickSequence::find_edges(const DetectionLines& rows, QuickDifferencer& differencer,
                                      WorkerPool& pool, QuickImage& image) {
  const int width = rows.own.width;
  const auto lines = static_cast<std::size_t>(rows.own.height);
  scratch_.resize(static_cast<std::size_t>(pool.workers()));
  most_on_line_ = static_cast<std::size_t>(width) / QuickKernels::kMerge_px + 2;
  for (Scratch& s : scratch_) {
    s.crossings.resize(static_cast<std::size_t>(width) + QuickKernels::kGathered);
    s.places.resize(static_cast<std::size_t>(width) + QuickKernels::kGathered);
    s.beside.resize(most_on_line_);
  }
  edges_.resize(most_on_line_ * lines);
  boundary_.resize(most_on_line_ * lines);
  still_.resize(most_on_line_ * lines);
  settled_.resize(most_on_line_ * lines);
  line_start_.assign(lines + 1, 0);
  differencer.difference(rows, pool, image, [&](int begin, int end, int worker) {
    Scratch& scratch = scratch_[static_cast<std::size_t>(worker)];
    for (int line = begin; line < end; ++line)
      line_start_[static_cast<std::size_t>(line) + 1] = edges_of_line(image, line, scratch);
  });
  for (std::size_t line = 0; line < lines; ++line) line_start_[line + 1] += line_start_[line];
  return line_start_.back();
}

/// Edges that all channels of both slides tell, where an edge beside them is the boundary beside theirs.
void QuickSequence::settle(const QuickContext& context, int line, const QuickLine& edges) const {
  std::fill_n(edges.settled, edges.count, std::uint8_t{0});
  std::fill_n(edges.boundary, edges.count, std::int16_t{-1});
  if (context.other == nullptr) return;
  const QuickImage& image = *context.other;
  if (line + 1 < image.lines) read_ahead(image.code_line(line + 1), image.width);
  const std::uint8_t* codes = image.code_line(line);
  const std::int16_t* by_code = shown_slide(context).by_code.data();
  int before = -2;
  for (int i = 0; i < edges.count; ++i) {
    const QuickEdge& own = edges.edges[i];
    const unsigned l = codes[own.left];
    const unsigned r = codes[own.right];
    const unsigned other = (l & QuickKernels::kSigns) << 3 | (r & QuickKernels::kSigns);
    const bool clear = own.clear && (l & r & QuickKernels::kIsClear) != 0;
    const int b = clear ? by_code[own.code * 64U + other] : -1;
    edges.boundary[i] = static_cast<std::int16_t>(b);
    if (b >= 0 && b == before + 1) edges.settled[i] = edges.settled[i - 1] = 1;
    before = b >= 0 ? b : -2;
  }
}

/// How far off the nearest place is where another frame shows the same signs on both sides; 0 where there is
/// none.
float QuickSequence::searched_px(const QuickImage& image, int line, const QuickEdge& edge) {
  const std::uint8_t* codes = image.code_line(line);
  const auto matches = [&](int px) {
    const int left = edge.left + px;
    const int right = edge.right + px;
    return left >= 0 && right < image.width &&
           ((static_cast<unsigned>(codes[left]) << 3 | (codes[right] & QuickKernels::kSigns)) & 0x3f) ==
               edge.code;
  };
  constexpr int kStep = static_cast<int>(kSearchStep_px);
  for (int px = kStep; px <= static_cast<int>(kSearch_px); px += kStep) {
    if (matches(px)) return static_cast<float>(px);
    if (matches(-px)) return static_cast<float>(-px);
  }
  return 0;
}

/// What is beside an edge in its frame and, where it stood then, in the other slide's.
QuickSequence::Beside QuickSequence::look_beside(const QuickImage& image, const QuickContext& context,
                                                 int line, const QuickLine& edges, int edge) {
  const QuickSpans spans = spans_of(image.width, edges.edges[edge].column_px, edges.left_reach_px(edge),
                                    edges.right_reach_px(edge));
  const auto [left, right] = evidence_at(image, line, spans);
  Beside out{left, right, {}, {}, true};
  float off = 0;
  if (context.same != nullptr) {
    const auto there = evidence_at(*context.same, line, spans);
    out.tracked = alike(out.left, there.left) && alike(out.right, there.right);
    if (!out.tracked) off = searched_px(*context.same, line, edges.edges[edge]);
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
void QuickSequence::search(const QuickContext& context, const QuickLine& line, int before, int behind,
                           Scratch& scratch) {
  constexpr int kPlaces = kPathCandidates;
  const PathKernels& kernels = path_kernels();
  const int begin = std::max(before, 0);
  const int end = std::min(behind + 1, line.count);
  // Where few boundaries lie between the two it is one of them, or none.
  const int missing = missing_between(line, before, behind);
  const bool few = missing >= 0 && missing <= kPlaces;
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
      *boundary = line.boundary[e];
      *gains = kSettledGain;
    } else {
      const Beside& beside = scratch.beside[static_cast<std::size_t>(e)];
      if (few) {
        used = 0;
        for (int b = line.boundary[before] + 1; b < line.boundary[behind]; ++b) {
          const Gain g = gain(context, beside, b);
          if (g.left + g.right < 0) continue;
          boundary[used] = b;
          gains[used++] = g.all - kGains.threshold;
        }
      } else {
        used = likely(context, line, e, beside, boundary, gains);
      }
      doubt_unexpected(context.expected, line.edges[e].column_px, used, boundary, gains);
    }
    path.extend(kernels, place, e == behind, candidates);
  }
  for (int e = begin; e < end; ++e)
    if (e != before && e != behind) line.boundary[e] = -1;
  for (std::int32_t a = path.end; a >= 0; a = candidates.from[static_cast<std::size_t>(a)]) {
    const int e = begin + a / kPlaces;
    if (line.settled[e] != 0) continue;
    const std::int32_t b = candidates.boundary[static_cast<std::size_t>(a)];
    if (convincing(context, scratch.beside[static_cast<std::size_t>(e)], b))
      line.boundary[e] = static_cast<std::int16_t>(b);
  }
}

void QuickSequence::decode_line(const QuickImage& image, const QuickContext& context, int line,
                                Scratch& scratch) {
  const QuickLine edges = this->line(line);
  settle(context, line, edges);
  std::fill_n(edges.still, edges.count, std::uint8_t{1});
  for (int before = -1; before < edges.count;) {
    int behind = before + 1;
    while (behind < edges.count && edges.settled[behind] == 0) ++behind;
    if (behind == before + 1) {
      before = behind;
      continue;
    }
    if (missing_between(edges, before, behind) == 0) {  // no room for what else was found there
      std::fill(edges.boundary + before + 1, edges.boundary + behind, std::int16_t{-1});
    } else {
      for (int e = before + 1; e < behind; ++e) {
        Beside& beside = scratch.beside[static_cast<std::size_t>(e)];
        beside = look_beside(image, context, line, edges, e);
        edges.still[e] = beside.tracked;
      }
      search(context, edges, before, behind, scratch);
    }
    before = behind;
  }
  float* seen = seen_px_.data() + static_cast<std::size_t>(line) * static_cast<std::size_t>(boundaries_);
  std::fill_n(seen, boundaries_, kNone);
  for (int e = 0; e < edges.count; ++e)
    if (edges.boundary[e] >= 0) seen[edges.boundary[e]] = edges.edges[e].column_px;
}

/// What the search found stays where a line above or below, or both edges beside it, agree.
void QuickSequence::drop_unsupported(int line, int lines, Scratch& scratch) {
  const QuickLine edges = this->line(line);
  for (int e = 0; e < edges.count; ++e) {
    const int b = edges.boundary[e];
    if (b < 0) continue;
    ++scratch.in_order;
    if (edges.settled[e] != 0) continue;
    bool goes_on = false;
    for (const int d : {-1, 1, -2, 2}) {
      if (line + d < 0 || line + d >= lines) continue;
      goes_on |= std::fabs(seen_px(line + d)[b] - edges.edges[e].column_px) <=
                 kLean_px * static_cast<float>(std::abs(d));
    }
    const auto follows = [&](int other, int boundary) {
      return other >= 0 && other < edges.count && boundary >= 0 && boundary < boundaries_ &&
             seen_px(line)[boundary] == edges.edges[other].column_px;
    };
    if (goes_on || (follows(e - 1, b - 1) && follows(e + 1, b + 1))) continue;
    edges.boundary[e] = -1;
    ++scratch.unsupported;
  }
}

/// What a line did not decode, those beside it predict.
void QuickSequence::complete(const QuickImage& image, const QuickContext& context, int line,
                             Scratch& scratch) {
  const QuickLine edges = this->line(line);
  const auto taken = [&](int b) {
    return std::find(edges.boundary, edges.boundary + edges.count, static_cast<std::int16_t>(b)) !=
           edges.boundary + edges.count;
  };
  for (int e = 0; e < edges.count; ++e) {
    if (edges.boundary[e] >= 0) continue;
    const float column = edges.edges[e].column_px;
    std::optional<Beside> beside;
    float nearest = kLean_px;
    int best = -1;
    for (const int from : {line - 1, line + 1}) {
      if (from < 0 || from >= image.lines) continue;
      const QuickLine there = this->line(from);
      const QuickEdge* last = there.edges + there.count;
      const QuickEdge* n = std::lower_bound(
          there.edges, last, column - nearest,
          [](const QuickEdge& other, float column_px) { return other.column_px < column_px; });
      for (; n != last && n->column_px <= column + kLean_px; ++n) {
        const int b = there.boundary[n - there.edges];
        const float distance = std::fabs(n->column_px - column);
        if (b < 0 || distance >= nearest || taken(b)) continue;
        if (!beside) beside = look_beside(image, context, line, edges, e);
        if (gain(context, *beside, b).all < kCompleteEvidence) continue;
        nearest = distance;
        best = b;
      }
    }
    if (best < 0) continue;
    edges.boundary[e] = static_cast<std::int16_t>(best);
    edges.still[e] = beside->tracked;
    ++scratch.completed;
  }
}

SequenceCounts QuickSequence::decode(const QuickImage& image, const QuickContext& context, WorkerPool& pool) {
  seen_px_.resize(static_cast<std::size_t>(image.lines) * static_cast<std::size_t>(boundaries_));
  for (Scratch& s : scratch_) s.in_order = s.unsupported = s.completed = 0;
  const auto for_lines = [&](const auto& work) {
    pool.for_shares(line_start_, [&](int begin, int end, int worker) {
      for (int line = begin; line < end; ++line) work(line, scratch_[static_cast<std::size_t>(worker)]);
    });
  };
  for_lines([&](int line, Scratch& scratch) { decode_line(image, context, line, scratch); });
  // Only now, since lines are asked about those beside them as they were.
  for_lines([&](int line, Scratch& scratch) { drop_unsupported(line, image.lines, scratch); });
  // Every second line by what is beside it, then those by these.
  for (const int odd : {0, 1}) {
    for_lines([&](int line, Scratch& scratch) {
      if (line % 2 == odd) complete(image, context, line, scratch);
    });
  }
  SequenceCounts counts;
  for (const Scratch& s : scratch_) {
    counts.in_order += s.in_order;
    counts.unsupported += s.unsupported;
    counts.completed += s.completed;
  }
  return counts;
}

}  // namespace relievo
