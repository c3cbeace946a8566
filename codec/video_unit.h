// SPDX-License-Identifier: Apache-2.0
// H.264's container level: what an access unit says of itself, read without decoding it.
#pragma once

#include <cstdint>
#include <span>

#include "base/result.h"
#include "base/stream.h"

namespace relievo {

enum class VideoSampling : std::uint8_t { kLuma, k420 };

/// What every picture of a stream is. 16..8192 pixels a side, even where there is chroma; 2^24 in all.
/// Samples use their full range; chroma is BT.601's with BT.709's primaries and sRGB's transfer, as JFIF has
/// it, sited between its four luma samples. The stream says all that.
struct VideoFormat {
  int width = 0, height = 0;
  VideoSampling sampling = VideoSampling::k420;
  int bits = 8;  // or 10

  bool operator==(const VideoFormat&) const = default;
};

/// Fails where it is none, saying why.
Status check_video_format(const VideoFormat& format);

/// One access unit of one stream, Annex B: exactly one progressive picture, all IDR slices, with a sequence
/// parameter set before them that says `format`, at most 4 reference pictures and no reordering, and a
/// picture parameter set, or none and no parameter sets at all; besides these only delimiters, SEI and
/// filler. True: an IDR picture. Any bytes.
Result<bool> check_access_unit(std::span<const std::uint8_t> unit, const VideoFormat& format);

/// Appends the unit's parameter sets, Annex B: none but in an IDR picture's. Of a checked unit.
void append_parameter_sets(std::span<const std::uint8_t> unit, Bytes& out);

/// Appends the unit without what no decoder needs: SEI, delimiters and filler.
void append_lean_unit(std::span<const std::uint8_t> unit, Bytes& out);

}  // namespace relievo
