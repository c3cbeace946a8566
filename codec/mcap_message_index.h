// SPDX-License-Identifier: Apache-2.0
// Where the messages of a chunk lie, without reading the chunk.
#pragma once

#include <cstdint>
#include <vector>

#include "base/result.h"
#include "codec/mcap_scan.h"

namespace relievo::mcap {

struct MessagePlace {
  std::uint64_t log_time = 0;
  std::uint16_t channel_id = 0;
  std::uint64_t offset = 0;  // of its record, in the file
};

/// From the chunk's message indexes, in the order of time; what they say is only checked for lying within the
/// chunk. Where there are none, from the chunk itself. Fails where it cannot be read.
Result<std::vector<MessagePlace>> read_message_places(const File& file, const ChunkIndex& chunk);

/// The same of a chunk's records; offsets are from `base`, where they begin.
Result<std::vector<MessagePlace>> message_places(std::span<const std::uint8_t> records, std::uint64_t base);

}  // namespace relievo::mcap
