// SPDX-License-Identifier: Apache-2.0
#include <CLI/CLI.hpp>
#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "base/counted.h"
#include "base/json_text.h"
#include "base/time.h"
#include "cli/checks.h"
#include "cli/progress.h"
#include "client/commands.h"
#include "client/export_formats.h"
#include "client/options.h"
#include "client/range_frames.h"
#include "client/recorded_stream.h"
#include "client/time_range.h"
#include "codec/video_file.h"

namespace relievo {
namespace {

struct Options {
  std::string file;
  std::string stream;
  std::filesystem::path out;
  std::string format = "ply";
  double depth_unit_mm = 1;
  bool reencode = false;
  bool draco = false;
  std::shared_ptr<RangeOptions> range;
  bool json = false;
};

const ExportFormat& format_named(const std::string& name) {
  const auto formats = export_formats();
  const auto found =
      std::ranges::find(formats, name, [](const ExportFormat& f) { return std::string(f.name); });
  return found != formats.end() ? *found
                                : formats.front();  // the latter is not reached: the option is checked
}

struct Exported {
  std::uint64_t written = 0;
  LeftOut left_out;
  bool stopped = false;
};

/// `after_ns`: the recording's start, of the first frame that what is written has no room for.
Error two_parts(const std::string& why, std::int64_t after_ns) {
  char from[48], to[48];
  std::snprintf(from, sizeof from, "%.9f", seconds(after_ns));
  std::snprintf(to, sizeof to, "%.9f", seconds(after_ns - 1));
  return Error{why + ": export each part by itself, one with --to " + to + ", one with --from " + from};
}

std::string size_text(const Image8& image) {
  return std::to_string(image.width()) + " x " + std::to_string(image.height());
}

bool are_equal(const PinholeModel& a, const PinholeModel& b) {
  return a.width == b.width && a.height == b.height && a.matrix == b.matrix && a.distortion == b.distortion;
}

/// Of the frames in the range. Fails where their cameras differ; nothing where there is no description.
Result<std::optional<Rig>> find_rig(RecordedStream& recorded, const TimeRange& range) {
  const auto infos = recorded.read_infos();
  if (!infos) return infos.error();
  const auto differs = [&](const RecordedInfo& info) {
    return !are_equal(info.info.rig.camera, infos->front().info.rig.camera);
  };
  if (std::ranges::none_of(*infos, differs))
    return infos->empty() ? std::nullopt : std::optional(infos->front().info.rig);
  if (auto status = recorded.seek(range.from_ns); !status) return status.error();
  std::optional<Rig> rig;
  for (;;) {
    const auto sample = recorded.next();
    if (!sample) return sample.error();
    if (!*sample || (*sample)->receive_time_ns > range.to_ns) return rig;
    if ((*sample)->topic != Topic::kFrame || (*sample)->receive_time_ns < range.from_ns) continue;
    const Rig& its = info_of(**sample, *infos)->info.rig;
    if (rig && !are_equal(rig->camera, its.camera))
      return two_parts("the camera was calibrated anew within the range, and what is written describes one",
                       (*sample)->receive_time_ns - recorded.summary().start_ns);
    rig = its;
  }
}

Result<std::unique_ptr<ExportWriter>> make_writer(const Options& options, RecordedStream& recorded,
                                                  const TimeRange& range) {
  ExportTarget target{.out = options.out,
                      .stream = recorded.stream(),
                      .rig = {},
                      .depth_unit_m = 1e-3 * options.depth_unit_mm,
                      .reencode = options.reencode,
                      .draco = options.draco};
  if (options.format == "depth" || options.format == "ros2") {
    auto rig = find_rig(recorded, range);
    if (!rig) return rig.error().in(options.file);
    target.rig = *std::move(rig);
  }
  return format_named(options.format).make(target);
}

Result<Exported> export_frames(const Options& options, RecordedStream& recorded, StopSignal& stop) {
  const auto range = find_range(*options.range, recorded);
  if (!range) return range.error().in(options.file);
  const auto writer = make_writer(options, recorded, *range);
  if (!writer) return writer.error();
  auto frames = RangeFrames::open(recorded, *range);
  if (!frames) return frames.error();
  Exported exported;
  Progress progress("export", "frames", range->frames);
  std::string size;  // of a video's pictures
  while (!exported.stopped) {
    const auto next = frames->next();
    if (!next) return next.error();
    if (!*next) break;
    const std::string its = size_text((*next)->frame.texture);
    if (options.format == "video" && exported.written > 0 && its != size)
      return two_parts("the texture is " + size + " at first and then " + its + ", and a video has one size",
                       (*next)->sample.receive_time_ns - recorded.summary().start_ns);
    size = its;
    if (auto status = (*writer)->add((*next)->frame, (*next)->data); !status) return status.error();
    progress.update(++exported.written);
    exported.stopped = stop.stopped();
  }
  exported.left_out = frames->left_out();
  if (exported.written > 0)
    if (auto status = (*writer)->finish(); !status) return status.error();
  return exported;
}

Status run(const Options& options, StopSignal& stop) {
  auto recorded = RecordedStream::open(options.file, options.stream);
  if (!recorded) return recorded.error();
  if (const Status free = recorded->check_output(options.out); !free) return free;
  recorded->warn_if_cut();
  auto exported = export_frames(options, *recorded, stop);
  if (!exported) return exported.error();
  const std::string written = counted(exported->written, "frame") + " " + is_or_are(exported->written) +
                              " in " + options.out.string();
  if (exported->stopped) return Error{"stopped early: " + written};
  const LeftOut& left_out = exported->left_out;
  if (exported->written == 0) return left_out.all().in(options.file);
  if (options.json) {
    std::puts(json_text(nlohmann::json({{"frames", exported->written},
                                        {format_named(options.format).is_one_file ? "file" : "folder",
                                         options.out.string()},
                                        {"format", options.format},
                                        {"unreadable", left_out.frames()},
                                        {"damaged", recorded->damaged()}}))
                  .c_str());
  } else if (left_out.unreadable == 0) {
    std::puts(written.c_str());
  }
  return left_out.told(written);
}

}  // namespace

Command export_command() {
  return {
      "export", "Write the frames of a recording as files that other programs open", [](CLI::App& app) {
        auto options = std::make_shared<Options>();
        std::vector<std::string> names;
        for (const ExportFormat& format : export_formats()) names.emplace_back(format.name);
        app.add_option("file", options->file, "Recording")->type_name("FILE")->required();
        app.add_option(
               "--out", options->out,
               "Folder, where files are named after their camera frames; of animation (.glb), video (.mp4, "
               ".mkv) and ros2 (.mcap) the one file")
            ->type_name("PATH")
            ->required();
        app.add_option(
               "--format", options->format,
               "ply, glb, obj (the textured surface), png (the texture), depth (texture and 16-bit depth "
               "as PNGs of a camera without distortion, which camera.json describes), animation (all "
               "frames in one GLB that plays them), video (of the texture; as recorded where it is H.264) or "
               "ros2 (a bag: points, picture and camera as ROS 2 has them)")
            ->check(CLI::IsMember(names))
            ->capture_default_str();
        app.add_option("--depth-unit", options->depth_unit_mm, "Of depth: millimetres a step; 65,535 fit")
            ->check(number(0.001, 100))
            ->type_name("MM")
            ->capture_default_str();
        app.add_flag("--reencode", options->reencode, "Of video: code it anew even where it could be copied");
        app.add_flag("--draco", options->draco,
                     "Of glb and animation: surfaces compressed (KHR_draco_mesh_compression), for viewers "
                     "that have Draco");
        app.add_option("--stream", options->stream, "Which stream, where the file holds several")
            ->type_name("NAME");
        options->range = add_range_options(app);
        app.add_flag("--json", options->json, "Print the result as JSON");
        app.final_callback([options, &app] {
          if (options->reencode && options->format != "video")
            throw CLI::ValidationError("--reencode", "there is no video in " + options->format);
          if (app.count("--depth-unit") > 0 && options->format != "depth")
            throw CLI::ValidationError("--depth-unit", "there is no depth picture in " + options->format);
          if (options->draco && !format_named(options->format).has_draco)
            throw CLI::ValidationError(
                "--draco", "there is no Draco in " + options->format + ": it is of glb and animation");
          const std::string no_folder = folder_name()(options->out.string());
          if (!format_named(options->format).is_one_file && !no_folder.empty())
            throw CLI::ValidationError(
                "--out",
                no_folder + (options->format == "glb" ? ", or --format animation for one file of all frames"
                                                      : ": " + options->format + " is a file a frame"));
          if (options->format == "video" && !is_video_name(options->out))
            throw CLI::ValidationError("--out", "a video's name ends in .mp4 or .mkv");
          if (options->format == "animation" && options->out.extension() != ".glb")
            throw CLI::ValidationError("--out", "an animation's name ends in .glb");
          if (options->format == "ros2" && options->out.extension() != ".mcap")
            throw CLI::ValidationError("--out", "a bag's name ends in .mcap");
        });
        app.footer(
            "Examples:\n"
            "  relievo export face.mcap --format glb --frames 30:59 --out DIR\n"
            "  relievo export face.mcap --format glb --draco --out DIR\n"
            "  relievo export face.mcap --format animation --from 1 --to 5 --out face.glb\n"
            "  relievo export face.mcap --format video --out face.mp4\n"
            "  relievo export face.mcap --format ros2 --out face_ros2.mcap");
        return [options](StopSignal& stop) { return run(*options, stop); };
      }};
}

}  // namespace relievo
