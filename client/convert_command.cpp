// SPDX-License-Identifier: Apache-2.0
#include <CLI/CLI.hpp>
#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <map>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <utility>
#include <vector>

#include "base/counted.h"
#include "base/json_text.h"
#include "base/whole_file.h"
#include "cli/checks.h"
#include "cli/progress.h"
#include "client/commands.h"
#include "client/range_frames.h"
#include "client/recorded_stream.h"
#include "client/time_range.h"
#include "codec/foxglove.h"
#include "codec/frame3d_codec.h"
#include "codec/frame_layout.h"
#include "codec/geometry_profile.h"
#include "codec/texture_codec.h"
#include "idl/cdr.h"
#include "idl/recorder.h"

namespace relievo {
namespace {

struct Options {
  std::string file, stream;
  std::filesystem::path out;
  std::shared_ptr<RangeOptions> range;
  std::optional<std::string> geometry, texture;
  std::optional<int> step_bits, key_interval, draco_speed, texture_quality;
  std::optional<float> bound_px;
  bool foxglove = false;
  bool json = false;

  /// Else frames stay as they are.
  bool encode() const {
    return geometry || texture || step_bits || key_interval || draco_speed || texture_quality || bound_px;
  }
};

/// `recorded`: the texture's codec, which it keeps unless another one is wanted.
EncodeOptions encode_options(const Options& options, TextureCodec recorded) {
  constexpr int kVideoInterval = 30;                                    // as serve has it
  EncodeOptions out{.geometry = GeometryCodec::kGrid, .step_bits = 6};  // likewise
  if (options.geometry) set_geometry_profile(*options.geometry, out);
  out.texture = options.texture ? texture_codec_named(*options.texture).value_or(recorded) : recorded;
  if (out.texture == TextureCodec::kH264) out.key_interval = std::max(out.key_interval, kVideoInterval);
  const auto set = [](const auto& given, auto& field) { field = given.value_or(field); };
  if (out.bound_px > 0) set(options.bound_px, out.bound_px);
  set(options.step_bits, out.step_bits);
  set(options.key_interval, out.key_interval);
  set(options.draco_speed, out.draco_speed);
  set(options.texture_quality, out.texture_quality);
  return out;
}

/// Throws CLI::ValidationError where something is asked for that the geometry does not have.
void check_geometry(const Options& options) {
  const std::string name = options.geometry.value_or("grid");
  const auto check = [&](const char* option, bool given, const std::vector<std::string>& its) {
    if (given && std::ranges::find(its, name) == its.end())
      throw CLI::ValidationError(option, "there is none in " + name + ": it is of --geometry " + its.front());
  };
  check("--bound", options.bound_px.has_value(), {"visual"});
  check("--draco-speed", options.draco_speed.has_value(), {"draco-mesh"});
  check("--step-bits", options.step_bits.has_value(), {"grid", "metric", "draco-grid"});
}

struct Converted {
  std::uint64_t frames = 0;
  std::uint64_t before = 0;  // of these: before the range, which builds on them
  LeftOut left_out;
  std::uint64_t bytes_before = 0, bytes_after = 0;  // of frames
};

/// Sample after sample from one file into another.
class Conversion {
 public:
  /// `out` is not there yet.
  Conversion(const Options& options, RecordedStream& recorded, std::filesystem::path out)
      : options_(options), recorded_(recorded), out_(std::move(out)) {}
  Conversion(const Conversion&) = delete;
  Conversion& operator=(const Conversion&) = delete;
  /// Leaves no part of a file.
  ~Conversion() {
    std::error_code ignored;
    if (std::exchange(writer_, nullptr)) std::filesystem::remove(out_, ignored);
  }

  Status begin() {
    if (options_.encode()) {
      if (options_.texture)
        if (auto usable = check_texture_codec(*texture_codec_named(*options_.texture)); !usable)
          return usable;
    }
    auto infos = recorded_.read_infos();
    if (!infos) return infos.error();
    infos_ = *std::move(infos);
    if (options_.encode() && infos_.empty())
      return Error{options_.file +
                   ": frames cannot be coded anew without the stream's description, and it is missing"};
    auto writer = RecordingWriter::create(out_, {.sync_ns = -1});
    if (!writer) return writer.error();
    writer_ = *std::move(writer);
    for (const Topic topic : {Topic::kInfo, Topic::kFrame, Topic::kStatus}) {
      const TopicType& type = topic_type(topic);
      const auto channel =
          writer_->add_channel({type.type_name, "omgidl", type.idl},
                               {type.topic_name, "cdr", type.type_name, {{"stream", recorded_.stream()}}});
      if (!channel) return channel.error();
      channels_[topic] = *channel;
    }
    for (const RecordingAttachment& attachment : recorded_.summary().attachments) {
      if (is_description(attachment)) continue;  // comes with the frames that it describes
      if (auto added = writer_->add_attachment(attachment); !added) return added;
    }
    if (!options_.foxglove) return {};
    auto foxglove = FoxgloveChannels::add_to(*writer_, recorded_.stream());
    if (!foxglove) return foxglove.error();
    foxglove_ = *std::move(foxglove);
    return {};
  }

  /// `wanted` false: before the range, where only what later frames build on counts.
  Status add(const RawSample& sample, bool wanted) {
    if (sample.topic == Topic::kInfo) return {};  // comes with the frames that it describes
    if (sample.topic != Topic::kFrame) return wanted ? write(sample) : Status();
    const auto view = read_frame_cdr(sample.cdr);
    if (!wanted) {
      if (view) (void)decoder_.remember(view->data);
      if (options_.encode() || !needed_later(sample)) return {};
      ++converted_.before;
      return copy(sample);
    }
    if (!options_.encode() && !foxglove_) return copy(sample);
    if (!converted_.left_out.decode(view, decoder_, frame_)) return {};
    if (auto status = options_.encode() ? encode(sample, *view, frame_) : copy(sample); !status)
      return status;
    if (!foxglove_) return {};
    const RecordedInfo* info = info_of(sample, infos_);
    return foxglove_->write(*writer_, frame_, info == nullptr ? nullptr : &info->info.rig.camera,
                            {sample.receive_time_ns, sample.source_time_ns, view->capture_time_ns});
  }

  Status finish() {
    auto finished = writer_->finish();
    if (finished) writer_.reset();
    return finished;
  }
  const Converted& converted() const { return converted_; }

 private:
  /// Where another session begins with this frame: what describes it, and an encoder that knows its rig.
  Status describe(const RawSample& frame) {
    const RecordedInfo* info = info_of(frame, infos_);
    if (info == described_) return {};
    described_ = info;
    if (options_.encode()) encoder_.emplace(info->info.rig, info->info.pattern);
    RawSample sample = info->sample;
    sample.receive_time_ns = frame.receive_time_ns;
    if (auto status = attachments_.add_to(*writer_, info->info, sample.cdr, sample.receive_time_ns); !status)
      return status;
    return write(sample);
  }
  Status copy(const RawSample& sample) {
    if (auto status = describe(sample); !status) return status;
    ++converted_.frames;
    converted_.bytes_before += sample.cdr.size();
    converted_.bytes_after += sample.cdr.size();
    return write(sample);
  }
  Status encode(const RawSample& sample, FrameView view, const Frame3D& frame) {
    const auto before = read_frame_layout(view.data);
    if (!before) return before.error();
    if (auto status = describe(sample); !status) return status;
    if (before->header.texture != TextureCodec::kNone) texture_ = before->header.texture;
    const EncodeOptions wanted = encode_options(options_, texture_);
    const auto bytes =
        keeps_texture(*before) ? encode_geometry(frame, wanted, *before) : encoder_->encode(frame, wanted);
    if (!bytes) return bytes.error();
    const auto header = read_frame_header(*bytes);
    if (wanted.geometry != GeometryCodec::kDracoMesh && header && header->geometry != wanted.geometry &&
        header->vertices > 0)
      return Error{options_.file +
                   ": the places of its vertices in the grid were not recorded (it is Draco): it can "
                   "only be coded as draco-mesh"};
    view.data = *bytes;
    RawSample coded{sample.topic, sample.stream, sample.source_time_ns, sample.receive_time_ns,
                    write_frame_cdr(view)};
    ++converted_.frames;
    converted_.bytes_before += sample.cdr.size();
    converted_.bytes_after += coded.cdr.size();
    return write(coded);
  }
  /// Unless something is asked of textures they stay as they are, byte for byte: coded anew they only lose.
  /// Those that build on each other, from the first one on that decodes alone.
  bool keeps_texture(const FrameLayout& frame) {
    if (options_.texture || options_.texture_quality) return false;
    if (frame.header.texture != TextureCodec::kH264) return true;
    chain_begun_ = chain_begun_ || texture_is_key(frame.header.texture, frame.sections.texture);
    return chain_begun_ && !options_.key_interval;
  }
  Result<Bytes> encode_geometry(const Frame3D& frame, EncodeOptions wanted, const FrameLayout& before) {
    const auto& [was, sections] = before;
    const bool alone = sections.texture.empty() || texture_is_key(was.texture, sections.texture);
    // So that there are frames which decode alone.
    if (was.texture == TextureCodec::kH264 && alone) encoder_->request_key_frame();
    wanted.texture = TextureCodec::kNone;
    const auto bytes = encoder_->encode(frame, wanted);
    if (!bytes) return bytes.error();
    const auto coded = read_frame_layout(*bytes);
    if (!coded) return coded.error();
    FrameHeader header = coded->header;
    header.texture = was.texture;
    header.texture_width = was.texture_width;
    header.texture_height = was.texture_height;
    header.is_key = header.is_key && alone;
    return write_frame(header, {coded->sections.geometry, sections.texture, coded->sections.quality});
  }
  Status write(const RawSample& sample) {
    const auto view =
        sample.topic == Topic::kFrame ? read_frame_cdr(sample.cdr) : Result<FrameView>(FrameView{});
    return writer_->write({channels_[sample.topic], view ? static_cast<std::uint32_t>(view->sequence) : 0,
                           sample.receive_time_ns, sample.source_time_ns, sample.cdr});
  }

  const Options& options_;
  RecordedStream& recorded_;
  const std::filesystem::path out_;
  std::unique_ptr<RecordingWriter> writer_;
  std::map<Topic, std::uint16_t> channels_;
  std::vector<RecordedInfo> infos_;
  const RecordedInfo* described_ = nullptr;  // the one that was written last
  DescriptionAttachments attachments_;
  std::optional<FrameEncoder> encoder_;  // of its rig
  std::optional<FoxgloveChannels> foxglove_;
  FrameDecoder decoder_;
  Frame3D frame_;
  TextureCodec texture_ = TextureCodec::kNone;  // the last one recorded
  bool chain_begun_ = false;                    // of textures that build on each other
  Converted converted_;
};

Status convert(const Options& options, RecordedStream& recorded, Conversion& conversion, StopSignal& stop) {
  const auto range = find_range(*options.range, recorded);
  if (!range) return range.error().in(options.file);
  if (auto begun = conversion.begin(); !begun) return begun;
  if (auto sought = recorded.seek(range->from_ns); !sought) return sought;
  Progress progress("convert", "frames", range->frames);
  while (!stop.stopped()) {
    const auto sample = recorded.next();
    if (!sample) return sample.error();
    if (!*sample || (*sample)->receive_time_ns > range->to_ns) break;
    if (auto added = conversion.add(**sample, (*sample)->receive_time_ns >= range->from_ns); !added)
      return added;
    progress.update(conversion.converted().frames - conversion.converted().before);
  }
  if (stop.stopped()) return Error{"stopped before the end; nothing was written"};
  const Converted& converted = conversion.converted();
  if (converted.frames == converted.before) return converted.left_out.all().in(options.file);
  return conversion.finish();
}

void report(const Options& options, const Converted& converted, const RecordedStream& recorded) {
  if (options.json) {
    const nlohmann::json j = {
        {"file", options.out.string()},        {"frames", converted.frames},
        {"frames_before", converted.before},   {"unreadable", converted.left_out.frames()},
        {"damaged", recorded.damaged()},       {"bytes_before", converted.bytes_before},
        {"bytes_after", converted.bytes_after}};
    std::puts(json_text(j).c_str());
    return;
  }
  if (converted.left_out.unreadable > 0) return;  // which is told with the others
  std::printf("%s: %s", options.out.c_str(), counted(converted.frames, "frame").c_str());
  if (converted.before > 0)
    std::printf(", the first %llu from before the range: it builds on them",
                static_cast<unsigned long long>(converted.before));
  std::puts("");
}

Status run(const Options& options, StopSignal& stop) {
  auto recorded = RecordedStream::open(options.file, options.stream);
  if (!recorded) return recorded.error();
  recorded->warn_if_cut();
  const auto out = where_to_write(options.out);
  if (!out) return out.error();
  std::error_code none;
  if (std::filesystem::exists(*out, none))
    return Error{options.out.string() + " exists already: name another file, or remove it"};
  Conversion conversion(options, *recorded, *out);
  if (auto done = convert(options, *recorded, conversion, stop); !done) return done;
  const Converted& converted = conversion.converted();
  report(options, converted, *recorded);
  return converted.left_out.told(counted(converted.frames, "frame") + " " + is_or_are(converted.frames) +
                                 " in " + options.out.string());
}

}  // namespace

Command convert_command() {
  return {
      "convert", "Write a part of a recording, coded anew, or with channels for generic viewers",
      [](CLI::App& app) {
        auto options = std::make_shared<Options>();
        app.add_option("file", options->file, "Recording; it is not changed")->type_name("FILE")->required();
        app.add_option("--out", options->out, "New file to write")->type_name("FILE")->required();
        app.add_option("--stream", options->stream, "Which stream, where the file holds several")
            ->type_name("NAME");
        options->range = add_range_options(app);
        app.add_option("--geometry", options->geometry,
                       "Code frames anew, surfaces as " + geometry_profile_names() + " (default grid)")
            ->check([](const std::string& name) {
              EncodeOptions unused;
              return set_geometry_profile(name, unused) ? "" : "give " + geometry_profile_names();
            })
            ->type_name("NAME");
        app.add_option("--texture", options->texture,
                       "Code frames anew, textures as " + texture_codec_names() +
                           " (default: they stay as they are, byte for byte)")
            ->check([](const std::string& name) {
              return texture_codec_named(name).value_or(TextureCodec::kNone) != TextureCodec::kNone
                         ? ""
                         : "give " + texture_codec_names();
            })
            ->type_name("NAME");
        app.add_option("--bound", options->bound_px,
                       "Of visual: how far a vertex may be off in the camera's picture, pixels (default 0.5)")
            ->check(number(0.01, 8))
            ->type_name("PX");
        app.add_option("--step-bits", options->step_bits,
                       "Of grid, metric and draco-grid: steps of 1/2^bits pixel (default 6)")
            ->check(CLI::Range(0, 8));
        app.add_option(
               "--key-interval", options->key_interval,
               "Of grids and h264: every Nth frame decodes alone (default 1; with metric, visual or h264 30)")
            ->check(CLI::Range(1, 1000));
        app.add_option("--draco-speed", options->draco_speed, "Of draco-mesh: 0 smallest, 9 fastest")
            ->check(CLI::Range(0, 9));
        app.add_option("--texture-quality", options->texture_quality,
                       "Code frames anew, textures too (default 80 where they are)")
            ->check(CLI::Range(1, 100));
        app.add_flag(
            "--foxglove", options->foxglove,
            "Besides, the texture as foxglove.CompressedImage with its CameraCalibration, and the surface as "
            "foxglove.SceneUpdate");
        app.add_flag("--json", options->json, "Print the result as JSON");
        app.final_callback([options] { check_geometry(*options); });
        app.footer(
            "Examples:\n"
            "  relievo convert face.mcap --out part.mcap --from 10 --to 20\n"
            "  relievo convert face.mcap --out small.mcap --geometry grid --step-bits 4 --key-interval 15\n"
            "  relievo convert face.mcap --out thin.mcap --geometry visual --texture h264\n"
            "  relievo convert face.mcap --out shown.mcap --foxglove");
        return [options](StopSignal& stop) { return run(*options, stop); };
      }};
}

}  // namespace relievo
