// SPDX-License-Identifier: Apache-2.0
#include "capture/reconstruct/grow.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <utility>

#include "capture/reconstruct/moving_places.h"

namespace relievo {
namespace {

constexpr std::array kBeside{-1, 1};  // boundaries

constexpr int kMoves = 4;  // boundaries around that were elsewhere

// Next to a boundary of the line, by the pitch of the lines around or of the line itself.
constexpr int kPitchLines = 2;
constexpr float kLeastPitch = 0.7F;  // of the frame's: a surface that turns away is too steep to go on
constexpr float kMostPitch = 1.4F;
constexpr float kPitch_px = 0.8F;      // standard deviation,
constexpr float kLinePitch_px = 1.8F;  // and by the line's own
constexpr float kMostMoved_px = 1.2F;  // farther from where it is expected it is another surface's

// What the frame before and what stands still say.
constexpr float kStood_px = 0.3F;  // less from one frame to the next, and it stands still
constexpr float kElsewhere = 2.F;  // pitches: it was on what has moved away
constexpr float kAlike = 0.2F;     // Backdrop::difference of what looks the same where the step is seen, too

// Standard deviations, measured on simulated scenes.
constexpr float kBetween_px = 0.12F;  // between the lines above and below,
constexpr float kLeanShare = 0.2F;    // and of their difference more
constexpr float kOneSide_px = 1.F;    // from one line,
constexpr float kDoubted_px = 1.F;    // and of a place that was given up

constexpr float kGoesOn_px = 2.F;  // from one line to the next a boundary leans less

constexpr float kDropped_px = 0.6F;  // from where it was given up, and it is the same

// What tells where a boundary is.
constexpr unsigned kAbove = 1, kBelow = 2, kLeft = 4, kRight = 8;

bool known(float x) {
  return x == x;
}

}  // namespace

/// On a line, of a place.
struct Growth::Neighbours {
  float left_px, right_px;  // infinite where there is none
  int left, right;          // boundaries

  /// Whether boundaries so near to the place are in the pattern's order with one there.
  bool in_order(int boundary, float column_px) const {
    return !(column_px - left_px < StepFinder::kOpen_px && left > boundary) &&
           !(right_px - column_px < StepFinder::kOpen_px && right < boundary);
  }
  StepPrediction prediction(float column_px, float sigma_px) const {
    return {column_px, sigma_px, std::min(column_px - left_px, StepFinder::kOpen_px),
            std::min(right_px - column_px, StepFinder::kOpen_px)};
  }
};

Growth::Growth(const std::array<double, 9>& colour_matrix, int boundaries, int lines)
    : steps_(colour_matrix), uncovered_(boundaries, lines), boundaries_(boundaries), lines_(lines) {
  now_.reset(boundaries, lines, kNoColumn);
  before_ = now_;
}

void Growth::fill(int width, const SequenceResult& result, const EdgeImage& edges,
                  const std::vector<RecoveredBoundary>& recovered, WorkerPool& pool) {
  moving_.resize(width, lines_);
  tried_.resize(static_cast<std::size_t>(lines_ * boundaries_));
  missed_px_.resize(tried_.size());
  dropped_.resize(tried_.size());
  in_order_.assign(static_cast<std::size_t>(lines_), 0);
  of_lines_.resize(static_cast<std::size_t>(pool.workers()));
  for (OfLines& of : of_lines_) {
    of.decoded = of.still = of.added = 0;
    of.doubted.clear();
    of.restored.clear();
  }
  pool.for_shares(edges.line_start, [&](int begin, int end, int worker) {
    for (int line = begin; line < end; ++line)
      fill_line(line, result, edges, of_lines_[static_cast<std::size_t>(worker)]);
  });
  for (const RecoveredBoundary& r : recovered) now_.line(r.line)[r.boundary] = r.column_px;
  doubted_.clear();
  std::size_t decoded = 0;
  std::size_t still = 0;
  for (const OfLines& of : of_lines_) {
    doubted_.insert(doubted_.end(), of.doubted.begin(), of.doubted.end());
    decoded += of.decoded;
    still += of.still;
  }
  mostly_still_ = 2 * still > decoded;
  measure_pitch();
  uncovered_.begin(pitch_px_);
}

void Growth::fill_line(int line, const SequenceResult& result, const EdgeImage& edges, OfLines& out) {
  float* here = now_.line(line);
  std::fill_n(here, boundaries_, kNoColumn);
  moving_.clear(line);
  std::fill_n(tried_.begin() + static_cast<std::ptrdiff_t>(line) * boundaries_, boundaries_, std::uint8_t{0});
  std::fill_n(dropped_.begin() + static_cast<std::ptrdiff_t>(line) * boundaries_, boundaries_, -1);
  std::fill_n(missed_px_.begin() + static_cast<std::ptrdiff_t>(line) * boundaries_, boundaries_, kNoColumn);
  for (std::uint32_t e = edges.line_start[static_cast<std::size_t>(line)];
       e < edges.line_start[static_cast<std::size_t>(line) + 1]; ++e) {
    const float column = edges.edges[e].column_px;
    if (result.boundary[e] >= 0) {
      here[result.boundary[e]] = column;
      ++out.decoded;
      out.still += result.still[e];
    }
    if (result.doubted[e] >= 0) out.doubted.push_back({line, e});
    if (result.still[e] == 0) moving_.add(line, column);
  }
}

void Growth::measure_pitch() {
  constexpr int kEvery = 8;  // lines
  float sum = 0;
  std::size_t count = 0;
  for (int line = 0; line < lines_; line += kEvery) {
    const float* here = now_.line(line);
    for (int b = 0; b + 1 < boundaries_; ++b) {
      const float apart = here[b + 1] - here[b];
      if (!(apart > 0)) continue;
      sum += apart;
      ++count;
    }
  }
  pitch_px_ = count == 0 ? 0 : sum / static_cast<float>(count);
}

/// Of a place on a line, for `boundary`, which the line does not have.
Growth::Neighbours Growth::neighbours(int line, int boundary, float column_px) {
  const float* here = now_.line(line);
  Neighbours out{-std::numeric_limits<float>::infinity(), std::numeric_limits<float>::infinity(), -1,
                 boundaries_};
  if (in_order_[static_cast<std::size_t>(line)] != 0) {
    const auto [left, right] = known_beside(line, boundary);
    const float left_px = left < 0 ? out.left_px : here[left];
    const float right_px = right == boundaries_ ? out.right_px : here[right];
    if (left_px < column_px && right_px >= column_px) return {left_px, right_px, left, right};
  }
  for (int b = 0; b < boundaries_; ++b) {
    const float px = here[b];
    if (px < column_px && px > out.left_px) {
      out.left_px = px;
      out.left = b;
    } else if (px >= column_px && px < out.right_px) {
      out.right_px = px;
      out.right = b;
    }
  }
  return out;
}

/// The nearest boundaries that a line has before and behind one; -1 and boundaries_ where there is none.
std::array<int, 2> Growth::known_beside(int line, int boundary) {
  const float* here = now_.line(line);
  int left = boundary - 1;
  int right = boundary + 1;
  while (left >= 0 && !known(here[left])) --left;
  while (right < boundaries_ && !known(here[right])) ++right;
  return {left, right};
}

/// Whether the boundaries of a line come in the pattern's order.
bool Growth::is_in_order(int line) {
  const float* here = now_.line(line);
  float last = -std::numeric_limits<float>::infinity();
  for (int b = 0; b < boundaries_; ++b) {
    if (here[b] <= last) return false;
    if (known(here[b])) last = here[b];
  }
  return true;
}

void Growth::put(int line, int boundary, float column_px) {
  float* here = now_.line(line);
  here[boundary] = column_px;
  const auto [left, right] = known_beside(line, boundary);
  if ((left >= 0 && here[left] >= column_px) || (right < boundaries_ && here[right] <= column_px))
    in_order_[static_cast<std::size_t>(line)] = 0;
}

/// From boundary + `side` to the boundary, by the nearest lines that have both; NaN where none has.
float Growth::pitch_beside(int line, int boundary, int side) {
  for (int lines = 1; lines <= kPitchLines; ++lines) {
    float sum = 0;
    int count = 0;
    for (const int direction : {-lines, lines}) {
      const float* there = now_.line(line + direction);
      const float apart = there[boundary] - there[boundary + side];
      if (!known(apart)) continue;
      sum += apart;
      ++count;
    }
    if (count > 0) return sum / static_cast<float>(count);
  }
  return kNoColumn;
}

/// As far from the next one on the line as on the lines around, or as that one is from its next.
std::optional<Growth::Prediction> Growth::predict_beside(int line, int boundary) {
  const float* here = now_.line(line);
  for (const int side : kBeside) {
    const float from = here[boundary + side];
    if (!known(from)) continue;
    float sigma = kPitch_px;
    float pitch = pitch_beside(line, boundary, side);
    if (!known(pitch)) {
      pitch = from - here[boundary + 2 * side];
      sigma = kLinePitch_px;
    }
    const float apart = static_cast<float>(-side) * pitch;
    if (!(apart > kLeastPitch * pitch_px_ && apart < kMostPitch * pitch_px_)) continue;
    const float column = from + pitch;
    const Neighbours near = neighbours(line, boundary, column);
    if (!near.in_order(boundary, column)) continue;
    if (side < 0 ? near.left != boundary - 1 : near.right != boundary + 1) continue;
    return Prediction{near.prediction(column, sigma), true};
  }
  return std::nullopt;
}

/// Where the boundary is on the nearest of two lines above, and below.
Growth::Around Growth::around(int line, int boundary) {
  Around out;
  for (const int direction : {-1, 1}) {
    for (const int lines : {direction, 2 * direction}) {
      const float px = now_.line(line + lines)[boundary];
      if (!known(px)) continue;
      out.column_px[out.count++] = px;
      out.sources |= direction < 0 ? kAbove : kBelow;
      break;
    }
  }
  return out;
}

/// Between the lines above and below, or, where the scene holds still but for what moves there, from one of
/// them.
std::optional<Growth::Prediction> Growth::predict_between(int line, int boundary, const Around& places) {
  const float* here = now_.line(line);
  unsigned sources = places.sources;
  if (known(here[boundary - 1])) sources |= kLeft;
  if (known(here[boundary + 1])) sources |= kRight;
  const bool both = places.count == 2;
  const bool beside = (sources & (kLeft | kRight)) != 0;
  if (!both && (!beside || !mostly_still_)) return std::nullopt;
  // What the frame before had there and this one does not may be covered by now.
  if (!both && known(before_.line(line)[boundary])) return std::nullopt;
  std::uint8_t& tried = tried_[static_cast<std::size_t>(line * boundaries_ + boundary)];
  if (std::exchange(tried, static_cast<std::uint8_t>(sources)) == sources) return std::nullopt;
  const float column = both ? 0.5F * (places.column_px[0] + places.column_px[1]) : places.column_px[0];
  const Neighbours near = neighbours(line, boundary, column);
  if (!near.in_order(boundary, column)) return std::nullopt;
  // Where the scene holds still, what is against a boundary is as good as what is for it.
  if (!both && !moving_.moves(line, column)) return std::nullopt;
  const float sigma =
      both ? kBetween_px + kLeanShare * std::fabs(places.column_px[1] - places.column_px[0]) : kOneSide_px;
  return Prediction{near.prediction(column, sigma), false};
}

/// Whether what stands still, and what the frame before saw, allow a boundary there. A place that only looks
/// as if the boundary before it went on is the more likely to be of another surface, the more is known of
/// that, unless much moves there.
bool Growth::fits_before(const SlideFieldView& view, int line, int boundary, const FoundStep& found,
                         bool beside) {
  const float column = found.column_px;
  if (std::fabs(found.moved_px) > kMostMoved_px) return false;
  const float since = std::fabs(before_.line(line)[boundary] - column);
  const bool stood = since < kStood_px || since > kElsewhere * pitch_px_;
  if (backdrop().stands(line, boundary, column)) {
    const auto difference = backdrop().difference(view, line, boundary, column);
    return difference ? *difference < kAlike : stood;
  }
  if (!beside || stood) return true;
  if (view.moving != nullptr && view.moving->around(line, column) >= MovingPlaces::kMost) return true;
  const float* here = now_.line(line);
  return std::none_of(kBeside.begin(), kBeside.end(), [&](int side) {
    const int next = boundary + side;
    return next >= 0 && next < boundaries_ && backdrop().stands(line, next, here[next]);
  });
}

std::optional<FoundStep> Growth::look(const SlideFieldView& view, int line, int boundary,
                                      const std::optional<Prediction>& p) {
  if (!p) return std::nullopt;
  const auto found = steps_.find(view, line, boundary, *p);
  return found && fits_before(view, line, boundary, *found, p->beside) ? found : std::nullopt;
}

std::size_t Growth::grow_line(const SlideFieldView& view, int line, const EdgeImage& edges,
                              SequenceResult& result, std::vector<RecoveredBoundary>& recovered) {
  const float* here = now_.line(line);
  std::size_t added = 0;
  for (int b = 0; b < boundaries_; ++b) {
    if (known(here[b])) continue;
    const Around places = around(line, b);
    std::optional<FoundStep> found;
    if (places.count < 2) {
      float& missed = missed_px_[static_cast<std::size_t>(line * boundaries_ + b)];
      const auto beside = predict_beside(line, b);
      if (beside && beside->column_px != missed) {
        found = look(view, line, b, beside);
        if (!found) missed = beside->column_px;
      }
    }
    if (!found && places.count > 0) found = look(view, line, b, predict_between(line, b, places));
    if (!found) continue;
    ++added;
    if (take_back(line, b, found->column_px, edges, result)) continue;
    put(line, b, found->column_px);
    recovered.push_back({line, b, found->column_px, found->sigma_px, 0});
  }
  return added;
}

/// What was given up for a weakness of its place, and both the field and a line beside show.
Growth::Confirmed Growth::confirm(const SlideFieldView& view, const Doubted& doubted, const EdgeImage& edges,
                                  const SequenceResult& result, std::vector<RecoveredBoundary>& recovered) {
  const auto [line, e] = doubted;
  if (line >= view.field.height) return Confirmed::kNo;
  const int b = result.doubted[e];
  const float here = now_.line(line)[b];
  const float column = edges.edges[e].column_px;
  if (result.boundary[e] >= 0 || known(here) || !moving_.moves(line, column)) return Confirmed::kNo;
  const Neighbours near = neighbours(line, b, column);
  if (!near.in_order(b, column)) return Confirmed::kNo;
  const auto found = steps_.find(view, line, b, near.prediction(column, kDoubted_px));
  if (!found || !fits_before(view, line, b, *found, false)) return Confirmed::kNo;
  const auto goes_on = [&](int other) {
    return std::fabs(now_.line(other)[b] - found->column_px) < kGoesOn_px;
  };
  if (!goes_on(line - 1) && !goes_on(line + 1)) return Confirmed::kNotYet;
  put(line, b, found->column_px);
  recovered.push_back({line, b, found->column_px, found->sigma_px, 0});
  return Confirmed::kYes;
}

/// Gives up moving boundaries that the field does not show: a silhouette came over their place between the
/// fields, or their code is another's.
void Growth::drop_line(const SlideFieldView& view, int line, const EdgeImage& edges, SequenceResult& result) {
  float* here = now_.line(line);
  for (std::uint32_t e = edges.line_start[static_cast<std::size_t>(line)];
       e < edges.line_start[static_cast<std::size_t>(line) + 1]; ++e) {
    const int b = result.boundary[e];
    if (b < 0) continue;
    const float column = here[b];
    const bool measured = view.motion != nullptr && view.motion->at(line, column) != 0;
    const bool goes =
        view.moving != nullptr && result.still[e] == 0 && view.moving->around(line, column) >= kMoves;
    if (!measured && !goes) continue;
    const auto room = [](float px) {
      return known(px) ? std::clamp(px, StepFinder::kLeastRoom_px, StepFinder::kOpen_px)
                       : StepFinder::kOpen_px;
    };
    if (!steps_.shows_another(view, line, b, column, room(column - here[b - 1]), room(here[b + 1] - column)))
      continue;
    result.boundary[e] = -1;
    here[b] = kNoColumn;
    dropped_[static_cast<std::size_t>(line * boundaries_ + b)] = static_cast<std::int32_t>(e);
  }
}

/// Where growth found what it had given up itself, and nearly there, the place that was measured is the
/// better one.
bool Growth::take_back(int line, int boundary, float found_px, const EdgeImage& edges,
                       SequenceResult& result) {
  const std::int32_t e = dropped_[static_cast<std::size_t>(line * boundaries_ + boundary)];
  if (e < 0) return false;
  const float column = edges.edges[static_cast<std::size_t>(e)].column_px;
  if (!(std::fabs(column - found_px) < kDropped_px)) return false;
  result.boundary[static_cast<std::size_t>(e)] = static_cast<std::int16_t>(boundary);
  put(line, boundary, column);
  return true;
}

std::size_t Growth::grow(const SlideFieldView& view, const EdgeImage& edges, WorkerPool& pool,
                         SequenceResult& result, std::vector<RecoveredBoundary>& recovered) {
  fill(view.field.width, result, edges, recovered, pool);
  const int lines = std::min(lines_, view.field.height);
  pool.for_shares(edges.line_start, [&](int begin, int end, int) {
    for (int line = begin; line < std::min(end, lines); ++line) uncovered_.find(view, line, now_, moving_);
  });
  pool.for_shares(edges.line_start, [&](int begin, int end, int worker) {
    OfLines& of = of_lines_[static_cast<std::size_t>(worker)];
    for (int line = begin; line < std::min(end, lines); ++line) {
      uncovered_.remember(view, line, edges, result, before_);
      of.added += uncovered_.restore(line, edges, now_, result, of.restored);
      drop_line(view, line, edges, result);
      in_order_[static_cast<std::size_t>(line)] = is_in_order(line) ? 1 : 0;
    }
  });
  std::size_t added = 0;
  for (const OfLines& of : of_lines_) {
    added += of.added;
    recovered.insert(recovered.end(), of.restored.begin(), of.restored.end());
  }
  // Downwards, then upwards what waits for a line below.
  const auto confirmed = [&](const Doubted& d) {
    const Confirmed is = confirm(view, d, edges, result, recovered);
    added += is == Confirmed::kYes;
    return is != Confirmed::kNotYet;
  };
  std::erase_if(doubted_, confirmed);
  for (auto d = doubted_.rbegin(); d != doubted_.rend(); ++d) confirmed(*d);
  for (int line = 0; line < lines; ++line) added += grow_line(view, line, edges, result, recovered);
  for (int line = lines - 1; line >= 0; --line) added += grow_line(view, line, edges, result, recovered);
  std::swap(now_, before_);
  return added;
}

}  // namespace relievo
