// SPDX-License-Identifier: Apache-2.0
// The topics' names and QoS, in one table. Internal to idl/, except topic_type() of idl/transport.h.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

#include "base/result.h"
#include "base/rung.h"
#include "idl/entity.h"
#include "idl/transport.h"

struct dds_topic_descriptor;

namespace relievo {

/// What a stream's server writes: the topics that are subscribed to, recorded and played.
constexpr std::array<Topic, 3> kTopics = {Topic::kInfo, Topic::kFrame, Topic::kStatus};

/// A killed writer's stream is gone after this. Cyclone renews it with every sample and, while there is none,
/// each four fifths of it: short enough to be noticed, long enough for a loaded machine to be half a second
/// late.
constexpr std::int64_t kLiveliness_ns = 2'500'000'000;

/// Who speaks of a stream: its server, or whoever watches it.
enum class Role { kServer, kWatcher };

/// A DDS publisher (`writing`) or subscriber for one stream, or for all where the name is empty. Servers are
/// in the partition of their stream's name and in the unnamed one; watchers of one stream in its name's, so
/// that no other stream's data travels to them, watchers of all in the unnamed one.
Result<Entity> create_group(std::int32_t participant, Role role, bool writing, const std::string& stream);

/// The same for a lower rung of a stream's ladder, which has a partition of its own, "STREAM/QUALITY": no
/// watcher of all streams is sent it unasked. kFull is the stream itself.
Result<Entity> create_group(std::int32_t participant, Role role, bool writing, const std::string& stream,
                            Rung rung);

/// A writer or reader of `topic` in `group`, with the table's QoS. The DDS topic is made as needed and lives
/// with the participant.
/// `depth`: other than the table's many samples kept for who asks again.
Result<Entity> create_writer(std::int32_t participant, std::int32_t group, Topic topic,
                             std::optional<int> depth = {});
Result<Entity> create_reader(std::int32_t participant, std::int32_t group, Topic topic);

/// The same for readers that know XCDR1 alone, such as Fast DDS 2: they find no other, and ours not this one.
/// Takes the samples of the other writer.
Result<Entity> create_cdr1_writer(std::int32_t participant, std::int32_t group, Topic topic);

/// The type under that name, of which nothing else is said: readers that know nothing of XTypes go by the
/// name.
dds_topic_descriptor type_by_name(const dds_topic_descriptor& type, const char* name);

/// What is said beside the streams: never recorded.
enum class SideTopic : std::uint8_t {
  kKeyFrameRequest,  // watchers to servers; one that nobody hears is gone
  kSecuredNotice,    // servers to watchers, kept for those that come late
  kClockQuestion,    // watchers to servers; one that is late is of no use, so none is sent again
  kClockAnswer,      // servers to watchers, likewise
};
Result<Entity> create_writer(std::int32_t participant, std::int32_t group, SideTopic topic);
Result<Entity> create_reader(std::int32_t participant, std::int32_t group, SideTopic topic);

}  // namespace relievo
