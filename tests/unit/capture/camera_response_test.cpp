// SPDX-License-Identifier: Apache-2.0
#include "capture/camera_response.h"

#include <gtest/gtest.h>

#include <cmath>

#include "tests/support/simulated.h"

namespace relievo {
namespace {

TEST(CameraResponse, GivesBackWhatItTook) {
  for (const double gamma : {1., 1.4, 2.2, 2.6}) {
    const CameraResponse response(gamma);
    EXPECT_EQ(response.is_straight(), gamma == 1);
    for (int v = 0; v < 256; ++v) {
      const auto value = static_cast<std::uint8_t>(v);
      const float light = response.light_of(value);
      EXPECT_NEAR(light, 255 * std::pow(v / 255.0, gamma), 1e-4) << gamma;
      // Where light rises by less than a part of it, values next to each other are one.
      EXPECT_NEAR(response.value_of(light), v, v < 4 ? 4 : 0) << gamma << " " << v;
    }
    EXPECT_EQ(response.value_of(-3.F), 0);
    EXPECT_EQ(response.value_of(300.F), 255);
  }
}

TEST(CameraResponse, FramesAreStraightenedWhole) {
  const CameraResponse response(2.2);
  WorkerPool pool(2);
  for (const Scan scan : {Scan::kInterlaced, Scan::kProgressive}) {
    CapturedFrame frame;
    frame.number = 7;
    frame.time_ns = 11;
    frame.scan = scan;
    frame.field_order = FieldOrder::kBottom;
    frame.lost_before = 2;
    frame.picture = Image8(16, 16, 3);
    for (std::size_t i = 0; i < frame.picture.size(); ++i)
      frame.picture.data()[i] = static_cast<std::uint8_t>(i % 256);
    if (scan == Scan::kProgressive) frame.complement = frame.picture.clone();
    CapturedFrame out;
    response.straighten(frame, pool, out);
    EXPECT_EQ(out.number, 7U);
    EXPECT_EQ(out.time_ns, 11);
    EXPECT_EQ(out.scan, scan);
    EXPECT_EQ(out.field_order, FieldOrder::kBottom);
    EXPECT_EQ(out.lost_before, 2U);
    ASSERT_EQ(out.picture.size(), frame.picture.size());
    ASSERT_EQ(out.complement.size(), frame.complement.size());
    for (std::size_t i = 0; i < out.picture.size(); ++i) {
      const double light = 255 * std::pow(static_cast<double>(i % 256) / 255, 2.2);
      EXPECT_EQ(out.picture.data()[i], std::lround(light));
      if (scan == Scan::kProgressive) {
        EXPECT_EQ(out.complement.data()[i], std::lround(light));
      }
    }
  }
}

TEST(CameraResponse, ASimulatedCameraHasTheOneItsRigSays) {
  const test::Simulated straight("object,width=160,height=120,stripes=30");
  const test::Simulated curved("object,width=160,height=120,stripes=30,gamma=2.2");
  EXPECT_EQ(straight.rig.camera_gamma, 1);
  EXPECT_EQ(curved.rig.camera_gamma, 2.2);
  const CapturedFrame a = straight.frame(3), b = curved.frame(3);
  const CameraResponse response(2.2);
  for (std::size_t i = 0; i < a.picture.size(); ++i)
    EXPECT_NEAR(response.light_of(b.picture.data()[i]), a.picture.data()[i], 1.7);
}

}  // namespace
}  // namespace relievo
