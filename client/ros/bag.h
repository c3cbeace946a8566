// SPDX-License-Identifier: Apache-2.0
// A recording that ROS 2 plays: an MCAP file of the profile "ros2", as rosbag2 writes them.
#pragma once

#include <filesystem>
#include <map>
#include <memory>
#include <optional>
#include <string>

#include "base/frame3d.h"
#include "base/result.h"
#include "base/rig.h"
#include "client/ros/messages.h"
#include "codec/recording.h"

namespace relievo {

/// A file of that name appears, or is replaced, when finish() succeeds. One thread.
class RosBag {
 public:
  /// `rig`: nothing where the camera is not known.
  static Result<RosBag> create(const std::filesystem::path& file, const std::string& stream,
                               std::optional<Rig> rig);
  RosBag(RosBag&&) = default;
  RosBag& operator=(RosBag&&) = delete;
  ~RosBag();

  /// Times rise. A topic is there from its first message on.
  Status add(const Frame3D& frame);
  Status finish();

 private:
  RosBag() = default;
  Result<std::uint16_t> channel_of(const RosTopicType& type);

  std::filesystem::path file_, unfinished_;
  std::string name_;
  std::optional<Rig> rig_;
  std::unique_ptr<RecordingWriter> writer_;
  std::map<RosTopic, std::uint16_t> channels_;
  std::uint32_t frames_ = 0;
};

}  // namespace relievo
