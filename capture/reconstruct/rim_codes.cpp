// SPDX-License-Identifier: Apache-2.0
#include "capture/reconstruct/rim_codes.h"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <cstdint>
#include <optional>
#include <utility>

#include "capture/reconstruct/column_grid.h"
#include "capture/reconstruct/luma_place.h"

namespace relievo {
namespace {

// Of the distance of the other surface's boundaries: farther from its first one, and that would have one more
// in between.
constexpr float kOfBack = 1.15F;
constexpr float kOfFront = 0.95F;

// What is as sure as this, and where its own surface foretells it, is a boundary.
constexpr float kSure_px = 0.06F;
constexpr float kForetold_px = 0.2F;
constexpr float kStray_px = 1.F;  // what is so far from there may be a rim whatever its colours are

// Where the scene's brightness changes.
constexpr float kNear_px = 1.6F;
constexpr float kBeyond_px = 2.F;
constexpr float kBeside_px = 1.F;

// Where its colour does, which tells more.
constexpr float kNearColour_px = 1.F;
constexpr float kOtherColour = 0.03F;  // distance of the shares of red, green and blue
constexpr float kBlurred_px = 2.F;     // next to a place,
constexpr float kPlateau_px = 5.F;     // and where its surface is looked at
constexpr int kLeastLight = 60;        // grey levels, of four samples in three channels

// Light of the projector that is none, of that on the other side of a place.
constexpr float kShadow = 0.05F;
constexpr int kBesideShadow_px = 3;

/// How far a place is from where those of its surface, which are on its `side` (-1, 1), foretell it; NaN
/// where these are not two.
float off_foretold_px(const Place* own, int side) {
  return std::fabs(goes_on_to(own[side].column_px, own[2 * side].column_px, own[3 * side].column_px) -
                   own->column_px);
}

/// What is seen of the scene itself on a line: under the light of both fields together.
struct SceneLine {
  SceneLine(const DetectionLines& rows, const DifferenceImage& image, int line)
      : own(rows.own.row(line)),
        above(rows.other_above(line)),
        below(rows.other_below(line)),
        white(image.white_line(line)),
        width(image.width) {}

  /// Shares of red, green and blue between two columns, in either order; nothing beside the picture and where
  /// there is no light.
  std::optional<std::array<float, 3>> colour(float one_px, float other_px) const;

  const std::uint8_t *own, *above, *below;
  const float* white;
  int width;
};

std::optional<std::array<float, 3>> SceneLine::colour(float one_px, float other_px) const {
  const int first = static_cast<int>(std::lround(std::min(one_px, other_px)));
  const int last = static_cast<int>(std::lround(std::max(one_px, other_px)));
  if (first < 0 || last >= width) return std::nullopt;
  std::array<int, 3> sums{};
  for (int i = 3 * first; i < 3 * (last + 1); ++i)
    sums[static_cast<std::size_t>(i % 3)] += 2 * own[i] + above[i] + below[i];
  const int all = sums[0] + sums[1] + sums[2];
  if (all < kLeastLight * (last - first + 1)) return std::nullopt;
  std::array<float, 3> out;
  for (std::size_t c = 0; c < 3; ++c) out[c] = static_cast<float>(sums[c]) / static_cast<float>(all);
  return out;
}

/// Whether the scene's brightness changes most between two columns, in either order, where it does so next to
/// `column_px`.
bool steepest_near(const SceneLine& scene, float one_px, float other_px, float column_px) {
  const int first = std::max(0, static_cast<int>(std::ceil(std::min(one_px, other_px))));
  const int last = std::min(scene.width - 2, static_cast<int>(std::max(one_px, other_px)) - 1);
  const float* white = scene.white;
  float steepest = 0;
  float off_px = kNear_px;  // nothing changes
  for (int x = first; x <= last; ++x) {
    const float step = std::fabs(white[x + 1] - white[x]) / (white[x + 1] + white[x] + kDarkSum);
    if (step <= steepest) continue;
    steepest = step;
    off_px = static_cast<float>(x) + 0.5F - column_px;
  }
  return std::fabs(off_px) < kNear_px;
}

/// Where the colour of the front's last place gives way to that of the back's first one; nothing where these
/// are nearly the same. `way`: from the front to the back, 1 to the right, -1 to the left.
std::optional<float> colour_changes(const SceneLine& scene, float front_px, float back_px, float way) {
  const auto front = scene.colour(front_px - way * kPlateau_px, front_px - way * kBlurred_px);
  const auto back = scene.colour(back_px + way * kBlurred_px, back_px + way * kPlateau_px);
  if (!front || !back) return std::nullopt;
  std::array<float, 3> change;
  float square = 0;
  for (std::size_t c = 0; c < 3; ++c) {
    change[c] = (*back)[c] - (*front)[c];
    square += change[c] * change[c];
  }
  if (square < kOtherColour * kOtherColour) return std::nullopt;
  float before = 0;  // of the change
  for (float x = std::round(front_px - way * kBlurred_px); way * (back_px - x) >= -kBlurred_px; x += way) {
    const auto here = scene.colour(x - 1, x + 1);
    if (!here) return std::nullopt;
    float gone = 0;
    for (std::size_t c = 0; c < 3; ++c) gone += ((*here)[c] - (*front)[c]) * change[c] / square;
    if (gone > 0.5F) return x - way * std::min(1.F, (gone - 0.5F) / (gone - before));
    before = gone;
  }
  return std::nullopt;
}

/// Two places that are neighbours on a line where a surface ends before another.
struct Step {
  const Place *front, *back;
  int way;  // from the one to the other, 1 to the right, -1 to the left
};

/// Whether one of the two is a rim: the front's last one or the back's first. Under `alike` of the two slides
/// the colours tell that it may be one.
bool is_rim(const SceneLine& scene, const Step& step, bool of_front, int alike) {
  const Place& own = of_front ? *step.front : *step.back;
  const auto way = static_cast<float>(step.way);
  const float front_px = step.front->column_px;
  const float back_px = step.back->column_px;
  const float off = off_foretold_px(&own, of_front ? -step.way : step.way);
  if (own.sigma_px < kSure_px && off < kForetold_px) return false;
  if (alike == 0 && !(off > kStray_px)) return false;
  const auto px = colour_changes(scene, front_px, back_px, way);
  if (px && std::fabs(*px - own.column_px) < kNearColour_px) return true;
  // Brightness tells too little where only one slide looks so.
  if (alike < 2) return false;
  return of_front
             ? steepest_near(scene, front_px - way * kBeyond_px, back_px - way * kBeside_px, own.column_px)
             : steepest_near(scene, front_px + way * kBeside_px, back_px + way * kBeyond_px, own.column_px);
}

/// How many of a line are taken out of `here`, which holds `count`. `front`: FrontEdges::front().
int drop_rims_of_line(const SceneLine& scene, const StripeColours& shown, const StripeColours& other,
                      int front, Place* here, int count) {
  int dropped = 0;
  int before = -1;
  for (int b = 0; b < count; ++b) {
    if (!here[b].known()) continue;
    const int left = std::exchange(before, b);
    if (left < 0 || left + 1 == b) continue;
    const auto l = static_cast<std::size_t>(left);
    const auto r = static_cast<std::size_t>(b);
    const int alike = (shown[l][1] == shown[r][0]) + (other[l][1] == other[r][0]);
    const float apart = here[b].column_px - here[left].column_px;
    if (!(apart > 0)) continue;
    const int of_front = front < 0 ? left : b;
    const int of_back = front < 0 ? b : left;
    const Step step{here + of_front, here + of_back, -front};
    // Whether there is room for one more boundary between: the front's next one, the back's one before.
    const auto stripe_px = [&](const Place* own, int side) {
      return static_cast<float>(side) * (own[side].column_px - own->column_px);
    };
    const bool front_fits = !(apart < kOfFront * stripe_px(step.front, front));
    const bool back_fits = !(apart < kOfBack * stripe_px(step.back, -front));
    int gone = -1;
    if (is_rim(scene, step, false, front_fits ? 0 : alike)) {
      gone = of_back;
    } else if (is_rim(scene, step, true, front_fits && !back_fits ? alike : 0)) {
      gone = of_front;
    }
    if (gone < 0) continue;
    here[gone] = {};
    if (gone == b) before = left;
    ++dropped;
  }
  return dropped;
}

/// Whether on one side of a place nothing is projected: the exposures differ by next to nothing there.
bool in_shadow(const DifferenceImage& image, int line, float column_px) {
  const int centre = static_cast<int>(std::lround(column_px));
  if (centre < kBesideShadow_px || centre + kBesideShadow_px >= image.width) return false;
  const float* of_channel = image.line(line);
  std::array<float, 2> light{};
  for (int c = 0; c < 3; ++c, of_channel += image.width) {
    float left = 0;
    float right = 0;
    for (int away = 1; away <= kBesideShadow_px; ++away) {
      left += of_channel[centre - away];
      right += of_channel[centre + away];
    }
    light[0] += std::fabs(left);
    light[1] += std::fabs(right);
  }
  return std::min(light[0], light[1]) < kShadow * std::max(light[0], light[1]);
}

/// Takes out of `here`, as drop_rims_of_line(), last boundaries of surfaces that lie in a shadow. Their
/// surface foretells them, and the light beside the shadow, blurred, has edges under any slide.
int drop_in_shadow(const DifferenceImage& image, int line, Place* here, int count) {
  int dropped = 0;
  for (int b = 0; b < count; ++b) {
    if (!here[b].known() || (here[b - 1].known() && here[b + 1].known())) continue;
    if (!in_shadow(image, line, here[b].column_px)) continue;
    here[b] = {};
    ++dropped;
  }
  return dropped;
}

}  // namespace

std::size_t drop_rims(const DetectionLines& rows, const DifferenceImage& image, const StripeColours& shown,
                      const StripeColours& other, int front, WorkerPool& pool, PlaceGrid& places,
                      SequenceResult& result, const EdgeImage& edges,
                      std::vector<RecoveredBoundary>& recovered) {
  std::atomic<std::size_t> total{0};
  pool.for_shares(edges.line_start, [&](int begin, int end, int) {
    for (int line = begin; line < end; ++line) {
      Place* here = places.line(line);
      const SceneLine scene(rows, image, line);
      const int dropped = drop_rims_of_line(scene, shown, other, front, here, places.boundaries()) +
                          drop_in_shadow(image, line, here, places.boundaries());
      if (dropped == 0) continue;
      total += static_cast<std::size_t>(dropped);
      for (std::uint32_t e = edges.line_start[static_cast<std::size_t>(line)];
           e < edges.line_start[static_cast<std::size_t>(line) + 1]; ++e) {
        std::int16_t& boundary = result.boundary[e];
        if (boundary >= 0 && !here[boundary].known()) boundary = -1;
      }
    }
  });
  if (total == 0) return 0;
  std::erase_if(recovered,
                [&](const RecoveredBoundary& r) { return !places.line(r.line)[r.boundary].known(); });
  return total;
}

}  // namespace relievo
