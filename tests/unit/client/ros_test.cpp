// SPDX-License-Identifier: Apache-2.0
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <limits>

#include "client/ros/messages.h"

namespace relievo {
namespace {

TEST(RosNames, AreWhatRosTakes) {
  for (const auto& [stream, name] : {std::pair{"face", "face"},
                                     {"my-rig.2", "my_rig_2"},
                                     {"a_-.b", "a_b"},
                                     {"2nd", "stream_2nd"},
                                     {"_hidden", "hidden"},
                                     {"a-", "a"},
                                     {"---", "stream"}})
    EXPECT_EQ(ros_name(stream), name) << stream;
}

TEST(RosNames, ASurfaceThatIsNoneIsRefused) {
  Frame3D frame;
  frame.surface.positions.resize(3);
  frame.surface.triangles.push_back({0, 1, 3});
  EXPECT_FALSE(ros_message(RosTopic::kPoints, frame, "face", nullptr).ok());
}

TEST(RosTimes, EndIn2038) {
  Frame3D frame;
  frame.time_ns = 2'147'483'647'999'999'999;
  EXPECT_TRUE(ros_message(RosTopic::kPoints, frame, "face", nullptr).ok());
  for (const std::int64_t later_ns :
       {std::int64_t{1}, std::numeric_limits<std::int64_t>::max() - frame.time_ns}) {
    Frame3D late;
    late.time_ns = frame.time_ns + later_ns;
    const auto refused = ros_message(RosTopic::kPoints, late, "face", nullptr);
    ASSERT_FALSE(refused.ok());
    EXPECT_THAT(refused.error().message, testing::HasSubstr("no times after 2038-01-19T03:14:07Z"));
  }
}

}  // namespace
}  // namespace relievo
