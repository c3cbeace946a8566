// SPDX-License-Identifier: Apache-2.0
#include "idl/ros_publisher.h"

#include <dds/dds.h>

#include <utility>

#include "idl/domain.h"
#include "idl/frame_writer.h"
#include "idl/raw_type.h"
#include "idl/topics.h"
#include "ros.h"

namespace relievo {
namespace {

constexpr int kDepth = 5;
constexpr std::int64_t kMaxBlocking_ns = 100'000'000;

struct TypeRow {
  const char* name;
  const dds_topic_descriptor_t* type;
};
constexpr TypeRow kTypes[] = {
    {"sensor_msgs/msg/PointCloud2", &sensor_msgs_msg_dds__PointCloud2__desc},
    {"sensor_msgs/msg/CompressedImage", &sensor_msgs_msg_dds__CompressedImage__desc},
    {"sensor_msgs/msg/CameraInfo", &sensor_msgs_msg_dds__CameraInfo__desc},
    {"tf2_msgs/msg/TFMessage", &tf2_msgs_msg_dds__TFMessage__desc}};

Qos topic_qos() {
  Qos qos(dds_create_qos());
  const dds_data_representation_id_t representation = DDS_DATA_REPRESENTATION_XCDR1;
  dds_qset_data_representation(qos.get(), 1, &representation);
  dds_qset_reliability(qos.get(), DDS_RELIABILITY_RELIABLE, kMaxBlocking_ns);
  dds_qset_durability(qos.get(), DDS_DURABILITY_VOLATILE);
  dds_qset_history(qos.get(), DDS_HISTORY_KEEP_LAST, kDepth);
  return qos;
}

class DdsRosPublisher final : public RosPublisher {
 public:
  static Result<std::unique_ptr<RosPublisher>> open(const DomainOptions& options,
                                                    const std::vector<RosPublication>& publications) {
    auto domain = Domain::open(options);
    if (!domain) return domain.error();
    auto publisher = std::make_unique<DdsRosPublisher>();
    publisher->domain_ = *std::move(domain);
    for (const RosPublication& publication : publications)
      if (auto added = publisher->add(publication); !added) return added.error().in(publication.topic);
    return std::unique_ptr<RosPublisher>(std::move(publisher));
  }

  bool has_readers(std::size_t index) const override {
    return matched_readers_of(topics_[index].writer.get()) > 0;
  }

  Status publish(std::size_t index, const Bytes& cdr) override {
    ddsi_serdata* const data = topics_[index].type.make(cdr);
    if (data == nullptr) return Error{"a message of " + topics_[index].name + " is none of its type"};
    const auto code = dds_writecdr(topics_[index].writer.get(), data);
    // A reader that does not keep up loses it, no other.
    if (code < 0 && code != DDS_RETCODE_TIMEOUT) return dds_error(code, "cannot publish for ROS");
    return {};
  }

 private:
  struct Published {
    std::string name;
    Entity topic, writer;
    RawType type;
  };

  Status add(const RosPublication& publication) {
    const dds_topic_descriptor_t* described = nullptr;
    for (const TypeRow& row : kTypes)
      if (row.name == publication.type) described = row.type;
    if (described == nullptr) return Error{"type " + publication.type + " is not known"};
    // ROS says nothing of its types beyond their names either.
    const dds_topic_descriptor_t type = type_by_name(*described, described->m_typename);
    const std::int32_t participant = domain_->plain_participant();
    const Qos qos = topic_qos();
    auto topic = take_entity(
        dds_create_topic(participant, &type, ("rt" + publication.topic).c_str(), qos.get(), nullptr),
        "topic");
    if (!topic) return topic.error();
    const auto writer_in = [&](std::int32_t group) {
      return take_entity(dds_create_writer(group, topic->get(), qos.get(), nullptr), "writer");
    };
    const auto reader_in = [&](std::int32_t group) {
      return take_entity(dds_create_reader(group, topic->get(), qos.get(), nullptr), "reader");
    };
    // Null strings and sequences of nothing: one of them all.
    const Bytes nothing(type.m_size);
    auto raw = RawType::find(participant, reader_in, writer_in, nothing.data());
    if (!raw) return raw.error();
    auto writer = writer_in(participant);
    if (!writer) return writer.error();
    topics_.push_back({publication.topic, *std::move(topic), *std::move(writer), *std::move(raw)});
    return {};
  }

  std::shared_ptr<Domain> domain_;
  std::vector<Published> topics_;
};

}  // namespace

Result<std::unique_ptr<RosPublisher>> RosPublisher::open(const DomainOptions& domain,
                                                         const std::vector<RosPublication>& publications) {
  return DdsRosPublisher::open(domain, publications);
}

}  // namespace relievo
