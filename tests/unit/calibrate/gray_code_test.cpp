// SPDX-License-Identifier: Apache-2.0
// Gray code: the code itself, and decoding of pictures whose every edge is known.
#include <gtest/gtest.h>

#include <bit>
#include <cmath>
#include <functional>

#include "capture/pattern/gray_code.h"
#include "capture/pattern/gray_decode.h"

namespace relievo {
namespace {

constexpr int kProjectorWidth = 100, kProjectorHeight = 60;
constexpr int kWidth = 160, kHeight = 96;

using Map = std::function<double(double x, double y)>;  // camera pixel to projector column or row

/// What a camera sees whose pixels integrate over their area, for maps that are smooth over a pixel.
std::uint8_t seen(const GraySlide& slide, const Map& map, int x, int y, double albedo) {
  constexpr int kSamples = 6;
  double lit = 0;
  for (int s = 0; s < kSamples * kSamples; ++s) {
    const double px = x + (s % kSamples + 0.5) / kSamples - 0.5,
                 py = y + (s / kSamples + 0.5) / kSamples - 0.5;
    const auto at = static_cast<std::uint32_t>(std::lround(map(px, py)));
    lit += ((gray_from_binary(at) >> slide.bit & 1u) != 0) != slide.inverse ? 1 : 0;
  }
  return static_cast<std::uint8_t>(std::lround(albedo * (20 + 180 * lit / (kSamples * kSamples))));
}

GrayStack stack_of(const Map& columns, const Map& rows, const std::function<double(int, int)>& albedo) {
  GrayStack stack;
  stack.projector_width = kProjectorWidth;
  stack.projector_height = kProjectorHeight;
  stack.picture = Image8(kWidth, kHeight, 3);
  stack.columns.resize(static_cast<std::size_t>(gray_bits(kProjectorWidth)));
  stack.rows.resize(static_cast<std::size_t>(gray_bits(kProjectorHeight)));
  for (const GraySlide& slide : gray_slides(kProjectorWidth, kProjectorHeight)) {
    if (slide.kind != GraySlide::Kind::kBit) continue;
    const bool column = slide.axis == GrayAxis::kColumns;
    auto& pair = (column ? stack.columns : stack.rows)[static_cast<std::size_t>(slide.bit)];
    Image8& picture = slide.inverse ? pair.inverse : pair.lit;
    picture = Image8(kWidth, kHeight, 1);
    for (int y = 0; y < kHeight; ++y) {
      for (int x = 0; x < kWidth; ++x)
        picture.row(y)[x] = seen(slide, column ? columns : rows, x, y, albedo(x, y));
    }
  }
  return stack;
}

double slanted_columns(double x, double y) {
  return 3.3 + 0.55 * x + 0.06 * y;
}
double slanted_rows(double x, double y) {
  return 2.1 + 0.03 * x + 0.52 * y;
}
double grey(int, int) {
  return 0.8;
}

TEST(GrayCode, RoundTripAndOneBitFlipsBetweenNeighbours) {
  for (std::uint32_t i = 0; i + 1 < 16384; ++i) {
    ASSERT_EQ(binary_from_gray(gray_from_binary(i)), i);
    const std::uint32_t flips = gray_from_binary(i) ^ gray_from_binary(i + 1);
    ASSERT_EQ(flips, 1u << gray_bit_between(static_cast<int>(i)));
  }
}

TEST(GrayCode, BitsCoverEveryPosition) {
  for (int count = 1; count <= 16384; ++count) {
    ASSERT_GE(1 << gray_bits(count), count);
    if (count > 2) {
      ASSERT_LT(1 << (gray_bits(count) - 1), count) << count;
    }
  }
}

TEST(GrayCode, SlidesAreInTheOrderOtherProgramsProject) {
  const auto slides = gray_slides(1024, 768);
  ASSERT_EQ(slides.size(), 42u);
  EXPECT_EQ(to_string(slides[0]), "column bit 9");
  EXPECT_EQ(to_string(slides[1]), "column bit 9, inverse");
  EXPECT_EQ(to_string(slides[38]), "row bit 0");
  EXPECT_EQ(to_string(slides[40]), "white");
  EXPECT_EQ(to_string(slides[41]), "black");
  const Image8 first = draw_gray_slide(slides[0], 1024, 768);
  EXPECT_EQ(first.row(5)[511], 0);
  EXPECT_EQ(first.row(5)[512], 255);
}

TEST(GrayDecode, SubPixelColumnsOfASlantedPlane) {
  const GrayStack stack = stack_of(slanted_columns, slanted_rows, grey);
  WorkerPool pool(2);
  const auto maps = decode_gray(stack, {}, pool);
  ASSERT_TRUE(maps.ok()) << maps.error().message;
  EXPECT_GT(maps->decoded, 0.97 * kWidth * kHeight);
  double squares = 0, whole = 0;
  int count = 0;
  for (int y = 4; y < kHeight - 4; ++y) {
    for (int x = 4; x < kWidth - 4; ++x) {
      if (maps->columns.row(y)[x] < 0) continue;
      const double truth = slanted_columns(x, y);
      squares += std::pow(maps->columns.row(y)[x] - truth, 2);
      whole += std::pow(std::round(truth) - truth, 2);
      ++count;
    }
  }
  EXPECT_LT(std::sqrt(squares / count), 0.04);
  EXPECT_GT(std::sqrt(whole / count), 0.25) << "whole columns would have passed: the test proves nothing";
}

TEST(GrayDecode, EdgesDoNotMoveWhereTheSurfaceChangesColour) {
  const GrayStack stack = stack_of(slanted_columns, slanted_rows,
                                   [](int x, int y) { return (x / 9 + y / 9) % 2 == 0 ? 0.25 : 1.0; });
  WorkerPool pool(1);
  const auto maps = decode_gray(stack, {}, pool);
  ASSERT_TRUE(maps.ok());
  double squares = 0;
  for (const GrayEdge& e : maps->column_edges.edges)
    squares += std::pow(slanted_columns(e.x, e.y) - e.value, 2);
  ASSERT_GT(maps->column_edges.edges.size(), 5000u);
  EXPECT_LT(std::sqrt(squares / static_cast<double>(maps->column_edges.edges.size())), 0.08);
}

TEST(GrayDecode, DepthStepStaysSharp) {
  const Map step = [](double x, double y) { return slanted_columns(x, y) + (x < 80 ? 0.0 : 6.7); };
  const auto maps = [&] {
    WorkerPool pool(1);
    return decode_gray(stack_of(step, slanted_rows, grey), {}, pool);
  }();
  ASSERT_TRUE(maps.ok());
  int wrong = 0;
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 0; x < kWidth; ++x) {
      const float at = maps->columns.row(y)[x];
      if (at >= 0 && std::fabs(at - step(x, y)) > 0.6) ++wrong;
    }
  }
  EXPECT_LE(wrong, 2 * kHeight);  // at most the two pixels a row that see both sides
}

TEST(GrayDecode, UnlitAndUnclearPixelsAreNotDecoded) {
  GrayStack stack = stack_of(slanted_columns, slanted_rows, [](int x, int) { return x < 40 ? 0.05 : 0.8; });
  for (int y = 0; y < kHeight; ++y) {  // a coarse bit that cannot be read: not a neighbouring column
    stack.columns[5].lit.row(y)[100] = stack.columns[5].inverse.row(y)[100] = 90;
  }
  WorkerPool pool(1);
  const auto maps = decode_gray(stack, {}, pool);
  ASSERT_TRUE(maps.ok());
  for (int y = 0; y < kHeight; ++y) {
    EXPECT_EQ(maps->columns.row(y)[20], -1);
    EXPECT_EQ(maps->rows.row(y)[20], -1);
  }
  EXPECT_GE(maps->uncertain, kHeight / 2u);
  EXPECT_EQ(maps->lit, 120u * kHeight);
}

TEST(GrayDecode, AProjectorThatWasLargerThanIsSaidIsTold) {
  GrayStack stack = stack_of(slanted_columns, slanted_rows, grey);
  WorkerPool pool(1);
  EXPECT_EQ(beyond_projector(stack, *decode_gray(stack, {}, pool)), "");
  // As many bits, the same shape: what is read inside fits.
  stack.projector_width = kProjectorWidth * 3 / 4;
  stack.projector_height = kProjectorHeight * 3 / 4;
  const auto maps = decode_gray(stack, {}, pool);
  ASSERT_TRUE(maps.ok()) << maps.error().message;
  EXPECT_GT(maps->decoded, 0u);
  EXPECT_NE(beyond_projector(stack, *maps).find("outside of 75x45: is --projector right,"), std::string::npos)
      << beyond_projector(stack, *maps);
}

TEST(GrayDecode, AnyNumberOfThreadsGivesTheSame) {
  const GrayStack stack = stack_of(slanted_columns, slanted_rows, grey);
  WorkerPool one(1), three(3);
  const auto a = decode_gray(stack, {}, one), b = decode_gray(stack, {}, three);
  ASSERT_TRUE(a.ok() && b.ok());
  for (std::size_t i = 0; i < a->columns.size(); ++i) {
    ASSERT_EQ(a->columns.data()[i], b->columns.data()[i]);
    ASSERT_EQ(a->rows.data()[i], b->rows.data()[i]);
  }
}

TEST(GrayDecode, RefusesStacksThatDoNotFit) {
  WorkerPool pool(1);
  GrayStack few = stack_of(slanted_columns, slanted_rows, grey);
  few.columns.pop_back();
  const auto short_of_bits = decode_gray(few, {}, pool);
  ASSERT_FALSE(short_of_bits.ok());
  EXPECT_EQ(short_of_bits.error().message, "100 projector columns need 7 bits, the stack has 6");
  GrayStack odd = stack_of(slanted_columns, slanted_rows, grey);
  odd.rows[2].lit = Image8(kWidth, kHeight - 1, 1);
  EXPECT_FALSE(decode_gray(odd, {}, pool).ok());
}

}  // namespace
}  // namespace relievo
