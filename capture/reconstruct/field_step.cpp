// SPDX-License-Identifier: Apache-2.0
#include "capture/reconstruct/field_step.h"

#include <algorithm>
#include <bit>
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

// The share of the right colour in the light.
constexpr int kBalanceReach_px = 6;          // columns to each side at which it is read
constexpr float kBalanceFarthest_px = 1.5F;  // from the place
constexpr float kLeastLight = 0.08F;         // of the brightest there; less has no share
constexpr std::array kPlateau_px{2.F, 3.F};  // from the place each side's own share is read,
constexpr float kPlateauRoom = 0.5F;         // or so much of the way to the next boundary
constexpr float kPlateauOff = 0.3F;          // from none, or all, that it may be
constexpr float kApartFromStep_px = 1.2F;    // no farther from the step

// Standard deviations, measured on simulated scenes.
constexpr float kFound_px = 0.4F;        // of where the field shows the step,
constexpr float kLeastFound_px = 0.15F;  // or of where its colours balance at least,
constexpr float kFoundNearly = 2.F;      // and times that of the balance, for it may be another step
constexpr float kOfNoise_px = 6.F;       // of a balance: of the noise, of the brightest light;
constexpr float kOfPlateau_px = 0.8F;    // of how far off the shares of the sides are;
constexpr float kOfLight_px = 0.25F;     // and of the logarithm of how much brighter one side is
constexpr float kApartShare = 0.3F;      // of the distance from the prediction

}  // namespace

struct StepFinder::Light {
  static constexpr int kColumns = 2 * kReach_px + 1;
  std::array<std::array<float, kColumns>, 3> primary;
  std::array<float, 3> full;
  float brightest;
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

  std::optional<FieldPlace> balance(const std::array<Primary, 2>& colours, float column_px, float left_px,
                                    float right_px, float noise) const;

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

void StepFinder::read(const SlideFieldView& view, int line, int centre, Light& out) const {
  out.first = centre - kReach_px;
  out.full = {};
  const std::uint8_t* p = view.field.row(line) + 3 * out.first;
  for (std::size_t i = 0; i < Light::kColumns; ++i, p += 3) {
    for (std::size_t c = 0; c < 3; ++c) {
      const float value = std::max(0.F, colour_[3 * c] * static_cast<float>(p[0]) +
                                            colour_[3 * c + 1] * static_cast<float>(p[1]) +
                                            colour_[3 * c + 2] * static_cast<float>(p[2]));
      out.primary[c][i] = value;
      out.full[c] = std::max(out.full[c], value);
    }
  }
  if (view.ambient > 0) {
    for (std::size_t c = 0; c < 3; ++c) {
      const float ambient = view.ambient * out.full[c];
      for (float& value : out.primary[c]) value = std::max(0.F, value - ambient);
      out.full[c] -= ambient;
    }
  }
  out.brightest = std::max({out.full[0], out.full[1], out.full[2], 2 * kDark});
  for (float& full : out.full) full = std::max(full, kFull * out.brightest);
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
  constexpr std::size_t kFirst = kSteps - kFurthest;
  constexpr std::size_t kLast = kSteps + kFurthest;
  std::size_t best = kFirst;
  for (std::size_t i = 0; i < steps.size(); ++i) {
    const float at = predicted_px + kStep_px * (static_cast<float>(i) - kSteps);
    float rise = 0;
    for (std::size_t c = 0; c < 3; ++c)
      rise += direction[c] * (light.at(c, at + kArm_px) - light.at(c, at - kArm_px));
    steps[i] = rise / flips;
    if (i > kFirst && i <= kLast && steps[i] > steps[best]) best = i;
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

/// `column_px` kBalanceReach_px or more inside of what was read.
std::optional<FieldPlace> StepFinder::Light::balance(const std::array<Primary, 2>& colours, float column_px,
                                                     float left_px, float right_px, float noise) const {
  const auto [a, b] = colours;
  // The amounts of the two colours whose sum comes nearest to the light of a column.
  const auto channels = [](int colour) {
    return static_cast<float>(std::popcount(static_cast<unsigned>(colour)));
  };
  const float of_a = channels(a);
  const float of_b = channels(b);
  const float of_both = channels(a & b);
  const float scale = 1 / (of_a * of_b - of_both * of_both);
  constexpr std::size_t kColumnsRead = 2 * kBalanceReach_px + 1;
  std::array<float, kColumnsRead> amounts, shares;
  const int first_column = static_cast<int>(column_px + 0.5F) - kBalanceReach_px;
  for (std::size_t i = 0; i < kColumnsRead; ++i) {
    const auto x = static_cast<std::size_t>(first_column - first) + i;
    float in_a = 0;
    float in_b = 0;
    for (std::size_t c = 0; c < 3; ++c) {
      const float value = primary[c][x] / full[c];
      if ((a >> c & 1) != 0) in_a += value;
      if ((b >> c & 1) != 0) in_b += value;
    }
    const float amount_b = scale * (of_a * in_b - of_both * in_a);
    amounts[i] = std::max(kLeastLight, scale * (of_b * in_a - of_both * in_b) + amount_b);
    shares[i] = std::clamp(amount_b / amounts[i], -0.5F, 1.5F);
  }
  const auto mean_beside = [&](const std::array<float, kColumnsRead>& of, float direction, float room_px) {
    float sum = 0;
    for (const float away : kPlateau_px) {
      const float off =
          column_px + direction * std::min(away, kPlateauRoom * room_px) - static_cast<float>(first_column);
      const auto i = static_cast<std::size_t>(off);
      sum += of[i] + (off - static_cast<float>(i)) * (of[i + 1] - of[i]);
    }
    return sum / static_cast<float>(kPlateau_px.size());
  };
  const float left = mean_beside(shares, -1, left_px);
  const float right = mean_beside(shares, 1, right_px);
  const float half = 0.5F * (std::clamp(left, -kPlateauOff, kPlateauOff) +
                             std::clamp(right, 1 - kPlateauOff, 1 + kPlateauOff));
  std::optional<float> found;
  float nearest = kBalanceFarthest_px;
  for (std::size_t i = 0; i + 1 < kColumnsRead; ++i) {
    if (shares[i] > half || shares[i + 1] <= half) continue;
    const float px = static_cast<float>(first_column) + static_cast<float>(i) +
                     (half - shares[i]) / (shares[i + 1] - shares[i]);
    if (std::fabs(px - column_px) >= nearest) continue;
    nearest = std::fabs(px - column_px);
    found = px;
  }
  if (!found) return std::nullopt;
  const float by_noise = kOfNoise_px * noise / brightest;
  const float by_plateau = kOfPlateau_px * std::max(std::fabs(left), std::fabs(1 - right));
  const float by_light =
      kOfLight_px * std::log(mean_beside(amounts, -1, left_px) / mean_beside(amounts, 1, right_px));
  return FieldPlace{*found, std::sqrt(by_noise * by_noise + by_plateau * by_plateau + by_light * by_light)};
}

std::optional<FoundStep> StepFinder::find(const SlideFieldView& view, int line, int boundary,
                                          const StepPrediction& p) const {
  const int centre = static_cast<int>(p.column_px + 0.5F);
  if (centre < kReach_px + 1 || centre + kReach_px + 1 >= view.field.width) return std::nullopt;
  Light light;
  read(view, line, centre, light);
  const std::array<Primary, 2>& colours = view.colours[static_cast<std::size_t>(boundary)];
  const auto rise = steepest(light, colours, p.column_px);
  if (!rise) return std::nullopt;
  float column = rise->column_px;
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
  } else if (const auto place = light.balance(colours, column, free_left, free_right, view.noise);
             place && std::fabs(place->column_px - column) < kApartFromStep_px) {
    column = place->column_px;
    found_px = std::max(kLeastFound_px, kFoundNearly * place->sigma_px);
  }
  const float own = 1 / (found_px * found_px);
  const float predicted = 1 / (p.sigma_px * p.sigma_px);
  return FoundStep{(own * column + predicted * p.column_px) / (own + predicted),
                   std::hypot(1 / std::sqrt(own + predicted), kApartShare * moved), moved};
}

std::optional<FieldPlace> StepFinder::balance(const SlideFieldView& view, int line, int boundary,
                                              float column_px, float left_px, float right_px) const {
  const int centre = static_cast<int>(column_px + 0.5F);
  if (centre < kReach_px + 1 || centre + kReach_px + 1 >= view.field.width) return std::nullopt;
  Light light;
  read(view, line, centre, light);
  return light.balance(view.colours[static_cast<std::size_t>(boundary)], column_px, left_px, right_px,
                       view.noise);
}

bool StepFinder::shows_another(const SlideFieldView& view, int line, int boundary, float column_px,
                               float left_px, float right_px) const {
  const int centre = static_cast<int>(column_px + 0.5F);
  if (centre < kReach_px + 1 || centre + kReach_px + 1 >= view.field.width) return false;
  Light light;
  read(view, line, centre, light);
  const auto [left, right] =
      light.agreement(view.colours[static_cast<std::size_t>(boundary)], column_px, left_px, right_px);
  return std::min(left, right) < kDisagrees;
}

}  // namespace relievo
