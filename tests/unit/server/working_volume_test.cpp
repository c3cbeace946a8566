// SPDX-License-Identifier: Apache-2.0
#include "server/working_volume.h"

#include <gtest/gtest.h>

namespace relievo {
namespace {

std::vector<Vec3f> block(std::size_t count, float from, float to) {
  std::vector<Vec3f> out;
  for (std::size_t i = 0; i < count; ++i) {
    const float f = static_cast<float>(i) / static_cast<float>(count - 1);
    const float v = from + f * (to - from);
    out.push_back({v - 1, 0.5F * (v - 1), v});
  }
  return out;
}

TEST(WorkingVolume, HasRoomAndStaysWhileFramesStayInside) {
  WorkingVolume volume{Volume{}};
  const Volume first = volume.fit(block(5000, 0.9F, 1.1F));
  EXPECT_NEAR(first.size_m, 0.25F, 0.001F);
  const Volume second = volume.fit(block(5000, 0.89F, 1.11F));
  EXPECT_EQ(second.size_m, first.size_m);
  EXPECT_EQ(second.min, first.min);
}

TEST(WorkingVolume, GrowsForAFrameThatLeavesIt) {
  WorkingVolume volume{Volume{}};
  volume.fit(block(5000, 0.9F, 1.1F));
  const Volume grown = volume.fit(block(5000, 0.9F, 1.5F));
  EXPECT_LE(grown.min[2], 0.875F);
  EXPECT_GE(grown.min[2] + grown.size_m, 1.5F);
}

TEST(WorkingVolume, AFewWrongPointsDoNotBlowItUp) {
  WorkingVolume volume{Volume{}};
  std::vector<Vec3f> points = block(10'000, 0.9F, 1.1F);
  points.push_back({0, 0, 50});
  EXPECT_LT(volume.fit(points).size_m, 0.3F);
  const Volume before = volume.fit(points);
  points.push_back({0, 0, 0.01F});
  EXPECT_EQ(volume.fit(points).size_m, before.size_m);
  EXPECT_EQ(volume.bits(1e-3), 9);  // 0.25 m in steps of 0.9 mm
}

TEST(WorkingVolume, AFixedOneIsKept) {
  WorkingVolume volume{Volume{{-1, -1, 0}, 2}};
  EXPECT_EQ(volume.fit(block(10, 5, 9)).size_m, 2);
  EXPECT_EQ(volume.bits(1e-4), 0);
}

}  // namespace
}  // namespace relievo
