// SPDX-License-Identifier: Apache-2.0
// Messages onto the network as ROS 2 nodes hear them, without ROS.
#pragma once

#include <cstddef>
#include <memory>
#include <string>
#include <vector>

#include "base/result.h"
#include "base/stream.h"
#include "idl/transport.h"

namespace relievo {

struct RosPublication {
  std::string topic;  // "/face/points"
  std::string type;   // "sensor_msgs/msg/PointCloud2", of those in idl/ros.idl
};

/// Writers of topics, found by nodes on any of ROS's DDS middlewares: reliable, the last few messages kept,
/// for readers of either reliability. Nothing is encrypted, whatever keys there are. One thread.
class RosPublisher {
 public:
  static Result<std::unique_ptr<RosPublisher>> open(const DomainOptions& domain,
                                                    const std::vector<RosPublication>& publications);
  virtual ~RosPublisher() = default;

  /// Of the publication `index`.
  virtual bool has_readers(std::size_t index) const = 0;
  /// `cdr`: XCDR1 with its encapsulation header. A reader that does not keep up may make it wait a tenth of a
  /// second, and loses messages.
  virtual Status publish(std::size_t index, const Bytes& cdr) = 0;
};

}  // namespace relievo
