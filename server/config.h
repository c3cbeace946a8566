// SPDX-License-Identifier: Apache-2.0
// What `serve` does: from a TOML file and from flags, flags winning.
#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "base/result.h"
#include "base/rung.h"
#include "base/web_options.h"
#include "capture/reconstruct/reconstructor.h"
#include "capture/source/camera_options.h"
#include "cli/checks.h"
#include "cli/recording_flags.h"
#include "codec/frame3d_codec.h"
#include "server/rate_control.h"

namespace relievo {

inline constexpr double kLeastBound_px = 0.01, kMostBound_px = 8;  // of ServeConfig::bound_px
inline constexpr int kMostRefreshes = 4;                           // of ProjectorConfig::refreshes
/// Of --bitrate; below it the coarsest pictures are not worth showing.
inline constexpr std::int64_t kLeastBitRate = 100'000, kMostBitRate = 1'000'000'000;
inline constexpr double kLeastDeadline_ms = 0.5, kMostDeadline_ms = 1000;  // of --deadline
inline constexpr double kLeastTexture_db = 20, kMostTexture_db = 60;       // of --psnr

/// Threads that reconstruct where nothing is said: half of the cores, 1 to 8, so that as many are left to
/// code and send.
int usual_threads();

/// How frames are decoded; `auto_pace`: `decoder` at first, then as PipelineOptions has it.
struct ServedDecoder {
  Decoder decoder = ReconstructOptions{}.decoder;
  bool auto_pace = false;

  bool operator==(const ServedDecoder&) const = default;
};

/// One stream that is served, and from what.
struct StreamConfig {
  std::string source = "sim:face";
  std::string scheme;          // of a simulated source; empty: as the source says
  CameraOptions camera;        // of a camera, in the table [camera]
  std::string stream;          // its name; empty: as the source's, see name_of()
  std::string record;          // empty: not recorded from the start
  bool record_beside = false;  // a file of that name that is there already: to the next unused one
  std::optional<std::uint64_t> frames;
  bool loop = false;
  bool fast = false;
  int threads = usual_threads();
  std::optional<ServedDecoder> decoder;  // see served_decoder()
  bool half_lines = false;
  SurfaceBuilderOptions surface;
  TextureCodec texture = TextureCodec::kJpeg;
  std::optional<int>
      texture_quality;  // the finest; not said: 80, or 95 where `rate` says how good it is to be
  VideoEncoderKind texture_encoder = VideoEncoderKind::kAuto;  // of H.264
  RateTargets rate;
  std::string geometry = "grid";  // a name of codec/geometry_profile.h
  int step_bits = 6;
  // Not said: every frame a key frame, but of metric, visual and H.264 every 30th.
  std::optional<int> key_interval;
  std::optional<double> bound_px;  // of visual
  int draco_speed = 4;
  std::vector<Rung> ladder = {Rung::kReduced, Rung::kTexture,
                              Rung::kSlow};  // qualities besides the full one, best first

  bool operator==(const StreamConfig&) const = default;
};

/// What set_decoder() takes.
inline const std::vector<std::string> kServedDecoders{"ordered", "quick", "auto", "paper"};

/// `name`: as --decoder has it. False where nothing is called so.
bool set_decoder(std::string_view name, StreamConfig& config);
/// What is said, or else auto where the camera sets the pace. Ordered where every frame is decoded however
/// long that takes, and where lines are left out by hand.
ServedDecoder served_decoder(const StreamConfig& config);
/// Whether decoder and half_lines go together.
Status check_lines(const StreamConfig& config);

/// The projector that pages may drive (/rig); docs/RIG.md.
struct ProjectorConfig {
  std::string output;         // as `project --output`; "auto": as `project` chooses; empty: pages drive none
  int refreshes = 1;          // that each picture stays
  int width = 0, height = 0;  // its picture, pixels; needed where no rig.yaml says it yet

  bool operator==(const ProjectorConfig&) const = default;
};

/// What a server does for all of its streams; and the one stream, or what those of `streams` have in common.
struct ServeConfig : StreamConfig {
  std::vector<StreamConfig> streams;  // the tables [[stream]]; empty: one stream
  int domain = 0;
  std::string interface;               // empty: Cyclone DDS chooses
  std::string keys;                    // as DomainOptions::keys
  std::string web = "127.0.0.1:8080";  // "none": no gateway
  WebOptions gateway;                  // in the table [gateway]
  RecordingTexts recording;            // in the table [recording]
  std::string record_folder;           // of recordings on request; empty: there are none
  std::string pre_roll = "0";          // of those: a duration
  ProjectorConfig projector;           // in the table [projector]

  /// All streams there are to be.
  std::vector<StreamConfig> all_streams() const;
};

/// As it is called on the network.
std::string name_of(const StreamConfig& config);

/// How its frames are encoded.
EncodeOptions encode_options(const StreamConfig& config);

/// Where a file says its settings: "threads", "gateway.open"; of the second table [[stream]]
/// "stream.1.source".
using SettingLines = std::map<std::string, int>;

/// Sets the fields that `file` names. Errors say file, line and what is wrong: an unknown key, a wrong type,
/// a value out of range, two streams of one name.
Status read_config(const std::filesystem::path& file, ServeConfig& config, SettingLines* lines = nullptr);

/// What settings that are sound one by one have wrong, in the words of flags.
struct Mistake {
  std::string setting;  // as in SettingLines
  Error error;
};
/// What cannot go together, is not built in, or is no source. Opens nothing.
std::optional<Mistake> find_mistake(const ServeConfig& config);
/// In the words of the file that had part in it, with its line where the setting is said there.
Error mistake_in(const std::filesystem::path& file, const SettingLines& lines, const Mistake& mistake);

/// Of --pre-roll: a duration, or 0.
Result<double> parse_pre_roll_s(const std::string& text);
ValueCheck pre_roll();

/// Of --ladder: "none", or lower rungs with commas between them.
Result<std::vector<Rung>> parse_ladder(const std::string& text);

/// What cannot name a stream.
ValueCheck stream_name();

}  // namespace relievo
