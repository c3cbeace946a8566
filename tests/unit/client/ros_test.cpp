// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

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

}  // namespace
}  // namespace relievo
