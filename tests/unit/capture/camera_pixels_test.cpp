// SPDX-License-Identifier: Apache-2.0
// Every camera format's way to RGB, against the formulas in floating point, on random bytes and odd sizes.
#include <gtest/gtest.h>
#include <linux/videodev2.h>

#include <algorithm>
#include <cmath>
#include <opencv2/imgcodecs.hpp>
#include <optional>
#include <random>
#include <vector>

#include "base/stream.h"
#include "capture/source/v4l2/capture_format.h"
#include "capture/source/v4l2/raw_picture.h"
#include "tests/support/make_surface.h"

namespace relievo::v4l2 {
namespace {

struct Case {
  const char* format;
  int width, height;
  FieldLayout layout;
  YcbcrCoding coding;
};

void PrintTo(const Case& c, std::ostream* out) {
  *out << c.format << " " << c.width << "x" << c.height;
}

constexpr int kPadding = 10;  // bytes behind each row

/// Random bytes as a driver would have them in one buffer.
struct Raw {
  CaptureFormat format;
  std::vector<std::uint8_t> first, second;

  explicit Raw(const Case& c) {
    format.pixels = pixel_format(std::string_view(c.format));
    format.width = c.width;
    format.buffer_height = c.height;
    format.layout = c.layout;
    format.coding = c.coding;
    const int row = c.width * format.pixels->bytes_a_pixel + kPadding;
    format.strides = {row, row + 6};
    const int chroma_rows = (c.height + 1) / 2;
    const bool separate = format.pixels->separate;
    first.resize(static_cast<std::size_t>(row * (c.height + (separate ? 0 : chroma_rows))));
    second.resize(separate ? static_cast<std::size_t>((row + 6) * chroma_rows) : 0);
    std::mt19937 random(7);
    for (auto* bytes : {&first, &second}) {
      for (std::uint8_t& byte : *bytes) byte = static_cast<std::uint8_t>(random());
    }
  }
  Filled filled() const {
    Filled out;
    out.planes[0] = {first.data(), first.size(), first.size()};
    out.planes[1] = {second.data(), second.size(), second.size()};
    return out;
  }
  int stride(int plane) const {
    return static_cast<int>(format.strides[format.pixels->separate && plane == 1]);
  }
  int at(int plane, int x, int y) const {
    const std::size_t offset = static_cast<std::size_t>(y * stride(plane) + x);
    if (plane == 0) return first[offset];
    return format.pixels->separate
               ? second[offset]
               : first[static_cast<std::size_t>(format.buffer_height * stride(0)) + offset];
  }
  /// The memory's row that a frame's row comes from, and the chroma row beside it.
  int memory_row(int y) const {
    if (format.layout != FieldLayout::kSequential) return y;
    const bool in_front = (y % 2 == 0) == format.top_in_front;
    return y / 2 + (in_front ? 0 : format.buffer_height / 2);
  }
  int chroma_row(int y) const {
    if (format.layout == FieldLayout::kInterlaced) return 2 * (y / 4) + y % 2;
    return memory_row(y) / 2;
  }
};

/// Luma and the two chroma samples nearest to the left of or at a pixel, and the next ones along the line.
struct Samples {
  double y, cb, cr;
};

Samples samples(const Raw& raw, int x, int y) {
  const std::string_view name = raw.format.pixels->name;
  const int row = raw.memory_row(y), pairs = (raw.format.width + 1) / 2;
  const auto chroma = [&](int pair, bool cr) {
    if (name == "YUYV") return raw.at(0, 4 * pair + (cr ? 3 : 1), row);
    if (name == "UYVY") return raw.at(0, 4 * pair + (cr ? 2 : 0), row);
    return raw.at(1, 2 * pair + cr, raw.chroma_row(y));
  };
  const auto interpolated = [&](bool cr) {
    const int pair = x / 2;
    if (x % 2 == 0) return 1.0 * chroma(pair, cr);
    return 0.5 * (chroma(pair, cr) + chroma(std::min(pair + 1, pairs - 1), cr));
  };
  const int luma = name == "YUYV"   ? raw.at(0, 2 * x, row)
                   : name == "UYVY" ? raw.at(0, 2 * x + 1, row)
                                    : raw.at(0, x, row);
  return {1.0 * luma, interpolated(false), interpolated(true)};
}

std::array<double, 3> expected(const Raw& raw, int x, int y) {
  const YcbcrCoding& c = raw.format.coding;
  const std::string_view name = raw.format.pixels->name;
  const auto ranged = [&](double v) { return c.full_range ? v : (v - 16) * 255 / 219; };
  if (name == "GREY") {
    const double v = ranged(raw.at(0, x, raw.memory_row(y)));
    return {v, v, v};
  }
  if (!raw.format.pixels->ycbcr) {
    const auto channel = [&](int i) {
      return ranged(raw.at(0, 3 * x + (name == "BGR24" ? 2 - i : i), raw.memory_row(y)));
    };
    return {channel(0), channel(1), channel(2)};
  }
  const Samples s = samples(raw, x, y);
  const double luma = ranged(s.y), scale = c.full_range ? 1 : 255.0 / 224;
  const double r = luma + 2 * (1 - c.kr) * scale * (s.cr - 128),
               b = luma + 2 * (1 - c.kb) * scale * (s.cb - 128);
  return {r, (luma - c.kr * r - c.kb * b) / (1 - c.kr - c.kb), b};
}

class Pixels : public testing::TestWithParam<Case> {};

TEST_P(Pixels, AreTheFormulas) {
  const Raw raw(GetParam());
  Image8 out(raw.format.width, raw.format.buffer_height, 3);
  ASSERT_TRUE(write_picture(raw.filled(), raw.format, {.picture = &out}));
  for (int y = 0; y < out.height(); ++y) {
    for (int x = 0; x < out.width(); ++x) {
      const auto want = expected(raw, x, y);
      for (int c = 0; c < 3; ++c) {
        const double level = std::clamp(want[static_cast<std::size_t>(c)], 0.0, 255.0);
        ASSERT_NEAR(out.row(y)[3 * x + c], level, 0.52) << "channel " << c << " at " << x << "," << y;
      }
    }
  }
}

TEST_P(Pixels, ABufferThatIsAByteShortIsDamaged) {
  const Raw raw(GetParam());
  Image8 out(raw.format.width, raw.format.buffer_height, 3);
  Filled filled = raw.filled();
  const bool separate = raw.format.pixels->separate;
  // Padding behind the last row need not be there.
  Filled::Plane& last = filled.planes[separate ? 1 : 0];
  const int chroma = (raw.format.width + 1) / 2 * 2;
  const int row =
      raw.format.pixels->planes == 2 ? chroma : raw.format.width * raw.format.pixels->bytes_a_pixel;
  const int rows = raw.format.pixels->planes == 2 && separate ? (raw.format.buffer_height + 1) / 2
                   : raw.format.pixels->planes == 2
                       ? raw.format.buffer_height + (raw.format.buffer_height + 1) / 2
                       : raw.format.buffer_height;
  last.used = static_cast<std::size_t>(raw.stride(separate ? 1 : 0) * (rows - 1) + row);
  EXPECT_TRUE(write_picture(filled, raw.format, {.picture = &out}));
  --last.used;
  EXPECT_FALSE(write_picture(filled, raw.format, {.picture = &out}));
}

constexpr YcbcrCoding k601{}, k601Full{.full_range = true}, k709{.kr = 0.2126, .kb = 0.0722},
    k2020Full{.kr = 0.2627, .kb = 0.0593, .full_range = true};

INSTANTIATE_TEST_SUITE_P(Formats, Pixels,
                         testing::Values(Case{"RGB24", 5, 3, FieldLayout::kProgressive, k601Full},
                                         Case{"RGB24", 6, 4, FieldLayout::kSequential, k601},
                                         Case{"BGR24", 6, 4, FieldLayout::kInterlaced, k601Full},
                                         Case{"BGR24", 5, 2, FieldLayout::kProgressive, k601},
                                         Case{"GREY", 7, 4, FieldLayout::kSequential, k601},
                                         Case{"GREY", 7, 3, FieldLayout::kProgressive, k601Full},
                                         Case{"YUYV", 8, 4, FieldLayout::kProgressive, k601},
                                         Case{"YUYV", 8, 4, FieldLayout::kInterlaced, k709},
                                         Case{"UYVY", 66, 6, FieldLayout::kSequential, k601Full},
                                         Case{"UYVY", 64, 8, FieldLayout::kProgressive, k2020Full},
                                         Case{"NV12", 8, 8, FieldLayout::kProgressive, k601},
                                         Case{"NV12", 6, 5, FieldLayout::kProgressive, k709},
                                         Case{"NV12", 8, 8, FieldLayout::kInterlaced, k2020Full},
                                         Case{"NV12", 8, 12, FieldLayout::kSequential, k601Full},
                                         Case{"NM12", 32, 8, FieldLayout::kProgressive, k709},
                                         Case{"NM12", 8, 8, FieldLayout::kSequential, k601}));

TEST(Coding, IsWhatTheDriverStates) {
  const auto of = [](std::uint32_t space, std::uint32_t encoding, std::uint32_t range, bool ycbcr = true) {
    const auto coding = coding_of(space, encoding, range, ycbcr);
    EXPECT_TRUE(coding);
    return coding ? *coding : YcbcrCoding{};
  };
  EXPECT_EQ(of(V4L2_COLORSPACE_SRGB, 0, 0).kr, 0.299);
  EXPECT_FALSE(of(V4L2_COLORSPACE_SRGB, 0, 0).full_range);
  EXPECT_EQ(of(V4L2_COLORSPACE_REC709, 0, 0).kr, 0.2126);
  EXPECT_EQ(of(V4L2_COLORSPACE_SRGB, V4L2_YCBCR_ENC_709, 0).kb, 0.0722);
  EXPECT_EQ(of(V4L2_COLORSPACE_BT2020, 0, V4L2_QUANTIZATION_FULL_RANGE).kb, 0.0593);
  EXPECT_TRUE(of(V4L2_COLORSPACE_BT2020, 0, V4L2_QUANTIZATION_FULL_RANGE).full_range);
  EXPECT_EQ(of(V4L2_COLORSPACE_SMPTE240M, 0, 0).kr, 0.212);
  EXPECT_TRUE(of(V4L2_COLORSPACE_JPEG, 0, 0).full_range);
  EXPECT_TRUE(of(V4L2_COLORSPACE_SRGB, 0, 0, false).full_range);  // RGB
  EXPECT_FALSE(of(V4L2_COLORSPACE_SRGB, 0, V4L2_QUANTIZATION_LIM_RANGE, false).full_range);
  EXPECT_FALSE(coding_of(V4L2_COLORSPACE_SRGB, V4L2_YCBCR_ENC_BT2020_CONST_LUM, 0, true));
}

class Jpeg : public testing::Test {
 protected:
  static constexpr int kWidth = 40, kHeight = 24;

  Jpeg() {
    format_.pixels = pixel_format(std::string_view("MJPEG"));
    format_.width = kWidth;
    format_.buffer_height = kHeight;
  }
  /// As many cameras give it: in many parts.
  static Bytes coded() {
    const Image8 picture = test::picture(kWidth, kHeight);
    const cv::Mat rgb(kHeight, kWidth, CV_8UC3, const_cast<std::uint8_t*>(picture.data()));
    Bytes out;
    EXPECT_TRUE(cv::imencode(".jpg", rgb, out, {cv::IMWRITE_JPEG_RST_INTERVAL, 1}));
    return out;
  }
  /// Nothing where it is damaged.
  std::optional<Bytes> read(const Bytes& bytes) const {
    Image8 out(kWidth, kHeight, 3);
    Filled filled;
    filled.planes[0] = {bytes.data(), bytes.size(), bytes.size()};
    if (!write_picture(filled, format_, {.picture = &out})) return std::nullopt;
    return Bytes(out.data(), out.data() + out.size());
  }

  CaptureFormat format_;
};

TEST_F(Jpeg, HostileBytesAreDamage) {
  std::mt19937 random(3);
  for (std::size_t size = 0; size < 300; ++size) {
    Bytes bytes(size);
    for (std::uint8_t& byte : bytes) byte = static_cast<std::uint8_t>(random());
    if (size > 3) bytes[0] = 0xff, bytes[1] = 0xd8, bytes[2] = 0xff;
    EXPECT_FALSE(read(bytes)) << size;
  }
}

TEST_F(Jpeg, ADamagedOneSpoilsNoneBehindIt) {
  const Bytes whole = coded();
  const auto expected = read(whole);
  ASSERT_TRUE(expected);
  std::mt19937 random(4);
  for (std::size_t i = 2; i < whole.size(); ++i) {
    Bytes cut = whole, changed = whole;
    cut.resize(i);
    changed[i] = static_cast<std::uint8_t>(random());
    read(cut);
    read(changed);
    ASSERT_EQ(read(whole), expected) << "cut or changed at byte " << i;
  }
}

/// Logitech's, for example, in most pictures.
TEST_F(Jpeg, BytesTooManyBetweenItsPartsAreNoDamage) {
  const Bytes whole = coded();
  const auto expected = read(whole);
  ASSERT_TRUE(expected);
  int parts = 0;
  for (std::size_t i = 2; i + 1 < whole.size(); ++i) {
    const bool ends_part = whole[i] == 0xff && whole[i + 1] >= 0xd0 && whole[i + 1] <= 0xd9;
    if (!ends_part) continue;
    Bytes longer = whole;
    longer.insert(longer.begin() + static_cast<std::ptrdiff_t>(i), 12, 0);
    EXPECT_EQ(read(longer), expected) << "before marker " << int{whole[i + 1]};
    ++parts;
  }
  EXPECT_GT(parts, 3);
}

TEST_F(Jpeg, WhatEndsEarlyIsDamage) {
  const Bytes whole = coded();
  EXPECT_FALSE(read({whole.begin(), whole.end() - 40}));
}

}  // namespace
}  // namespace relievo::v4l2
