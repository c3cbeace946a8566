// SPDX-License-Identifier: Apache-2.0
// SequenceDecoder's check of edges that move. One slide's colours repeat along the pattern, and beside a
// silhouette that moves on the other slide's frame shows the surface behind: then a run of edges is easily
// taken for one of other boundaries. But how far an edge moves is measured, and so is where boundaries were.
#include <algorithm>
#include <cmath>
#include <limits>

#include "capture/reconstruct/sequence.h"

namespace relievo {
namespace {

constexpr float kNone = std::numeric_limits<float>::quiet_NaN();
constexpr float kOff_px = 2;                // between where a boundary was and where its edge's motion says,
constexpr float kOffShare = 0.2F;           // and of that motion more
constexpr std::uint32_t kLeastInARow = 3;   // edges that confirm a run, whatever its others do
constexpr std::uint32_t kContradicted = 4;  // one edge in so many of a run is let pass,
constexpr std::uint32_t kLeastAsDeep = 5;   // or three where so many are all as deep as what was there
constexpr float kNear_px = 2;      // of where an edge's motion says it was: a boundary that was there
constexpr float kWasNear = 2.5F;   // gains so much
constexpr float kAsDeep = 1.5F;    // one as deep as what was near there
constexpr float kStands_px = 1;    // of where a boundary stands still: it is that one, and
constexpr float kStands = 1.F;     // gains so much;
constexpr float kHovering = 1.1F;  // farther off, but less than this of the way to the next one, it
constexpr float kHovers = 3.F;     // loses
constexpr int kLines = 2;          // above and below, on which that is looked for

}  // namespace

/// Whether the frame before had a boundary, on a line about one, at a column `as_asked(line, column)`.
template <class AsAsked>
bool SequenceDecoder::was_seen(int line, const SequenceContext& context, int boundary,
                               AsAsked as_asked) const {
  const int lines = static_cast<int>(context.before_px->size()) / boundaries_;
  for (int l = std::max(0, line - kLines); l <= std::min(lines - 1, line + kLines); ++l) {
    const float before_px = (*context.before_px)[static_cast<std::size_t>(l * boundaries_ + boundary)];
    if (!std::isnan(before_px) && as_asked(l, before_px)) return true;
  }
  return false;
}

/// How far what is at a place came since the frame before.
float SequenceDecoder::moved_px(int line, float column_px, const SequenceContext& context) {
  return context.motion->between_frames(*context.before_motion, line, column_px, context.before_fields);
}

/// Whether a boundary was, in the frame before, where the motion of an edge puts it then.
bool SequenceDecoder::moved_as_measured(const EdgeImage& edges, int line, std::uint32_t e,
                                        const SequenceContext& context, int boundary) const {
  const float column = edges.edges[e].column_px;
  const float motion = context.motion->at(line, column);
  const float moved = moved_px(line, column, context);
  const float off = kOff_px * context.motion->scale + kOffShare * std::fabs(moved);
  return was_seen(line, context, boundary, [&](int l, float before_px) {
    return std::fabs(before_px - (column - moved)) < off &&
           std::fabs(context.before_motion->at(l, before_px) - motion) < FieldMotion::kSurface_px;
  });
}

/// What the frame before says for a boundary at a place: by where the boundary was, if what is there was at
/// `was_px`; by its depth; or for it was hidden and is back where it stands still. One that is near where it
/// stands still, but not there, would be on a surface just before that: more likely the boundary is another,
/// and its run only seems to go on with what stands beside it.
float SequenceDecoder::expected_gain(int line, float column_px, float was_px, const SequenceContext& context,
                                     int boundary) const {
  float gain = 0;
  if (depths_.has(line, boundary, column_px)) {
    const float near = kNear_px * context.motion->scale;
    gain = kAsDeep;
    if (was_seen(line, context, boundary, [&](int, float px) { return std::fabs(px - was_px) < near; }))
      gain += kWasNear;
  }
  if (context.backdrop == nullptr) return gain;
  const float off = std::fabs(column_px - context.backdrop->column_px(line, boundary));
  if (off < kStands_px) return gain + kStands;
  return off < kHovering * context.backdrop->pitch_px(line, boundary) ? gain - kHovers : gain;
}

/// Whether an edge that moves cannot be a boundary by where that was before.
bool SequenceDecoder::unconfirmed(const EdgeImage& edges, int line, std::uint32_t e,
                                  const SequenceContext& context, int boundary) const {
  if (context.before_px == nullptr || context.motion == nullptr || !context.motion->line_moves(line))
    return false;
  return !beside_[e].tracked && !moved_as_measured(edges, line, e, context, boundary);
}

/// Whether all edges of a run are as deep as what the frame before had there.
bool SequenceDecoder::as_deep(const EdgeImage& edges, int line, std::uint32_t first, std::uint32_t end,
                              const SequenceResult& out) const {
  for (std::uint32_t e = first; e < end; ++e)
    if (!depths_.has(line, out.boundary[e], edges.edges[e].column_px)) return false;
  return true;
}

/// Gives up edges on lines where something moves that the frame before contradicts, or does not confirm.
void SequenceDecoder::check_motion(const EdgeImage& edges, int line, const SequenceContext& context,
                                   Scratch& scratch, SequenceResult& out) {
  const std::uint32_t begin = edges.line_start[static_cast<std::size_t>(line)];
  const std::uint32_t end = edges.line_start[static_cast<std::size_t>(line) + 1];
  float* seen = out.seen_px.data() + static_cast<std::size_t>(line) * static_cast<std::size_t>(boundaries_);
  std::fill_n(seen, boundaries_, kNone);
  for (std::uint32_t e = begin; e < end; ++e)
    if (out.boundary[e] >= 0) seen[out.boundary[e]] = edges.edges[e].column_px;
  if (context.before_px == nullptr || context.motion == nullptr || !context.motion->line_moves(line)) return;
  // Runs of edges that follow each other on one surface are judged together: at its ends a surface comes into
  // view, where nothing was before.
  for (std::uint32_t e = begin; e < end;) {
    const std::uint32_t first = e;
    float motion = context.motion->at(line, edges.edges[e].column_px);
    std::uint32_t confirmed = 0;
    std::uint32_t contradicted = 0;
    std::uint32_t in_a_row = 0;
    std::uint32_t most_in_a_row = 0;
    bool goes_on = true;
    while (goes_on) {
      const int boundary = out.boundary[e];
      const bool is_confirmed = boundary >= 0 && !unconfirmed(edges, line, e, context, boundary);
      confirmed += is_confirmed;
      contradicted += boundary >= 0 && !is_confirmed &&
                      was_seen(line, context, boundary, [](int, float) { return true; });
      in_a_row = is_confirmed ? in_a_row + 1 : 0;
      most_in_a_row = std::max(most_in_a_row, in_a_row);
      if (++e == end) break;
      const float before = motion;
      motion = context.motion->at(line, edges.edges[e].column_px);
      goes_on = boundary >= 0 && out.boundary[e] == boundary + 1 &&
                std::fabs(motion - before) < FieldMotion::kSurface_px;
    }
    if (2 * confirmed >= e - first || most_in_a_row >= kLeastInARow) continue;
    // What was hidden in the frame before, or not decoded, is no contradiction; nor is what another surface
    // showed then, where the run is as deep as what was there.
    if (e - first >= kLeastInARow && contradicted * kContradicted <= e - first) continue;
    if (confirmed > 0 && e - first >= kLeastAsDeep && contradicted * kContradicted <= 3 * (e - first) &&
        as_deep(edges, line, first, e, out))
      continue;
    for (std::uint32_t i = first; i < e; ++i) {
      scratch.in_order -= out.boundary[i] >= 0;
      out.boundary[i] = -1;
    }
  }
}

}  // namespace relievo
