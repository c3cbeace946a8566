// SPDX-License-Identifier: Apache-2.0
// Folders of Gray-code pictures as several programs name and order them.
#include "capture/calibrate/gray_stack.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>

#include "capture/calibrate/pictures.h"
#include "tests/support/temp_folder.h"

namespace relievo {
namespace {

using test::TempFolder;
using testing::HasSubstr;

constexpr int kWidth = 64, kHeight = 48;

/// The slides seen by a camera that is the projector: each pixel sees its own column and row.
void expect_identity(const Result<GrayStack>& stack) {
  ASSERT_TRUE(stack.ok()) << stack.error().message;
  WorkerPool pool(1);
  const auto maps = decode_gray(*stack, {.window_px = 0}, pool);
  ASSERT_TRUE(maps.ok()) << maps.error().message;
  ASSERT_EQ(maps->decoded, std::size_t{kWidth} * kHeight);
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 0; x < kWidth; ++x) {
      ASSERT_EQ(maps->columns.row(y)[x], x);
      ASSERT_EQ(maps->rows.row(y)[x], y);
    }
  }
  EXPECT_EQ(stack->picture.row(3)[3], 255);
}

std::string numbered(std::size_t i) {
  return "shot" + std::to_string(i) + ".png";  // 2 must come before 10
}

Image8 slide(std::size_t i) {
  return draw_gray_slide(gray_slides(kWidth, kHeight)[i], kWidth, kHeight);
}

TEST(GrayStack, OwnSlidesReadBack) {
  const TempFolder folder;
  ASSERT_TRUE(write_gray_slides(folder.path(), kWidth, kHeight).ok());
  std::ofstream(folder / "._gray_00.png") << "what a Mac keeps beside a file";
  expect_identity(read_gray_stack(folder.path(), kWidth, kHeight));
}

TEST(GrayStack, SlidesStopWhereAsked) {
  const TempFolder folder;
  const auto stopped = write_gray_slides(folder.path(), kWidth, kHeight,
                                         [](std::size_t done, std::size_t) { return done < 3; });
  ASSERT_FALSE(stopped.ok());
  EXPECT_NE(stopped.error().message.find("stopped: 3 of "), std::string::npos) << stopped.error().message;
  EXPECT_EQ(std::distance(std::filesystem::directory_iterator(folder.path()), {}), 3);
}

TEST(GrayStack, WhiteAndBlackFirstOrLeftOut) {
  const std::size_t count = gray_slides(kWidth, kHeight).size();
  const TempFolder first, without;
  for (std::size_t i = 0; i < count; ++i) {
    ASSERT_TRUE(write_png(first / numbered(i), slide((i + count - 2) % count)).ok());
    if (i + 2 < count) {
      ASSERT_TRUE(write_png(without / numbered(i), slide(i)).ok());
    }
  }
  expect_identity(read_gray_stack(first.path(), kWidth, kHeight));
  expect_identity(read_gray_stack(without.path(), kWidth, kHeight));
}

TEST(GrayStack, TaggedNamesInAnyOrder) {
  const TempFolder folder;
  const auto slides = gray_slides(kWidth, kHeight);
  for (std::size_t i = 0; i + 2 < slides.size(); ++i) {
    const GraySlide& s = slides[i];
    char name[64];
    std::snprintf(name, sizeof name, "%zu.5_[%02d-%02d-%02d_%02zu]_img.png", 99 - i,
                  s.axis == GrayAxis::kRows ? 1 : 0, s.bit, s.inverse ? 1 : 0, i);
    ASSERT_TRUE(write_png(folder / name, slide(i)).ok());
  }
  std::ofstream(folder / "list.yaml") << "not a picture";
  expect_identity(read_gray_stack(folder.path(), kWidth, kHeight));
}

TEST(GrayStack, ErrorsSayWhatIsMissing) {
  const TempFolder folder;
  EXPECT_THAT(read_gray_stack(folder / "none", kWidth, kHeight).error().message, HasSubstr("is no folder"));
  for (std::size_t i = 0; i < 10; ++i) ASSERT_TRUE(write_png(folder / numbered(i), slide(i)).ok());
  EXPECT_THAT(read_gray_stack(folder.path(), kWidth, kHeight).error().message,
              HasSubstr("has 10 pictures; a projector of 64x48 needs 24"));

  const TempFolder tagged;
  ASSERT_TRUE(write_png(tagged / "[00-00-00].png", slide(10)).ok());
  EXPECT_THAT(read_gray_stack(tagged.path(), kWidth, kHeight).error().message,
              HasSubstr("has no picture of column bit 0, inverse"));
}

TEST(GrayStack, APictureCopiedOverItsInverseIsNamed) {
  const TempFolder folder;
  ASSERT_TRUE(write_gray_slides(folder.path(), kWidth, kHeight).ok());
  const auto whole = read_gray_stack(folder.path(), kWidth, kHeight);
  ASSERT_TRUE(whole.ok()) << whole.error().message;
  EXPECT_TRUE(flat_bits(*whole, {}).empty());
  std::filesystem::copy_file(folder / "gray_14.png", folder / "gray_15.png",
                             std::filesystem::copy_options::overwrite_existing);
  const auto copied = read_gray_stack(folder.path(), kWidth, kHeight);
  ASSERT_TRUE(copied.ok()) << copied.error().message;
  const auto flat = flat_bits(*copied, {});
  ASSERT_EQ(flat.size(), 1u);
  EXPECT_EQ(to_string(flat[0]), "row bit 4");
}

TEST(GrayStack, DamagedAndOddPictures) {
  const TempFolder folder;
  ASSERT_TRUE(write_gray_slides(folder.path(), kWidth, kHeight).ok());
  ASSERT_TRUE(write_png(folder / "gray_07.png", Image8(kWidth, kHeight + 1, 1)).ok());
  EXPECT_THAT(read_gray_stack(folder.path(), kWidth, kHeight).error().message,
              HasSubstr("gray_07.png is 64x49"));
  std::ofstream(folder / "gray_07.png", std::ios::trunc) << "no picture";
  EXPECT_THAT(read_gray_stack(folder.path(), kWidth, kHeight).error().message,
              HasSubstr("gray_07.png cannot be read"));
}

}  // namespace
}  // namespace relievo
