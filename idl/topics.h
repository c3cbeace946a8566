// SPDX-License-Identifier: Apache-2.0
// The topics' names and QoS, in one table. Internal to idl/, except topic_type() of idl/transport.h.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

#include "base/result.h"
#include "idl/entity.h"
#include "idl/transport.h"

namespace relievo {

constexpr std::array<Topic, 3> kTopics = {Topic::kInfo, Topic::kFrame, Topic::kStatus};

/// A publisher or subscriber entity for one stream: writers offer their stream's name and the unnamed
/// partition; readers of one stream ask for its name, so that no other stream's data travels to them.
Result<Entity> create_group(std::int32_t participant, bool writing, const std::string& stream);

/// A writer or reader of `topic` in `group`, with the table's QoS. The DDS topic is made as needed and lives
/// with the participant.
Result<Entity> create_writer(std::int32_t participant, std::int32_t group, Topic topic);
Result<Entity> create_reader(std::int32_t participant, std::int32_t group, Topic topic);

}  // namespace relievo
