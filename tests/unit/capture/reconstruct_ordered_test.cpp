// SPDX-License-Identifier: Apache-2.0
// The ordered decoder's stages on lines made by hand, and the whole of it on simulated scenes.
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <random>

#include "capture/pattern/bcsl.h"
#include "capture/reconstruct/consistency.h"
#include "capture/reconstruct/edges.h"
#include "capture/reconstruct/field_difference.h"
#include "capture/reconstruct/reconstructor.h"
#include "capture/reconstruct/refine.h"
#include "capture/reconstruct/sequence.h"
#include "tests/support/striped_scene.h"

namespace relievo {
namespace {

constexpr int kLines = 30;
constexpr int kWidth = 400;
constexpr float kSpacing_px = 8;
constexpr std::array<double, 9> kPlain{1, 0, 0, 0, 1, 0, 0, 0, 1};

struct Placed {
  int boundary;  // -1: an edge that no boundary made
  float column_px;
};

/// Boundaries [first, last] from `column_px` on, one every kSpacing_px.
std::vector<Placed> run(int first, int last, float column_px) {
  std::vector<Placed> out;
  for (int b = first; b <= last; ++b) {
    out.push_back({b, column_px + static_cast<float>(b - first) * kSpacing_px});
  }
  return out;
}

SideEvidence evidence(Primary colour) {
  return {colour & 1 ? 1.F : -1.F, colour & 2 ? 1.F : -1.F, colour & 4 ? 1.F : -1.F};
}

/// Stripes to the left and right of a line's edge k. At an edge that no boundary made, those of its
/// neighbours: a depth step's own edge, or within one stripe nothing.
std::array<int, 2> stripes_beside(const std::vector<Placed>& line, std::size_t k) {
  if (line[k].boundary >= 0) return {line[k].boundary, line[k].boundary + 1};
  return {line[k - 1].boundary + 1, line[k + 1].boundary};
}

/// The same line kLines times, under `slide`.
EdgeImage edges_of(const Pattern& pattern, int slide, const std::vector<Placed>& line) {
  EdgeImage out;
  out.lines = kLines;
  out.line_start = {0};
  for (int l = 0; l < kLines; ++l) {
    for (std::size_t k = 0; k < line.size(); ++k) {
      Edge edge;
      edge.column_px = line[k].column_px;
      edge.sigma_px = edge.noise_px = 0.02F;
      edge.slope = 20;
      edge.left_reach_px = edge.right_reach_px = 3;
      const auto [left, right] = stripes_beside(line, k);
      edge.left = evidence(pattern.colour(left, slide));
      edge.right = evidence(pattern.colour(right, slide));
      if (left == right) {  // noise
        edge.left = {0.3F, -0.2F, 0.3F};
        edge.right = {-0.3F, 0.3F, 0.2F};
      }
      out.edges.push_back(edge);
    }
    out.line_start.push_back(static_cast<std::uint32_t>(out.edges.size()));
  }
  return out;
}

/// What a frame under `slide` shows of the line: flat stripes of +-100 and a white sum of 100.
DifferenceImage picture_of(const Pattern& pattern, int slide, const std::vector<Placed>& line) {
  DifferenceImage out;
  out.width = kWidth;
  out.lines = kLines;
  out.noise = 0.5F;
  out.values.assign(static_cast<std::size_t>(kLines * 3 * kWidth), 0);
  out.white.assign(static_cast<std::size_t>(kLines * kWidth), 100);
  for (int x = 0; x < kWidth; ++x) {
    int stripe = line.front().boundary;
    for (std::size_t k = 0; k < line.size(); ++k) {
      if (line[k].column_px <= static_cast<float>(x)) stripe = stripes_beside(line, k)[1];
    }
    const SideEvidence e = evidence(pattern.colour(stripe, slide));
    for (int l = 0; l < kLines; ++l) {
      for (int c = 0; c < 3; ++c)
        out.values[static_cast<std::size_t>((l * 3 + c) * kWidth + x)] = 100 * e[static_cast<std::size_t>(c)];
    }
  }
  return out;
}

/// A slide's field in which lines do not differ.
const Image8& grey_slide() {
  static const Image8 picture = [] {
    Image8 out(kWidth, kLines, 3);
    for (int line = 0; line < kLines; ++line) std::fill_n(out.row(line), 3 * kWidth, std::uint8_t{100});
    return out;
  }();
  return picture;
}

Pattern sixty_stripes() {
  return *make_pattern(6, 2, 200, 60);
}

/// Decodes `line`, seen under slide 1, with `other_line` as slide 2's frame saw it.
SequenceResult decode(const std::vector<Placed>& line, const std::vector<Placed>& other_line,
                      const std::vector<Placed>& same_line, const Backdrop* backdrop = nullptr) {
  const Pattern pattern = sixty_stripes();
  const DifferenceImage other = picture_of(pattern, 1, other_line);
  const DifferenceImage same = picture_of(pattern, 0, same_line);
  WorkerPool pool(1);
  SequenceDecoder decoder(pattern);
  SequenceResult result;
  decoder.decode(edges_of(pattern, 0, line),
                 {.order = SlideOrder::kNewerIsFirst, .other = &other, .same = &same, .backdrop = backdrop},
                 pool, result);
  return result;
}

void expect_decoded(const std::vector<Placed>& line, const SequenceResult& result) {
  ASSERT_EQ(result.boundary.size(), line.size() * kLines);
  for (std::size_t i = 0; i < result.boundary.size(); ++i)
    ASSERT_EQ(result.boundary[i], line[i % line.size()].boundary) << "edge " << i % line.size();
}

TEST(SequenceDecoder, DecodesALineInOrder) {
  const auto line = run(3, 40, 20);
  expect_decoded(line, decode(line, line, line));
}

TEST(SequenceDecoder, GoesOverMissingBoundaries) {
  const auto whole = run(3, 40, 20);
  auto line = whole;
  line.erase(line.begin() + 20, line.begin() + 22);
  line.erase(line.begin() + 9);
  expect_decoded(line, decode(line, whole, whole));
}

TEST(SequenceDecoder, LeavesFalseEdgesOut) {
  const auto whole = run(3, 40, 20);
  auto line = whole;
  line.insert(line.begin() + 25, {-1, line[24].column_px + 3});
  line.insert(line.begin() + 6, {-1, line[5].column_px + 4});
  expect_decoded(line, decode(line, whole, whole));
}

TEST(SequenceDecoder, JumpsAtADepthStep) {
  auto line = run(3, 15, 20);
  line.push_back({-1, line.back().column_px + 5});
  for (const Placed& p : run(36, 48, 20 + 14 * kSpacing_px)) line.push_back(p);
  expect_decoded(line, decode(line, line, line));
}

TEST(SequenceDecoder, ASurfaceInFrontMayComeOutOfOrder) {
  auto line = run(20, 32, 20);
  line.push_back({-1, line.back().column_px + 5});
  for (const Placed& p : run(1, 12, 20 + 14 * kSpacing_px)) line.push_back(p);
  expect_decoded(line, decode(line, line, line));
}

TEST(SequenceDecoder, DecodesWhatMovedFromItsOwnColours) {
  // 1 m/s in depth at 30 frames a second, 1.2 m away: 5 px a frame.
  const auto line = run(6, 40, 40);
  const SequenceResult result = decode(line, run(6, 40, 35), run(6, 40, 30));
  std::size_t right = 0;
  for (std::size_t i = 0; i < result.boundary.size(); ++i) {
    const int expected = line[i % line.size()].boundary;
    EXPECT_TRUE(result.boundary[i] == expected || result.boundary[i] < 0) << result.boundary[i];
    right += result.boundary[i] == expected;
  }
  EXPECT_GE(right * 10, result.boundary.size() * 9);
}

TEST(SequenceDecoder, WhatHoversBeforeWhatStandsStillIsNotTakenForIt) {
  // An arm, 3 px off the stripes of the wall that it hides, has their colours under the slide shown; when the
  // other slide was, it was elsewhere.
  const auto wall = run(3, 40, 20);
  auto line = wall;
  for (std::size_t k = 16; k < 20; ++k) line[k].column_px += 3;
  Backdrop backdrop(sixty_stripes().boundaries(), kLines);
  const std::vector<std::array<Primary, 2>> colours;
  for (int l = 0; l < kLines; ++l)
    for (const Placed& p : wall)
      backdrop.remember({.field = grey_slide().view(), .colours = colours}, l, p.boundary, p.column_px);
  const SequenceResult unaware = decode(line, wall, wall);
  const SequenceResult aware = decode(line, wall, wall, &backdrop);
  std::size_t mistaken = 0;
  for (std::size_t i = 0; i < aware.boundary.size(); ++i) {
    const std::size_t k = i % line.size();
    if (k < 16 || k >= 20) {
      EXPECT_EQ(aware.boundary[i], wall[k].boundary);
    } else {
      mistaken += unaware.boundary[i] == wall[k].boundary;
      EXPECT_NE(aware.boundary[i], wall[k].boundary) << k;
    }
  }
  EXPECT_GE(mistaken, std::size_t{2 * kLines}) << "there is nothing to mistake";
}

TEST(SequenceDecoder, OneSlideNeedsNoOtherFrame) {
  const Pattern pattern = *make_pattern(6, 1, 2, 20);
  const auto line = run(1, 17, 20);
  WorkerPool pool(1);
  SequenceDecoder decoder(pattern);
  SequenceResult result;
  decoder.decode(edges_of(pattern, 0, line), {.order = SlideOrder::kNewerIsFirst}, pool, result);
  expect_decoded(line, result);
}

TEST(EdgeFinder, FindsASubPixelPlaceAndSaysHowGood) {
  std::mt19937 random(7);
  std::normal_distribution<float> noise(0, 2);
  DifferenceImage image;
  image.width = 60;
  image.lines = 400;
  image.noise = 2;
  for (int l = 0; l < image.lines; ++l) {
    for (int c = 0; c < 3; ++c) {
      for (int x = 0; x < image.width; ++x) {
        const float ramp = std::clamp(20 * (static_cast<float>(x) - 30.3F), -100.F, 100.F);
        image.values.push_back((c == 1 ? 100 : ramp) + noise(random));
      }
    }
  }
  WorkerPool pool(2);
  EdgeImage edges;
  EdgeFinder().find(image, pool, edges);
  ASSERT_EQ(edges.edges.size(), 400U);
  double mean = 0;
  double square = 0;
  for (const Edge& e : edges.edges) {
    mean += e.column_px - 30.3;
    square += (e.column_px - 30.3) * (e.column_px - 30.3);
    EXPECT_LT(e.left[0], -0.9F);
    EXPECT_GT(e.left[1], 0.9F);
    EXPECT_GT(e.right[2], 0.9F);
  }
  EXPECT_NEAR(mean / 400, 0, 0.01);
  EXPECT_NEAR(std::sqrt(square / 400), edges.edges[0].sigma_px, 0.5 * edges.edges[0].sigma_px);
}

TEST(Refiner, TakesASharpLumaStepOverABlurredColour) {
  // The step lies at 200; the blurred colours' crossing was found 0.8 px off.
  const Pattern pattern = sixty_stripes();
  const std::vector<Placed> line{{10, 200}};
  const DifferenceImage image = picture_of(pattern, 0, line);
  EdgeImage edges = edges_of(pattern, 0, {{10, 200.3F}});
  for (Edge& e : edges.edges) e.sigma_px = 0.5F;
  SequenceResult result;
  result.boundary.assign(kLines, 10);
  result.still.assign(kLines, 1);
  WorkerPool pool(1);
  const SequenceDecoder decoder(pattern);
  Refiner(kPlain).refine(image, grey_slide().view(), result, decoder.shown_colours(SlideOrder::kNewerIsFirst),
                         pool, edges);
  for (const Edge& e : edges.edges) {
    EXPECT_NEAR(e.column_px, 199.5, 0.05);  // half way between the last pixel before and the first after
    EXPECT_LT(e.sigma_px, 0.5F);
    EXPECT_EQ(e.contrast, 0);
    EXPECT_FALSE(e.at_step);
  }
}

/// What a frame tells of chroma's blur whose boundaries lie 0.8 px from where luma has them, on shading.
float blur_told(bool still) {
  const Pattern pattern = sixty_stripes();
  DifferenceImage image = picture_of(pattern, 0, {{10, 150}, {11, 250}});
  for (int l = 0; l < kLines; ++l) {
    for (int x = 0; x < kWidth; ++x)
      image.white[static_cast<std::size_t>(l * kWidth + x)] =
          100 + 60 * std::sin(0.02F * std::numbers::pi_v<float> * static_cast<float>(x - 150));
  }
  EdgeImage edges = edges_of(pattern, 0, {{10, 148.7F}, {11, 248.7F}});
  SequenceResult result;
  for (int l = 0; l < kLines; ++l) result.boundary.insert(result.boundary.end(), {10, 11});
  result.still.assign(result.boundary.size(), still ? 1 : 0);
  WorkerPool pool(1);
  const SequenceDecoder decoder(pattern);
  Refiner refiner(kPlain);
  refiner.refine(image, grey_slide().view(), result, decoder.shown_colours(SlideOrder::kNewerIsFirst), pool,
                 edges);
  return refiner.blur_px();
}

TEST(Refiner, WhatMovesDoesNotTellTheBlurOfChroma) {
  const float as_it_was = Refiner(kPlain).blur_px();
  EXPECT_GT(blur_told(true), as_it_was);
  EXPECT_EQ(blur_told(false), as_it_was);
}

TEST(Refiner, SaysWhereTheSceneItselfHasAStep) {
  const Pattern pattern = sixty_stripes();
  DifferenceImage image = picture_of(pattern, 0, {{10, 200}});
  for (int l = 0; l < kLines; ++l) {
    for (int x = 200; x < kWidth; ++x) image.white[static_cast<std::size_t>(l * kWidth + x)] = 30;
  }
  EdgeImage edges = edges_of(pattern, 0, {{10, 199.6F}});
  SequenceResult result;
  result.boundary.assign(kLines, 10);
  result.still.assign(kLines, 1);
  WorkerPool pool(1);
  const SequenceDecoder decoder(pattern);
  Refiner(kPlain).refine(image, grey_slide().view(), result, decoder.shown_colours(SlideOrder::kNewerIsFirst),
                         pool, edges);
  for (const Edge& e : edges.edges) {
    EXPECT_TRUE(e.at_step);
    EXPECT_GT(e.contrast, 0.4F);
    EXPECT_GT(e.sigma_px, 0.1F);
  }
}

struct Surface2D {
  EdgeImage edges;
  SequenceResult result;
};

/// Boundaries 0..19 on kLines lines, leaning a little, with noise.
Surface2D slanted(float noise_px) {
  std::mt19937 random(3);
  std::normal_distribution<float> noise(0, noise_px);
  Surface2D s;
  s.edges = edges_of(sixty_stripes(), 0, run(0, 19, 20));
  for (std::size_t i = 0; i < s.edges.edges.size(); ++i) {
    s.edges.edges[i].column_px += 0.2F * static_cast<float>(i / 20) + noise(random);
    s.edges.edges[i].sigma_px = s.edges.edges[i].noise_px = noise_px;
    s.result.boundary.push_back(static_cast<std::int16_t>(i % 20));
    s.result.still.push_back(1);
  }
  return s;
}

float truth(std::size_t i) {
  return 20 + kSpacing_px * static_cast<float>(i % 20) + 0.2F * static_cast<float>(i / 20);
}

TEST(Consistency, AveragesNoiseAlongTheBoundary) {
  Surface2D s = slanted(0.03F);
  WorkerPool pool(1);
  ConsistencyCheck check;
  EXPECT_EQ(check.check(59, pool, s.result, s.edges).rejected, 0U);
  double square = 0;
  int count = 0;
  for (std::size_t i = 3 * 20; i < (kLines - 3) * 20; ++i, ++count)  // lines with three more on both sides
    square += std::pow(s.edges.edges[i].column_px - truth(i), 2);
  EXPECT_LT(std::sqrt(square / count), 0.017);
}

TEST(Consistency, PutsBackWhatAStepDrewOff) {
  Surface2D s = slanted(0.02F);
  for (int l = 0; l < kLines; ++l) {  // the last boundary before the step: drawn towards it, and known to be
    Edge& e = s.edges.edges[static_cast<std::size_t>(l * 20 + 19)];
    e.column_px += 0.3F;
    e.sigma_px = 0.3F;
  }
  WorkerPool pool(1);
  ConsistencyCheck check;
  EXPECT_EQ(check.check(59, pool, s.result, s.edges).rejected, 0U);
  for (int l = 0; l < kLines; ++l) {
    const auto i = static_cast<std::size_t>(l * 20 + 19);
    EXPECT_NEAR(s.edges.edges[i].column_px, truth(i), 0.2) << l;
    EXPECT_LT(s.edges.edges[i].sigma_px, 0.2F);
  }
}

TEST(Consistency, AmidASurfaceThatHoldsStillMoreDoubtIsLeftThanWhereItMoves) {
  for (const bool still : {true, false}) {
    Surface2D s = slanted(0.02F);
    for (Edge& e : s.edges.edges) e.sigma_px = 0.45F;  // so that none predicts another
    s.result.still.assign(s.result.still.size(), still ? 1 : 0);
    WorkerPool pool(1);
    ConsistencyCheck check;
    check.check(59, pool, s.result, s.edges);
    for (std::size_t i = 0; i < s.result.boundary.size(); ++i) {
      const int b = static_cast<int>(i % 20);
      if (b == 0 || b == 19) continue;  // at an end, where less is allowed
      EXPECT_EQ(s.result.boundary[i], still ? b : -1);
    }
  }
}

TEST(Consistency, GivesUpTheStepsOwnEdgeAndSmallPieces) {
  Surface2D s = slanted(0.02F);
  for (int l = 0; l < kLines; ++l) s.edges.edges[static_cast<std::size_t>(l * 20 + 19)].at_step = true;
  // Six boundaries of another code in the middle of boundary 10's contour.
  for (int l = 12; l < 18; ++l) s.result.boundary[static_cast<std::size_t>(l * 20 + 10)] = 50;
  WorkerPool pool(1);
  ConsistencyCheck check;
  EXPECT_EQ(check.check(59, pool, s.result, s.edges).rejected, static_cast<std::size_t>(kLines + 6));
  for (int l = 0; l < kLines; ++l) EXPECT_EQ(s.result.boundary[static_cast<std::size_t>(l * 20 + 19)], -1);
  for (int l = 12; l < 18; ++l) EXPECT_EQ(s.result.boundary[static_cast<std::size_t>(l * 20 + 10)], -1);
}

TEST(Consistency, WhatFollowsOnTheLineSpeaksForASmallPiece) {
  for (const bool two : {false, true}) {
    Surface2D s = slanted(0.02F);
    // Something thin before it: nine lines of boundary 50, or of 50 and 51.
    for (int l = 12; l < 21; ++l) {
      s.result.boundary[static_cast<std::size_t>(l * 20 + 10)] = 50;
      s.result.boundary[static_cast<std::size_t>(l * 20 + 11)] = two ? 51 : -1;
    }
    WorkerPool pool(1);
    ConsistencyCheck check;
    check.check(59, pool, s.result, s.edges);
    int kept = 0;
    for (int l = 12; l < 21; ++l)
      kept += (s.result.boundary[static_cast<std::size_t>(l * 20 + 10)] == 50) +
              (s.result.boundary[static_cast<std::size_t>(l * 20 + 11)] == 51);
    EXPECT_EQ(kept, two ? 18 : 0);
  }
}

TEST(Consistency, GivesUpABoundaryThatADepthStepStandsInFor) {
  // From boundary 10 on the surface is another, half a stripe further left; 10 itself is hidden, and what
  // shows its colours is the step.
  Surface2D s = slanted(0.02F);
  for (std::size_t i = 0; i < s.edges.edges.size(); ++i) {
    if (i % 20 == 10) s.edges.edges[i].column_px -= 0.3F * kSpacing_px;
    if (i % 20 > 10) s.edges.edges[i].column_px -= 0.6F * kSpacing_px;
  }
  WorkerPool pool(1);
  ConsistencyCheck check;
  check.check(59, pool, s.result, s.edges);
  for (std::size_t i = 0; i < s.result.boundary.size(); ++i) {
    if (i % 20 == 10) {
      EXPECT_EQ(s.result.boundary[i], -1);
    } else if (i % 20 < 9 || i % 20 > 11) {
      EXPECT_EQ(s.result.boundary[i], static_cast<int>(i % 20));
    }
  }
}

TEST(Consistency, TakesSpeckleForNoise) {
  // Columns scatter by far more than their standard deviation says: where the light is speckled.
  Surface2D s = slanted(0.25F);
  for (Edge& e : s.edges.edges) e.sigma_px = e.noise_px = 0.03F;
  WorkerPool pool(1);
  ConsistencyCheck check;
  EXPECT_LT(check.check(59, pool, s.result, s.edges).rejected, s.result.boundary.size() / 50);
  double square = 0;
  int count = 0;
  for (std::size_t i = 3 * 20; i < (kLines - 3) * 20; ++i, ++count)
    square += std::pow(s.edges.edges[i].column_px - truth(i), 2);
  EXPECT_LT(std::sqrt(square / count), 0.15);
}

// A hand before the projector's lens. What a worker kept of the frame before, when it had lines, crashed
// here.
TEST(OrderedDecoder, WhatGoesDarkIsDecodedByAnyNumberOfThreads) {
  const test::StripedScene scene = test::striped_scene(Scan::kInterlaced);
  std::vector<std::vector<GridPoint>> points;
  for (const int threads : {1, 2, 8, 64}) {
    auto reconstructor =
        Reconstructor::create(scene.rig, scene.pattern, {.decoder = Decoder::kOrdered, .threads = threads});
    ASSERT_TRUE(reconstructor);
    for (std::uint64_t n = 0; n < 6; ++n) {
      CapturedFrame frame = test::draw_frame(scene, n);
      const int rows = frame.picture.height();
      for (int y = 0; n >= 2 && y < rows; ++y)
        if (y < rows / 2 || y >= rows / 2 + 12)
          std::fill_n(frame.picture.row(y), 3 * frame.picture.width(), 8);
      const auto out = reconstructor->add(frame);
      ASSERT_TRUE(out);
      if (n == 5) points.push_back(*out ? (*out)->surface.grid : std::vector<GridPoint>());
    }
    ASSERT_EQ(points.back().size(), points.front().size()) << threads;
    for (std::size_t i = 0; i < points.back().size(); ++i)
      ASSERT_EQ(points.back()[i].column_px, points.front()[i].column_px) << threads;
  }
}

TEST(OrderedDecoder, GivesTheSameForAnyNumberOfThreads) {
  const test::StripedScene scene = test::striped_scene(Scan::kInterlaced);
  std::vector<Surface> surfaces;
  for (const int threads : {1, 2, 5, 64}) {  // of 64 most have no line
    auto reconstructor =
        Reconstructor::create(scene.rig, scene.pattern, {.decoder = Decoder::kOrdered, .threads = threads});
    ASSERT_TRUE(reconstructor);
    for (std::uint64_t n = 0; n < 3; ++n) {
      auto frame = reconstructor->add(test::draw_frame(scene, n));
      ASSERT_TRUE(frame);
      if (n == 2) surfaces.push_back((*frame)->surface);
    }
  }
  for (const Surface& s : surfaces) {
    EXPECT_EQ(s.positions, surfaces[0].positions);
    EXPECT_EQ(s.triangles, surfaces[0].triangles);
  }
}

}  // namespace
}  // namespace relievo
