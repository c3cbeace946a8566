// SPDX-License-Identifier: Apache-2.0
// Frames as messages of ROS 2: what its nodes, RViz and readers of its bags know. Coordinates stay: the
// camera frame is ROS's optical frame (REP 103: x right, y down, z forward, metres).
#pragma once

#include <array>
#include <optional>
#include <string>

#include "base/frame3d.h"
#include "base/result.h"
#include "base/rig.h"
#include "base/stream.h"

namespace relievo {

enum class RosTopic { kPoints, kImage, kCameraInfo, kTransforms };

struct RosTopicType {
  RosTopic topic;
  std::string name;        // of the topic, behind the stream's; kTransforms has a name of its own, "/tf"
  std::string type;        // "sensor_msgs/msg/PointCloud2"
  std::string definition;  // as of encoding "ros2msg": of the type, then of those that it is made of
};
/// In the order of RosTopic.
const std::array<RosTopicType, 4>& ros_topic_types();

/// The stream's name as ROS wants one: letters, digits and single underscores, no digit first; other
/// characters become underscores. Topics begin with it, and it names the coordinate frame.
std::string ros_name(const std::string& stream);
/// "/face/points".
std::string ros_topic_name(const RosTopicType& type, const std::string& ros_name);

/// A topic's message, as CDR with its encapsulation header, with the frame's time:
/// - kPoints, sensor_msgs/PointCloud2: x y z (metres), rgb (packed as PCL has it: blue first; light grey
/// where
///   there is no texture), where known sigma (metres: standard deviation of the depth, 0 not known) and
///   interpolated (0 or 1);
/// - kImage, sensor_msgs/CompressedImage: the texture as a JPEG;
/// - kCameraInfo: the camera, at the texture's size;
/// - kTransforms, tf2_msgs/TFMessage: where the camera stands in the frame "world".
/// Nothing where that is not known; `rig` is null where the camera is not. Fails on a surface that
/// check_surface() refuses.
Result<std::optional<Bytes>> ros_message(RosTopic topic, const Frame3D& frame, const std::string& ros_name,
                                         const Rig* rig);

}  // namespace relievo
