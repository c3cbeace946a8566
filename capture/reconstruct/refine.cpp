// SPDX-License-Identifier: Apache-2.0
#include "capture/reconstruct/refine.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>

namespace relievo {
namespace {

constexpr int kReach_px = 7;  // samples looked at on each side

constexpr int kPlateau_px = 5;        // of these, where a side's level is measured: from 2 px on
constexpr float kBreak = 0.12F;       // change of luma over two columns, of its sum, at which a surface ends
constexpr float kFarthest_px = 2.5F;  // between colour's place and luma's
constexpr float kVarianceOfMedian = 2.198F;  // variance over median of the squares, of normal deviates
constexpr int kContrastReach_px = 4;         // how far a step in the scene draws an edge
constexpr int kLumaReach_px = 2;             // and its place in luma
constexpr int kContrastLines = 1;            // the low-pass across lines reaches as far
constexpr float kDark = 3;                   // grey levels of the fields' sum, below which ratios are noise
// What the scene's contrast, 0..1, adds to a standard deviation. Zero crossings keep their place on texture
// but are blurred as colour is, which the frame itself tells; luma is sharp but its levels are uncertain.
constexpr float kLevelShare = 0.16F;         // of the luma ratio
constexpr float kLeastColourBias_px = 0.4F;  // of a zero crossing
constexpr float kMostColourBias_px = 2.F;
constexpr float kDrawnTogether = 1.6F;      // what draws colour draws luma too, the same way
constexpr float kModel_px = 0.012F;         // of any place: edges are not straight between samples
constexpr float kPlain = 0.05F;             // contrast that is none,
constexpr float kContrasty = 0.1F;          // and one by which the bias is measured
constexpr float kSteep = 0.15F;             // slope of the luma ratio that places a boundary well, a pixel
constexpr float kApartShare = 0.35F;        // of the distance between luma's and colour's place
constexpr float kApartNoise = 2.5F;         // beyond so many standard deviations of it
constexpr float kNoLuma_px = 0.1F;          // where luma shows no step, and
constexpr float kNoLumaContrast_px = 0.6F;  // times contrast more
constexpr float kLumaFactor = 1.3F;         // the middle level is itself measured
constexpr float kLevelSlack = 0.1F;         // of a side's luma ratio about what the code tells
constexpr float kLeastRise = 0.12F;         // of luma, between the sides of a boundary that luma shows
constexpr float kLeastSlope = 0.2F;         // of that, a pixel
constexpr float kWideStripe_px = 12.F;
constexpr float kStepContrast = 0.12F;  // a step of the scene that is one
constexpr int kRowReach_px = 4;         // columns compared with the lines above and below
constexpr float kRowStep = 0.12F;       // difference, of the sum, that is another surface's
constexpr float kRowNoise = 3.F;        // grey levels more: noise
constexpr float kStepNear_px = 1.2F;

/// Of a column that is not negative; a call of std::lround takes ten times as long.
int column_of(float column_px) {
  return static_cast<int>(column_px + 0.5F);
}

/// True where the steepest place of a step of `white` around `column_px` is there.
bool steepest_at(const float* white, int centre, float column_px) {
  float brightest = 0;
  float darkest = 1e9F;
  float steepest = -1;
  int at = 0;
  for (int x = centre - kContrastReach_px; x <= centre + kContrastReach_px; ++x) {
    brightest = std::max(brightest, white[x]);
    darkest = std::min(darkest, white[x]);
    const float rise = std::fabs(white[x] - white[x - 1]);
    if (rise > steepest) {
      steepest = rise;
      at = x;
    }
  }
  if (brightest - darkest < kStepContrast * (brightest + darkest + kDark)) return false;
  const float before = std::fabs(white[at - 1] - white[at - 2]);
  const float after = std::fabs(white[at + 1] - white[at]);
  const float bend = before - 2 * steepest + after;
  const float place = static_cast<float>(at) - 0.5F +
                      (bend < 0 ? std::clamp(0.5F * (before - after) / bend, -0.5F, 0.5F) : 0);
  return std::fabs(place - column_px) < kStepNear_px;
}

/// Mean distance of neighbouring boundaries that follow each other in the pattern.
float usual_stripe_px(const SequenceResult& result, const EdgeImage& edges) {
  float sum = 0;
  int count = 0;
  for (int line = 0; line < edges.lines; line += 4) {
    for (std::uint32_t e = edges.line_start[static_cast<std::size_t>(line)] + 1;
         e < edges.line_start[static_cast<std::size_t>(line) + 1]; ++e) {
      if (result.boundary[e - 1] < 0 || result.boundary[e] != result.boundary[e - 1] + 1) continue;
      sum += edges.edges[e].column_px - edges.edges[e - 1].column_px;
      ++count;
    }
  }
  return count > 0 ? sum / static_cast<float>(count) : 0;
}

/// 0..1, of the scene in white light on this line and those beside it.
template <int kAround_px>
float contrast_around(const DifferenceImage& image, int line, int centre, bool wide_stripes) {
  static_assert(kContrastLines == 1);
  const float* above = image.white_line(std::max(0, line - 1)) + centre - kAround_px;
  const float* here = image.white_line(line) + centre - kAround_px;
  const float* below = image.white_line(std::min(image.lines - 1, line + 1)) + centre - kAround_px;
  float brightest = 0;
  float darkest = 1e9F;
  for (int i = 0; i <= 2 * kAround_px; ++i) {
    brightest = std::max(brightest, std::max(std::max(above[i], here[i]), below[i]));
    darkest = std::min(darkest, std::min(std::min(above[i], here[i]), below[i]));
  }
  if (wide_stripes) {
    // What is dark over two pixels only is speckle, no step of the scene.
    darkest = 1e9F;
    for (const float* w : {above, here, below})
      for (int i = 0; i <= 2 * kAround_px; ++i)
        darkest = std::min(darkest, std::max(std::max(w[i - 1], w[i]), w[i + 1]));
  }
  return (brightest - darkest) / (brightest + darkest + kDark);
}

}  // namespace

bool same_surface(View8 slide, int line, int other, float column_px) {
  const int centre = column_of(column_px);
  if (other < 0 || other >= slide.height || centre < kRowReach_px || centre + kRowReach_px >= slide.width)
    return false;
  const std::uint8_t* here = slide.row(line);
  const std::uint8_t* there = slide.row(other);
  int difference = 0;
  int sum = 0;
  for (int i = 3 * (centre - kRowReach_px); i < 3 * (centre + kRowReach_px + 1); ++i) {
    difference += std::abs(here[i] - there[i]);
    sum += here[i] + there[i];
  }
  return static_cast<float>(difference) <=
         kRowStep * static_cast<float>(sum) + kRowNoise * static_cast<float>(6 * kRowReach_px + 3);
}

Refiner::Refiner(const std::array<double, 9>& colour_matrix) {
  const Eigen::Matrix3d m =
      Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(colour_matrix.data());
  const Eigen::RowVector3d rec601(0.299, 0.587, 0.114);
  const Eigen::RowVector3d weights = rec601 * m.inverse();
  for (int i = 0; i < 3; ++i) luma_[static_cast<std::size_t>(i)] = static_cast<float>(weights[i]);
  for (std::size_t c = 0; c < 8; ++c) {
    ratio_[c] =
        ((c & 1 ? luma_[0] : -luma_[0]) + (c & 2 ? luma_[1] : -luma_[1]) + (c & 4 ? luma_[2] : -luma_[2])) /
        (luma_[0] + luma_[1] + luma_[2]);
  }
}

/// What luma_place asks of the columns around it, each of them once: difference over sum is the projected
/// light's own, whatever the surface.
struct Refiner::Light {
  static constexpr int kColumns = 16;
  static_assert(kColumns >= 2 * kReach_px + 1);
  int first;  // column
  std::array<float, kColumns> red, green, blue, luma;
  std::array<std::uint8_t, kColumns> ends;  // 1: the scene changes from the column before to the one behind
};

Refiner::Light Refiner::light_around(const DifferenceImage& image, int line, int centre) const {
  Light out;
  out.first = std::clamp(centre - Light::kColumns / 2, 0, image.width - Light::kColumns);
  const float* red = image.line(line) + out.first;
  const float* green = red + image.width;
  const float* blue = green + image.width;
  const float* white = image.white_line(line) + out.first;
  for (std::size_t i = 0; i < Light::kColumns; ++i) {
    const float unit = 1.F / (white[i] + kDark);
    out.red[i] = red[i] * unit;
    out.green[i] = green[i] * unit;
    out.blue[i] = blue[i] * unit;
    out.luma[i] = luma_[0] * out.red[i] + luma_[1] * out.green[i] + luma_[2] * out.blue[i];
  }
  std::array<float, Light::kColumns + 2> around{};
  std::copy_n(white, Light::kColumns, around.begin() + 1);
  const bool at_left = out.first == 0;
  const bool at_right = out.first + Light::kColumns == image.width;
  if (!at_left) around.front() = white[-1];
  if (!at_right) around.back() = white[Light::kColumns];
  for (std::size_t i = 0; i < Light::kColumns; ++i)
    out.ends[i] = std::fabs(around[i + 2] - around[i]) > kBreak * (around[i + 2] + around[i] + kDark);
  if (at_left) out.ends.front() = 1;
  if (at_right) out.ends.back() = 1;
  return out;
}

/// Columns from `centre` on in the direction of `step` that show the same surface in the same light, as far
/// as luma tells, `reach` at most.
int Refiner::clear_run(const Light& light, int centre, int step, int reach) {
  int run = 1;
  for (; run < reach; ++run) {
    const int i = centre + step * run - light.first;
    if (i < 0 || i >= Light::kColumns || light.ends[static_cast<std::size_t>(i)]) break;
  }
  return run;
}

Refiner::LumaPlace Refiner::luma_place(const DifferenceImage& image, int line, const Sides& sides,
                                       float share, float own) const {
  const int centre = column_of(own);
  const Light light = light_around(image, line, centre);
  const auto at = [&](int x) { return light.luma[static_cast<std::size_t>(x - light.first)]; };

  LumaPlace out{own, 0, 0, 0, false};
  out.contrast = contrast_around<kLumaReach_px>(image, line, centre, wide_stripes_);
  float place = own;
  const auto reach_in = [](float free) { return std::clamp(static_cast<int>(free - 2.F), 2, kPlateau_px); };
  std::array<int, 3> last{};
  for (int round = 0; round < 2; ++round) {
    const std::array reach_of{reach_in(sides.free_left_px + (place - own)),
                              reach_in(sides.free_right_px - (place - own))};
    const std::array columns{column_of(place), reach_of[0], reach_of[1]};
    if (round > 0 && columns == last) break;  // it would find the same
    last = columns;
    // Plateaus of both sides, and how strong each channel comes back from this surface.
    std::array<float, 2> measured{};
    std::array<int, 2> samples{};
    std::array<float, 3> amplitude{};
    for (int s = 0; s < 2; ++s) {
      const int direction = s == 0 ? -1 : 1;
      const int middle = columns[0];
      const int reach = reach_of[static_cast<std::size_t>(s)];
      const int run = clear_run(light, middle, direction, reach + 1);
      std::array<float, 3> sum{};
      float level = 0;
      int n = 0;
      for (int i = 2; i <= reach; ++i) {
        const int x = middle + direction * i;
        if (i >= run || x < centre - kReach_px || x > centre + kReach_px) break;
        const auto i_light = static_cast<std::size_t>(x - light.first);
        sum[0] += light.red[i_light];
        sum[1] += light.green[i_light];
        sum[2] += light.blue[i_light];
        level += at(x);
        ++n;
      }
      samples[static_cast<std::size_t>(s)] = n;
      if (n == 0) {
        if (!sides.narrow) continue;
        // Between two steps: the nearest sample still tells the surface's channels, but no level.
        const auto nearest = static_cast<std::size_t>(middle + direction - light.first);
        const std::array channels{light.red[nearest], light.green[nearest], light.blue[nearest]};
        for (std::size_t c = 0; c < 3; ++c) amplitude[c] = std::max(amplitude[c], std::fabs(channels[c]));
        continue;
      }
      measured[static_cast<std::size_t>(s)] = level / static_cast<float>(n);
      for (std::size_t c = 0; c < 3; ++c)
        amplitude[c] = std::max(amplitude[c], std::fabs(sum[c]) / static_cast<float>(n));
    }
    // Expected levels: this surface's channels under the code's colours. A surface in the projector's white
    // light alone would have `share`.
    float total = 0;
    for (std::size_t c = 0; c < 3; ++c) total += luma_[c] * amplitude[c];
    if (!(total > 0)) return out;
    std::array<float, 2> expected{};
    for (std::size_t s = 0; s < 2; ++s) {
      const Primary colour = sides.colours[s];
      for (std::size_t c = 0; c < 3; ++c) {
        const float part = luma_[c] * amplitude[c] * share / total;
        expected[s] += (colour >> c & 1) ? part : -part;
      }
    }
    std::array<float, 2> levels{};
    for (std::size_t s = 0; s < 2; ++s) {
      const float off = measured[1 - s] - expected[1 - s];
      if (samples[s] > 0) {
        levels[s] = std::clamp(measured[s], expected[s] - kLevelSlack, expected[s] + kLevelSlack);
      } else {
        levels[s] = expected[s] + (samples[1 - s] > 0 ? std::clamp(off, -kLevelSlack, kLevelSlack) : 0);
      }
    }
    const float middle = 0.5F * (levels[0] + levels[1]);
    float nearest = kFarthest_px;
    bool found = false;
    for (int x = centre - 4; x < centre + 4; ++x) {
      const float a = at(x) - middle;
      const float b = at(x + 1) - middle;
      if ((a > 0) == (b > 0) || (b > a) != (levels[1] > levels[0])) continue;
      const float column = static_cast<float>(x) - a / (b - a);
      if (std::fabs(column - place) >= nearest) continue;
      nearest = std::fabs(column - place);
      out.column_px = column;
      out.slope = std::fabs(b - a);
      found = true;
    }
    out.rise = levels[1] - levels[0];
    out.found = found;
    if (!found) return out;
    place = out.column_px;
  }
  return out;
}

void Refiner::look_around(const DifferenceImage& image, int line, Edge& edge) const {
  const int centre = column_of(edge.column_px);
  if (centre < kReach_px || centre + kReach_px >= image.width) return;
  edge.contrast = contrast_around<kContrastReach_px>(image, line, centre, wide_stripes_);
  // The line alone has no more contrast than it has with its neighbours.
  edge.at_step =
      edge.contrast >= kStepContrast && steepest_at(image.white_line(line), centre, edge.column_px);
}

Refiner::Place Refiner::find(const DifferenceImage& image, int line, float column_px,
                             const Sides& sides) const {
  const int centre = column_of(column_px);
  if (centre < kReach_px || centre + kReach_px >= image.width) return {column_px, 0, false, false};
  const LumaPlace luma = luma_place(
      image, line, {sides.free_left_px, sides.free_right_px, sides.colours, true}, share_, column_px);
  if (std::fabs(luma.rise) < kLeastRise) return {column_px, 0, false, false};
  if (!luma.found || luma.slope < kLeastSlope * std::fabs(luma.rise)) return {column_px, 0, false, true};
  const float sigma = luma_sigma(image, line, luma);
  const float level =
      kLevelShare * contrast_around<kLumaReach_px>(image, line, centre, wide_stripes_) / luma.slope;
  return {luma.column_px, std::sqrt(sigma * sigma + level * level), true, true};
}

void Refiner::refine_edge(const DifferenceImage& image, int line, const LumaPlace& luma, const Drawn& drawn,
                          Edge& edge) const {
  const float own = edge.column_px;
  const float colour_noise = edge.sigma_px * edge.sigma_px + drawn.always_px * drawn.always_px;
  const float colour_bias = drawn.by_contrast_px * edge.contrast;
  const float w_colour = 1 / (colour_noise + colour_bias * colour_bias);
  float w_luma = 0;
  float noise = colour_noise;
  float pure_weight = 1 / colour_noise;
  if (luma.found) {
    const float sigma = luma_sigma(image, line, luma);
    const float luma_bias = kLevelShare * luma.contrast / luma.slope;
    pure_weight += 1 / (sigma * sigma);
    noise += sigma * sigma;
    w_luma = 1 / (sigma * sigma + luma_bias * luma_bias);
    edge.column_px = (w_luma * luma.column_px + w_colour * own) / (w_luma + w_colour);
  }
  // Where the two disagree by more than they should, neither is as good as it looks.
  const float apart =
      luma.found
          ? kApartShare * std::max(0.F, std::fabs(luma.column_px - own) - kApartNoise * std::sqrt(noise))
          : kNoLuma_px + kNoLumaContrast_px * edge.contrast;
  edge.sigma_px = std::sqrt(1 / (w_luma + w_colour) + apart * apart + kModel_px * kModel_px);
  edge.noise_px = 1 / std::sqrt(pure_weight);
}

float Refiner::luma_sigma(const DifferenceImage& image, int line, const LumaPlace& luma) const {
  const int x = std::clamp(column_of(luma.column_px), 0, image.width - 1);
  const float noise = image.noise_at(line, x) *
                      std::sqrt(luma_[0] * luma_[0] + luma_[1] * luma_[1] + luma_[2] * luma_[2]) /
                      (image.white_line(line)[x] + kDark);
  return kLumaFactor * noise / luma.slope;
}

/// Share of the projector's light in what the frame shows: the rest is ambient. The median of the luma steps
/// over those that white light alone would show.
float Refiner::projected_share(const DifferenceImage& image, const SequenceResult& result,
                               const std::vector<std::array<Primary, 2>>& colours,
                               const EdgeImage& edges) const {
  constexpr int kBins = 64;
  constexpr int kSide_px = 3;
  constexpr std::uint32_t kEvery = 3;
  constexpr int kEveryLine = 3;
  std::array<std::uint32_t, kBins> histogram{};
  std::uint32_t total = 0;
  for (int line = 0; line < edges.lines; line += kEveryLine) {
    const float* d = image.line(line);
    const float* white = image.white_line(line);
    for (std::uint32_t e = edges.line_start[static_cast<std::size_t>(line)];
         e < edges.line_start[static_cast<std::size_t>(line) + 1]; e += kEvery) {
      if (result.boundary[e] < 0) continue;
      const auto [left, right] = colours[static_cast<std::size_t>(result.boundary[e])];
      const float step = ratio_[right] - ratio_[left];
      const int centre = column_of(edges.edges[e].column_px);
      if (std::fabs(step) < 0.5F || centre < kSide_px || centre + kSide_px >= image.width) continue;
      const auto ratio = [&](int x) {
        return (luma_[0] * d[x] + luma_[1] * d[image.width + x] + luma_[2] * d[2 * image.width + x]) /
               (white[x] + kDark);
      };
      const float share = (ratio(centre + kSide_px) - ratio(centre - kSide_px)) / step;
      ++histogram[static_cast<std::size_t>(std::clamp(share, 0.F, 0.999F) * kBins)];
      ++total;
    }
  }
  std::uint32_t seen = 0;
  for (std::size_t i = 0; i < kBins; ++i) {
    seen += histogram[i];
    if (total > 0 && seen * 2 >= total) return (static_cast<float>(i) + 0.5F) / kBins;
  }
  return 1;
}

/// How far blurred chroma draws colour's place from luma's, in the frame at hand.
Refiner::Drawn Refiner::colour_drawn(const DifferenceImage& image, const EdgeImage& edges) {
  const auto median = [](std::vector<float>& values) {
    if (values.empty()) return 0.F;
    const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
    std::nth_element(values.begin(), middle, values.end());
    return *middle;
  };
  always_.clear();
  by_contrast_.clear();
  for (int line = 0; line < edges.lines; ++line) {
    for (std::uint32_t e = edges.line_start[static_cast<std::size_t>(line)];
         e < edges.line_start[static_cast<std::size_t>(line) + 1]; ++e) {
      const LumaPlace& luma = places_[e];
      if (!luma.found) continue;
      const Edge& edge = edges.edges[e];
      const float sigma = luma_sigma(image, line, luma);
      const float apart = luma.column_px - edge.column_px;
      const float excess = apart * apart - sigma * sigma - edge.sigma_px * edge.sigma_px;
      if (edge.contrast < kPlain) {
        always_.push_back(excess);
      } else if (edge.contrast > kContrasty && luma.slope > kSteep) {
        const float level = kLevelShare * luma.contrast / luma.slope;
        by_contrast_.push_back((excess - level * level) / (edge.contrast * edge.contrast));
      }
    }
  }
  return {std::sqrt(std::max(0.F, median(always_)) * kVarianceOfMedian),
          std::clamp(kDrawnTogether * std::sqrt(std::max(0.F, median(by_contrast_)) * kVarianceOfMedian),
                     kLeastColourBias_px, kMostColourBias_px)};
}

void Refiner::refine(const DifferenceImage& image, View8 slide, const SequenceResult& result,
                     const std::vector<std::array<Primary, 2>>& colours, WorkerPool& pool, EdgeImage& edges) {
  share_ = projected_share(image, result, colours, edges);
  wide_stripes_ = usual_stripe_px(result, edges) > kWideStripe_px;
  places_.assign(edges.edges.size(), {});
  pool.for_ranges(edges.lines, [&](int begin_line, int end_line, int) {
    for (int line = begin_line; line < end_line; ++line) {
      const std::uint32_t begin = edges.line_start[static_cast<std::size_t>(line)];
      const std::uint32_t end = edges.line_start[static_cast<std::size_t>(line) + 1];
      for (std::uint32_t e = begin; e < end; ++e) {
        if (result.boundary[e] < 0) continue;
        const float own = edges.edges[e].column_px;
        if (own < kReach_px || own + kReach_px + 1 > static_cast<float>(image.width)) continue;
        const float left = e > begin ? edges.edges[e - 1].column_px : own - 100;
        const float right = e + 1 < end ? edges.edges[e + 1].column_px : own + 100;
        look_around(image, line, edges.edges[e]);
        places_[e] = luma_place(
            image, line, {own - left, right - own, colours[static_cast<std::size_t>(result.boundary[e])]},
            share_, own);
      }
    }
  });
  const Drawn drawn = colour_drawn(image, edges);
  pool.for_ranges(edges.lines, [&](int begin_line, int end_line, int) {
    for (int line = begin_line; line < end_line; ++line)
      for (std::uint32_t e = edges.line_start[static_cast<std::size_t>(line)];
           e < edges.line_start[static_cast<std::size_t>(line) + 1]; ++e)
        if (result.boundary[e] >= 0) {
          Edge& edge = edges.edges[e];
          refine_edge(image, line, places_[e], drawn, edge);
          if (edge.contrast > kStepContrast) {
            edge.above_differs = line > 0 && !same_surface(slide, line, line - 1, edge.column_px);
            edge.below_differs =
                line + 1 < slide.height && !same_surface(slide, line, line + 1, edge.column_px);
          }
        }
  });
}

}  // namespace relievo
