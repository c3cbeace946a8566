// SPDX-License-Identifier: Apache-2.0
// Which of libavcodec's H.264 encoders codes the pictures.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

#include "base/result.h"

namespace relievo {

/// kAuto: the first hardware encoder that opens and gives each picture at once, else x264.
enum class VideoEncoderKind : std::uint8_t { kAuto, kX264, kNvenc, kVaapi, kV4l2m2m };

/// "auto", "x264", "nvenc", "vaapi", "v4l2m2m".
std::string_view video_encoder_name(VideoEncoderKind kind);
/// Nothing where there is none of that name.
std::optional<VideoEncoderKind> video_encoder_named(std::string_view name);
/// "auto, x264, nvenc, vaapi or v4l2m2m": for messages and help.
std::string video_encoder_names();

/// What kAuto is on this machine, found out once; and why it is not the hardware's where it is not.
struct ChosenVideoEncoder {
  VideoEncoderKind kind = VideoEncoderKind::kX264;
  std::string why_not_hardware;
};
const ChosenVideoEncoder& chosen_video_encoder();

}  // namespace relievo
