// SPDX-License-Identifier: Apache-2.0
#include "capture/pattern/slides.h"

#include <gtest/gtest.h>

#include "capture/pattern/bcsl.h"

namespace relievo {
namespace {

Primary lit(const std::uint8_t* pixel) {
  return static_cast<Primary>((pixel[0] / 255) | (pixel[1] / 255) << 1 | (pixel[2] / 255) << 2);
}

TEST(Slides, StripesDivideTheWidthAsTheContractSays) {
  const auto pattern = make_pattern(6, 2, 100, 71);
  ASSERT_TRUE(pattern);
  for (const int width : {71, 640, 1024, 1283}) {
    for (const int slide : {0, 1}) {
      const Image8 picture = draw_slide(*pattern, slide, false, width, 3);
      for (int x = 0; x < width; ++x) {
        // The stripe left of the first boundary that lies right of the pixel's centre.
        int stripe = 0;
        while (stripe < pattern->boundaries() && pattern->boundary_column_px(stripe, width) < x) ++stripe;
        ASSERT_EQ(lit(picture.row(2) + 3 * x), pattern->colour(stripe, slide)) << x << " of " << width;
      }
    }
  }
}

TEST(Slides, RowSlidesAreColumnSlidesTurned) {
  const auto pattern = make_pattern(6, 2, 0, 30);
  ASSERT_TRUE(pattern);
  const Image8 columns = draw_slide(*pattern, 1, true, 100, 2),
               rows = draw_row_slide(*pattern, 1, true, 3, 100);
  for (int i = 0; i < 100; ++i) ASSERT_EQ(lit(rows.row(i) + 6), lit(columns.row(1) + 3 * i)) << i;
}

TEST(Slides, SlideAndComplementMakeWhite) {
  const auto pattern = make_pattern(3, 2, 0, 20);
  ASSERT_TRUE(pattern);
  const Image8 slide = draw_slide(*pattern, 1, false, 200, 2);
  const Image8 complement = draw_slide(*pattern, 1, true, 200, 2);
  const Image8 frame = draw_interlaced(*pattern, 1, FieldOrder::kTop, 200, 2);
  const Image8 lower = draw_interlaced(*pattern, 1, FieldOrder::kBottom, 200, 2);
  for (int i = 0; i < 600; ++i) {
    ASSERT_EQ(slide.row(0)[i] + complement.row(0)[i], 255);
    ASSERT_EQ(frame.row(0)[i], slide.row(0)[i]);
    ASSERT_EQ(frame.row(1)[i], complement.row(0)[i]);
    ASSERT_EQ(lower.row(0)[i], complement.row(0)[i]);
    ASSERT_EQ(lower.row(1)[i], slide.row(0)[i]);
  }
}

}  // namespace
}  // namespace relievo
