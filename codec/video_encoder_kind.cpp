// SPDX-License-Identifier: Apache-2.0
#include "codec/video_encoder_kind.h"

#include <array>

#include "codec/row_names.h"

namespace relievo {
namespace {

struct Row {
  VideoEncoderKind kind;
  std::string_view name;
};
constexpr std::array kRows{Row{VideoEncoderKind::kAuto, "auto"}, Row{VideoEncoderKind::kX264, "x264"},
                           Row{VideoEncoderKind::kNvenc, "nvenc"}, Row{VideoEncoderKind::kVaapi, "vaapi"},
                           Row{VideoEncoderKind::kV4l2m2m, "v4l2m2m"}};

}  // namespace

std::string_view video_encoder_name(VideoEncoderKind kind) {
  for (const Row& row : kRows)
    if (row.kind == kind) return row.name;
  return "unknown";
}

std::optional<VideoEncoderKind> video_encoder_named(std::string_view name) {
  for (const Row& row : kRows)
    if (row.name == name) return row.kind;
  return std::nullopt;
}

std::string video_encoder_names() {
  return names_of(kRows);
}

}  // namespace relievo
