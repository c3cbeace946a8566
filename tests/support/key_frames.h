// SPDX-License-Identifier: Apache-2.0
// Frames of a plausible stream in which not every one decodes alone. Their geometry is no geometry.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>

#include "base/time.h"
#include "codec/frame_layout.h"

namespace relievo::test {

/// Frame `sequence` of a stream whose every `key_interval`th is a key frame.
inline FrameMessage frame_of_group(std::uint64_t sequence, std::uint64_t key_interval,
                                   std::size_t size = 1000) {
  const Bytes geometry(size, static_cast<std::uint8_t>(sequence));
  FrameHeader header;
  header.number = sequence;
  header.is_key = sequence % key_interval == 0;
  FrameSections sections;
  sections.geometry = geometry;
  FrameMessage message;
  message.sequence = message.number = sequence;
  message.capture_time_ns = message.publish_time_ns = utc_now_ns();
  message.data = std::make_shared<const Bytes>(write_frame(header, sections));
  return message;
}

}  // namespace relievo::test
