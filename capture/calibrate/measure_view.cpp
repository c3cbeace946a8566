// SPDX-License-Identifier: Apache-2.0
#include "capture/calibrate/measure_view.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>
#include <limits>
#include <utility>

#include "capture/calibrate/local_homography.h"

namespace relievo {
namespace {

constexpr std::size_t kLeastCorners = 8;
// Radii around a corner, times the distance to its neighbours: stripes may be as wide as a square.
constexpr double kRadii[] = {1, 1.5, 2.25};

/// The smallest distance to another corner, camera pixels.
double spacing(const std::vector<BoardCorner>& corners, std::size_t i) {
  double least = std::numeric_limits<double>::infinity();
  for (std::size_t j = 0; j < corners.size(); ++j) {
    if (j == i) continue;
    least = std::min(least, std::hypot(corners[j].camera_px[0] - corners[i].camera_px[0],
                                       corners[j].camera_px[1] - corners[i].camera_px[1]));
  }
  return least;
}

void add(ImageF& sum, const Image8& grey) {
  for (std::size_t i = 0; i < sum.size(); ++i) sum.data()[i] += static_cast<float>(grey.data()[i]);
}

void add_rgb(ImageF& sum, const Image8& rgb) {
  const std::uint8_t* p = rgb.data();
  for (std::size_t i = 0; i < sum.size(); ++i, p += 3)
    sum.data()[i] += static_cast<float>(p[0] + 2 * p[1] + p[2]);
}

/// The sum of all pictures: a slide and its inverse together light everything once, so the code vanishes, and
/// most of the noise.
ImageF even_light(const GrayStack& stack) {
  ImageF out(stack.width(), stack.height(), 1);
  for (const auto* pairs : {&stack.columns, &stack.rows}) {
    for (const GrayPair& pair : *pairs) {
      add(out, pair.lit);
      add(out, pair.inverse);
    }
  }
  return out;
}

ImageF even_light(const StripeStack& stack) {
  ImageF out(stack.width(), stack.height(), 1);
  for (const auto* pairs : {&stack.columns, &stack.rows}) {
    for (const StripePair& pair : *pairs) {
      add_rgb(out, pair.lit);
      add_rgb(out, pair.complement);
    }
  }
  return out;
}

/// What the projector changes where it is bright, of 255: the 98th percentile of the difference of the
/// coarsest bit's pictures.
int brightest_change(const GrayStack& stack) {
  const GrayPair& pair = stack.columns.back();
  std::array<std::size_t, 256> histogram{};
  for (std::size_t i = 0; i < pair.lit.size(); ++i)
    ++histogram[static_cast<std::size_t>(std::abs(pair.lit.data()[i] - pair.inverse.data()[i]))];
  std::size_t above = 0;
  int change = 255;
  for (; change > 0 && 50 * above < pair.lit.size(); --change)
    above += histogram[static_cast<std::size_t>(change)];
  return change;
}

MeasuredView without(const std::string& name, std::string why) {
  return {.name = name, .corners = {}, .refused = std::move(why)};
}

std::string no_board(const Board& board, std::size_t seen) {
  if (!board.charuco()) return "the whole board is not seen in the pictures";
  return "only " + std::to_string(seen) +
         " corners of the board are seen in the pictures; is it the board and the dictionary given?";
}

MeasuredView with_projector(const std::string& name, const std::vector<BoardCorner>& seen, const Board& board,
                            const ProjectorEdges& edges) {
  MeasuredView view{.name = name, .corners = {}, .refused = {}};
  for (std::size_t i = 0; i < seen.size(); ++i) {
    for (const double times : kRadii) {
      const auto projected = project_corner(edges, seen[i].camera_px, times * spacing(seen, i));
      if (!projected) continue;
      view.corners.push_back({board.corner_m(seen[i].index), seen[i].camera_px, projected->projector_px});
      break;
    }
  }
  if (view.corners.size() < kLeastCorners || 4 * view.corners.size() < 3 * seen.size()) {
    view.refused =
        "only " + std::to_string(view.corners.size()) + " of " + std::to_string(seen.size()) +
        " corners could be decoded; is the projector's light on the whole board, and its size right?";
  }
  return view;
}

}  // namespace

MeasuredView measure_view(const std::string& name, const GrayStack& stack, const Board& board,
                          const GrayDecodeOptions& options, WorkerPool& pool) {
  const auto seen = find_board(even_light(stack), board);
  if (seen.size() < kLeastCorners) return without(name, no_board(board, seen.size()));
  GrayDecodeOptions whole = options;
  whole.window_px = 0;  // the edges are what is needed
  // Of dim pictures less is asked: a black square reflects a tenth of what white does.
  whole.min_contrast =
      std::clamp(brightest_change(stack) * 3 / 20, std::min(6, options.min_contrast), options.min_contrast);
  auto maps = decode_gray(stack, whole, pool);
  if (!maps) return without(name, maps.error().message);
  // Its corners would fit: they are where they were projected. The stripes of the running system would not
  // be.
  if (std::string why = beyond_projector(stack, *maps); !why.empty()) return without(name, std::move(why));
  return with_projector(
      name, seen, board,
      {stack.width(), stack.height(), std::move(maps->column_edges), std::move(maps->row_edges)});
}

MeasuredView measure_view(const std::string& name, const StripeStack& stack, const Board& board,
                          const CameraColours& colours, WorkerPool& pool) {
  const auto seen = find_board(even_light(stack), board);
  if (seen.size() < kLeastCorners) return without(name, no_board(board, seen.size()));
  auto edges = decode_stripes(stack, colours, pool);
  if (!edges) return without(name, edges.error().message);
  return with_projector(name, seen, board, *edges);
}

}  // namespace relievo
