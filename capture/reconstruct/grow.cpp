// SPDX-License-Identifier: Apache-2.0
#include "capture/reconstruct/grow.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <utility>

namespace relievo {
namespace {

constexpr float kNone = std::numeric_limits<float>::quiet_NaN();
constexpr int kMargin = 2;

// The step between a boundary's two colours.
constexpr std::size_t kSteps = 9;     // to each side of the prediction it is looked at,
constexpr std::size_t kFurthest = 5;  // and looked for,
constexpr float kStep_px = 0.5F;      // so far apart
constexpr float kArm_px = 1.5F;       // each side's colour is read this far from it
constexpr float kNearly = 0.85F;      // of the greatest rise
constexpr float kLeastStep = 0.25F;   // of the light there

// The colours themselves.
constexpr int kReach_px = 14;         // light around in which each primary is somewhere at its brightest
constexpr float kFull = 0.5F;         // of the brightest primary, what each is taken to reach
constexpr float kDark = 12.F;         // grey levels; less is no light
constexpr float kOff = 0.4F;          // of its brightest: in between on and off
constexpr float kClear = 0.25F;       // to either side of that it is clear
constexpr float kLeastAgree = 0.55F;  // of each side's colour, -1..1
constexpr float kDisagrees = 0.2F;    // less: a side is of another colour
constexpr float kMostSide_px = 4.5F;  // colours are read up to here

constexpr float kLeastRoom_px = 3.F;  // to the next boundary
constexpr float kOpen_px = 12.F;      // where there is none
constexpr int kCell_px = 4;           // in which motion is told,
constexpr int kCellsAround = 3;       // and around an edge that moves

// Standard deviations, measured on simulated scenes.
constexpr float kFound_px = 0.4F;     // of where the field shows the step
constexpr float kBetween_px = 0.12F;  // between the lines above and below,
constexpr float kLeanShare = 0.2F;    // and of their difference more
constexpr float kOneSide_px = 1.F;    // from one line
constexpr float kApartShare = 0.3F;   // of the distance between the two

// What tells where a boundary is.
constexpr unsigned kAbove = 1, kBelow = 2, kLeft = 4, kRight = 8;

bool known(float x) {
  return x == x;
}

}  // namespace

struct Growth::Light {
  static constexpr int kColumns = 2 * kReach_px + 1;
  std::array<std::array<float, kColumns>, 3> primary;
  std::array<float, 3> full;
  int first;

  float at(std::size_t c, float column_px) const {
    const float off = column_px - static_cast<float>(first);
    const int i = static_cast<int>(off);
    const float share = off - static_cast<float>(i);
    const auto k = static_cast<std::size_t>(i);
    return primary[c][k] + share * (primary[c][k + 1] - primary[c][k]);
  }

  /// Of columns [from, to] with a colour, -1..1.
  float agreement(Primary colour, float from, float to) const {
    const int begin = static_cast<int>(from + 0.5F);
    const int last = std::max(begin, static_cast<int>(to + 0.5F));
    float sum = 0;
    for (int x = begin; x <= last; ++x) {
      for (std::size_t c = 0; c < 3; ++c) {
        const float share = primary[c][static_cast<std::size_t>(x - first)] / full[c];
        const float on = std::clamp((share - kOff) / kClear, -1.F, 1.F);
        sum += (colour >> c & 1) != 0 ? on : -on;
      }
    }
    return sum / static_cast<float>(3 * (last - begin + 1));
  }

  /// Of the side that agrees less with a boundary's colours.
  float agreement(const std::array<Primary, 2>& colours, float column_px, float free_left_px,
                  float free_right_px) const {
    const float l = std::min(0.55F * free_left_px, kMostSide_px);
    const float r = std::min(0.55F * free_right_px, kMostSide_px);
    return std::min(agreement(colours[0], column_px - l, column_px - 0.5F * l),
                    agreement(colours[1], column_px + 0.5F * r, column_px + r));
  }
};

Growth::Growth(const std::array<double, 9>& colour_matrix, int boundaries, int lines)
    : boundaries_(boundaries),
      lines_(lines),
      stride_(static_cast<std::size_t>(boundaries) + 2 * kMargin),
      now_(stride_ * static_cast<std::size_t>(lines + 2 * kMargin), kNone),
      before_(now_) {
  std::transform(colour_matrix.begin(), colour_matrix.end(), colour_.begin(),
                 [](double m) { return static_cast<float>(m); });
}

float* Growth::row(std::vector<float>& grid, int line) const {
  return grid.data() + static_cast<std::size_t>(line + kMargin) * stride_ + kMargin;
}

void Growth::fill(int width, const SequenceResult& result, const EdgeImage& edges,
                  const std::vector<RecoveredBoundary>& recovered) {
  cells_ = width / kCell_px + 1;
  moving_.assign(static_cast<std::size_t>(lines_ * cells_), 0);
  tried_.assign(static_cast<std::size_t>(lines_ * boundaries_), 0);
  std::size_t decoded = 0;
  std::size_t still = 0;
  for (int line = 0; line < lines_; ++line) {
    float* here = row(now_, line);
    std::uint8_t* moving = moving_.data() + static_cast<std::size_t>(line * cells_);
    std::fill_n(here, boundaries_, kNone);
    for (std::uint32_t e = edges.line_start[static_cast<std::size_t>(line)];
         e < edges.line_start[static_cast<std::size_t>(line) + 1]; ++e) {
      const float column = edges.edges[e].column_px;
      if (result.boundary[e] >= 0) {
        here[result.boundary[e]] = column;
        ++decoded;
        still += result.still[e];
      }
      if (result.still[e] != 0) continue;
      const int cell = static_cast<int>(column) / kCell_px;
      const int first = std::clamp(cell - kCellsAround, 0, cells_ - 1);
      const int last = std::clamp(cell + kCellsAround, 0, cells_ - 1);
      std::fill(moving + first, moving + last + 1, std::uint8_t{1});
    }
  }
  for (const RecoveredBoundary& r : recovered) row(now_, r.line)[r.boundary] = r.column_px;
  mostly_still_ = 2 * still > decoded;
}

/// Whether an edge near a place was elsewhere two frames ago.
bool Growth::moves(int line, float column_px) const {
  const int cell = static_cast<int>(column_px) / kCell_px;
  return cell >= 0 && cell < cells_ && moving_[static_cast<std::size_t>(line * cells_ + cell)] != 0;
}

std::optional<Growth::Prediction> Growth::predict(int line, int boundary) {
  const float* here = row(now_, line);
  std::array<float, 2> places{};
  std::size_t count = 0;
  unsigned sources = 0;
  for (const int direction : {-1, 1}) {
    for (const int lines : {direction, 2 * direction}) {
      const float px = row(now_, line + lines)[boundary];
      if (!known(px)) continue;
      places[count++] = px;
      sources |= direction < 0 ? kAbove : kBelow;
      break;
    }
  }
  if (count == 0) return std::nullopt;
  if (known(here[boundary - 1])) sources |= kLeft;
  if (known(here[boundary + 1])) sources |= kRight;
  const bool both = count == 2;
  const bool beside = (sources & (kLeft | kRight)) != 0;
  if (!both && (!beside || !mostly_still_)) return std::nullopt;
  // What the frame before had there and this one does not may be covered by now.
  if (!both && known(row(before_, line)[boundary])) return std::nullopt;
  std::uint8_t& tried = tried_[static_cast<std::size_t>(line * boundaries_ + boundary)];
  if (std::exchange(tried, static_cast<std::uint8_t>(sources)) == sources) return std::nullopt;
  const float column = both ? 0.5F * (places[0] + places[1]) : places[0];
  float left = -std::numeric_limits<float>::infinity();
  float right = std::numeric_limits<float>::infinity();
  int left_index = -1;
  int right_index = boundaries_;
  for (int b = 0; b < boundaries_; ++b) {
    const float px = here[b];
    if (px < column && px > left) {
      left = px;
      left_index = b;
    } else if (px >= column && px < right) {
      right = px;
      right_index = b;
    }
  }
  if ((column - left < kOpen_px && left_index > boundary) ||
      (right - column < kOpen_px && right_index < boundary))
    return std::nullopt;
  // Where the scene holds still, what is against a boundary is as good as what is for it.
  if (!both && !moves(line, column)) return std::nullopt;
  const float sigma = both ? kBetween_px + kLeanShare * std::fabs(places[1] - places[0]) : kOneSide_px;
  return Prediction{column, sigma, std::min(column - left, kOpen_px), std::min(right - column, kOpen_px)};
}

void Growth::read(const std::uint8_t* pixels, int centre, Light& out) const {
  out.first = centre - kReach_px;
  out.full = {};
  const std::uint8_t* p = pixels + 3 * out.first;
  for (std::size_t i = 0; i < Light::kColumns; ++i, p += 3) {
    for (std::size_t c = 0; c < 3; ++c) {
      const float value = std::max(0.F, colour_[3 * c] * static_cast<float>(p[0]) +
                                            colour_[3 * c + 1] * static_cast<float>(p[1]) +
                                            colour_[3 * c + 2] * static_cast<float>(p[2]));
      out.primary[c][i] = value;
      out.full[c] = std::max(out.full[c], value);
    }
  }
  const float brightest = std::max({out.full[0], out.full[1], out.full[2], 2 * kDark});
  for (float& full : out.full) full = std::max(full, kFull * brightest);
}

std::optional<Growth::Found> Growth::find(const SlideFieldView& view, int line, int boundary,
                                          const Prediction& p) const {
  const int centre = static_cast<int>(p.column_px + 0.5F);
  if (centre < kReach_px + 1 || centre + kReach_px + 1 >= view.field.width) return std::nullopt;
  Light light;
  read(view.field.row(line), centre, light);
  const auto [left, right] = view.colours[static_cast<std::size_t>(boundary)];
  std::array<float, 3> direction{};
  float flips = 0;
  for (std::size_t c = 0; c < 3; ++c) {
    direction[c] = static_cast<float>((right >> c & 1) - (left >> c & 1));
    flips += std::fabs(direction[c]);
  }
  std::array<float, 2 * kSteps + 1> steps;
  std::size_t best = kSteps - kFurthest;
  for (std::size_t i = 0; i < steps.size(); ++i) {
    const float at = p.column_px + kStep_px * (static_cast<float>(i) - kSteps);
    float rise = 0;
    for (std::size_t c = 0; c < 3; ++c)
      rise += direction[c] * (light.at(c, at + kArm_px) - light.at(c, at - kArm_px));
    steps[i] = rise / flips;
    if (steps[i] > steps[best] && i <= kSteps + kFurthest) best = i;
  }
  if (steps[best] <= 0) return std::nullopt;  // what follows is of a rise
  // The middle of what rises nearly as much: a sharp step does so as far as the arms reach.
  const float nearly = kNearly * steps[best];
  std::size_t first = best;
  std::size_t last = best;
  while (first > 0 && steps[first - 1] >= nearly) --first;
  while (last + 1 < steps.size() && steps[last + 1] >= nearly) ++last;
  if (first == 0 || last + 1 == steps.size()) return std::nullopt;  // another's, farther away
  const float before = (steps[first] - nearly) / (steps[first] - steps[first - 1]);
  const float behind = (steps[last] - nearly) / (steps[last] - steps[last + 1]);
  const float middle = 0.5F * (static_cast<float>(first) - before + static_cast<float>(last) + behind);
  const float moved = kStep_px * (middle - kSteps);
  const float column = p.column_px + moved;
  const float free_left = p.left_px + moved;
  const float free_right = p.right_px - moved;
  if (free_left < kLeastRoom_px || free_right < kLeastRoom_px) return std::nullopt;
  float level = kDark;
  for (std::size_t c = 0; c < 3; ++c)
    for (const float at : {-2.F, -1.F, 0.F, 1.F, 2.F}) level = std::max(level, light.at(c, column + at));
  if (steps[best] < kLeastStep * level) return std::nullopt;
  if (light.agreement({left, right}, column, free_left, free_right) < kLeastAgree) return std::nullopt;
  const float own = 1 / (kFound_px * kFound_px);
  const float predicted = 1 / (p.sigma_px * p.sigma_px);
  return Found{(own * column + predicted * p.column_px) / (own + predicted),
               std::hypot(1 / std::sqrt(own + predicted), kApartShare * moved)};
}

std::size_t Growth::grow_line(const SlideFieldView& view, int line,
                              std::vector<RecoveredBoundary>& recovered) {
  float* here = row(now_, line);
  std::size_t added = 0;
  for (int b = 0; b < boundaries_; ++b) {
    if (known(here[b])) continue;
    const auto p = predict(line, b);
    if (!p) continue;
    const auto found = find(view, line, b, *p);
    if (!found) continue;
    here[b] = found->column_px;
    recovered.push_back({line, b, found->column_px, found->sigma_px, 0});
    ++added;
  }
  return added;
}

/// Gives up moving boundaries that the field does not show: a silhouette came over their place between the
/// fields, or their code is another's.
void Growth::drop_line(const SlideFieldView& view, int line, const EdgeImage& edges, SequenceResult& result) {
  float* here = row(now_, line);
  for (std::uint32_t e = edges.line_start[static_cast<std::size_t>(line)];
       e < edges.line_start[static_cast<std::size_t>(line) + 1]; ++e) {
    const int b = result.boundary[e];
    if (b < 0) continue;
    const float column = here[b];
    const int centre = static_cast<int>(column + 0.5F);
    if (centre < kReach_px + 1 || centre + kReach_px + 1 >= view.field.width) continue;
    if (view.motion->at(line, column) == 0) continue;
    Light light;
    read(view.field.row(line), centre, light);
    const auto room = [](float px) { return known(px) ? std::clamp(px, kLeastRoom_px, kOpen_px) : kOpen_px; };
    const float left = room(column - here[b - 1]);
    const float right = room(here[b + 1] - column);
    if (light.agreement(view.colours[static_cast<std::size_t>(b)], column, left, right) >= kDisagrees)
      continue;
    result.boundary[e] = -1;
    here[b] = kNone;
  }
}

std::size_t Growth::grow(const SlideFieldView& view, const EdgeImage& edges, SequenceResult& result,
                         std::vector<RecoveredBoundary>& recovered) {
  fill(view.field.width, result, edges, recovered);
  const int lines = std::min(lines_, view.field.height);
  for (int line = 0; line < lines; ++line)
    if (view.motion != nullptr && view.motion->line_moves(line)) drop_line(view, line, edges, result);
  std::size_t added = 0;
  for (int line = 0; line < lines; ++line) added += grow_line(view, line, recovered);
  for (int line = lines - 1; line >= 0; --line) added += grow_line(view, line, recovered);
  std::swap(now_, before_);
  return added;
}

}  // namespace relievo
