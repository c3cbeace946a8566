// SPDX-License-Identifier: Apache-2.0
#include "client/ros/bag.h"

#include <system_error>
#include <utility>

#include "base/whole_file.h"

namespace relievo {

namespace fs = std::filesystem;

Result<RosBag> RosBag::create(const fs::path& file, const std::string& stream, std::optional<Rig> rig) {
  const auto target = where_to_write(file);
  if (!target) return target.error();
  RosBag bag;
  bag.file_ = *target;
  bag.name_ = ros_name(stream);
  bag.rig_ = std::move(rig);
  const fs::path unfinished = unfinished_name(bag.file_);
  auto writer = RecordingWriter::create(unfinished, {.sync_ns = -1, .profile = "ros2"});
  if (!writer) return told_of(bag.file_, writer.error(), unfinished);
  bag.unfinished_ = unfinished;
  bag.writer_ = *std::move(writer);
  return bag;
}

RosBag::~RosBag() {
  if (!writer_) return;
  writer_.reset();
  std::error_code ignored;
  fs::remove(unfinished_, ignored);
}

Result<std::uint16_t> RosBag::channel_of(const RosTopicType& type) {
  const auto known = channels_.find(type.topic);
  if (known != channels_.end()) return known->second;
  const auto added = writer_->add_channel({type.type, "ros2msg", type.definition},
                                          {ros_topic_name(type, name_), "cdr", type.type, {}});
  if (added) channels_[type.topic] = *added;
  return added;
}

Status RosBag::add(const Frame3D& frame) {
  for (const RosTopicType& type : ros_topic_types()) {
    auto message = ros_message(type.topic, frame, name_, rig_ ? &*rig_ : nullptr);
    if (!message) return message.error();
    if (!*message) continue;
    const auto channel = channel_of(type);
    if (!channel) return channel.error();
    if (auto status = writer_->write({*channel, frames_, frame.time_ns, frame.time_ns, **std::move(message)});
        !status)
      return told_of(file_, status.error(), unfinished_);
  }
  ++frames_;
  return {};
}

Status RosBag::finish() {
  if (auto status = writer_->finish(); !status) return told_of(file_, status.error(), unfinished_);
  std::error_code failed;
  fs::rename(unfinished_, file_, failed);
  if (failed) return Error{"cannot write " + file_.string() + ": " + failed.message()};
  writer_.reset();
  return {};
}

}  // namespace relievo
