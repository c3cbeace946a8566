// SPDX-License-Identifier: Apache-2.0
// What `serve` does: from a TOML file and from flags, flags winning.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>

#include "base/result.h"
#include "base/web_options.h"
#include "capture/reconstruct/reconstructor.h"
#include "capture/source/camera_options.h"
#include "cli/recording_flags.h"
#include "codec/frame3d_codec.h"

namespace relievo {

inline constexpr double kLeastBound_px = 0.01, kMostBound_px = 8;  // of ServeConfig::bound_px
/// Of --bitrate; below it the coarsest pictures are not worth showing.
inline constexpr std::int64_t kLeastBitRate = 100'000, kMostBitRate = 1'000'000'000;

struct ServeConfig {
  std::string source = "sim:face";
  std::string scheme;    // of a simulated source; empty: as the source says
  CameraOptions camera;  // of a camera, in the table [camera]
  std::string stream;    // empty: named after the source
  int domain = 0;
  std::string interface;               // empty: Cyclone DDS chooses
  std::string keys;                    // as DomainOptions::keys
  std::string web = "127.0.0.1:8080";  // "none": no gateway
  WebOptions gateway;                  // in the table [gateway]
  std::string record;                  // empty: not recorded
  RecordingTexts recording;            // in the table [recording]
  std::optional<std::uint64_t> frames;
  bool loop = false;
  bool fast = false;
  int threads = 1;
  Decoder decoder = ReconstructOptions{}.decoder;
  SurfaceBuilderOptions surface;
  TextureCodec texture = TextureCodec::kJpeg;
  int texture_quality = 80;
  double bit_rate = 0;            // bits a second at most; 0: as the qualities make it
  std::string geometry = "grid";  // a name of codec/geometry_profile.h
  int step_bits = 6;
  // Not said: every frame a key frame, but of metric, visual and H.264 every 30th.
  std::optional<int> key_interval;
  std::optional<double> bound_px;  // of visual
  int draco_speed = 4;
};

/// How its frames are encoded.
EncodeOptions encode_options(const ServeConfig& config);

/// Sets the fields that `file` names. Errors say file, line and what is wrong: an unknown key, a wrong type,
/// a value out of range.
Status read_config(const std::filesystem::path& file, ServeConfig& config);

}  // namespace relievo
