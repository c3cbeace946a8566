// SPDX-License-Identifier: Apache-2.0
// Detection on fields built analytically: every boundary's sub-pixel place and colours are known.
#include "capture/reconstruct/detect.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <tuple>
#include <vector>

#include "tests/support/make_surface.h"
#include "tests/unit/capture/drawn_frame.h"

namespace relievo {
namespace {

using Matrix = std::array<double, 9>;
constexpr Matrix kIdentity{1, 0, 0, 0, 1, 0, 0, 0, 1};
/// Measured on a real camera and projector.
constexpr Matrix kCrosstalk{1.21770055196,     -0.163374168046, -0.0543263559093,
                            -0.204662193076,   1.35776376654,   -0.153101548739,
                            -0.00711181172159, -0.242394329117, 1.24950613756};

Matrix inverse(const Matrix& m) {
  const auto minor = [&](std::size_t a, std::size_t b, std::size_t c, std::size_t d) {
    return m[a] * m[d] - m[b] * m[c];
  };
  const double det = m[0] * minor(4, 5, 7, 8) - m[1] * minor(3, 5, 6, 8) + m[2] * minor(3, 4, 6, 7);
  return {minor(4, 5, 7, 8) / det, minor(2, 1, 8, 7) / det, minor(1, 2, 4, 5) / det,
          minor(5, 3, 8, 6) / det, minor(0, 2, 6, 8) / det, minor(2, 0, 5, 3) / det,
          minor(3, 4, 6, 7) / det, minor(1, 0, 7, 6) / det, minor(0, 1, 3, 4) / det};
}

/// Stripes on a white wall, blurred by a Gaussian.
struct Stripes {
  int width = 160;
  int height = 24;
  Scan scan = Scan::kProgressive;
  std::vector<Primary> colours{1, 2, 4, 6, 5, 3, 1, 6, 2, 5};  // 8 etc. where black is wanted
  double first = 14.3;  // column of the first boundary on row 0, and the distance of each to the next
  double pitch = 15.17;
  double lean = 0;     // columns a row
  double sigma = 1.2;  // pixels
  double low = 20;     // projected grey levels of a dark channel and of a lit one
  double high = 220;
  Matrix colour_matrix = kIdentity;

  int boundaries() const { return static_cast<int>(colours.size()) - 1; }
  double place(int boundary, double row) const { return first + boundary * pitch + lean * row; }

  std::array<double, 3> projected(double x, double row, bool complement) const {
    std::array<double, 3> out{};
    for (std::size_t c = 0; c < 3; ++c) {
      double value = 0;
      for (int k = 0; k <= boundaries(); ++k) {
        const auto edge = [&](int b) {
          if (b < 0) return 1.0;
          if (b >= boundaries()) return 0.0;
          return 0.5 * std::erfc((place(b, row) - x) / (sigma * std::sqrt(2.0)));
        };
        const Primary colour = colours[static_cast<std::size_t>(k)];
        const bool lit = (colour >> c & 1) != (complement ? 1 : 0);
        if (lit) value += edge(k - 1) - edge(k);
      }
      out[c] = low + (high - low) * value;
    }
    return out;
  }

  Image8 picture(bool complement) const {
    const Matrix camera = inverse(colour_matrix);
    Image8 out(width, height, 3);
    for (int y = 0; y < height; ++y) {
      const bool dark = scan == Scan::kInterlaced ? y % 2 == 1 : complement;
      for (int x = 0; x < width; ++x) {
        const auto p = projected(x, y, dark);
        for (std::size_t c = 0; c < 3; ++c) {
          const double v = camera[3 * c] * p[0] + camera[3 * c + 1] * p[1] + camera[3 * c + 2] * p[2];
          out.row(y)[3 * static_cast<std::size_t>(x) + c] =
              static_cast<std::uint8_t>(std::lround(std::clamp(v, 0.0, 255.0)));
        }
      }
    }
    return out;
  }

  CapturedFrame frame() const {
    CapturedFrame f;
    f.scan = scan;
    f.picture = picture(false);
    if (scan == Scan::kProgressive) f.complement = picture(true);
    return f;
  }
};

Detection detect(const CapturedFrame& frame, const Matrix& matrix = kIdentity,
                 const DetectOptions& options = {}, int threads = 1) {
  WorkerPool pool(threads);
  Detector detector(matrix, options);
  Detection out;
  detector.detect(frame, pool, out);
  return out;
}

std::vector<Boundary> line_of(const Detection& d, int line) {
  const auto l = static_cast<std::size_t>(line);
  return {d.boundaries.begin() + d.line_start[l], d.boundaries.begin() + d.line_start[l + 1]};
}

/// Every line has exactly the stripes' boundaries, within `tolerance` pixels, with their colours.
void expect_stripes(const Detection& d, const Stripes& stripes, double tolerance) {
  const int step = stripes.scan == Scan::kInterlaced ? 2 : 1;
  ASSERT_EQ(d.width, stripes.width);
  ASSERT_EQ(d.lines, (stripes.height + step - 1) / step);
  ASSERT_EQ(d.line_start.size(), static_cast<std::size_t>(d.lines) + 1);
  double worst = 0;
  for (int line = 0; line < d.lines; ++line) {
    // Lines at the picture's edge are smoothed and compared with the complement one-sidedly: where boundaries
    // lean, they move there.
    const bool edge = line < 2 || line >= d.lines - 2;
    const double allowed = tolerance + (edge ? 0.5 * step * std::fabs(stripes.lean) : 0);
    const auto found = line_of(d, line);
    ASSERT_EQ(found.size(), static_cast<std::size_t>(stripes.boundaries())) << "line " << line;
    for (int k = 0; k < stripes.boundaries(); ++k) {
      const Boundary& b = found[static_cast<std::size_t>(k)];
      const double error = b.column_px - stripes.place(k, line * step);
      if (!edge) worst = std::max(worst, std::fabs(error));
      EXPECT_NEAR(error, 0, allowed) << "line " << line << ", boundary " << k;
      EXPECT_EQ(b.left, stripes.colours[static_cast<std::size_t>(k)]);
      EXPECT_EQ(b.right, stripes.colours[static_cast<std::size_t>(k) + 1]);
    }
  }
  ::testing::Test::RecordProperty("worst_error_1e4_px", static_cast<int>(worst * 1e4));
}

bool same(const std::vector<Boundary>& a, const std::vector<Boundary>& b) {
  return std::equal(a.begin(), a.end(), b.begin(), b.end(), [](const Boundary& p, const Boundary& q) {
    return p.column_px == q.column_px && p.slope == q.slope && p.left == q.left && p.right == q.right;
  });
}

/// What holds of every detection, whatever was seen.
void expect_sound(const Detection& d) {
  ASSERT_EQ(d.line_start.size(), static_cast<std::size_t>(d.lines) + 1);
  ASSERT_EQ(d.line_start.front(), 0U);
  ASSERT_EQ(d.line_start.back(), d.boundaries.size());
  ASSERT_EQ(d.colours.size(), static_cast<std::size_t>(d.width) * static_cast<std::size_t>(d.lines));
  for (const Primary c : d.colours) ASSERT_LE(c, 6);
  for (int line = 0; line < d.lines; ++line) {
    ASSERT_LE(d.line_start[static_cast<std::size_t>(line)], d.line_start[static_cast<std::size_t>(line) + 1]);
    float last = -1;
    for (const Boundary& b : line_of(d, line)) {
      ASSERT_GT(b.column_px, last);
      ASSERT_LT(b.column_px, static_cast<float>(d.width));
      ASSERT_NE(b.left, b.right);
      for (const Primary c : {b.left, b.right}) ASSERT_TRUE(c >= 1 && c <= 6) << int{c};
      ASSERT_TRUE(std::isfinite(b.slope) && b.slope > 0);
      last = b.column_px;
    }
  }
}

CapturedFrame noise(int width, int height, Scan scan, std::uint64_t seed) {
  test::Random random(seed);
  const auto fill = [&] {
    Image8 picture(width, height, 3);
    for (std::size_t i = 0; i < picture.size(); ++i)
      picture.data()[i] = static_cast<std::uint8_t>(random.below(256));
    return picture;
  };
  CapturedFrame f;
  f.scan = scan;
  f.picture = fill();
  if (scan == Scan::kProgressive) f.complement = fill();
  return f;
}

TEST(Detect, PlacesAndColoursOfIdealStripes) {
  const Stripes stripes;
  expect_stripes(detect(stripes.frame()), stripes, 0.02);
}

TEST(Detect, EverySubPixelPlace) {
  for (int i = 0; i < 16; ++i) {
    Stripes stripes;
    stripes.height = 3;
    stripes.first = 14 + i / 16.0;
    stripes.pitch = 15;
    expect_stripes(detect(stripes.frame()), stripes, 0.02);
  }
}

TEST(Detect, EveryPairOfColours) {
  for (Primary left = 1; left <= 6; ++left) {
    for (Primary right = 1; right <= 6; ++right) {
      if (left == right) continue;
      Stripes stripes;
      stripes.width = 48;
      stripes.height = 3;
      stripes.colours = {left, right};
      stripes.first = 23.4;
      expect_stripes(detect(stripes.frame()), stripes, 0.02);
    }
  }
}

TEST(Detect, CrosstalkIsTakenOutByTheColourMatrix) {
  Stripes stripes;
  stripes.colour_matrix = kCrosstalk;
  expect_stripes(detect(stripes.frame(), kCrosstalk), stripes, 0.03);
}

TEST(Detect, InverseInTheTestIsOne) {
  const Matrix a = inverse(kCrosstalk);
  for (std::size_t i = 0; i < 3; ++i)
    for (std::size_t j = 0; j < 3; ++j) {
      double sum = 0;
      for (std::size_t k = 0; k < 3; ++k) sum += a[3 * i + k] * kCrosstalk[3 * k + j];
      EXPECT_NEAR(sum, i == j, 1e-12);
    }
}

TEST(Detect, DarkObjectsAreNormalised) {
  // A tenth of the light: the same thresholds hold, on the normalised scale; only rounding to whole grey
  // levels is coarser.
  Stripes stripes;
  stripes.low = 2;
  stripes.high = 26;
  expect_stripes(detect(stripes.frame()), stripes, 0.15);
}

TEST(Detect, ALeaningBoundaryKeepsItsPlaceInterlaced) {
  for (const double lean : {0.4, -0.4}) {
    Stripes stripes;
    stripes.scan = Scan::kInterlaced;
    stripes.height = 25;  // an odd one: the last line has no complement below it
    stripes.lean = lean;
    if (lean < 0) stripes.first = 24;
    expect_stripes(detect(stripes.frame()), stripes, 0.03);
  }
}

TEST(Detect, ALeaningBoundaryKeepsItsPlaceProgressive) {
  Stripes stripes;
  stripes.lean = 0.4;
  expect_stripes(detect(stripes.frame()), stripes, 0.03);
}

TEST(Detect, BlackStripesAreNeverAColour) {
  // Black under the slide and white under the complement, and the reverse: both are no code's colour.
  for (const Primary never : {0, 7}) {
    Stripes stripes;
    stripes.height = 4;
    stripes.colours = {1, static_cast<Primary>(never), 2};
    stripes.first = 40;
    stripes.pitch = 50;
    const Detection d = detect(stripes.frame());
    expect_sound(d);
    EXPECT_TRUE(d.boundaries.empty());
    EXPECT_EQ(d.colours[65], 0);
    EXPECT_EQ(d.colours[20], 1);
    EXPECT_EQ(d.colours[120], 2);
  }
}

// As published: no crossing counts for more, also one as steep again.
TEST(Detect, CrossingsOfSeveralChannelsAreOneBoundaryInTheirMiddle) {
  const CapturedFrame frame =
      drawn_frame(Scan::kProgressive, 32, 4, [](int, int x, int channel, bool complement) {
        const int difference[] = {16 * (x - 15), -8 * (x - 16),
                                  -100};  // red rises, green falls a pixel later
        const int half = std::clamp(difference[channel] / 2, -100, 100);
        return static_cast<std::uint8_t>(complement ? 128 - half : 128 + half);
      });
  const auto found = line_of(detect(frame), 1);
  ASSERT_EQ(found.size(), 1U);
  EXPECT_NEAR(found[0].column_px, 15.5, 1e-3);
  EXPECT_EQ(found[0].left, 2);
  EXPECT_EQ(found[0].right, 1);
}

TEST(Detect, SlopeThresholdOfEq4) {
  // Across 2 delta = 4 pixels the difference of a ramp changes by a known amount.
  Stripes stripes;
  stripes.width = 96;
  stripes.height = 3;
  stripes.colours = {1, 2};
  stripes.first = 47.5;
  stripes.sigma = 12;
  stripes.low = 0;
  stripes.high = 255;
  // Difference of a channel: +-255 far off, slope 2 * 255 / (sigma sqrt(2 pi)) = 17 a pixel at the boundary.
  const auto count = [&](float threshold) {
    DetectOptions options;
    options.slope_threshold = threshold;
    options.search_px = 30;
    return detect(stripes.frame(), kIdentity, options).boundaries.size();
  };
  EXPECT_EQ(count(5), 3U);
  EXPECT_EQ(count(40), 3U);
  EXPECT_EQ(count(75), 0U);
}

TEST(Detect, ColourThresholdNeedsTwoChannels) {
  // Channels differ by 60 of 255 (normalised) between slide and complement.
  Stripes stripes;
  stripes.width = 64;
  stripes.height = 3;
  stripes.colours = {1, 2};
  stripes.first = 31.4;
  stripes.low = 140;
  stripes.high = 200;
  const double difference = 60 * 255.0 / 200;
  const auto with = [&](double threshold) {
    DetectOptions options;
    options.colour_threshold = static_cast<float>(threshold);
    return detect(stripes.frame(), kIdentity, options);
  };
  const Detection below = with(difference - 2);
  EXPECT_EQ(below.boundaries.size(), 3U);
  EXPECT_EQ(below.colours[10], 1);
  const Detection above = with(difference + 2);
  EXPECT_TRUE(above.boundaries.empty());
  EXPECT_EQ(std::count(above.colours.begin(), above.colours.end(), 0),
            static_cast<std::ptrdiff_t>(above.colours.size()));
}

TEST(Detect, BlackPictureHasNoBoundaries) {
  for (const Scan scan : {Scan::kInterlaced, Scan::kProgressive}) {
    CapturedFrame frame;
    frame.scan = scan;
    frame.picture = Image8(64, 32, 3);
    if (scan == Scan::kProgressive) frame.complement = Image8(64, 32, 3);
    const Detection d = detect(frame);
    expect_sound(d);
    EXPECT_TRUE(d.boundaries.empty());
    EXPECT_FALSE(same_slide(d, d));  // nothing valid tells nothing
  }
}

TEST(Detect, EmptyPicture) {
  for (const Scan scan : {Scan::kInterlaced, Scan::kProgressive}) {
    CapturedFrame frame;
    frame.scan = scan;
    const Detection d = detect(frame, kIdentity, {}, 2);
    expect_sound(d);
    EXPECT_EQ(d.lines, 0);
  }
}

TEST(Detect, TinyPictures) {
  for (const Scan scan : {Scan::kInterlaced, Scan::kProgressive}) {
    for (int width = 1; width <= 17; ++width) {
      for (int height = 1; height <= 3; ++height) {
        SCOPED_TRACE(std::to_string(width) + "x" + std::to_string(height));
        for (std::uint64_t seed = 0; seed < 8; ++seed)
          expect_sound(detect(noise(width, height, scan, seed), kIdentity, {}, 2));
      }
    }
  }
}

TEST(Detect, NoiseIsSound) {
  for (const Scan scan : {Scan::kInterlaced, Scan::kProgressive})
    expect_sound(detect(noise(211, 61, scan, 5), kCrosstalk));
}

TEST(Detect, AnyNumberOfThreadsGivesTheSameBytes) {
  Stripes stripes;
  stripes.scan = Scan::kInterlaced;
  stripes.height = 37;
  stripes.lean = 0.3;
  for (const CapturedFrame& frame :
       {noise(97, 41, Scan::kInterlaced, 1), noise(97, 41, Scan::kProgressive, 2), stripes.frame()}) {
    const Detection serial = detect(frame);
    EXPECT_FALSE(serial.boundaries.empty());
    for (const int threads : {2, 3, 8, 64}) {
      const Detection threaded = detect(frame, kIdentity, {}, threads);
      EXPECT_TRUE(same(threaded.boundaries, serial.boundaries)) << threads;
      EXPECT_EQ(threaded.line_start, serial.line_start) << threads;
      EXPECT_EQ(threaded.colours, serial.colours) << threads;
    }
  }
}

TEST(Detect, NothingIsLeftFromTheFrameBefore) {
  // A detector keeps scratch memory: smaller pictures after larger ones, more threads than lines.
  WorkerPool pool(3);
  Detector detector(kIdentity, {});
  Detection reused;
  for (const auto& [width, height] :
       {std::tuple(97, 41), std::tuple(40, 2), std::tuple(97, 1), std::tuple(64, 30)}) {
    const CapturedFrame frame = noise(width, height, Scan::kProgressive, 3);
    detector.detect(frame, pool, reused);
    expect_sound(reused);
    const Detection fresh = detect(frame);
    EXPECT_TRUE(same(reused.boundaries, fresh.boundaries)) << width << "x" << height;
    EXPECT_EQ(reused.line_start, fresh.line_start);
    EXPECT_EQ(reused.colours, fresh.colours);
  }
}

TEST(SameSlide, TellsTheSlidesApart) {
  Stripes first;
  Stripes second;
  second.colours = {2, 4, 1, 3, 6, 5, 2, 1, 4, 6};
  Stripes first_moved = first;
  first_moved.first += 2.5;
  const Detection a = detect(first.frame());
  const Detection b = detect(second.frame());
  EXPECT_TRUE(same_slide(a, a));
  EXPECT_TRUE(same_slide(a, detect(first_moved.frame())));
  EXPECT_FALSE(same_slide(a, b));
  EXPECT_FALSE(same_slide(b, a));
}

}  // namespace
}  // namespace relievo
