// SPDX-License-Identifier: Apache-2.0
#include "capture/reconstruct/field_step.h"

#include <algorithm>
#include <cmath>

namespace relievo {
namespace {

// The step between a boundary's two colours.
constexpr std::size_t kSteps = 9;     // to each side of the prediction it is looked at,
constexpr std::size_t kFurthest = 5;  // and looked for,
constexpr float kStep_px = 0.5F;      // so far apart
constexpr float kArm_px = 1.5F;       // each side's colour is read this far from it
constexpr float kNearly = 0.85F;      // of the greatest rise
constexpr float kLeastStep = 0.25F;   // of the light there

// The colours themselves.
constexpr float kFull = 0.5F;         // of the brightest primary, what each is taken to reach
constexpr float kDark = 12.F;         // grey levels; less is no light
constexpr float kOff = 0.4F;          // of its brightest: in between on and off
constexpr float kClear = 0.25F;       // to either side of that it is clear
constexpr float kLeastAgree = 0.55F;  // of each side's colour, -1..1
constexpr float kDisagrees = 0.2F;    // less: a side is of another colour
constexpr float kMostSide_px = 4.5F;  // colours are read up to here
constexpr float kSideShare = 0.55F;   // of the way to the next boundary, or up to here

// A side that ends beside the boundary.
constexpr float kEndFrom_px = 1.F;    // its colour is read from here
constexpr float kEndTo_px = 1.6F;     // to here,
constexpr float kEndAgree = 0.2F;     // as blur mixes it with the other surface's,
constexpr float kEndOff = -0.9F;      // less, -1..1, and a primary is off,
constexpr float kEndMoved_px = 0.7F;  // no farther from the prediction,
constexpr float kEndFound_px = 2.F;   // whose place is the better one: sigma of the step's

// Standard deviations, measured on simulated scenes.
constexpr float kFound_px = 0.4F;    // of where the field shows the step
constexpr float kApartShare = 0.3F;  // of the distance from the prediction

}  // namespace

struct StepFinder::Light {
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

  /// The brightest within two pixels.
  float level(float column_px) const {
    float out = kDark;
    for (std::size_t c = 0; c < 3; ++c)
      for (const float off : {-2.F, -1.F, 0.F, 1.F, 2.F}) out = std::max(out, at(c, column_px + off));
    return out;
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

  /// Of both sides with a boundary's colours.
  std::array<float, 2> agreement(const std::array<Primary, 2>& colours, float column_px, float free_left_px,
                                 float free_right_px) const {
    const float l = std::min(kSideShare * free_left_px, kMostSide_px);
    const float r = std::min(kSideShare * free_right_px, kMostSide_px);
    return {agreement(colours[0], column_px - l, column_px - 0.5F * l),
            agreement(colours[1], column_px + 0.5F * r, column_px + r)};
  }

  /// Whether what is next to it on one side may be of that side's colour.
  bool end_agrees(const std::array<Primary, 2>& colours, float column_px, bool of_left) const {
    const Primary colour = colours[of_left ? 0 : 1];
    const float near = column_px + (of_left ? -kEndFrom_px : kEndFrom_px);
    const float far = column_px + (of_left ? -kEndTo_px : kEndTo_px);
    for (std::size_t c = 0; c < 3; ++c) {
      const float on = (0.5F * (at(c, near) + at(c, far)) / full[c] - kOff) / kClear;
      if ((colour >> c & 1) != 0 && on < kEndOff) return false;
    }
    return agreement(colour, std::min(near, far), std::max(near, far)) >= kEndAgree;
  }
};

struct StepFinder::Rise {
  float column_px;
  float height;  // a channel that flips
};

StepFinder::StepFinder(const std::array<double, 9>& colour_matrix) {
  std::transform(colour_matrix.begin(), colour_matrix.end(), colour_.begin(),
                 [](double m) { return static_cast<float>(m); });
}

void StepFinder::read(const std::uint8_t* pixels, int centre, Light& out) const {
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

/// Nothing where the step belongs to a boundary farther away.
std::optional<StepFinder::Rise> StepFinder::steepest(const Light& light,
                                                     const std::array<Primary, 2>& colours,
                                                     float predicted_px) {
  std::array<float, 3> direction{};
  float flips = 0;
  for (std::size_t c = 0; c < 3; ++c) {
    direction[c] = static_cast<float>((colours[1] >> c & 1) - (colours[0] >> c & 1));
    flips += std::fabs(direction[c]);
  }
  std::array<float, 2 * kSteps + 1> steps;
  std::size_t best = kSteps - kFurthest;
  for (std::size_t i = 0; i < steps.size(); ++i) {
    const float at = predicted_px + kStep_px * (static_cast<float>(i) - kSteps);
    float rise = 0;
    for (std::size_t c = 0; c < 3; ++c)
      rise += direction[c] * (light.at(c, at + kArm_px) - light.at(c, at - kArm_px));
    steps[i] = rise / flips;
    if (steps[i] > steps[best] && i <= kSteps + kFurthest) best = i;
  }
  if (steps[best] <= 0) return std::nullopt;  // of a clipped picture, or one under another camera's colours
  // The middle of what rises nearly as much: a sharp step does so as far as the arms reach.
  const float nearly = kNearly * steps[best];
  std::size_t first = best;
  std::size_t last = best;
  while (first > 0 && steps[first - 1] >= nearly) --first;
  while (last + 1 < steps.size() && steps[last + 1] >= nearly) ++last;
  if (first == 0 || last + 1 == steps.size()) return std::nullopt;
  const float before = (steps[first] - nearly) / (steps[first] - steps[first - 1]);
  const float behind = (steps[last] - nearly) / (steps[last] - steps[last + 1]);
  const float middle = 0.5F * (static_cast<float>(first) - before + static_cast<float>(last) + behind);
  return Rise{predicted_px + kStep_px * (middle - kSteps), steps[best]};
}

std::optional<FoundStep> StepFinder::find(const SlideFieldView& view, int line, int boundary,
                                          const StepPrediction& p) const {
  const int centre = static_cast<int>(p.column_px + 0.5F);
  if (centre < kReach_px + 1 || centre + kReach_px + 1 >= view.field.width) return std::nullopt;
  Light light;
  read(view.field.row(line), centre, light);
  const std::array<Primary, 2>& colours = view.colours[static_cast<std::size_t>(boundary)];
  const auto rise = steepest(light, colours, p.column_px);
  if (!rise) return std::nullopt;
  const float column = rise->column_px;
  const float moved = column - p.column_px;
  const float free_left = p.left_px + moved;
  const float free_right = p.right_px - moved;
  if (free_left < kLeastRoom_px || free_right < kLeastRoom_px) return std::nullopt;
  if (rise->height < kLeastStep * light.level(column)) return std::nullopt;
  const auto [left, right] = light.agreement(colours, column, free_left, free_right);
  float found_px = kFound_px;
  if (std::min(left, right) < kLeastAgree) {
    if (std::max(left, right) < kLeastAgree || std::fabs(moved) > kEndMoved_px) return std::nullopt;
    if (!light.end_agrees(colours, column, left < right)) return std::nullopt;
    found_px = kEndFound_px;
  }
  const float own = 1 / (found_px * found_px);
  const float predicted = 1 / (p.sigma_px * p.sigma_px);
  return FoundStep{(own * column + predicted * p.column_px) / (own + predicted),
                   std::hypot(1 / std::sqrt(own + predicted), kApartShare * moved), moved};
}

bool StepFinder::shows_another(const SlideFieldView& view, int line, int boundary, float column_px,
                               float left_px, float right_px) const {
  const int centre = static_cast<int>(column_px + 0.5F);
  if (centre < kReach_px + 1 || centre + kReach_px + 1 >= view.field.width) return false;
  Light light;
  read(view.field.row(line), centre, light);
  const auto [left, right] =
      light.agreement(view.colours[static_cast<std::size_t>(boundary)], column_px, left_px, right_px);
  return std::min(left, right) < kDisagrees;
}

}  // namespace relievo
