// SPDX-License-Identifier: Apache-2.0
// Reads samples as they are on the wire and in recordings (CDR with its 4-byte encapsulation header) without
// DDS. Any input: bytes from the network are hostile, and a bad sample gives an error.
#pragma once

#include <cstdint>
#include <span>
#include <string>

#include "base/result.h"
#include "base/stream.h"

namespace relievo {

/// A relievo::Frame; `data` points into the bytes it was read from.
struct FrameView {
  std::string stream;
  std::uint64_t sequence = 0;
  std::uint64_t number = 0;
  std::int64_t capture_time_ns = 0;
  std::int64_t publish_time_ns = 0;
  std::span<const std::uint8_t> data;
};

/// Little-endian delimited XCDR2, which is what Cyclone DDS hands out for @appendable types. Members that a
/// newer writer appended are skipped; stream names, enumerations, sizes and numbers are checked for being
/// possible at all (the pattern's code itself is checked by whoever decodes with it).
Result<FrameView> read_frame_cdr(std::span<const std::uint8_t> cdr);
/// Whether a relievo::Frame holds a frame that decodes without others. Looks at its first kFrameStartBytes
/// alone, and needs no more. Any input.
bool holds_key_frame(std::span<const std::uint8_t> start_of_cdr);
inline constexpr std::size_t kFrameStartBytes = 256;

/// The bytes that a Publisher sends for this frame.
Bytes write_frame_cdr(const FrameView& frame);
Bytes write_frame_cdr(const std::string& stream, const FrameMessage& frame);

Result<StreamInfo> read_info_cdr(std::span<const std::uint8_t> cdr);
Result<ServerStatus> read_status_cdr(std::span<const std::uint8_t> cdr);

}  // namespace relievo
