// SPDX-License-Identifier: Apache-2.0
// In the guest: every format and field layout that the test camera has, against what its pattern must give.
#include <gtest/gtest.h>

#include <algorithm>
#include <ostream>
#include <utility>
#include <vector>

#include "base/time.h"
#include "vivid.h"

namespace relievo {
namespace {

using namespace test;

struct FormatCase {
  const char* name;
  std::string device;
  const char* format;
  bool ycbcr;
  bool dmabuf;
};

void PrintTo(const FormatCase& c, std::ostream* out) {
  *out << c.name;
}

class Formats : public testing::TestWithParam<FormatCase> {};

TEST_P(Formats, GivesThePatternsPixels) {
  const FormatCase& c = GetParam();
  set(c.device, {{"test_pattern", "100_colorbar"}, {"osd_text_mode", "none"}});
  const auto source = open(c.device, {.input = "0",
                                      .format = c.format,
                                      .width = 320,
                                      .height = 180,
                                      .rate = 60,
                                      .dmabuf = c.dmabuf,
                                      .controls = still("100_colorbar")});
  ASSERT_TRUE(source);
  const Rig& rig = source->info().rig;
  EXPECT_EQ(rig.scan, Scan::kProgressive);
  EXPECT_EQ(rig.camera.width, 320);
  EXPECT_EQ(rig.camera.height, 180);
  EXPECT_NEAR(rig.frame_rate, 30, 1e-6);
  const CapturedFrame frames[] = {next(*source), next(*source)};
  EXPECT_EQ(source->counts().lost_frames, 0u);
  EXPECT_EQ(source->counts().damaged_pictures, 0u);
  const bool grey = std::string(c.format) == "GREY";
  for (const CapturedFrame& frame : frames) {
    for (const Image8* picture : {&frame.picture, &frame.complement}) {
      expect_picture(*picture,
                     grey      ? 2
                     : c.ycbcr ? 1
                               : 0,
                     [&](int x, int) {
                       if (c.ycbcr) return subsampled_bar(x, 320, kBt601);
                       const Rgb rgb = colour_bar(x, 320);
                       if (!grey) return rgb;
                       const double y =
                           kBt709.kr * rgb[0] + (1 - kBt709.kr - kBt709.kb) * rgb[1] + kBt709.kb * rgb[2];
                       return Rgb{y, y, y};  // the driver's grey is Rec. 709's
                     });
    }
  }
}

INSTANTIATE_TEST_SUITE_P(Vivid, Formats,
                         testing::Values(FormatCase{"Rgb24", kVivid, "RGB24", false, false},
                                         FormatCase{"Bgr24", kVivid, "BGR24", false, false},
                                         FormatCase{"Yuyv", kVivid, "YUYV", true, false},
                                         FormatCase{"Uyvy", kVivid, "UYVY", true, false},
                                         FormatCase{"Nv12", kVivid, "NV12", true, false},
                                         FormatCase{"Grey", kVivid, "GREY", false, false},
                                         FormatCase{"Rgb24Dmabuf", kVivid, "RGB24", false, true},
                                         FormatCase{"Nv12Dmabuf", kVivid, "NV12", true, true},
                                         FormatCase{"MultiplanarRgb24", kMultiplanar, "RGB24", false, false},
                                         FormatCase{"MultiplanarYuyv", kMultiplanar, "YUYV", true, false},
                                         FormatCase{"MultiplanarNv12", kMultiplanar, "NV12", true, false},
                                         FormatCase{"MultiplanarNm12", kMultiplanar, "NM12", true, false},
                                         FormatCase{"MultiplanarNm12Dmabuf", kMultiplanar, "NM12", true,
                                                    true}),
                         [](const auto& test) { return std::string(test.param.name); });

/// The colour filter over a pixel: 0 red, 1 green, 2 blue. `order`: of the first four, "RGGB".
int filter_at(const std::string& order, int x, int y) {
  return std::string("RGB").find(order[static_cast<std::size_t>(2 * (y % 2) + x % 2)]);
}

class Bayer : public testing::TestWithParam<const char*> {};

TEST_P(Bayer, IsTheMosaicDemosaicedBilinearly) {
  const std::string order = GetParam();
  const auto source = open(kVivid, {.input = "0",
                                    .format = "S" + order + "8",
                                    .width = 320,
                                    .height = 180,
                                    .rate = 60,
                                    .controls = still("100_colorbar")});
  ASSERT_TRUE(source);
  const CapturedFrame frame = next(*source);
  const auto mean = [&](int x, int y,
                        int channel) {  // of the neighbours under that filter, or the pixel itself
    if (filter_at(order, x, y) == channel) return colour_bar(x, 320)[static_cast<std::size_t>(channel)];
    // Nearest first: green and the row's or column's own colour lie beside a pixel, the third at its corners.
    double sum = 0;
    int count = 0;
    for (const bool corners : {false, true}) {
      if (count > 0) break;
      for (int dy = -1; dy <= 1; ++dy) {
        for (int dx = -1; dx <= 1; ++dx) {
          if ((dx != 0 && dy != 0) != corners || (dx == 0 && dy == 0)) continue;
          if (filter_at(order, x + dx + 2, y + dy + 2) != channel) continue;
          sum += colour_bar(x + dx, 320)[static_cast<std::size_t>(channel)];
          ++count;
        }
      }
    }
    return sum / count;
  };
  expect_picture(frame.picture, 1, [&](int x, int y) {
    // The outermost pixels have their neighbours' values.
    const int inner_x = std::clamp(x, 1, 318), inner_y = std::clamp(y, 1, 178);
    return Rgb{mean(inner_x, inner_y, 0), mean(inner_x, inner_y, 1), mean(inner_x, inner_y, 2)};
  });
}

INSTANTIATE_TEST_SUITE_P(Vivid, Bayer, testing::Values("RGGB", "BGGR", "GRBG", "GBRG"),
                         [](const auto& test) { return std::string(test.param); });

struct CodingCase {
  const char* name;
  const char* encoding;      // vivid's menu
  const char* quantization;  // vivid's menu
  Luma luma;
};

void PrintTo(const CodingCase& c, std::ostream* out) {
  *out << c.name;
}

class Codings : public testing::TestWithParam<CodingCase> {};

TEST_P(Codings, MatrixAndRangeAreTheDrivers) {
  const CodingCase& c = GetParam();
  auto controls = still("100_colorbar");
  controls.push_back({"y_cbcr_encoding", c.encoding});
  controls.push_back({"quantization", c.quantization});
  set(kVivid, controls);  // before the format is asked for: it is stated there
  const auto source = open(kVivid, {.input = "0", .format = "YUYV", .width = 320, .height = 180, .rate = 60});
  ASSERT_TRUE(source);
  const bool full = std::string(c.quantization) == "full_range";
  // The driver's whole-numbered matrices are up to a step off in each sample; another matrix or range is off
  // by more than ten levels.
  expect_picture(next(*source).picture, 2.5,
                 [&](int x, int) { return subsampled_bar(x, 320, c.luma, full); });
}

INSTANTIATE_TEST_SUITE_P(Vivid, Codings,
                         testing::Values(CodingCase{"Bt601Full", "itu_r_601", "full_range", kBt601},
                                         CodingCase{"Bt709Limited", "rec_709", "limited_range", kBt709},
                                         CodingCase{"Bt709Full", "rec_709", "full_range", kBt709},
                                         CodingCase{"Bt2020Limited", "bt_2020", "limited_range", kBt2020},
                                         CodingCase{"Smpte240Limited", "smpte_240m", "limited_range",
                                                    kSmpte240}),
                         [](const auto& test) { return std::string(test.param.name); });

struct FieldCase {
  const char* name;
  const char* standard;
  const char* field;
  const char* format;
};

void PrintTo(const FieldCase& c, std::ostream* out) {
  *out << c.name;
}

class Fields : public testing::TestWithParam<FieldCase> {};

TEST_P(Fields, RowsLieWhereTheyBelong) {
  const FieldCase& c = GetParam();
  const bool ntsc = std::string(c.standard).starts_with("NTSC");
  const auto source = open(kVivid, {.input = "S-Video 0",
                                    .standard = c.standard,
                                    .format = c.format,
                                    .field = c.field,
                                    .controls = still("alternating_hor_lines")});
  ASSERT_TRUE(source);
  const Rig& rig = source->info().rig;
  EXPECT_EQ(rig.scan, Scan::kInterlaced);
  EXPECT_EQ(rig.camera.width, 720);
  EXPECT_EQ(rig.camera.height, ntsc ? 480 : 576);
  EXPECT_NEAR(rig.frame_rate, ntsc ? 30000.0 / 1001 : 25, 1e-4);
  const std::string field = c.field;
  const bool bottom_first = field == "seq-bt" || (field != "seq-tb" && ntsc);
  EXPECT_EQ(rig.field_order, bottom_first ? FieldOrder::kBottom : FieldOrder::kTop);
  for (std::uint64_t i = 0; i < 3; ++i) {
    const CapturedFrame frame = next(*source);
    EXPECT_EQ(frame.number, i);
    const int from = ntsc ? 0 : 1;  // the driver's first PAL row is half a line and a signal to the screen
    expect_picture(frame.picture, 1, [&](int x, int y) {
      if (y < from)
        return Rgb{1.0 * frame.picture.row(y)[3 * x], 1.0 * frame.picture.row(y)[3 * x + 1],
                   1.0 * frame.picture.row(y)[3 * x + 2]};
      const double level = y % 2 == 0 ? 0 : 255;
      return Rgb{level, level, level};
    });
    EXPECT_NEAR(seconds(frame.time_ns), seconds(utc_now_ns()), 2);
  }
  std::vector<double> periods_ms;
  CapturedFrame before = next(*source);
  while (periods_ms.size() < 5) {
    CapturedFrame frame = next(*source);
    periods_ms.push_back(static_cast<double>(frame.time_ns - before.time_ns) * 1e-6 /
                         static_cast<double>(frame.number - before.number));
    before = std::move(frame);
  }
  // The driver's stamps are those of its 4 ms clock, or later where the guest had no processor.
  std::nth_element(periods_ms.begin(), periods_ms.begin() + 2, periods_ms.end());
  EXPECT_NEAR(periods_ms[2], 1000 / rig.frame_rate, 9);
}

INSTANTIATE_TEST_SUITE_P(Vivid, Fields,
                         testing::Values(FieldCase{"NtscInterlaced", "NTSC-M", "interlaced", "RGB24"},
                                         FieldCase{"NtscSequentialTop", "NTSC-M", "seq-tb", "RGB24"},
                                         FieldCase{"NtscSequentialBottom", "NTSC-M", "seq-bt", "UYVY"},
                                         FieldCase{"NtscAlternate", "NTSC-M", "alternate", "RGB24"},
                                         FieldCase{"PalInterlaced", "PAL-B", "interlaced", "YUYV"},
                                         FieldCase{"PalInterlacedNv12", "PAL-B", "interlaced", "NV12"},
                                         FieldCase{"PalSequentialNv12", "PAL-B", "seq-tb", "NV12"},
                                         FieldCase{"PalAlternate", "PAL-B", "alternate", "YUYV"}),
                         [](const auto& test) { return std::string(test.param.name); });

TEST(Settings, WhatTheDeviceDoesNotGiveIsSaid) {
  const auto refused = [](const CameraOptions& options) {
    const auto source = open_source("v4l2:" + kVivid, {.camera = options});
    EXPECT_FALSE(source);
    return source ? std::string() : source.error().message;
  };
  EXPECT_NE(refused({.input = "9"}).find("0 (Webcam 0)"), std::string::npos);
  EXPECT_NE(refused({.input = "2", .standard = "PAL-X"}).find("NTSC-M"), std::string::npos);
  EXPECT_NE(refused({.input = "0", .standard = "NTSC-M"}).find("takes no TV standard"), std::string::npos);
  EXPECT_NE(refused({.input = "0", .format = "MJPEG"}).find("YUYV"), std::string::npos);
  EXPECT_NE(refused({.input = "0", .width = 333, .height = 222}).find("instead of 333x222"),
            std::string::npos);
  EXPECT_NE(refused({.input = "0", .width = 320, .height = 180, .rate = 61}).find("60.00"),
            std::string::npos);
  EXPECT_NE(refused({.controls = {{"brightness", "300"}}}).find("0 to 255"), std::string::npos);
  EXPECT_NE(refused({.controls = {{"shine", "3"}}}).find("brightness"), std::string::npos);
  EXPECT_NE(refused({.controls = {{"read_only_integer_32_bits", "3"}}}).find("can only be read"),
            std::string::npos);
}

TEST(Settings, ASecondProgramIsToldThatTheCameraIsInUse) {
  const auto first = open(kVivid, {.input = "0", .width = 320, .height = 180});
  ASSERT_TRUE(first);
  const auto second = open_source("v4l2:" + kVivid, {.camera = {.width = 320, .height = 180}});
  ASSERT_FALSE(second);
  EXPECT_NE(second.error().message.find("in use"), std::string::npos) << second.error().message;
}

}  // namespace
}  // namespace relievo
