// SPDX-License-Identifier: Apache-2.0
#include "server/config.h"

#include <algorithm>
#include <regex>
#include <sstream>
#include <thread>
#include <vector>

#include "base/stream.h"
#include "capture/source/field_source.h"
#include "cli/listen_address.h"
#include "cli/quantities.h"
#include "cli/web_flags.h"
#include "codec/geometry_profile.h"
#include "codec/texture_codec.h"
#include "server/camera_flags.h"
#include "server/options.h"

namespace relievo {

EncodeOptions encode_options(const StreamConfig& config) {
  constexpr int kVideoInterval = 30;  // a second: what a late joiner waits at most
  constexpr int kUsualQuality = 80, kFinestQuality = 95;
  EncodeOptions options;
  set_geometry_profile(config.geometry, options);
  options.step_bits = config.step_bits;
  options.draco_speed = config.draco_speed;
  options.texture = config.texture;
  options.texture_encoder = config.texture_encoder;
  options.texture_quality =
      config.texture_quality.value_or(config.rate.texture_db > 0 ? kFinestQuality : kUsualQuality);
  const int usual = config.texture == TextureCodec::kH264 ? kVideoInterval : 1;
  options.key_interval = config.key_interval.value_or(std::max(usual, options.key_interval));
  if (options.bound_px > 0 && config.bound_px) options.bound_px = static_cast<float>(*config.bound_px);
  return options;
}

/// "take:../shared/takes/bunny" -> "bunny", "sim:face,stripes=70" -> "face".
std::string name_of(const StreamConfig& config) {
  if (!config.stream.empty()) return config.stream;
  std::string name = config.source.substr(config.source.find(':') + 1);
  name = name.substr(0, name.find(','));
  while (!name.empty() && name.back() == '/') name.pop_back();
  name = std::filesystem::path(name).stem().string();
  for (char& c : name) {
    if (!valid_stream_name(std::string(1, c)) && c != '.') c = '_';
  }
  return valid_stream_name(name) ? name : "stream";
}

std::vector<StreamConfig> ServeConfig::all_streams() const {
  return streams.empty() ? std::vector<StreamConfig>{*this} : streams;
}

int usual_threads() {
  return static_cast<int>(std::clamp(std::thread::hardware_concurrency() / 2, 1U, 8U));
}

bool set_decoder(std::string_view name, StreamConfig& config) {
  const bool is_auto = name == "auto";
  const auto decoder = is_auto ? Decoder::kOrdered : decoder_named(name);
  if (!decoder) return false;
  config.decoder = {*decoder, is_auto};
  return true;
}

ServedDecoder served_decoder(const StreamConfig& config) {
  return config.decoder.value_or(ServedDecoder{.auto_pace = !config.fast && !config.half_lines});
}

Status check_lines(const StreamConfig& config) {
  if (served_decoder(config).auto_pace && config.half_lines)
    return Error{"decoder auto leaves out lines where it has to: leave this out, or name a decoder"};
  return {};
}

Result<double> parse_pre_roll_s(const std::string& text) {
  if (text == "0" || text == "0s") return 0.0;
  const auto seconds = parse_duration_s(text);
  if (!seconds) return Error{"'" + text + "' is no duration such as 10s or 1min, and not 0"};
  return *seconds;
}

ValueCheck pre_roll() {
  return [](const std::string& text) {
    const auto seconds = parse_pre_roll_s(text);
    return seconds ? std::string() : seconds.error().message;
  };
}

Result<std::vector<Rung>> parse_ladder(const std::string& text) {
  std::vector<Rung> out;
  if (text == "none") return out;
  std::stringstream names(text);
  for (std::string name; std::getline(names, name, ',');) {
    const auto rung = rung_named(name);
    if (!rung || *rung == Rung::kFull || is_jpeg(*rung))
      return Error{
          "'" + name +
          "' is no lower quality: there are reduced, texture and slow, with commas between them, and none"};
    out.push_back(*rung);
  }
  if (out.empty()) return Error{"give reduced, texture, slow, with commas between them, or none"};
  std::sort(out.begin(), out.end());
  out.erase(std::unique(out.begin(), out.end()), out.end());
  return out;
}

ValueCheck stream_name() {
  return [](const std::string& name) {
    return valid_stream_name(name)
               ? std::string()
               : "'" + name + "' cannot name a stream: use up to 64 letters, digits, '_', '-' and '.'";
  };
}

namespace {

std::optional<Mistake> mistake(const std::string& setting, const Status& sound) {
  return sound ? std::nullopt : std::optional(Mistake{setting, sound.error()});
}

Status check_source_of(const StreamConfig& stream) {
  const auto source = with_scheme(stream.source, stream.scheme);
  return source ? check_source(*source) : source.error();
}

Status check_psnr(const StreamConfig& stream) {
  if (stream.rate.texture_db > 0 && stream.texture == TextureCodec::kPng)
    return Error{"psnr is kept of textures that lose something: leave it out with png"};
  return {};
}

std::optional<Mistake> find_mistake(const StreamConfig& stream) {
  if (const std::string wrong = stream_name()(name_of(stream)); !wrong.empty())
    return Mistake{"source", Error{wrong}};
  const bool is_named = stream.texture_encoder != VideoEncoderKind::kAuto;
  const Status codec = check_texture_codec(stream.texture, stream.texture_encoder);
  if (!codec) return mistake(is_named ? "texture_encoder" : "texture", codec);
  if (const Status source = check_source_of(stream); !source) return mistake("source", source);
  if (const Status lines = check_lines(stream); !lines) return mistake("half_lines", lines);
  if (const Status psnr = check_psnr(stream); !psnr) return mistake("psnr", psnr);
  return mistake("camera.rig", check_rig(stream.source, stream.camera));
}

std::optional<Mistake> find_mistake(const RecordingTexts& recording) {
  const auto sound = recording_options(recording);
  if (sound) return std::nullopt;
  return Mistake{recording.keep_size.empty() ? "recording.keep_for" : "recording.keep_size", sound.error()};
}

std::optional<Mistake> find_mistake(const WebOptions& gateway) {
  const Status sound = check_web_options(gateway);
  return mistake(gateway.open.value_or(false) ? "gateway.open"
                 : gateway.tls_key.empty()    ? "gateway.tls_cert"
                                              : "gateway.tls_key",
                 sound);
}

/// A folder's last name may be new; of others it is a slip of the pen.
Status check_can_make(const std::string& folder) {
  namespace fs = std::filesystem;
  std::error_code ignored;
  if (fs::is_directory(folder, ignored)) return {};
  if (fs::exists(folder, ignored)) return Error{"cannot record to " + folder + ": it is no folder"};
  fs::path path = fs::absolute(folder, ignored).lexically_normal();
  if (!path.has_filename()) path = path.parent_path();  // "takes/"
  if (fs::is_directory(path.parent_path(), ignored)) return {};
  return Error{"cannot record to " + folder + ": there is no folder " + path.parent_path().string() +
               "; make it, or is the name right?"};
}

Status check_folder(const ServeConfig& config) {
  if (config.record_folder.empty()) return {};
  if (const Status there = check_can_make(config.record_folder); !there) return there;
  if (config.web == "none")
    return Error{"recordings to " + config.record_folder +
                 " are started by the web API: leave out --web none, or give --record FILE"};
  return {};
}

/// "give --tls-cert FILE" as a file has it: "give tls_cert".
std::string in_settings(const std::string& message) {
  static const std::regex flag(" --([a-z-]+)( [A-Z]+\\b)?");
  std::string out;
  auto rest = message.cbegin();
  for (std::sregex_iterator at(message.begin(), message.end(), flag), end; at != end; ++at) {
    std::string name = at->str(1);
    std::replace(name.begin(), name.end(), '-', '_');
    out.append(rest, (*at)[0].first).append(" " + name);
    rest = (*at)[0].second;
  }
  return out.append(rest, message.cend());
}

}  // namespace

std::optional<Mistake> find_mistake(const ServeConfig& config) {
  if (config.streams.empty()) {
    if (auto found = find_mistake(static_cast<const StreamConfig&>(config))) return found;
  }
  for (std::size_t i = 0; i < config.streams.size(); ++i) {
    const auto found = find_mistake(config.streams[i]);
    if (found)
      return Mistake{"stream." + std::to_string(i) + "." + found->setting,
                     found->error.in("stream " + name_of(config.streams[i]))};
  }
  if (auto found = find_mistake(config.gateway)) return found;
  if (auto found = find_mistake(config.recording)) return found;
  if (config.web != "none") {
    if (const auto address = parse_listen_address(config.web); !address)
      return Mistake{"web", address.error()};
  }
  return mistake("recording.folder", check_folder(config));
}

Error mistake_in(const std::filesystem::path& file, const SettingLines& lines, const Mistake& mistake) {
  const std::string& setting = mistake.setting;
  const std::size_t name = setting.starts_with("stream.") ? setting.find('.', 7) + 1 : 0;
  auto said = lines.find(setting);
  if (said == lines.end()) said = lines.find(setting.substr(name));  // for all streams
  const std::string line = said == lines.end() ? "" : ":" + std::to_string(said->second);
  return {file.string() + line + ": " + setting.substr(name) + ": " +
          in_settings(" " + mistake.error.message).substr(1)};
}

}  // namespace relievo
