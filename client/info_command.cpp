// SPDX-License-Identifier: Apache-2.0
#include <CLI/CLI.hpp>
#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <mutex>
#include <nlohmann/json.hpp>
#include <set>
#include <utility>
#include <vector>

#include "base/counted.h"
#include "base/json_text.h"
#include "base/log.h"
#include "base/time.h"
#include "cli/checks.h"
#include "cli/progress.h"
#include "client/commands.h"
#include "client/input.h"
#include "client/options.h"
#include "client/recorded_stream.h"
#include "codec/frame3d_codec.h"
#include "codec/texture_codec.h"
#include "idl/cdr.h"

namespace relievo {
namespace {

struct Options {
  std::shared_ptr<DomainOptions> domain;
  std::string what;
  std::string stream;
  double wait_s = 3;
  bool json = false;
};

// What frames add up to, in a file or over a while of a live stream.
struct FrameTotals {
  std::uint64_t frames = 0;
  std::uint64_t lost = 0;        // gaps in the frame sequence
  std::uint64_t unreadable = 0;  // frames whose bytes are of no version we know
  std::uint64_t geometry_bytes = 0, texture_bytes = 0, other_bytes = 0;
  std::uint64_t vertices = 0, triangles = 0;
  std::set<std::string> geometry_codecs, texture_codecs;
  std::uint32_t texture_width = 0, texture_height = 0;  // of the last frame
  std::uint64_t steps = 0;                              // from a frame to the next of its session,
  std::int64_t steps_ns = 0;                            // which took so long
  std::int64_t last_ns = 0;
  std::uint64_t last_sequence = 0;

  double rate() const { return steps_ns > 0 ? static_cast<double>(steps) / seconds(steps_ns) : 0; }
  std::uint64_t bytes() const { return geometry_bytes + texture_bytes + other_bytes; }
};

std::string codec_name(GeometryCodec codec) {
  if (codec == GeometryCodec::kDracoMesh) return "draco-mesh";
  if (codec == GeometryCodec::kDracoGrid) return "draco-grid";
  return codec == GeometryCodec::kGrid ? "grid" : std::to_string(static_cast<int>(codec));
}

/// As which, and when, a frame was published.
struct FramePlace {
  std::uint64_t sequence = 0;
  std::int64_t time_ns = 0;
  bool begins = false;  // of another session or recording than the frame before: between them nothing was
                        // lost or late
};

void add_frame(FrameTotals& totals, const FramePlace& at, std::span<const std::uint8_t> data) {
  if (totals.frames++ > 0 && !at.begins) {
    if (at.sequence > totals.last_sequence) totals.lost += at.sequence - totals.last_sequence - 1;
    if (at.time_ns >
        totals.last_ns) {  // not where it is played again from its start, or the clock was set back
      ++totals.steps;
      totals.steps_ns += at.time_ns - totals.last_ns;
    }
  }
  totals.last_sequence = at.sequence;
  totals.last_ns = at.time_ns;
  const auto header = read_frame_header(data);
  if (!header) {
    ++totals.unreadable;
    totals.other_bytes += data.size();
    return;
  }
  totals.geometry_bytes += header->geometry_bytes;
  totals.texture_bytes += header->texture_bytes;
  totals.other_bytes += data.size() - header->geometry_bytes - header->texture_bytes;
  totals.vertices += header->vertices;
  totals.triangles += header->triangles;
  totals.geometry_codecs.insert(codec_name(header->geometry));
  totals.texture_codecs.insert(texture_codec_name(header->texture));
  totals.texture_width = header->texture_width;
  totals.texture_height = header->texture_height;
}

std::string joined(const std::set<std::string>& names) {
  std::string text;
  for (const auto& name : names) text += (text.empty() ? "" : ", ") + name;
  return text.empty() ? "none" : text;
}

nlohmann::json frames_json(const FrameTotals& totals) {
  const std::uint64_t read = totals.frames - totals.unreadable;
  return {{"frames", totals.frames},
          {"lost", totals.lost},
          {"unreadable", totals.unreadable},
          {"frame_rate", totals.rate()},
          {"bytes",
           {{"geometry", totals.geometry_bytes},
            {"texture", totals.texture_bytes},
            {"other", totals.other_bytes}}},
          {"geometry_codecs", totals.geometry_codecs},
          {"texture_codecs", totals.texture_codecs},
          {"texture_size", {totals.texture_width, totals.texture_height}},
          {"mean_vertices", read > 0 ? totals.vertices / read : 0},
          {"mean_triangles", read > 0 ? totals.triangles / read : 0}};
}

nlohmann::json pinhole_json(const PinholeModel& model) {
  return {{"size", {model.width, model.height}}, {"matrix", model.matrix}, {"distortion", model.distortion}};
}

/// Null where the rig does not say it.
nlohmann::json known(double quality) {
  return quality > 0 ? nlohmann::json(quality) : nlohmann::json();
}

nlohmann::json place_json(const Rig& rig) {
  if (!rig.world_from_camera) return {};
  return {{"rotation", rig.world_from_camera->rotation}, {"translation", rig.world_from_camera->translation}};
}

nlohmann::json info_json(const StreamInfo& info) {
  return {
      {"stream", info.stream},
      {"source", info.source},
      {"started", utc_text(info.started_ns)},
      {"rig",
       {{"scan", to_string(info.rig.scan)},
        {"frame_rate", info.rig.frame_rate},
        {"camera", pinhole_json(info.rig.camera)},
        {"projector", pinhole_json(info.rig.projector)},
        {"projector_from_camera_rotation", info.rig.projector_from_camera_rotation},
        {"projector_from_camera_translation", info.rig.projector_from_camera_translation},
        {"colour_matrix", info.rig.colour_matrix},
        {"camera_gamma", info.rig.camera_gamma},
        {"stereo_rms_px", known(info.rig.stereo_rms_px)},
        {"scale_error", known(info.rig.scale_error)},
        {"world_from_camera", place_json(info.rig)}}},
      {"pattern",
       {{"base", info.pattern.base}, {"slides", info.pattern.slides}, {"stripes", info.pattern.stripes()}}}};
}

void print_info(const StreamInfo& info) {
  std::printf("source      %s, started %s\n", info.source.c_str(), utc_text(info.started_ns).c_str());
  std::printf("camera      %d x %d %s, %.2f frames/s, focal length %.1f px\n", info.rig.camera.width,
              info.rig.camera.height, std::string(to_string(info.rig.scan)).c_str(), info.rig.frame_rate,
              info.rig.camera.fx());
  const auto& t = info.rig.projector_from_camera_translation;
  std::printf("projector   %d x %d, %.3f m from the camera; %d stripes, base %d, %s\n",
              info.rig.projector.width, info.rig.projector.height,
              std::sqrt(t[0] * t[0] + t[1] * t[1] + t[2] * t[2]), info.pattern.stripes(), info.pattern.base,
              counted(static_cast<std::uint64_t>(info.pattern.slides), "slide").c_str());
}

void print_frames(const FrameTotals& totals) {
  std::printf("frames      %llu at %.2f/s, %llu lost\n", static_cast<unsigned long long>(totals.frames),
              totals.rate(), static_cast<unsigned long long>(totals.lost));
  if (totals.frames == 0) return;
  const std::uint64_t read = totals.frames - totals.unreadable;
  std::printf("a frame     %s: geometry %s, texture %s, other %s\n",
              bytes_text(totals.bytes() / totals.frames).c_str(),
              bytes_text(totals.geometry_bytes / totals.frames).c_str(),
              bytes_text(totals.texture_bytes / totals.frames).c_str(),
              bytes_text(totals.other_bytes / totals.frames).c_str());
  if (read > 0) {
    std::printf("surface     %llu vertices, %llu triangles on average\n",
                static_cast<unsigned long long>(totals.vertices / read),
                static_cast<unsigned long long>(totals.triangles / read));
    std::printf("codecs      geometry %s; texture %s, %u x %u\n", joined(totals.geometry_codecs).c_str(),
                joined(totals.texture_codecs).c_str(), totals.texture_width, totals.texture_height);
  }
  if (totals.unreadable > 0) {
    std::printf("unreadable  %s %s damaged, or of a format that this version does not read\n",
                counted(totals.unreadable, "frame").c_str(), is_or_are(totals.unreadable));
  }
}

void print_json(const nlohmann::json& j) {
  std::puts(json_text(j).c_str());
}

Status describe_file(const Options& options, StopSignal& stop) {
  auto recorded = RecordedStream::open(options.what, options.stream);
  if (!recorded) return recorded.error();
  const auto infos = recorded->read_infos();
  if (!infos) return infos.error();
  FrameTotals totals;
  std::vector<std::uint64_t> session_frames(infos->size());
  const RecordedInfo* last_session = nullptr;
  std::int64_t last_received_ns = 0;
  // Where files of one session were joined, what was published between them was not recorded.
  const auto begins_recording = [&](std::int64_t since_ns, std::int64_t received_ns) {
    return std::ranges::any_of(recorded->summary().starts_ns, [&](std::int64_t start_ns) {
      return since_ns < start_ns && start_ns <= received_ns;
    });
  };
  Progress progress("read", "frames", recorded->frames());
  while (!stop.stopped()) {
    auto sample = recorded->next();
    if (!sample) return sample.error();
    if (!*sample) break;
    if ((*sample)->topic != Topic::kFrame) continue;
    const RecordedInfo* const session = info_of(**sample, *infos);
    if (session) ++session_frames[static_cast<std::size_t>(session - infos->data())];
    const auto frame = read_frame_cdr((*sample)->cdr);
    if (!frame) {
      ++totals.unreadable;
      ++totals.frames;
      continue;
    }
    const std::int64_t received_ns = (*sample)->receive_time_ns;
    const bool begins = begins_recording(std::exchange(last_received_ns, received_ns), received_ns);
    add_frame(totals,
              {.sequence = frame->sequence,
               .time_ns = frame->publish_time_ns,
               .begins = std::exchange(last_session, session) != session || begins},
              frame->data);
    progress.update(totals.frames);
  }
  progress.finish();
  if (stop.stopped()) return Error{"stopped before the whole file was read"};

  const RecordingSummary& summary = recorded->summary();
  std::error_code ignored;
  const auto file_bytes = std::filesystem::file_size(options.what, ignored);
  const double duration_s = seconds(summary.end_ns - summary.start_ns);
  if (options.json) {
    nlohmann::json j = frames_json(totals);
    j["file"] = options.what;
    j["stream"] = recorded->stream();
    j["file_bytes"] = file_bytes;
    j["recorded"] = utc_text(summary.start_ns);
    j["duration_s"] = duration_s;
    j["recordings"] = summary.recordings;
    j["recovered"] = summary.recovered;
    j["lost_bytes"] = summary.lost_bytes;
    j["damaged_parts"] = recorded->damaged() + summary.damage.size();
    j["attachments"] = nlohmann::json::array();
    for (const auto& attachment : summary.attachments) j["attachments"].push_back(attachment.name);
    if (!infos->empty()) j["info"] = info_json(infos->front().info);
    j["sessions"] = nlohmann::json::array();
    for (std::size_t i = 0; i < infos->size(); ++i) {
      nlohmann::json session = info_json((*infos)[i].info);
      session["start_s"] = seconds((*infos)[i].sample.receive_time_ns - summary.start_ns);
      session["frames"] = session_frames[i];
      j["sessions"].push_back(std::move(session));
    }
    print_json(j);
    return {};
  }
  std::printf("file        %s, %s\n", options.what.c_str(), bytes_text(file_bytes).c_str());
  std::printf("stream      %s, recorded %s, %s\n", recorded->stream().c_str(),
              utc_text(summary.start_ns).c_str(), duration_text(duration_s).c_str());
  for (std::size_t i = 0; i < infos->size(); ++i) {
    if (infos->size() > 1)
      std::printf("session %-3zu from %.3f s on, %s\n", i + 1,
                  seconds((*infos)[i].sample.receive_time_ns - summary.start_ns),
                  counted(session_frames[i], "frame").c_str());
    print_info((*infos)[i].info);
  }
  print_frames(totals);
  if (summary.recordings > 1)
    std::printf(
        "joined      %zu recordings lie one behind the other in this file; all of them are told of here\n",
        summary.recordings);
  if (summary.recovered) {
    const std::string lost =
        summary.lost_bytes > 0 ? "; " + bytes_text(summary.lost_bytes) + " are no part of a recording" : "";
    std::printf(
        "recovered   the recording is being written, or was cut short or damaged: its index was made "
        "anew%s\n",
        lost.c_str());
  }
  for (const std::string& line : summary.damage) std::printf("damaged     %s\n", line.c_str());
  if (recorded->damaged() > 0) {
    std::printf("damaged     %s could not be read; `relievo recover` writes a copy without\n",
                counted(recorded->damaged(), "part").c_str());
  }
  return {};
}

Status describe_live(const Options& options, StopSignal& stop) {
  std::mutex mutex;
  FrameTotals totals;
  std::optional<StreamInfo> info;
  std::optional<ServerStatus> status;
  Subscriber::Callbacks callbacks;
  callbacks.info = [&](const StreamInfo& i) {
    std::lock_guard lock(mutex);
    info = i;
  };
  callbacks.status = [&](const ServerStatus& s) {
    std::lock_guard lock(mutex);
    status = s;
  };
  callbacks.frame = [&](const std::string&, const FrameMessage& f) {
    std::lock_guard lock(mutex);
    add_frame(totals, {.sequence = f.sequence, .time_ns = f.publish_time_ns}, *f.data);
  };
  auto subscriber = Subscriber::create(*options.domain, options.what, callbacks);
  if (!subscriber) return subscriber.error();
  stop.wait_for(std::chrono::nanoseconds(static_cast<std::int64_t>(options.wait_s * 1e9)));
  subscriber->reset();
  if (!info) {
    return Error{"'" + options.what + "' is neither a file nor a live stream in domain " +
                 std::to_string(options.domain->domain) + "; `relievo streams` lists what there is"};
  }
  if (options.json) {
    nlohmann::json j = frames_json(totals);
    j["stream"] = options.what;
    j["info"] = info_json(*info);
    if (status) j["state"] = to_string(status->state);
    print_json(j);
    return {};
  }
  std::printf("stream      %s, live%s\n", options.what.c_str(),
              status ? (", " + std::string(to_string(status->state))).c_str() : "");
  print_info(*info);
  print_frames(totals);
  return {};
}

Status run(const Options& options, StopSignal& stop) {
  const auto file = is_file(options.what);
  if (!file) return file.error();
  return *file ? describe_file(options, stop) : describe_live(options, stop);
}

}  // namespace

Command info_command() {
  return {
      "info", "Describe a recording or a live stream", [](CLI::App& app) {
        auto options = std::make_shared<Options>();
        options->domain = add_domain_options(app);
        app.add_option("what", options->what, "A recording's file or a live stream's name")
            ->type_name("FILE|STREAM")
            ->required();
        app.add_option("--stream", options->stream, "Which stream, where the file holds several")
            ->type_name("NAME");
        app.add_option("--wait", options->wait_s, "How long to watch a live stream, seconds")
            ->check(number(0.1, 3600))
            ->capture_default_str();
        app.add_flag("--json", options->json, "Print JSON");
        app.final_callback([options, &app] { check_given(app, options->what, {.of_files = {"--stream"}}); });
        app.footer("Examples:\n  relievo info face.mcap --json\n  relievo info face --wait 10");
        return [options](StopSignal& stop) { return run(*options, stop); };
      }};
}

}  // namespace relievo
