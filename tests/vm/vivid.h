// SPDX-License-Identifier: Apache-2.0
// The kernel's test camera, as the guest has it: what its devices are, its controls, what its pattern must
// give.
#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "capture/source/field_source.h"
#include "capture/source/v4l2/controls.h"

namespace relievo::test {

// As camera_test.cpp loads the drivers.
inline const std::string kVivid = "/dev/video0";
inline const std::string kMultiplanar = "/dev/video2";
inline const std::string kLoopback = "/dev/video20";

/// Sets controls of a device that may be streaming meanwhile.
inline void set(const std::string& device, const std::vector<CameraControl>& controls) {
  const auto opened = v4l2::Device::open(v4l2::kernel_io(), device);
  ASSERT_TRUE(opened) << opened.error().message;
  const Status done = v4l2::set_controls(*opened, controls);
  ASSERT_TRUE(done) << done.error().message;
}

/// What every test of pictures begins with: bright colours that each colour space has in common, no text.
inline std::vector<CameraControl> still(const std::string& pattern) {
  return {{"test_pattern", pattern},     {"osd_text_mode", "none"},
          {"colorspace", "srgb"},        {"y_cbcr_encoding", "0"},
          {"quantization", "0"},         {"transfer_function", "0"},
          {"standard_signal_mode", "0"}, {"percentage_of_dropped_buffers", "0"},
          {"wrap_sequence_number", "0"}, {"wrap_timestamp", "0"}};
}

inline std::unique_ptr<FieldSource> open(const std::string& device, const CameraOptions& options) {
  auto source = open_source("v4l2:" + device, {.camera = options});
  EXPECT_TRUE(source) << source.error().message;
  return source ? *std::move(source) : nullptr;
}

/// The next frame; a failure of the test and an empty one where there is none.
inline CapturedFrame next(FieldSource& source) {
  auto frame = source.next();
  if (!frame) {
    ADD_FAILURE() << frame.error().message;
    return {};
  }
  if (!*frame) {
    ADD_FAILURE() << "ended";
    return {};
  }
  return *std::move(*frame);
}

using Rgb = std::array<double, 3>;

/// "100% Colorbar": white, yellow, cyan, green, magenta, red, blue, black, an eighth of the width each.
inline Rgb colour_bar(int x, int width) {
  const int bar = 8 * x / width;
  return {bar & 2 ? 0.0 : 255.0, bar & 4 ? 0.0 : 255.0, bar & 1 ? 0.0 : 255.0};
}

/// Luma's shares of red and blue.
struct Luma {
  double kr, kb;
};
constexpr Luma kBt601{0.299, 0.114}, kBt709{0.2126, 0.0722}, kBt2020{0.2627, 0.0593}, kSmpte240{0.212, 0.087};

/// What the driver's pattern sends in 8 bits: it scales by 255/256 and truncates.
struct Samples {
  int y, cb, cr;
};
inline Samples sent(const Rgb& rgb, const Luma& luma, bool full_range) {
  const double y = (luma.kr * rgb[0] + (1 - luma.kr - luma.kb) * rgb[1] + luma.kb * rgb[2]) / 255;
  const double pb = (rgb[2] / 255 - y) / (2 * (1 - luma.kb)), pr = (rgb[0] / 255 - y) / (2 * (1 - luma.kr));
  const auto scaled = [](double black, double range, double value) {
    return static_cast<int>(std::floor(black + range * value * 255 / 256));
  };
  const double chroma = full_range ? 255 : 224;
  return {scaled(full_range ? 0 : 16, full_range ? 255 : 219, y), scaled(128, chroma, pb),
          scaled(128, chroma, pr)};
}

/// What such samples mean.
inline Rgb received(double y8, double cb8, double cr8, const Luma& luma, bool full_range) {
  const double y = full_range ? y8 / 255 : (y8 - 16) / 219;
  const double pb = (cb8 - 128) / (full_range ? 255 : 224), pr = (cr8 - 128) / (full_range ? 255 : 224);
  const double r = y + 2 * (1 - luma.kr) * pr, b = y + 2 * (1 - luma.kb) * pb;
  const double g = (y - luma.kr * r - luma.kb * b) / (1 - luma.kr - luma.kb);
  const auto byte = [](double v) { return std::clamp(255 * v, 0.0, 255.0); };
  return {byte(r), byte(g), byte(b)};
}

/// The bars after chroma of the even pixels alone was sent, and interpolated between them.
inline Rgb subsampled_bar(int x, int width, const Luma& luma, bool full_range = false) {
  const Samples here = sent(colour_bar(x, width), luma, full_range);
  if (x % 2 == 0) return received(here.y, here.cb, here.cr, luma, full_range);
  const Samples before = sent(colour_bar(x - 1, width), luma, full_range);
  const Samples after = sent(colour_bar(std::min(x + 1, width - 2), width), luma, full_range);
  return received(here.y, 0.5 * (before.cb + after.cb), 0.5 * (before.cr + after.cr), luma, full_range);
}

/// Every pixel within `tolerance` of expected(x, y); says where it is worst.
template <typename Expected>
void expect_picture(const Image8& picture, double tolerance, const Expected& expected) {
  double worst = -1;
  int worst_x = 0, worst_y = 0, worst_channel = 0;
  for (int y = 0; y < picture.height(); ++y) {
    for (int x = 0; x < picture.width(); ++x) {
      const Rgb want = expected(x, y);
      for (int c = 0; c < 3; ++c) {
        const double off = std::abs(picture.row(y)[3 * x + c] - want[static_cast<std::size_t>(c)]);
        if (off > worst) worst = off, worst_x = x, worst_y = y, worst_channel = c;
      }
    }
  }
  ASSERT_GE(worst, 0) << "an empty picture";
  EXPECT_LE(worst, tolerance) << "channel " << worst_channel << " at " << worst_x << "," << worst_y << " is "
                              << int{picture.row(worst_y)[3 * worst_x + worst_channel]};
}

}  // namespace relievo::test
