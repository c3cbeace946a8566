// SPDX-License-Identifier: Apache-2.0
// Proves: topics for ROS open whatever their names are, and whatever the memory held before that is taken
// for it.
#include "idl/ros_publisher.h"

#include <gtest/gtest.h>
#include <malloc.h>

#include "tests/support/own_domain.h"

namespace relievo::test {
namespace {

TEST(RosPublisher, OpensInMemoryThatWasUsedBefore) {
  mallopt(M_PERTURB, 0x55);  // new memory is full of 0xaa
  const auto publisher =
      RosPublisher::open({own_domain(), "lo"}, {{"/a/points", "sensor_msgs/msg/PointCloud2"},
                                                {"/a/image", "sensor_msgs/msg/CompressedImage"},
                                                {"/a/info", "sensor_msgs/msg/CameraInfo"},
                                                {"/tf", "tf2_msgs/msg/TFMessage"}});
  mallopt(M_PERTURB, 0);
  ASSERT_TRUE(publisher.ok()) << publisher.error().message;
  for (std::size_t i = 0; i < 4; ++i) EXPECT_FALSE((*publisher)->has_readers(i));
}

}  // namespace
}  // namespace relievo::test
