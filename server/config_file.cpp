// SPDX-License-Identifier: Apache-2.0
// The TOML file of config.h.
#include <toml++/toml.h>
#include <algorithm>
#include <cctype>
#include <cmath>
#include <limits>
#include <string_view>
#include <utility>
#include <vector>

#include "base/whole_file.h"
#include "cli/quantities.h"
#include "cli/size_option.h"
#include "cli/web_flags.h"
#include "codec/geometry_profile.h"
#include "codec/texture_codec.h"
#include "server/camera_flags.h"
#include "server/config.h"
#include "server/options.h"

namespace relievo {
namespace {

constexpr std::size_t kLargestConfig = 1 << 20;

std::string place(const std::filesystem::path& file, const toml::source_region& at) {
  return file.string() + ":" + std::to_string(at.begin.line) + ": ";
}

/// Reads one table, remembering the first thing wrong.
class Reader {
 public:
  /// `lines` are set, those of this table's settings under `prefix` and their names.
  Reader(const std::filesystem::path& file, const toml::table& table, SettingLines& lines,
         std::string prefix = {})
      : file_(file), table_(table), lines_(lines), prefix_(std::move(prefix)) {}

  void text(std::string_view key, std::string& out) {
    if (const toml::node* node = take(key)) {
      if (auto value = string_in(*node, key, "must be a string in quotes")) out = *std::move(value);
    }
  }
  /// Text that the flag of that name takes.
  void checked(std::string_view key, const ValueCheck& check, std::string& out) {
    const toml::node* node = take(key);
    if (node == nullptr) return;
    const auto value = string_in(*node, key, "must be a string in quotes");
    if (!value) return;
    if (const std::string wrong = check(*value); !wrong.empty())
      return refuse(*node, key, "is wrong: " + wrong);
    out = *value;
  }
  /// A list of such texts.
  void checked(std::string_view key, const ValueCheck& check, std::vector<std::string>& out) {
    const toml::node* node = take(key);
    if (node == nullptr) return;
    const toml::array* list = node->as_array();
    if (list == nullptr) return refuse(*node, key, "must be a list of strings in quotes");
    out.clear();
    for (const toml::node& entry : *list) {
      const auto value = string_in(entry, key, "must be a list of strings in quotes");
      if (!value) return;
      if (const std::string wrong = check(*value); !wrong.empty())
        return refuse(entry, key, "is wrong: " + wrong);
      out.push_back(*value);
    }
  }
  void decoder(std::string_view key, StreamConfig& out) {
    const toml::node* node = take(key);
    if (node == nullptr) return;
    const auto value = node->value_exact<std::string>();
    if (!set_decoder(value.value_or(""), out))
      refuse(*node, key, "must be \"ordered\", \"quick\", \"auto\" or \"paper\"");
  }
  void scheme(std::string_view key, std::string& out) {
    const toml::node* node = take(key);
    if (node == nullptr) return;
    const auto value = node->value_exact<std::string>();
    if (!value || !scheme_named(*value))
      return refuse(*node, key, "must be " + scheme_names() + " in quotes");
    out = *value;
  }
  void geometry(std::string_view key, std::string& out) {
    const toml::node* node = take(key);
    if (node == nullptr) return;
    const auto value = node->value_exact<std::string>();
    EncodeOptions unused;
    if (!value || !set_geometry_profile(*value, unused))
      return refuse(*node, key, "must be " + geometry_profile_names() + " in quotes");
    out = *value;
  }
  /// A list of lower rungs.
  void ladder(std::string_view key, std::vector<Rung>& out) {
    std::vector<std::string> names;
    const bool given = table_.contains(key);
    checked(
        key,
        [](const std::string& name) {
          const auto rungs = parse_ladder(name);
          return name == "none" || name.find(',') != std::string::npos
                     ? "there are \"reduced\", \"texture\" and \"slow\", and [] for none"
                 : rungs ? std::string()
                         : rungs.error().message;
        },
        names);
    if (!given || error_) return;
    std::string all;
    for (const std::string& name : names) all += (all.empty() ? "" : ",") + name;
    out = parse_ladder(all.empty() ? "none" : all).value();
  }
  /// One of the values that `named` finds by the names of `names`, such as "\"a\" or \"b\"".
  template <typename Value>
  void one_of(std::string_view key, std::optional<Value> (*named)(std::string_view), const std::string& names,
              Value& out) {
    const toml::node* node = take(key);
    if (node == nullptr) return;
    const auto text = node->value_exact<std::string>();
    const auto value = text ? named(*text) : std::nullopt;
    if (!value) return refuse(*node, key, "must be " + names + " in quotes");
    out = *value;
  }
  template <typename Flag>  // bool, or one that may be unsaid
  void flag(std::string_view key, Flag& out) {
    if (const toml::node* node = take(key)) {
      if (const auto value = node->value_exact<bool>())
        out = *value;
      else
        refuse(*node, key, "must be true or false");
    }
  }
  std::optional<std::int64_t> integer(std::string_view key, std::int64_t least, std::int64_t most) {
    const toml::node* node = take(key);
    if (node == nullptr) return std::nullopt;
    const auto value = node->value_exact<std::int64_t>();
    if (value && *value >= least && *value <= most) return *value;
    refuse(*node, key,
           "must be a whole number from " + std::to_string(least) + " to " + std::to_string(most));
    return std::nullopt;
  }
  void rate(std::string_view key, double& out) {
    const toml::node* node = take(key);
    if (node == nullptr) return;
    const auto value = node->value<double>();  // a whole number too
    if (!value || !(*value >= kLeastRate && *value <= kMostRate))
      return refuse(*node, key, "must be a number of pictures a second from 0.1 to 1000");
    out = *value;
  }
  void number(std::string_view key, const std::string& range, double least, double most, double& out) {
    const toml::node* node = take(key);
    if (node == nullptr) return;
    const auto value = node->value<double>();  // a whole number too
    if (!value || !(*value >= least && *value <= most))
      return refuse(*node, key, "must be a number of " + range);
    out = *value;
  }
  void bound(std::string_view key, std::optional<double>& out) {
    const toml::node* node = take(key);
    if (node == nullptr) return;
    const auto value = node->value<double>();  // a whole number too
    if (!value || !(*value >= kLeastBound_px && *value <= kMostBound_px))
      return refuse(*node, key, "must be a number of pixels from 0.01 to 8");
    out = *value;
  }
  void size(std::string_view key, int& width, int& height) {
    const toml::node* node = take(key);
    if (node == nullptr) return;
    const auto value = node->value_exact<std::string>();
    const auto size = value ? parse_size(*value) : std::nullopt;
    if (!size) return refuse(*node, key, "must be a size such as \"640x480\", in quotes");
    width = size->width;
    height = size->height;
  }
  /// A table of names and values, each a number, text in quotes, true or false.
  void controls(std::string_view key, std::vector<CameraControl>& out) {
    const toml::node* node = take(key);
    if (node == nullptr) return;
    const toml::table* table = node->as_table();
    if (table == nullptr) return refuse(*node, key, "must be a table of controls");
    // In the order of the lines, since one control may have to be set before another.
    std::vector<std::pair<toml::source_position, CameraControl>> ordered;
    for (const auto& [name, value] : *table) {
      std::string text;
      if (const auto number = value.value_exact<std::int64_t>())
        text = std::to_string(*number);
      else if (const auto flag = value.value_exact<bool>())
        text = *flag ? "1" : "0";
      else if (const auto quoted = value.value_exact<std::string>())
        text = *quoted;
      else
        return refuse(value, name.str(), "must be a whole number, true, false, or text in quotes");
      ordered.push_back({name.source().begin, {std::string(name.str()), text}});
    }
    std::stable_sort(ordered.begin(), ordered.end(),
                     [](const auto& a, const auto& b) { return a.first < b.first; });
    for (auto& [at, control] : ordered) out.push_back(std::move(control));
  }
  /// What `read` makes of a table within this one.
  template <typename Read>
  void table(std::string_view key, const Read& read) {
    const toml::node* node = take(key);
    if (node == nullptr) return;
    if (node->as_table() == nullptr)
      return refuse(*node, key, "must be a table: write [" + std::string(key) + "]");
    Reader inner(file_, *node->as_table(), lines_, prefix_ + std::string(key) + ".");
    read(inner);
    if (const Status done = inner.finish(); !done && !error_) error_ = done.error();
  }
  void integer(std::string_view key, std::int64_t least, std::int64_t most, int& out) {
    if (const auto value = integer(key, least, most)) out = static_cast<int>(*value);
  }

  /// [[KEY]], once or more.
  bool has_tables(std::string_view key) const {
    const toml::node* node = table_.get(key);
    return node != nullptr && node->is_array_of_tables();
  }
  /// Where KEY is a table, but is to be one of several.
  void no_single_table(std::string_view key) {
    const toml::node* node = table_.get(key);
    if (node != nullptr && node->is_table())
      refuse(*node, key, "is a table with one bracket: write [[" + std::string(key) + "]]");
  }
  /// What `read` makes of each of them.
  template <typename Read>
  void tables(std::string_view key, const Read& read) {
    const toml::node* node = take(key);
    if (node == nullptr) return;
    int number = 0;
    for (const toml::node& entry : *node->as_array()) {
      Reader inner(file_, *entry.as_table(), lines_,
                   prefix_ + std::string(key) + "." + std::to_string(number++) + ".");
      read(inner);
      if (const Status done = inner.finish(); !done && !error_) error_ = done.error();
    }
  }
  /// The whole table.
  void refuse(const std::string& why) {
    if (!error_) error_ = Error{place(file_, table_.source()) + why};
  }

  Status finish() {
    for (const auto& [key, node] : table_) {
      if (std::find(known_.begin(), known_.end(), key.str()) != known_.end()) continue;
      std::string all;
      for (const std::string_view name : known_) all += " " + std::string(name);
      refuse(node, key.str().empty() ? "\"\"" : key.str(), "is no setting; there are:" + all);
    }
    return error_ ? Status(*error_) : Status();
  }

 private:
  /// What has control characters names no file, stream or host: at a zero the system would take another one.
  std::optional<std::string> string_in(const toml::node& node, std::string_view key, const char* otherwise) {
    auto value = node.value_exact<std::string>();
    if (!value) {
      refuse(node, key, otherwise);
    } else if (std::any_of(value->begin(), value->end(),
                           [](unsigned char c) { return std::iscntrl(c) != 0; })) {
      refuse(node, key, "must have no control characters");
      value.reset();
    }
    return value;
  }
  const toml::node* take(std::string_view key) {
    known_.push_back(key);
    const toml::node* node = table_.get(key);
    if (node != nullptr) lines_[prefix_ + std::string(key)] = static_cast<int>(node->source().begin.line);
    return node;
  }
  void refuse(const toml::node& node, std::string_view key, const std::string& why) {
    if (!error_) error_ = Error{place(file_, node.source()) + std::string(key) + " " + why};
  }

  const std::filesystem::path& file_;
  const toml::table& table_;
  SettingLines& lines_;
  const std::string prefix_;
  std::vector<std::string_view> known_;  // string literals
  std::optional<Error> error_;
};

void read_camera(Reader& reader, CameraOptions& camera) {
  reader.text("rig", camera.rig);
  reader.text("pattern", camera.pattern);
  reader.text("input", camera.input);
  reader.text("standard", camera.standard);
  reader.text("format", camera.format);
  reader.size("size", camera.width, camera.height);
  reader.rate("rate", camera.rate);
  reader.checked("field", one_of(kFieldLayouts), camera.field);
  reader.checked("field_order", one_of(kFieldOrders), camera.field_order);
  reader.flag("odd_pairs", camera.odd_pairs);
  reader.flag("dmabuf", camera.dmabuf);
  reader.integer("buffers", kLeastBuffers, kMostBuffers, camera.buffers);
  reader.controls("controls", camera.controls);
}

void read_recording(Reader& reader, ServeConfig& config) {
  reader.text("folder", config.record_folder);
  reader.checked("pre_roll", pre_roll(), config.pre_roll);
  RecordingTexts& recording = config.recording;
  reader.checked("split_size", byte_count(), recording.split_size);
  reader.checked("split_every", duration(), recording.split_every);
  reader.checked("keep_size", byte_count(), recording.keep_size);
  reader.checked("keep_for", duration(), recording.keep_for);
  reader.checked("sync", sync_policy(), recording.sync);
}

void read_projector(Reader& reader, ProjectorConfig& projector) {
  reader.text("output", projector.output);
  reader.integer("refreshes", 1, kMostRefreshes, projector.refreshes);
  reader.size("size", projector.width, projector.height);
}

/// All but its name.
void read_stream(Reader& reader, StreamConfig& config) {
  reader.text("source", config.source);
  reader.scheme("scheme", config.scheme);
  reader.text("record", config.record);
  config.record_beside = !config.record.empty();  // a service comes back by itself
  if (const auto frames = reader.integer("frames", 1, std::numeric_limits<std::int64_t>::max())) {
    config.frames = static_cast<std::uint64_t>(*frames);
  }
  reader.flag("loop", config.loop);
  reader.flag("fast", config.fast);
  reader.integer("threads", 1, 64, config.threads);
  reader.decoder("decoder", config);
  reader.flag("half_lines", config.half_lines);
  reader.flag("dense", config.surface.dense);
  reader.integer("fill_holes", 0, kMostFilled, config.surface.fill_holes);
  reader.one_of("texture", texture_codec_named, texture_codec_names(), config.texture);
  reader.one_of("texture_encoder", video_encoder_named, video_encoder_names(), config.texture_encoder);
  if (const auto quality = reader.integer("texture_quality", 1, 100))
    config.texture_quality = static_cast<int>(*quality);
  if (const auto bits = reader.integer("bitrate", kLeastBitRate, kMostBitRate))
    config.rate.bit_rate = static_cast<double>(*bits);
  reader.number("deadline", "milliseconds from 0.5 to 1000", kLeastDeadline_ms, kMostDeadline_ms,
                config.rate.deadline_ms);
  reader.number("psnr", "decibels from 20 to 60", kLeastTexture_db, kMostTexture_db, config.rate.texture_db);
  reader.geometry("geometry", config.geometry);
  reader.integer("step_bits", 0, 8, config.step_bits);
  reader.bound("bound", config.bound_px);
  if (const auto frames = reader.integer("key_interval", 1, 1000))
    config.key_interval = static_cast<int>(*frames);
  reader.integer("draco_speed", 0, 9, config.draco_speed);
  reader.ladder("ladder", config.ladder);
  reader.table("camera", [&](Reader& camera) { read_camera(camera, config.camera); });
}

/// Whatever way there is written, also where there is nothing yet.
bool same_file(const std::filesystem::path& a, const std::filesystem::path& b) {
  const auto place_of = [](const std::filesystem::path& file) {
    std::error_code failed;
    const auto place = std::filesystem::weakly_canonical(std::filesystem::absolute(file, failed), failed);
    return failed ? file.lexically_normal() : place;
  };
  return place_of(a) == place_of(b);
}

/// A table [[stream]].
void read_one_of_many(Reader& reader, ServeConfig& config) {
  StreamConfig stream = config;
  stream.camera.controls.clear();  // a camera's own
  reader.checked("name", stream_name(), stream.stream);
  read_stream(reader, stream);
  for (const StreamConfig& other : config.streams) {
    if (name_of(other) == name_of(stream))
      reader.refuse("two streams are called '" + name_of(stream) + "': give each a name of its own");
    if (!stream.record.empty() && !other.record.empty() && same_file(other.record, stream.record))
      reader.refuse("two streams are recorded to " + stream.record + ": give each a file of its own");
  }
  config.streams.push_back(std::move(stream));
}

void read_gateway(Reader& reader, WebOptions& gateway) {
  reader.text("tls_cert", gateway.tls_cert);
  reader.text("tls_key", gateway.tls_key);
  reader.text("token_file", gateway.token_file);
  reader.flag("open", gateway.open);
  reader.checked("allow_origins", web_origin(), gateway.origins);
  const auto count = [&](std::string_view key, std::optional<int>& out) {
    if (const auto value = reader.integer(key, 1, kMostClients)) out = static_cast<int>(*value);
  };
  count("max_clients", gateway.max_clients);
  count("max_per_address", gateway.max_per_address);
  if (const auto rate = reader.integer("max_rate", std::lround(kLeastWebRate), std::lround(kMostWebRate)))
    gateway.max_rate = static_cast<double>(*rate);
}

}  // namespace

Status read_config(const std::filesystem::path& file, ServeConfig& config, SettingLines* lines) {
  const auto text = read_whole_file(file, kLargestConfig);
  if (!text) return text.error().in("the configuration cannot be used");
  toml::table table;
  try {
    table = toml::parse(*text, file.string());
  } catch (const toml::parse_error& error) {
    return Error{place(file, error.source()) + std::string(error.description())};
  }
  SettingLines unused;
  Reader reader(file, table, lines != nullptr ? *lines : unused);
  read_stream(reader, config);
  reader.integer("domain", 0, 230, config.domain);
  reader.text("interface", config.interface);
  reader.text("keys", config.keys);
  reader.checked("web", listen_address(true), config.web);
  reader.table("recording", [&](Reader& recording) { read_recording(recording, config); });
  reader.table("projector", [&](Reader& projector) { read_projector(projector, config.projector); });
  reader.table("gateway", [&](Reader& gateway) { read_gateway(gateway, config.gateway); });
  // Last, since what is said outside of them holds for all.
  reader.no_single_table("stream");
  if (!reader.has_tables("stream"))
    reader.checked("stream", stream_name(), config.stream);
  else
    reader.tables("stream", [&](Reader& stream) { read_one_of_many(stream, config); });
  return reader.finish();
}

}  // namespace relievo
