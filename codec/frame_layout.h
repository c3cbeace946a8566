// SPDX-License-Identifier: Apache-2.0
// The container of codec/FORMAT.md: a header, a table of sections, the sections.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

#include "base/result.h"
#include "base/stream.h"
#include "codec/frame3d_codec.h"

namespace relievo {

/// The kinds of section that this version knows.
struct FrameSections {
  std::span<const std::uint8_t> geometry;
  std::span<const std::uint8_t> texture;
  std::span<const std::uint8_t> quality;  // empty where there is none of a known codec
};

struct FrameLayout {
  FrameHeader header;
  FrameSections sections;
};

/// Checks the whole layout and that counts and sizes fit each other, not the payloads. Any input.
Result<FrameLayout> read_frame_layout(std::span<const std::uint8_t> bytes);

/// Which frames before it a frame needs (FORMAT.md, "What builds on what").
enum class BuildsOn : std::uint8_t { kNothing, kKeyFrame, kFrameBefore };
/// Any input; nothing for what is no frame.
BuildsOn what_it_builds_on(std::span<const std::uint8_t> bytes);
/// Whether a frame's grid builds on that of the key frame `key`. Any input.
bool grid_builds_on(std::span<const std::uint8_t> bytes, std::span<const std::uint8_t> key);

/// Fails where one of the counts is above its limit.
Status check_limits(const DecodeLimits& limits, std::uint64_t vertices, std::uint64_t triangles,
                    std::uint64_t texture_pixels);
std::uint64_t texture_pixels(const FrameHeader& header);

/// Vertices that a byte of a grid may stand for; writers fill up with zeros.
inline constexpr std::uint64_t kMostGridVerticesPerByte = 256;

/// Header, table and sections; the sections' sizes in `header` are not read.
Bytes write_frame(const FrameHeader& header, const FrameSections& sections);

}  // namespace relievo
