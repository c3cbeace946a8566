// SPDX-License-Identifier: Apache-2.0
#include "idl/topics.h"

#include <dds/dds.h>

#include <memory>

#include "idl/idl_text.h"
#include "relievo.h"
#include "relievo_cdr1.h"

namespace relievo {
namespace {

constexpr std::int64_t kMaxBlocking_ns = 100'000'000;  // a publisher waits no longer for its socket
constexpr int kMaxStreams = 256;                       // of a reader: what a hostile peer can make it hold

struct TopicRow {
  const dds_topic_descriptor_t* type;
  dds_durability_kind_t durability;
  int writer_depth;  // samples a stream kept for retransmission and late joiners
  int reader_depth;  // samples a stream waiting for a slow callback
};

// Always RELIABLE and KEEP_LAST: with KEEP_ALL one stopped reader would stall the writer and so everybody.
const TopicRow& row(Topic topic) {
  static const TopicRow rows[] = {
      {&relievo_StreamInfo_desc, DDS_DURABILITY_TRANSIENT_LOCAL, 1, 1},
      {&relievo_Frame_desc, DDS_DURABILITY_VOLATILE, 16, 32},
      {&relievo_ServerStatus_desc, DDS_DURABILITY_TRANSIENT_LOCAL, 1, 4},
  };
  return rows[static_cast<std::size_t>(topic)];
}

Qos reliable_qos(dds_durability_kind_t durability,
                 dds_data_representation_id_t representation = DDS_DATA_REPRESENTATION_XCDR2) {
  Qos qos(dds_create_qos());
  dds_qset_reliability(qos.get(), DDS_RELIABILITY_RELIABLE, kMaxBlocking_ns);
  dds_qset_durability(qos.get(), durability);
  dds_qset_data_representation(qos.get(), 1, &representation);
  return qos;
}

// In XCDR2 as far as nothing else is said, also of types that could be had in others: Cyclone wants all
// topics of a name alike.
Result<Entity> create_topic(std::int32_t participant, const dds_topic_descriptor_t& type,
                            const std::string& name) {
  const Qos qos(dds_create_qos());
  const dds_data_representation_id_t representation = DDS_DATA_REPRESENTATION_XCDR2;
  dds_qset_data_representation(qos.get(), 1, &representation);
  return take_entity(dds_create_topic(participant, &type, name.c_str(), qos.get(), nullptr), "topic " + name);
}

Result<Entity> create_topic(std::int32_t participant, Topic topic) {
  return create_topic(participant, *row(topic).type, topic_type(topic).topic_name);
}

/// Says that it is the topic's own type, and nothing of how that is made.
dds_topic_descriptor_t cdr1_type(Topic topic) {
  static_assert(sizeof(relievo_StreamInfo) == sizeof(relievo_cdr1_StreamInfo) &&
                sizeof(relievo_Frame) == sizeof(relievo_cdr1_Frame) &&
                sizeof(relievo_ServerStatus) == sizeof(relievo_cdr1_ServerStatus));
  static const dds_topic_descriptor_t* const types[] = {
      &relievo_cdr1_StreamInfo_desc, &relievo_cdr1_Frame_desc, &relievo_cdr1_ServerStatus_desc};
  return type_by_name(*types[static_cast<std::size_t>(topic)], row(topic).type->m_typename);
}

struct SideRow {
  const dds_topic_descriptor_t* type;
  const char* name;
  dds_durability_kind_t durability;
  bool reliable;
  int depth;  // 1: only the last one of a stream counts
};
const SideRow& row(SideTopic topic) {
  static const SideRow rows[] = {
      {&relievo_KeyFrameRequest_desc, "relievo/key_frame_request", DDS_DURABILITY_VOLATILE, true, 1},
      {&relievo_SecuredNotice_desc, "relievo/secured", DDS_DURABILITY_TRANSIENT_LOCAL, true, 1},
      {&relievo_ClockQuestion_desc, "relievo/clock_question", DDS_DURABILITY_VOLATILE, false, 32},
      {&relievo_ClockAnswer_desc, "relievo/clock_answer", DDS_DURABILITY_VOLATILE, false, 32},
  };
  return rows[static_cast<std::size_t>(topic)];
}

Qos side_qos(SideTopic topic) {
  Qos qos = reliable_qos(row(topic).durability);
  if (!row(topic).reliable) dds_qset_reliability(qos.get(), DDS_RELIABILITY_BEST_EFFORT, 0);
  dds_qset_history(qos.get(), DDS_HISTORY_KEEP_LAST, row(topic).depth);
  dds_qset_resource_limits(qos.get(), DDS_LENGTH_UNLIMITED, kMaxStreams, DDS_LENGTH_UNLIMITED);
  dds_qset_writer_data_lifecycle(qos.get(), false);
  return qos;
}

}  // namespace

dds_topic_descriptor type_by_name(const dds_topic_descriptor& type, const char* name) {
  return {.m_size = type.m_size,
          .m_align = type.m_align,
          .m_flagset = type.m_flagset & ~static_cast<std::uint32_t>(DDS_TOPIC_XTYPES_METADATA),
          .m_nkeys = type.m_nkeys,
          .m_typename = name,
          .m_keys = type.m_keys,
          .m_nops = type.m_nops,
          .m_ops = type.m_ops,
          .m_meta = type.m_meta,
          .type_information = {},
          .type_mapping = {},
          .restrict_data_representation = type.restrict_data_representation};
}

const TopicType& topic_type(Topic topic) {
  static const TopicType types[] = {
      {"relievo::StreamInfo", "relievo/info", kIdlText},
      {"relievo::Frame", "relievo/frame", kIdlText},
      {"relievo::ServerStatus", "relievo/status", kIdlText},
  };
  return types[static_cast<std::size_t>(topic)];
}

Result<Entity> create_group(std::int32_t participant, Role role, bool writing, const std::string& stream) {
  Qos qos(dds_create_qos());
  const char* partitions[] = {stream.c_str(), ""};
  if (role == Role::kServer) {
    dds_qset_partition(qos.get(), 2, partitions);
  } else if (!stream.empty()) {
    dds_qset_partition(qos.get(), 1, partitions);
  }
  return writing ? take_entity(dds_create_publisher(participant, qos.get(), nullptr), "publisher")
                 : take_entity(dds_create_subscriber(participant, qos.get(), nullptr), "subscriber");
}

Result<Entity> create_group(std::int32_t participant, Role role, bool writing, const std::string& stream,
                            Rung rung) {
  if (rung == Rung::kFull) return create_group(participant, role, writing, stream);
  return create_group(participant, Role::kWatcher, writing, stream + "/" + std::string(to_string(rung)));
}

namespace {

Result<Entity> create_writer(std::int32_t group, Topic topic, Result<Entity> dds_topic, Qos qos,
                             std::optional<int> depth) {
  if (!dds_topic) return dds_topic.error();
  dds_qset_history(qos.get(), DDS_HISTORY_KEEP_LAST, depth.value_or(row(topic).writer_depth));
  dds_qset_liveliness(qos.get(), DDS_LIVELINESS_AUTOMATIC, kLiveliness_ns);
  // Otherwise a server's exit would read as "stream deleted" and a late joiner would get one sample at most.
  dds_qset_writer_data_lifecycle(qos.get(), false);
  if (row(topic).durability == DDS_DURABILITY_TRANSIENT_LOCAL) {
    dds_qset_durability_service(qos.get(), 0, DDS_HISTORY_KEEP_LAST, row(topic).writer_depth,
                                DDS_LENGTH_UNLIMITED, DDS_LENGTH_UNLIMITED, DDS_LENGTH_UNLIMITED);
  }
  return take_entity(dds_create_writer(group, dds_topic->get(), qos.get(), nullptr),
                     "writer of " + topic_type(topic).topic_name);
}

}  // namespace

Result<Entity> create_writer(std::int32_t participant, std::int32_t group, Topic topic,
                             std::optional<int> depth) {
  return create_writer(group, topic, create_topic(participant, topic), reliable_qos(row(topic).durability),
                       depth);
}

Result<Entity> create_cdr1_writer(std::int32_t participant, std::int32_t group, Topic topic) {
  const dds_topic_descriptor_t type = cdr1_type(topic);
  return create_writer(group, topic, create_topic(participant, type, topic_type(topic).topic_name),
                       reliable_qos(row(topic).durability, DDS_DATA_REPRESENTATION_XCDR1), std::nullopt);
}

Result<Entity> create_reader(std::int32_t participant, std::int32_t group, Topic topic) {
  auto dds_topic = create_topic(participant, topic);
  if (!dds_topic) return dds_topic.error();
  const Qos qos = reliable_qos(row(topic).durability);
  dds_qset_history(qos.get(), DDS_HISTORY_KEEP_LAST, row(topic).reader_depth);
  dds_qset_resource_limits(qos.get(), DDS_LENGTH_UNLIMITED, kMaxStreams, DDS_LENGTH_UNLIMITED);
  return take_entity(dds_create_reader(group, dds_topic->get(), qos.get(), nullptr),
                     "reader of " + topic_type(topic).topic_name);
}

Result<Entity> create_writer(std::int32_t participant, std::int32_t group, SideTopic topic) {
  auto dds_topic = create_topic(participant, *row(topic).type, row(topic).name);
  if (!dds_topic) return dds_topic.error();
  return take_entity(dds_create_writer(group, dds_topic->get(), side_qos(topic).get(), nullptr),
                     std::string("writer of ") + row(topic).name);
}

Result<Entity> create_reader(std::int32_t participant, std::int32_t group, SideTopic topic) {
  auto dds_topic = create_topic(participant, *row(topic).type, row(topic).name);
  if (!dds_topic) return dds_topic.error();
  return take_entity(dds_create_reader(group, dds_topic->get(), side_qos(topic).get(), nullptr),
                     std::string("reader of ") + row(topic).name);
}

}  // namespace relievo
