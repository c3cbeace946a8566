// SPDX-License-Identifier: Apache-2.0
#include "capture/reconstruct/refine.h"

#include <algorithm>
#include <cmath>

#include "capture/reconstruct/place_rules.h"

namespace relievo {

using namespace place_rules;

namespace {

constexpr float kModel_px = 0.003F;  // of any place: an edge is not quite what its samples tell
constexpr float kAtStep_px = 0.1F;   // and where it lies on a step of the scene
constexpr float kSteep = 0.15F;      // slope of the luma ratio that places a boundary well, a pixel
constexpr float kWideStripe_px = 12.F;
constexpr float kNoEnd_px = 1e4F;     // of a stripe that ends nowhere near
constexpr float kFarApart_px = 1.5F;  // colour and luma that do not tell the blur of chroma
constexpr float kMostCost_px = 0.5F;
constexpr float kKeptOfCost = 0.9F;       // from frame to frame: the camera stays what it is
constexpr std::size_t kLeastOfBlur = 40;  // edges that tell it
constexpr std::size_t kMostOfBlur = 128;
constexpr int kShareEvery = 3;           // edges and lines that tell the ambient light
constexpr float kShareOfNone = 0.68F;    // projected share, as blur leaves it, where no light is ambient
constexpr int kRowReach_px = 4;          // columns compared with the lines above and below
constexpr float kRowStep = 0.12F;        // difference, of the sum, that is another surface's
constexpr float kRowNoise = 3.F;         // grey levels more: noise
constexpr float kSharpContrast = 0.08F;  // from which on a low-pass would draw luma's place
constexpr float kSharpLevelShare = 0.1F;
constexpr float kSharpNoise = 1.63F;  // of luma without the low-pass along the line, by that with it

/// True where the steepest place of a step of `white` around `column_px` is there.
bool steepest_at(const float* white, int centre, float column_px) {
  const auto [darkest, brightest] =
      std::minmax_element(white + centre - kContrastReach_px, white + centre + kContrastReach_px + 1);
  if (*brightest - *darkest < kStepContrast * (*brightest + *darkest + kDarkSum)) return false;
  return std::fabs(steepest_place_px(white, centre, kContrastReach_px) - column_px) < kStepNear_px;
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

Refiner::Refiner(const std::array<double, 9>& colour_matrix)
    : placer_(colour_matrix), shift_(colour_matrix) {}

float Refiner::ambient() const {
  // Two fields show the projector's light once and the ambient light twice.
  const float projected = std::min(1.F, share_ / kShareOfNone);
  return (1 - projected) / (1 + projected);
}

Refiner::Place Refiner::find(const DifferenceImage& image, int line, float column_px,
                             const Sides& sides) const {
  const int centre = column_of(column_px);
  if (centre < kLumaReach_px || centre + kLumaReach_px >= image.width || image.width < 16)
    return {column_px, 0, false, false};
  LumaQuery query{column_px, sides};
  query.sides.narrow = true;
  const LumaPlace luma = placer_.place(image, line, share_, query);
  if (std::fabs(luma.rise) < kLeastRise) return {column_px, 0, false, false};
  if (!luma.found || luma.slope < kLeastSlope * std::fabs(luma.rise)) return {column_px, 0, false, true};
  const float sigma = placer_.sigma_px(image, line, luma);
  const float level =
      kLevelShare * contrast_around(image, line, centre, kLumaContrast_px, wide_stripes_) / luma.slope;
  return {luma.column_px, std::hypot(sigma, level, scatter_.luma_px()), true, true};
}

/// What is around an edge, into it and `out`; `luma` is where luma has it.
void Refiner::look_at(const DifferenceImage& image, int line, const LumaLine& light, const LumaPlace& luma,
                      bool sharp, Edge& edge, LumaSeen& out) const {
  const int centre = column_of(edge.column_px);
  if (centre + kLumaReach_px < image.width) {
    edge.contrast = light.contrast(centre);
    // The line alone has no more contrast than it has with its neighbours.
    edge.at_step =
        edge.contrast >= kStepContrast && steepest_at(image.white_line(line), centre, edge.column_px);
  }
  if (!luma.found) return;
  const float sigma = placer_.sigma_px(image, line, luma) * (sharp ? kSharpNoise : 1.F);
  const float level = (sharp ? kSharpLevelShare : kLevelShare) * light.luma_contrast(centre) / luma.slope;
  out = {luma.column_px, sigma, level, luma.slope > kSteep, true};
}

ShiftQuery Refiner::shift_query(const DifferenceImage& image, int line, const SequenceResult& result,
                                const std::vector<std::array<Primary, 2>>& colours, const EdgeImage& edges,
                                std::uint32_t e) {
  const auto own = static_cast<std::size_t>(result.boundary[e]);
  ShiftQuery query{image.white_line(line),
                   image.width,
                   edges.edges[e].column_px,
                   colours[own],
                   kNoEnd_px * -1,
                   kNoEnd_px,
                   colours[own]};
  const bool left = e > edges.line_start[static_cast<std::size_t>(line)] && own > 0 &&
                    result.boundary[e - 1] + 1 == result.boundary[e];
  const bool right = e + 1 < edges.line_start[static_cast<std::size_t>(line) + 1] &&
                     result.boundary[e + 1] == result.boundary[e] + 1;
  if (left) {
    query.left_end_px = edges.edges[e - 1].column_px;
    query.beyond_colours[0] = colours[own - 1][0];
  }
  if (right) {
    query.right_end_px = edges.edges[e + 1].column_px;
    query.beyond_colours[1] = colours[own + 1][1];
  }
  return query;
}

/// The blur by which zero crossings would be drawn off luma's places as they are, in this frame and, ever
/// less, those before. Where little tells it, it stays as it was.
void Refiner::find_blur(const DifferenceImage& image, const SequenceResult& result,
                        const std::vector<std::array<Primary, 2>>& colours, const EdgeImage& edges,
                        WorkerPool& pool) {
  std::size_t total = 0;
  for (const Scratch& of : scratch_) total += of.tell_blur.size();
  if (total < kLeastOfBlur) return;
  const std::size_t every = std::max(std::size_t{1}, total / kMostOfBlur);
  tell_blur_.clear();
  std::size_t seen = 0;
  for (const Scratch& of : scratch_)
    for (const auto [line, e] : of.tell_blur)
      if (seen++ % every == 0) tell_blur_.push_back({line, e, {}});
  pool.for_ranges(static_cast<int>(tell_blur_.size()), [&](int begin, int end, int) {
    for (auto i = static_cast<std::size_t>(begin); i < static_cast<std::size_t>(end); ++i) {
      auto& [line, e, costs] = tell_blur_[i];
      const ShiftQuery query = shift_query(image, line, result, colours, edges, e);
      const float apart = edges.edges[e].column_px - seen_[e].column_px;
      for (std::size_t b = 0; b < costs.size(); ++b)
        costs[b] = std::min(kMostCost_px, std::fabs(apart - shift_.shift_px(query, b)));
    }
  });
  for (std::size_t b = 0; b < blur_cost_.size(); ++b) {
    blur_cost_[b] *= kKeptOfCost;
    for (const TellsBlur& edge : tell_blur_) blur_cost_[b] += edge.costs[b];
  }
  blur_ =
      static_cast<std::size_t>(std::min_element(blur_cost_.begin(), blur_cost_.end()) - blur_cost_.begin());
}

/// As LumaPlacer::places(), by luma without a low-pass along the line.
void Refiner::place_sharply(int line, int width, Scratch& scratch) const {
  constexpr int kMargin = LumaView::kMargin;
  Placing& placing = scratch.sharply;
  scratch.sharp_ratio.assign(static_cast<std::size_t>(width + 2 * kMargin), 0);
  float* ratio = scratch.sharp_ratio.data() + kMargin;
  // The columns around each, what several have in common once.
  int from = 0;
  int to = 0;
  for (const LumaQuery& query : placing.queries) {
    const int first = column_of(query.own_px) - kLumaReach_px - 1 - kMargin;
    const int begin = std::max(first < from ? 0 : to, first);
    from = first;
    to = std::min(width, first + 2 * (kLumaReach_px + 1 + kMargin));
    if (begin < to) sharp_->ratio(line, begin, to - begin, kDarkSum, ratio + begin);
  }
  LumaView view = scratch.light.view();
  view.luma = ratio;
  luma_kernels().places(view, {placer_.weights(), share_}, placing.queries.data(),
                        static_cast<int>(placing.queries.size()), placing.places.data());
}

void Refiner::look_at_line(const DifferenceImage& image, int line, const SequenceResult& result,
                           const std::vector<std::array<Primary, 2>>& colours, int worker, EdgeImage& edges) {
  const std::uint32_t begin = edges.line_start[static_cast<std::size_t>(line)];
  const std::uint32_t end = edges.line_start[static_cast<std::size_t>(line) + 1];
  if (begin == end) return;
  Scratch& scratch = scratch_[static_cast<std::size_t>(worker)];
  for (Placing* placing : {&scratch.plainly, &scratch.sharply}) {
    placing->edges.clear();
    placing->queries.clear();
  }
  placer_.read_line(image, line, wide_stripes_, scratch.light);
  for (std::uint32_t e = begin; e < end; ++e) {
    seen_[e].found = false;
    if (result.boundary[e] < 0) continue;
    const float own = edges.edges[e].column_px;
    if (own < kLumaReach_px || own + kLumaReach_px + 1 > static_cast<float>(image.width)) continue;
    const int centre = column_of(own);
    // What moves leaves stripes in the fields' sum, and the scene only seems to have contrast.
    const bool sharp = sharp_ != nullptr && !wide_stripes_ && result.still[e] != 0 &&
                       centre + kLumaReach_px < image.width &&
                       scratch.light.contrast(centre) > kSharpContrast;
    Placing& placing = sharp ? scratch.sharply : scratch.plainly;
    placing.edges.push_back(e);
    // Written where it stays: a copy of what was just written in parts would wait for it.
    LumaQuery& query = placing.queries.emplace_back();
    query.own_px = own;
    query.sides.free_left_px = e > begin ? own - edges.edges[e - 1].column_px : 100;
    query.sides.free_right_px = e + 1 < end ? edges.edges[e + 1].column_px - own : 100;
    query.sides.colours = colours[static_cast<std::size_t>(result.boundary[e])];
  }
  for (Placing* placing : {&scratch.plainly, &scratch.sharply}) {
    const std::size_t count = placing->edges.size();
    if (count == 0) continue;
    placing->places.resize(count);
    const bool sharp = placing == &scratch.sharply;
    if (sharp) {
      place_sharply(line, image.width, scratch);
    } else {
      placer_.places(scratch.light, share_, placing->queries.data(), count, placing->places.data());
    }
    for (std::size_t i = 0; i < count; ++i) {
      const std::uint32_t e = placing->edges[i];
      look_at(image, line, scratch.light, placing->places[i], sharp, edges.edges[e], seen_[e]);
    }
  }
  for (std::uint32_t e = begin; e < end; ++e) {
    const Edge& edge = edges.edges[e];
    // What moves is off for other reasons.
    if (seen_[e].found && result.still[e] != 0 && edge.contrast > kContrasty &&
        std::fabs(seen_[e].column_px - edge.column_px) < kFarApart_px)
      scratch.tell_blur.push_back({line, e});
  }
}

void Refiner::refine_edge(const LumaSeen& luma, const ColourAndLumaErrors& errors, Edge& edge) {
  const float own = edge.column_px;
  const float colour_noise = squared(edge.sigma_px) + squared(errors.colour.px);
  const float w_colour = 1 / (colour_noise + squared(errors.colour.by_contrast_px * edge.contrast));
  float w_luma = 0;
  float noise = colour_noise;
  float pure_weight = 1 / colour_noise;
  if (luma.found) {
    const float variance = squared(luma.sigma_px) + squared(errors.luma.px);
    pure_weight += 1 / variance;
    noise += variance;
    w_luma = 1 / (variance + squared(luma.level_px) + squared(errors.luma.by_contrast_px * edge.contrast));
    edge.column_px = (w_luma * luma.column_px + w_colour * own) / (w_luma + w_colour);
  }
  // Where the two disagree by more than they should, neither is as good as it looks.
  const float apart =
      luma.found
          ? kApartShare * std::max(0.F, std::fabs(luma.column_px - own) - kApartNoise * std::sqrt(noise))
          : kNoLuma_px + kNoLumaContrast_px * edge.contrast;
  const float model = edge.at_step ? kAtStep_px : kModel_px;
  edge.sigma_px = std::sqrt(1 / (w_luma + w_colour) + squared(apart) + squared(model));
  edge.noise_px = 1 / std::sqrt(pure_weight);
}

void Refiner::refine(const DifferenceImage& image, View8 slide, const SequenceResult& result,
                     const std::vector<std::array<Primary, 2>>& colours, WorkerPool& pool, EdgeImage& edges,
                     const SharpLuma* sharp) {
  sharp_ = sharp;
  const std::array<float, 3>& luma = placer_.weights();
  share_ = projected_share(placer_, result, colours, edges, image.width, kShareEvery, [&](int line, int x) {
    const float* d = image.line(line);
    return (luma[0] * d[x] + luma[1] * d[image.width + x] + luma[2] * d[2 * image.width + x]) /
           (image.white_line(line)[x] + kDarkSum);
  });
  wide_stripes_ = usual_stripe_px(result, edges) > kWideStripe_px;
  seen_.resize(edges.edges.size());
  scratch_.resize(static_cast<std::size_t>(pool.workers()));
  for (Scratch& of : scratch_) of.tell_blur.clear();
  scatter_.begin(pool.workers());
  pool.for_shares(edges.line_start, [&](int begin, int end, int worker) {
    for (int line = begin; line < end; ++line) {
      look_at_line(image, line, result, colours, worker, edges);
      scatter_.line(edges, result, seen_, line, worker);
    }
  });
  scatter_.settle_plain(pool);
  find_blur(image, result, colours, edges, pool);
  pool.for_shares(edges.line_start, [&](int begin, int end, int worker) {
    for (int line = begin; line < end; ++line)
      for (std::uint32_t e = edges.line_start[static_cast<std::size_t>(line)];
           e < edges.line_start[static_cast<std::size_t>(line) + 1]; ++e) {
        if (result.boundary[e] < 0) continue;
        Edge& edge = edges.edges[e];
        const float noise =
            image.noise / (image.white_line(line)[column_of(edge.column_px)] + kDarkSum);  // a contrast, too
        if (edge.contrast > noise && result.still[e] != 0)
          edge.column_px -= (1 - squared(noise / edge.contrast)) *
                            shift_.shift_px(shift_query(image, line, result, colours, edges, e), blur_);
        scatter_.apart(edge, seen_[e], result.still[e] != 0, worker);
      }
  });
  const PlaceScatter::Errors errors = scatter_.errors(pool);
  pool.for_shares(edges.line_start, [&](int begin_line, int end_line, int) {
    for (int line = begin_line; line < end_line; ++line)
      for (std::uint32_t e = edges.line_start[static_cast<std::size_t>(line)];
           e < edges.line_start[static_cast<std::size_t>(line) + 1]; ++e)
        if (result.boundary[e] >= 0) {
          Edge& edge = edges.edges[e];
          refine_edge(seen_[e], result.still[e] != 0 ? errors.still : errors.moving, edge);
          if (edge.contrast > kStepContrast) {
            edge.above_differs = line > 0 && !same_surface(slide, line, line - 1, edge.column_px);
            edge.below_differs =
                line + 1 < slide.height && !same_surface(slide, line, line + 1, edge.column_px);
          }
        }
  });
}

}  // namespace relievo
