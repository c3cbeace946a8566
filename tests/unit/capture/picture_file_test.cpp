// SPDX-License-Identifier: Apache-2.0
// Proves: pictures of each format are read, and what a file declares is looked at before memory is taken.
#include "capture/picture_file.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <fstream>
#include <iostream>
#include <opencv2/imgcodecs.hpp>
#include <string>

#include "base/stream.h"
#include "tests/support/make_surface.h"
#include "tests/support/temp_folder.h"

namespace relievo {
namespace {

using testing::HasSubstr;

Bytes encoded(const char* ending, const std::vector<int>& parameters = {}) {
  const Image8 picture = test::picture(40, 24);
  const cv::Mat mat(picture.height(), picture.width(), CV_8UC3, const_cast<std::uint8_t*>(picture.data()));
  Bytes out;
  EXPECT_TRUE(cv::imencode(ending, mat, out, parameters)) << ending;
  return out;
}

class PictureFile : public testing::Test {
 protected:
  Result<Image8> read(const Bytes& bytes) const {
    const auto file = folder_ / "picture";
    std::ofstream(file, std::ios::binary)
        .write(reinterpret_cast<const char*>(bytes.data()), static_cast<std::streamsize>(bytes.size()));
    return read_rgb(file);
  }
  const test::TempFolder folder_;
};

TEST_F(PictureFile, EveryFormatIsRead) {
  for (const char* ending : {".png", ".jpg", ".bmp", ".ppm", ".tiff"}) {
    const Bytes file = encoded(ending);
    EXPECT_EQ(declared_pixels(file), 40u * 24u) << ending;
    const auto picture = read(file);
    ASSERT_TRUE(picture.ok()) << picture.error().message;
    EXPECT_EQ(picture->width(), 40) << ending;
    EXPECT_EQ(picture->height(), 24) << ending;
    EXPECT_EQ(picture->channels(), 3) << ending;
  }
  EXPECT_EQ(declared_pixels(encoded(".jpg", {cv::IMWRITE_JPEG_PROGRESSIVE, 1})), 40u * 24u);
}

TEST_F(PictureFile, GreyBecomesRgb) {
  const std::string pgm = "P5\n2 1\n255\n\x10\x20";
  const auto rgb = read({pgm.begin(), pgm.end()});
  ASSERT_TRUE(rgb.ok()) << rgb.error().message;
  EXPECT_EQ(std::vector<int>(rgb->data(), rgb->data() + 6), (std::vector<int>{16, 16, 16, 32, 32, 32}));
}

TEST_F(PictureFile, LosslessFormatsKeepEveryPixel) {
  const Image8 picture = test::picture(40, 24);
  for (const char* ending : {".png", ".bmp", ".ppm", ".tiff"}) {
    const auto rgb = read(encoded(ending));
    ASSERT_TRUE(rgb.ok()) << rgb.error().message;
    for (std::size_t i = 0; i < picture.size(); ++i)  // the encoder took them for BGR
      ASSERT_EQ(rgb->data()[i], picture.data()[i / 3 * 3 + 2 - i % 3]) << ending << " " << i;
  }
}

/// And the decoder, which prints lines of its own, does not see it.
TEST_F(PictureFile, ADamagedPngIsRefusedInOneLine) {
  const Bytes whole = encoded(".png");
  Bytes damaged = whole;
  damaged[whole.size() / 2] ^= 0x10;
  testing::internal::CaptureStderr();
  const auto changed = read(damaged);
  const auto cut = read({whole.begin(), whole.end() - 20});
  EXPECT_EQ(testing::internal::GetCapturedStderr(), "");
  ASSERT_FALSE(changed.ok());
  EXPECT_THAT(changed.error().message, HasSubstr("is damaged: wrong checksum"));
  ASSERT_FALSE(cut.ok());
  EXPECT_THAT(cut.error().message, HasSubstr("is cut short"));
}

std::uint32_t crc32(const std::uint8_t* data, std::size_t size) {
  std::uint32_t c = ~0U;
  for (std::size_t i = 0; i < size; ++i) {
    c ^= data[i];
    for (int bit = 0; bit < 8; ++bit) c = (c & 1) != 0 ? (c >> 1) ^ 0xEDB88320U : c >> 1;
  }
  return ~c;
}

/// Whose checksums are right: the program that wrote it was at fault.
TEST_F(PictureFile, APngOfBrokenDataIsRefusedInOneLine) {
  Bytes broken = encoded(".png");
  constexpr std::array<std::uint8_t, 4> kData = {'I', 'D', 'A', 'T'};
  const auto found = std::search(broken.begin(), broken.end(), kData.begin(), kData.end());
  ASSERT_NE(found, broken.end());
  const auto at = static_cast<std::size_t>(found - broken.begin());
  std::size_t length = 0;
  for (std::size_t i = at - 4; i < at; ++i) length = length << 8 | broken[i];
  std::fill_n(broken.begin() + static_cast<std::ptrdiff_t>(at + 6), length - 2, 0xEE);
  const std::uint32_t crc = crc32(&broken[at], 4 + length);
  for (std::size_t i = 0; i < 4; ++i)
    broken[at + 4 + length + i] = static_cast<std::uint8_t>(crc >> (24 - 8 * i));
  testing::internal::CaptureStderr();
  const auto picture = read(broken);
  EXPECT_EQ(testing::internal::GetCapturedStderr(), "");
  ASSERT_FALSE(picture.ok());
  EXPECT_THAT(picture.error().message, HasSubstr("is damaged: "));
}

TEST_F(PictureFile, OtherFormatsThatAreCutShortAreRefusedInOneLine) {
  for (const char* ending : {".bmp", ".ppm", ".tiff"}) {
    const Bytes whole = encoded(ending);
    for (const std::size_t size : {whole.size() / 50, whole.size() / 2, whole.size() - 1}) {
      testing::internal::CaptureStderr();
      const auto cut = read({whole.begin(), whole.begin() + static_cast<std::ptrdiff_t>(size)});
      EXPECT_EQ(testing::internal::GetCapturedStderr(), "") << ending << " " << size;
      ASSERT_FALSE(cut.ok()) << ending << " " << size;
      EXPECT_THAT(cut.error().message, HasSubstr("cut short")) << ending << " " << size;
    }
  }
  testing::internal::CaptureStderr();
  std::cerr << "of others";
  EXPECT_EQ(testing::internal::GetCapturedStderr(), "of others");
}

TEST_F(PictureFile, AJpegThatIsCutShortIsRefusedInOneLine) {
  const Bytes whole = encoded(".jpg");
  testing::internal::CaptureStderr();
  const auto cut = read({whole.begin(), whole.begin() + static_cast<std::ptrdiff_t>(whole.size() * 3 / 4)});
  EXPECT_EQ(testing::internal::GetCapturedStderr(), "");
  ASSERT_FALSE(cut.ok());
  EXPECT_THAT(cut.error().message, HasSubstr("is damaged: "));
}

/// As some cameras write them.
TEST_F(PictureFile, AJpegWithBytesTooManyIsRead) {
  const Bytes whole = encoded(".jpg");
  Bytes longer = whole;
  longer.insert(longer.end() - 2, 12, 0);  // before the end's marker
  const auto expected = read(whole), picture = read(longer);
  ASSERT_TRUE(expected.ok() && picture.ok()) << picture.error().message;
  EXPECT_TRUE(std::equal(picture->data(), picture->data() + picture->size(), expected->data()));
}

/// libjpeg tells its first warning.
TEST_F(PictureFile, AJpegWithAPartMissingIsDamagedThoughBytesTooManyComeBefore) {
  Bytes broken = encoded(".jpg", {cv::IMWRITE_JPEG_RST_INTERVAL, 1});
  const auto marker = [&](int low) {
    const auto is_marker = [low](int a, int b) { return a == 0xff && b == low; };
    return std::adjacent_find(broken.begin(), broken.end(), is_marker);
  };
  const auto before = marker(0xd0), after = marker(0xd1);
  ASSERT_TRUE(before != broken.end() && after - before > 6);
  broken.erase(before + 4, after);
  broken.insert(marker(0xd0), 12, 0);
  const auto picture = read(broken);
  ASSERT_FALSE(picture.ok());
  EXPECT_THAT(picture.error().message, HasSubstr("is damaged: "));
}

TEST_F(PictureFile, PngsOfOtherKindsBecomeRgb) {
  const cv::Mat grey16(2, 3, CV_16UC1, cv::Scalar(0x1234));
  const cv::Mat alpha(2, 3, CV_8UC4, cv::Scalar(3, 2, 1, 77));  // BGR and alpha
  Bytes file;
  ASSERT_TRUE(cv::imencode(".png", grey16, file));
  const auto grey = read(file);
  ASSERT_TRUE(grey.ok()) << grey.error().message;
  EXPECT_EQ(std::vector<int>(grey->data(), grey->data() + 3), (std::vector<int>{0x12, 0x12, 0x12}));
  ASSERT_TRUE(cv::imencode(".png", alpha, file));
  const auto colours = read(file);
  ASSERT_TRUE(colours.ok()) << colours.error().message;
  EXPECT_EQ(std::vector<int>(colours->data(), colours->data() + 3), (std::vector<int>{1, 2, 3}));
}

/// A file of each format that says it has 65,500 x 65,500 pixels: 13 GB.
TEST_F(PictureFile, WhatIsTooLargeToBeTrueIsRefused) {
  const auto put = [](Bytes file, std::size_t at, std::initializer_list<std::uint8_t> bytes) {
    std::copy(bytes.begin(), bytes.end(), file.begin() + static_cast<std::ptrdiff_t>(at));
    return file;
  };
  const auto refused = [&](const Bytes& file) { return read(file).error().message; };
  EXPECT_THAT(refused(put(encoded(".png"), 16, {0, 0, 0xFF, 0xDC, 0, 0, 0xFF, 0xDC})),
              HasSubstr("says it has 4290250000 pixels"));
  EXPECT_THAT(refused(put(encoded(".bmp"), 18, {0xDC, 0xFF, 0, 0, 0x24, 0, 0xFF, 0xFF})),
              HasSubstr("says it has 4290250000 pixels"));  // from the top: a height below 0
  Bytes jpeg = encoded(".jpg");
  constexpr std::array<std::uint8_t, 2> kFrame = {0xFF, 0xC0};
  const auto frame = std::search(jpeg.begin(), jpeg.end(), kFrame.begin(), kFrame.end());
  ASSERT_NE(frame, jpeg.end());
  jpeg = put(jpeg, static_cast<std::size_t>(frame - jpeg.begin()) + 5, {0xFF, 0xDC, 0xFF, 0xDC});
  EXPECT_THAT(refused(jpeg), HasSubstr("says it has 4290250000 pixels"));
  const std::string pnm = "P6 # 3 3\n65500 # 3\n 65500 255\n123";
  EXPECT_THAT(refused({pnm.begin(), pnm.end()}), HasSubstr("says it has 4290250000 pixels"));
  EXPECT_THAT(refused({'I', 'I', '*', 0, 8, 0, 0, 0, 2,    0,                         // two entries
                       0,   1,   4,   0, 1, 0, 0, 0, 0xDC, 0xFF, 0, 0,                // width
                       1,   1,   4,   0, 1, 0, 0, 0, 0xDC, 0xFF, 0, 0, 0, 0, 0, 0}),  // height
              HasSubstr("says it has 4290250000 pixels"));
}

/// Below the most, but emptier than any picture.
TEST_F(PictureFile, MorePixelsThanItsBytesCanHoldAreRefused) {
  const std::string pnm = "P6 9000 9000 255\n123";
  EXPECT_THAT(read({pnm.begin(), pnm.end()}).error().message, HasSubstr("81000000 pixels"));
}

TEST_F(PictureFile, OtherFormatsAreNotHandedToAnyDecoder) {
  for (const std::string& text :
       {std::string("RIFF1234WEBPVP8 "), std::string("#?RADIANCE\n"), std::string("P7\n"), std::string("P6"),
        std::string("II*"), std::string()}) {
    EXPECT_EQ(declared_pixels({reinterpret_cast<const std::uint8_t*>(text.data()), text.size()}),
              std::nullopt);
    EXPECT_THAT(read({text.begin(), text.end()}).error().message, HasSubstr("it is no PNG")) << text;
  }
  EXPECT_THAT(read({'B', 'M'}).error().message, HasSubstr("does not say how large it is"));
  EXPECT_THAT(read_rgb(folder_ / "none").error().message, HasSubstr("is missing"));
}

}  // namespace
}  // namespace relievo
