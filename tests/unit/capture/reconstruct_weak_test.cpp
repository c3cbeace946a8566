// SPDX-License-Identifier: Apache-2.0
// What is too weak for one pixel or one line: averaging of weak signals, and boundaries followed over lines.
#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "capture/pattern/bcsl.h"
#include "capture/reconstruct/edges.h"
#include "capture/reconstruct/sequence.h"
#include "capture/reconstruct/trace.h"
#include "capture/reconstruct/weak_signal.h"

namespace relievo {
namespace {

constexpr int kWidth = 320;
constexpr int kLines = 64;
constexpr float kStripe_px = 12;
constexpr float kNoise = 1.5F;

Pattern thirty_stripes() {
  return *make_pattern(6, 2, 100, 30);
}

/// Column of a boundary on a line: stripes lean by a quarter of a pixel a line.
float place(int boundary, int line) {
  return 4 + kStripe_px * static_cast<float>(boundary) + 0.25F * static_cast<float>(line);
}

std::array<float, 3> signs(Primary colour) {
  return {colour & 1 ? 1.F : -1.F, colour & 2 ? 1.F : -1.F, colour & 4 ? 1.F : -1.F};
}

/// Leaning stripes under `slide` whose amplitude `level` gives at each (line, column), in independent noise.
template <typename Level>
DifferenceImage picture(const Pattern& pattern, int slide, unsigned seed, const Level& level) {
  std::mt19937 random(seed);
  std::normal_distribution<float> noise(0, kNoise);
  DifferenceImage out;
  out.width = kWidth;
  out.lines = kLines;
  out.noise = kNoise;
  out.values.resize(static_cast<std::size_t>(kLines * 3 * kWidth));
  out.white.assign(static_cast<std::size_t>(kLines * kWidth), 100);
  for (int l = 0; l < kLines; ++l) {
    for (int x = 0; x < kWidth; ++x) {
      // A boundary within the pixel divides it between two stripes.
      const float at = (static_cast<float>(x) - place(0, l)) / kStripe_px + 1;
      const int stripe = std::clamp(static_cast<int>(std::floor(at - 0.5F / kStripe_px)), 0, 28);
      const float share =
          std::clamp((static_cast<float>(x) + 0.5F) - place(stripe, l), 0.F, 1.F);  // of the next stripe
      const auto before = signs(pattern.colour(stripe, slide));
      const auto after = signs(pattern.colour(stripe + 1, slide));
      for (std::size_t c = 0; c < 3; ++c) {
        out.values[static_cast<std::size_t>((l * 3 + static_cast<int>(c)) * kWidth + x)] =
            level(l, x) * ((1 - share) * before[c] + share * after[c]) + noise(random);
      }
    }
  }
  return out;
}

/// Bright on the left, weak in the middle, nothing on the right.
float three_levels(int, int x) {
  return x < 112 ? 80.F : x < 224 ? 4.F : 0.F;
}

TEST(WeakSignal, TellsStrongWeakAndNoneApart) {
  const DifferenceImage before = picture(thirty_stripes(), 0, 1, three_levels);
  DifferenceImage image = before;
  WorkerPool pool(1);
  WeakSignal().average(pool, image);
  for (int l = 0; l < kLines; l += DifferenceImage::kCellLines) {
    EXPECT_EQ(image.signal_at(l, 50), Signal::kStrong);
    EXPECT_EQ(image.signal_at(l, 170), Signal::kWeak);
    EXPECT_EQ(image.signal_at(l, 300), Signal::kNone);
  }
  for (int l = 0; l < kLines; ++l) {
    for (const int x : {0, 60, 111, 224, 319}) EXPECT_EQ(image.line(l)[x], before.line(l)[x]);
  }
}

TEST(WeakSignal, BesideOtherLinesFewerAreAveraged) {
  const DifferenceImage before = picture(thirty_stripes(), 0, 1, [](int l, int) {
    return l < 16 ? 80.F : l < 48 ? 4.F : 0.F;
  });
  DifferenceImage image = before;
  WorkerPool pool(1);
  WeakSignal().average(pool, image);
  const auto at = [&](int l) { return image.signal_at(l, 170); };
  EXPECT_EQ(at(8), Signal::kStrong);
  EXPECT_EQ(at(16), Signal::kFading);
  EXPECT_EQ(at(24), Signal::kWeak);
  EXPECT_EQ(at(32), Signal::kWeak);
  EXPECT_EQ(at(40), Signal::kFading);
  EXPECT_EQ(at(48), Signal::kNone);
  // Of the bright lines above, the first dark one has a quarter of the nearest and the next one nothing.
  const int x = static_cast<int>(place(10, 16) + kStripe_px / 2);
  const float bright = signs(thirty_stripes().colour(11, 0))[0];
  EXPECT_NEAR(image.line(16)[x], bright * (0.25F * 80 + 0.75F * 4), 4.F);
  EXPECT_NEAR(image.line(17)[x], bright * 4, 4.F);
  EXPECT_GT(image.fading_noise, image.weak_noise);
  EXPECT_LT(image.fading_noise, image.noise);
}

TEST(WeakSignal, AveragesTheNoiseAwayAndKeepsTheStripes) {
  const Pattern pattern = thirty_stripes();
  DifferenceImage image = picture(pattern, 0, 2, [](int, int) { return 4.F; });
  WorkerPool pool(1);
  WeakSignal().average(pool, image);
  double square = 0;
  int count = 0;
  for (int l = 8; l < kLines - 8; ++l) {
    for (int b = 2; b < 20; ++b) {
      const int middle = static_cast<int>(place(b, l) + kStripe_px / 2);
      const auto colour = signs(pattern.colour(b + 1, 0));
      for (std::size_t c = 0; c < 3; ++c, ++count) {
        const float error = image.line(l)[static_cast<int>(c) * kWidth + middle] - 4 * colour[c];
        square += error * error;
      }
    }
  }
  // White noise, which these pictures have, is averaged more than weak_noise says of low-passed noise.
  EXPECT_LT(std::sqrt(square / count), image.weak_noise);
  EXPECT_LT(image.weak_noise, 0.5F * image.noise);
}

TEST(WeakSignal, AnyNumberOfThreadsGivesTheSame) {
  const DifferenceImage before = picture(thirty_stripes(), 0, 3, three_levels);
  DifferenceImage one = before;
  WorkerPool pool(1);
  WeakSignal().average(pool, one);
  for (const int threads : {2, 5}) {
    DifferenceImage many = before;
    WorkerPool more(threads);
    WeakSignal().average(more, many);
    EXPECT_EQ(many.values, one.values);
    EXPECT_EQ(many.signal, one.signal);
  }
}

TEST(WeakSignal, TinyPictures) {
  WorkerPool pool(2);
  WeakSignal weak;
  for (const int width : {0, 1, 3, 17}) {
    for (const int lines : {0, 1, 5, 9}) {
      DifferenceImage image;
      image.width = width;
      image.lines = lines;
      image.noise = 1;
      image.values.assign(static_cast<std::size_t>(3 * width * lines), 3.F);
      weak.average(pool, image);
      for (const float v : image.values) EXPECT_NEAR(v, 3.F, 1e-5F);
    }
  }
}

/// Share of boundaries 2..20 on all lines but the first and last few that an edge lies on.
double found_share(const EdgeImage& edges) {
  int found = 0;
  int all = 0;
  for (int l = 8; l < kLines - 8; ++l) {
    for (int b = 2; b <= 20; ++b, ++all) {
      bool near = false;
      for (std::uint32_t e = edges.line_start[static_cast<std::size_t>(l)];
           e < edges.line_start[static_cast<std::size_t>(l) + 1]; ++e)
        near |= std::fabs(edges.edges[e].column_px - place(b, l)) < 1;
      found += near;
    }
  }
  return static_cast<double>(found) / all;
}

TEST(WeakSignal, EdgesAreFoundThatOnePixelDoesNotShow) {
  DifferenceImage image = picture(thirty_stripes(), 0, 4, [](int, int) { return 3.F; });
  WorkerPool pool(1);
  EdgeImage edges;
  image.weak_noise = image.noise;
  EdgeFinder().find(image, pool, edges);
  EXPECT_LT(found_share(edges), 0.75);
  WeakSignal().average(pool, image);
  EdgeFinder().find(image, pool, edges);
  EXPECT_GT(found_share(edges), 0.97);
}

/// Every boundary decoded where it is, but for `without` on the lines that `missing` names.
struct Decoded {
  EdgeImage edges;
  SequenceResult result;
};

template <typename Missing>
Decoded decoded(const Missing& missing) {
  Decoded out;
  out.edges.lines = kLines;
  out.edges.line_start = {0};
  for (int l = 0; l < kLines; ++l) {
    for (int b = 0; b < 22; ++b) {
      if (missing(b, l)) continue;
      Edge edge;
      edge.column_px = place(b, l);
      edge.slope = 20;
      out.edges.edges.push_back(edge);
      out.result.boundary.push_back(static_cast<std::int16_t>(b));
    }
    out.edges.line_start.push_back(static_cast<std::uint32_t>(out.edges.edges.size()));
  }
  return out;
}

/// Lines on which `boundary` is decoded, within a pixel of its place.
int decoded_lines(const Decoded& d, int boundary) {
  int count = 0;
  for (int l = 0; l < kLines; ++l) {
    for (std::uint32_t e = d.edges.line_start[static_cast<std::size_t>(l)];
         e < d.edges.line_start[static_cast<std::size_t>(l) + 1]; ++e) {
      if (d.result.boundary[e] != boundary) continue;
      EXPECT_NEAR(d.edges.edges[e].column_px, place(boundary, l), 1.F) << l;
      ++count;
    }
  }
  return count;
}

std::size_t trace(const DifferenceImage& image, const DifferenceImage& other, Decoded& d, int threads = 1) {
  WorkerPool pool(threads);
  const SequenceDecoder sequence(thirty_stripes());
  return Tracer().trace(image, sequence, {.order = SlideOrder::kNewerIsFirst, .other = &other}, pool,
                        d.result, d.edges);
}

TEST(Tracer, FillsGapsInABoundary) {
  const Pattern pattern = thirty_stripes();
  const auto bright = [](int, int) { return 60.F; };
  const DifferenceImage image = picture(pattern, 0, 5, bright);
  Decoded d = decoded([](int b, int l) { return b == 10 && (l == 20 || l == 31 || l == 32); });
  EXPECT_EQ(trace(image, picture(pattern, 1, 6, bright), d), 3U);
  EXPECT_EQ(decoded_lines(d, 10), kLines);
  EXPECT_EQ(d.result.boundary.size(), d.edges.edges.size());
  for (int l = 0; l < kLines; ++l) {
    for (std::uint32_t e = d.edges.line_start[static_cast<std::size_t>(l)] + 1;
         e < d.edges.line_start[static_cast<std::size_t>(l) + 1]; ++e)
      EXPECT_LT(d.edges.edges[e - 1].column_px, d.edges.edges[e].column_px);
  }
}

TEST(Tracer, FollowsABoundaryIntoWeakLight) {
  const Pattern pattern = thirty_stripes();
  const auto fading = [](int l, int) { return l < 24 ? 60.F : 4.F; };
  DifferenceImage image = picture(pattern, 0, 9, fading);
  DifferenceImage other = picture(pattern, 1, 10, fading);
  WorkerPool pool(1);
  WeakSignal().average(pool, image);
  WeakSignal().average(pool, other);
  const auto upper = [](int b, int l) { return b != 10 || l >= 30; };
  Decoded d = decoded(upper);
  trace(image, other, d);
  EXPECT_GT(decoded_lines(d, 10), kLines - 6);

  // But not where the other slide's frame shows other stripes, nor where the light is bright enough for lines
  // by themselves.
  DifferenceImage wrong = picture(pattern, 0, 11, fading);
  WeakSignal().average(pool, wrong);
  d = decoded(upper);
  trace(image, wrong, d);
  EXPECT_LT(decoded_lines(d, 10), 34);
  const auto bright = [](int, int) { return 60.F; };
  DifferenceImage lit = picture(pattern, 0, 12, bright);
  DifferenceImage lit_other = picture(pattern, 1, 13, bright);
  WeakSignal().average(pool, lit);
  WeakSignal().average(pool, lit_other);
  d = decoded(upper);
  EXPECT_EQ(trace(lit, lit_other, d), 0U);
}

TEST(Tracer, AnyNumberOfThreadsGivesTheSame) {
  const Pattern pattern = thirty_stripes();
  const auto bright = [](int, int) { return 60.F; };
  const DifferenceImage image = picture(pattern, 0, 14, bright);
  const DifferenceImage other = picture(pattern, 1, 15, bright);
  const auto holes = [](int b, int l) { return (b * 7 + l * 5) % 13 == 0; };
  Decoded one = decoded(holes);
  EXPECT_GT(trace(image, other, one), 50U);
  for (const int threads : {2, 5}) {
    Decoded many = decoded(holes);
    trace(image, other, many, threads);
    ASSERT_EQ(many.result.boundary, one.result.boundary);
    for (std::size_t e = 0; e < one.edges.edges.size(); ++e)
      ASSERT_EQ(many.edges.edges[e].column_px, one.edges.edges[e].column_px);
  }
}

}  // namespace
}  // namespace relievo
