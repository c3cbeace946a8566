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

  /// Shares of red, green and blue; nothing beside the picture and where there is no light.
  std::optional<std::array<float, 3>> colour(float from_px, float to_px) const;

  const std::uint8_t *own, *above, *below;
  const float* white;
  int width;
};

std::optional<std::array<float, 3>> SceneLine::colour(float from_px, float to_px) const {
  const int first = static_cast<int>(std::lround(from_px));
  const int last = static_cast<int>(std::lround(to_px));
  if (first < 0 || last >= width || last < first) return std::nullopt;
  std::array<int, 3> sums{};
  for (int i = 3 * first; i < 3 * (last + 1); ++i)
    sums[static_cast<std::size_t>(i % 3)] += 2 * own[i] + above[i] + below[i];
  const int all = sums[0] + sums[1] + sums[2];
  if (all < kLeastLight * (last - first + 1)) return std::nullopt;
  std::array<float, 3> out;
  for (std::size_t c = 0; c < 3; ++c) out[c] = static_cast<float>(sums[c]) / static_cast<float>(all);
  return out;
}

/// Whether the scene's brightness changes most between two columns where it does so next to `column_px`.
bool steepest_near(const SceneLine& scene, float from_px, float to_px, float column_px) {
  const int first = std::max(0, static_cast<int>(std::ceil(from_px)));
  const int last = std::min(scene.width - 2, static_cast<int>(to_px) - 1);
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
/// are nearly the same.
std::optional<float> colour_changes(const SceneLine& scene, float front_px, float back_px) {
  const auto front = scene.colour(front_px - kPlateau_px, front_px - kBlurred_px);
  const auto back = scene.colour(back_px + kBlurred_px, back_px + kPlateau_px);
  if (!front || !back) return std::nullopt;
  std::array<float, 3> way;
  float square = 0;
  for (std::size_t c = 0; c < 3; ++c) {
    way[c] = (*back)[c] - (*front)[c];
    square += way[c] * way[c];
  }
  if (square < kOtherColour * kOtherColour) return std::nullopt;
  float before = 0;  // of the way
  for (float x = std::round(front_px - kBlurred_px); x <= back_px + kBlurred_px; ++x) {
    const auto here = scene.colour(x - 1, x + 1);
    if (!here) return std::nullopt;
    float gone = 0;
    for (std::size_t c = 0; c < 3; ++c) gone += ((*here)[c] - (*front)[c]) * way[c] / square;
    if (gone > 0.5F) return x - std::min(1.F, (gone - 0.5F) / (gone - before));
    before = gone;
  }
  return std::nullopt;
}

/// Whether a place, the front's last one or the back's first, is a rim. The two are neighbours; under `alike`
/// of the two slides the colours tell that it may be one.
bool is_rim(const SceneLine& scene, const Place& front, const Place& back, bool of_front, int alike) {
  const Place& own = of_front ? front : back;
  const float off = off_foretold_px(&own, of_front ? -1 : 1);
  if (own.sigma_px < kSure_px && off < kForetold_px) return false;
  if (alike == 0 && !(off > kStray_px)) return false;
  const auto px = colour_changes(scene, front.column_px, back.column_px);
  if (px && std::fabs(*px - own.column_px) < kNearColour_px) return true;
  // Brightness tells too little where only one slide looks so.
  if (alike < 2) return false;
  return of_front
             ? steepest_near(scene, front.column_px - kBeyond_px, back.column_px - kBeside_px, own.column_px)
             : steepest_near(scene, front.column_px + kBeside_px, back.column_px + kBeyond_px, own.column_px);
}

/// How many of a line are taken out of `here`, which holds `count`.
int drop_rims_of_line(const SceneLine& scene, const StripeColours& shown, const StripeColours& other,
                      Place* here, int count) {
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
    // Whether there is room for one more boundary between: the front's next one, the back's one before.
    const bool front_fits = !(apart < kOfFront * (here[left].column_px - here[left - 1].column_px));
    const bool back_fits = !(apart < kOfBack * (here[b + 1].column_px - here[b].column_px));
    if (is_rim(scene, here[left], here[b], false, front_fits ? 0 : alike)) {
      here[b] = {};
      before = left;
      ++dropped;
    } else if (is_rim(scene, here[left], here[b], true, front_fits && !back_fits ? alike : 0)) {
      here[left] = {};
      ++dropped;
    }
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
                      const StripeColours& other, WorkerPool& pool, PlaceGrid& places, SequenceResult& result,
                      const EdgeImage& edges, std::vector<RecoveredBoundary>& recovered) {
  std::atomic<std::size_t> total{0};
  pool.for_shares(edges.line_start, [&](int begin, int end, int) {
    for (int line = begin; line < end; ++line) {
      Place* here = places.line(line);
      const SceneLine scene(rows, image, line);
      const int dropped = drop_rims_of_line(scene, shown, other, here, places.boundaries()) +
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
