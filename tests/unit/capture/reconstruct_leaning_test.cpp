// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>

#include "capture/reconstruct/detection_lines.h"
#include "capture/reconstruct/edges.h"
#include "capture/reconstruct/field_difference.h"
#include "capture/reconstruct/leaning.h"
#include "capture/reconstruct/weak_signal.h"
#include "tests/unit/capture/drawn_frame.h"

namespace relievo {
namespace {

constexpr int kWidth = 320;
constexpr int kRows = 136;
constexpr int kMiddle = kRows / 2;  // of a cell of DifferenceImage, too
constexpr std::array<double, 9> kIdentity{1, 0, 0, 0, 1, 0, 0, 0, 1};

/// One boundary, red to its left and blue to its right, that moves by `lean_px` a row; from the first row on
/// light becomes brighter by `rise` a row.
struct Scene {
  Scan scan;
  float level, rise, lean_px;
  int first_lit = 0;  // row

  float place(int row) const { return 100 + lean_px * static_cast<float>(row - kMiddle); }
  int rows_a_line() const { return scan == Scan::kInterlaced ? 2 : 1; }

  std::uint8_t value(int row, int x, int channel, bool complement) const {
    if (row < first_lit) return 8;
    const float right = 0.5F * (1 + std::erf((static_cast<float>(x) - place(row)) / (0.8F * std::sqrt(2.F))));
    const float lit = channel == 0 ? 1 - right : channel == 2 ? right : 0;
    const float light = std::min(230.F, level * std::exp(rise * static_cast<float>(row - kMiddle)));
    return static_cast<std::uint8_t>(std::lround(8 + light * (complement ? 1 - lit : lit)));
  }

  CapturedFrame frame() const {
    return drawn_frame(scan, kWidth, kRows, [&](int row, int x, int channel, bool complement) {
      return value(row, x, channel, complement);
    });
  }
};

/// What of it is seen, as the ordered decoder does.
struct Found {
  Found(const Scene& scene, float noise) : frame(scene.frame()), rows(frame) {
    Differencer(kIdentity).difference(rows, pool, image);
    image.noise = std::max(image.noise, noise);
    WeakSignal().average(pool, image);
    EdgeFinder().find(image, pool, edges);
    for (const Edge& edge : edges.edges)
      result.boundary.push_back(std::fabs(edge.column_px - 100) < 60 ? 3 : -1);
  }
  std::size_t correct() { return LeanCorrection().correct(rows, image, 8, pool, result, edges); }
  bool has(int line) const {
    for (std::uint32_t e = edges.line_start[static_cast<std::size_t>(line)];
         e < edges.line_start[static_cast<std::size_t>(line) + 1]; ++e)
      if (result.boundary[e] >= 0) return true;
    return false;
  }

  CapturedFrame frame;
  DetectionLines rows;  // of frame
  WorkerPool pool{2};
  DifferenceImage image;
  EdgeImage edges;
  SequenceResult result;
};

struct Off {
  double before_px, after_px;  // mean, to the right of the true place
};

/// Of the lines about the middle.
Off off(const Scene& scene, Signal signal, float noise) {
  Found found(scene, noise);
  const DifferenceImage& image = found.image;
  const EdgeImage& edges = found.edges;
  const auto mean_px = [&] {
    double sum = 0;
    int count = 0;
    for (int line = image.lines / 2 - 1; line < image.lines / 2 + 3; ++line) {
      EXPECT_EQ(image.signal_at(line, 100), signal);
      for (std::uint32_t e = edges.line_start[static_cast<std::size_t>(line)];
           e < edges.line_start[static_cast<std::size_t>(line) + 1]; ++e, ++count)
        sum += edges.edges[e].column_px - scene.place(scene.rows_a_line() * line);
    }
    EXPECT_EQ(count, 4);
    return sum / count;
  };
  const double before = mean_px();
  EXPECT_EQ(found.correct(), 0U);
  return {before, mean_px()};
}

TEST(LeanCorrection, PutsBackWhatBrighterLinesDraw) {
  struct Case {
    const char* what;
    Scene scene;
    Signal signal;
    float noise;
    double drawn_px;  // variance of the mean over lines, in rows, times rise and lean
    double left;      // share of it: small rises are taken for noise in part
  };
  constexpr Scan kInterlaced = Scan::kInterlaced;
  constexpr Scan kProgressive = Scan::kProgressive;
  for (const auto& [what, scene, signal, noise, drawn_px, left] : {
           Case{"interlaced", {kInterlaced, 60, 0.15F, 0.4F}, Signal::kStrong, 0.3F, 2.5 * 0.15 * 0.4, 0.25},
           Case{"darker below",
                {kInterlaced, 60, -0.15F, 0.4F},
                Signal::kStrong,
                0.3F,
                -2.5 * 0.15 * 0.4,
                0.25},
           Case{"the other way",
                {kInterlaced, 60, 0.15F, -0.4F},
                Signal::kStrong,
                0.3F,
                -2.5 * 0.15 * 0.4,
                0.25},
           Case{"progressive", {kProgressive, 60, 0.3F, 1.F}, Signal::kStrong, 0.3F, 0.5 * 0.3, 0.25},
           Case{"fading", {kProgressive, 8, 0.3F, 0.5F}, Signal::kFading, 2.5F, 0.3 * 0.5, 0.25},
           Case{"weak", {kProgressive, 6, 0.1F, 1.F}, Signal::kWeak, 1.9F, 3 * 0.1, 0.6},
       }) {
    SCOPED_TRACE(what);
    const Off px = off(scene, signal, noise);
    EXPECT_NEAR(px.before_px, drawn_px, 0.25 * std::fabs(drawn_px));
    EXPECT_LT(std::fabs(px.after_px), left * std::fabs(drawn_px));
  }
}

TEST(LeanCorrection, LeavesWhatIsAsBrightOrStandsUpright) {
  for (const Scene& scene : {Scene{Scan::kInterlaced, 60, 0, 0.6F}, Scene{Scan::kInterlaced, 60, 0.08F, 0}}) {
    const Off px = off(scene, Signal::kStrong, 0.3F);
    EXPECT_NEAR(px.before_px, 0, 0.01);
    EXPECT_NEAR(px.after_px, px.before_px, 0.003);
  }
}

TEST(LeanCorrection, GivesUpWhatOnlyTheLineBesideItShows) {
  for (const Scan scan : {Scan::kInterlaced, Scan::kProgressive}) {
    const Scene scene{scan, 60, 0, 0, kMiddle};
    const int lit = kMiddle / scene.rows_a_line();
    Found found(scene, 0.3F);
    EXPECT_TRUE(found.has(lit - 1)) << "the low-pass shows nothing: this tests nothing";
    EXPECT_EQ(found.correct(), 1U);
    EXPECT_FALSE(found.has(lit - 1));
    for (int line = lit; line < found.image.lines; ++line) EXPECT_TRUE(found.has(line)) << "line " << line;
  }
}

// Beside the end of a surface only one row of the other exposure shows it, half a line off.
TEST(LeanCorrection, PutsBackWhatOneRowOfTheOtherExposureShows) {
  for (const float lean_px : {0.4F, -0.4F}) {
    for (const bool upper : {true, false}) {
      const Scene scene{Scan::kInterlaced, 60, 0, lean_px};
      CapturedFrame frame = scene.frame();
      // The other half of the rows is of another surface, green to the left and magenta to the right.
      for (int y = upper ? kMiddle : 0; y < (upper ? kRows : kMiddle); ++y) {
        for (int i = 0; i < 3 * kWidth; i += 3) {
          std::uint8_t* rgb = frame.picture.row(y) + i;
          const std::uint8_t red = rgb[0];
          rgb[0] = rgb[2];
          rgb[1] = red;
        }
      }
      const DetectionLines rows(frame);
      WorkerPool pool(1);
      DifferenceImage image;
      Differencer(kIdentity).aligned_difference(rows, pool, image);
      EdgeImage edges;
      EdgeFinder().find(image, pool, edges);
      const int line =
          upper ? kMiddle / 2 - 1 : kMiddle / 2;  // the last one, or the first one, of the surface
      ASSERT_EQ(image.steps.at(line, 100), upper ? LineSteps::kBelow : LineSteps::kAbove);
      SequenceResult result;
      result.boundary.assign(edges.edges.size(), -1);
      const auto edge_on = [&](int l) {
        std::uint32_t out = edges.line_start[static_cast<std::size_t>(l)];
        while (std::fabs(edges.edges[out].column_px - scene.place(2 * l)) > 2) ++out;
        return out;
      };
      const int beside = upper ? line - 1 : line + 1;
      result.boundary[edge_on(line)] = result.boundary[edge_on(beside)] = 3;
      const auto off_px = [&] { return edges.edges[edge_on(line)].column_px - scene.place(2 * line); };
      const float lean_by_line = 2 * lean_px;
      EXPECT_NEAR(off_px(), (upper ? -0.25F : 0.25F) * lean_by_line, 0.03F);
      LeanCorrection().correct(rows, image, 8, pool, result, edges);
      EXPECT_NEAR(off_px(), 0, 0.06F) << (upper ? "upper" : "lower") << ", leaning by " << lean_px;
    }
  }
}

TEST(LeanCorrection, KeepsADarkLineThatShowsItsOwn) {
  Found found({Scan::kProgressive, 60, 0.8F, 0}, 0.3F);  // each line has 0.45 of the next one's light
  EXPECT_EQ(found.correct(), 0U);
}

/// Columns of one boundary on five lines, whose edges' slopes are 10, 20, 30, 40 and 50.
std::array<float, 5> corrected(const std::array<float, 5>& columns_px) {
  EdgeImage edges{.lines = 5, .line_start = {0}, .edges = {}};
  SequenceResult result;
  for (std::size_t l = 0; l < columns_px.size(); ++l) {
    edges.edges.push_back({.column_px = columns_px[l], .slope = 10 * static_cast<float>(l + 1)});
    edges.line_start.push_back(static_cast<std::uint32_t>(l + 1));
    result.boundary.push_back(0);
  }
  DifferenceImage image;
  image.width = kWidth;
  image.lines = 5;
  WorkerPool pool(1);
  const CapturedFrame frame = Scene{Scan::kInterlaced, 60, 0, 0}.frame();
  LeanCorrection().correct(DetectionLines(frame), image, 1, pool, result, edges);
  std::array<float, 5> out{};
  for (std::size_t l = 0; l < out.size(); ++l) out[l] = edges.edges[l].column_px;
  return out;
}

TEST(LeanCorrection, AStepFromLineToLineIsNoLean) {
  // To another surface, too far away to be the same boundary's, and so near that it could be.
  for (const float step : {8.F, 2.F}) {
    const std::array<float, 5> columns{50, 50, 50, 50 + step, 50 + step};
    const std::array<float, 5> out = corrected(columns);
    for (const std::size_t l : {0, 1, 2, 3, 4})
      EXPECT_NEAR(out[l], columns[l], 1e-5F) << step << ", line " << l;
  }
}

TEST(LeanCorrection, AtAnEndOneNeighbourTellsIt) {
  const auto out = corrected({50, 51, 52, 53, 54});
  // Rises to twice the slope, of the mean of both; most of it is no noise.
  EXPECT_NEAR(out[0], 50 - 0.625F * (2.F / 3), 0.02F);
  EXPECT_LT(out[2], 52 - 0.15F);
}

}  // namespace
}  // namespace relievo
