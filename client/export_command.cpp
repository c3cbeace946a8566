// SPDX-License-Identifier: Apache-2.0
#include <CLI/CLI.hpp>
#include <cstdio>
#include <filesystem>
#include <memory>
#include <nlohmann/json.hpp>

#include "base/log.h"
#include "cli/progress.h"
#include "client/commands.h"
#include "client/options.h"
#include "client/recorded_stream.h"
#include "client/time_range.h"
#include "codec/export.h"
#include "codec/frame3d_codec.h"
#include "idl/cdr.h"

namespace relievo {
namespace {

struct Options {
  std::string file;
  std::string stream;
  std::filesystem::path folder;
  std::string format = "ply";
  std::shared_ptr<RangeOptions> range;
  bool json = false;
};

struct Format {
  const char* name;  // and the files' extension
  Status (*write)(const std::filesystem::path& file, const Frame3D& frame);
};

const Format kFormats[] = {
    {"ply", [](const auto& file,
               const auto& frame) { return write_ply(file, frame.surface, frame.texture.view()); }},
    {"glb", [](const auto& file, const auto& frame) { return write_glb(file, frame); }},
    {"obj", [](const auto& file, const auto& frame) { return write_obj(file, frame); }},
    {"png", [](const auto& file, const auto& frame) { return write_png(file, frame.texture.view()); }},
};

const Format& format_named(const std::string& name) {
  for (const Format& format : kFormats) {
    if (name == format.name) return format;
  }
  return kFormats[0];  // not reached: the option is checked
}

std::string file_name(std::uint64_t number, const char* extension) {
  char text[48];
  std::snprintf(text, sizeof text, "%06llu.%s", static_cast<unsigned long long>(number), extension);
  return text;
}

struct Exported {
  std::uint64_t written = 0;
  std::uint64_t unreadable = 0;
  std::uint64_t waiting = 0;  // for the key frame they build on
  std::string first_problem;
  bool stopped = false;
};

Status export_frame(const Options& options, const RawSample& sample, FrameDecoder& decoder,
                    Exported& exported) {
  const auto unreadable = [&](const Error& error) {
    if (exported.unreadable++ == 0) exported.first_problem = error.message;
    return Status();
  };
  const auto view = read_frame_cdr(sample.cdr);
  if (!view) return unreadable(view.error());
  if (read_frame_header(view->data) && !decoder.can_decode(view->data)) {
    if (exported.waiting++ == 0)
      log_warning("the recording begins between key frames: frames before the first one cannot be shown");
    return {};
  }
  const auto frame = decoder.decode(view->data);
  if (!frame) return unreadable(frame.error());
  std::error_code error;  // made with the first frame, so that a failure leaves no empty folder
  if (exported.written == 0) std::filesystem::create_directories(options.folder, error);
  if (error) return Error{"cannot make the folder " + options.folder.string() + ": " + error.message()};
  const Format& format = format_named(options.format);
  if (auto status = format.write(options.folder / file_name(frame->number, format.name), *frame); !status) {
    return status;
  }
  ++exported.written;
  return {};
}

/// Frames before the range may be what those in it build on.
void remember(const RawSample& sample, FrameDecoder& decoder) {
  if (const auto view = read_frame_cdr(sample.cdr)) (void)decoder.remember(view->data);
}

Result<Exported> export_frames(const Options& options, RecordedStream& recorded, StopSignal& stop) {
  const auto range = find_range(*options.range, recorded);
  if (!range) return range.error().in(options.file);
  if (auto status = recorded.seek(range->from_ns); !status) return status.error();
  Exported exported;
  FrameDecoder decoder;
  Progress progress("export", "frames", range->frames);
  for (;;) {
    auto sample = recorded.next();
    if (!sample) return sample.error();
    if (!*sample || (*sample)->receive_time_ns > range->to_ns) break;
    if ((*sample)->topic != Topic::kFrame) continue;
    if ((*sample)->receive_time_ns < range->from_ns) {
      remember(**sample, decoder);
      continue;
    }
    if (auto status = export_frame(options, **sample, decoder, exported); !status) return status.error();
    progress.update(exported.written);
    exported.stopped = stop.stopped();
    if (exported.stopped) break;
  }
  return exported;
}

Status run(const Options& options, StopSignal& stop) {
  auto recorded = RecordedStream::open(options.file, options.stream);
  if (!recorded) return recorded.error();
  auto exported = export_frames(options, *recorded, stop);
  if (!exported) return exported.error();
  const std::string written = std::to_string(exported->written) + " frames are in " + options.folder.string();
  if (exported->stopped) return Error{"stopped early: " + written};
  if (exported->unreadable > 0) {
    return Error{std::to_string(exported->unreadable) + " frames could not be decoded (" +
                 exported->first_problem + "); the other " + written};
  }
  if (exported->written == 0) return Error{options.file + ": no frame in that range is whole"};
  if (options.json) {
    std::puts(nlohmann::json({{"frames", exported->written},
                              {"folder", options.folder.string()},
                              {"format", options.format},
                              {"damaged", recorded->damaged()}})
                  .dump(2, ' ', false, nlohmann::json::error_handler_t::replace)
                  .c_str());
  } else {
    std::puts(written.c_str());
  }
  return {};
}

}  // namespace

Command export_command() {
  return {"export", "Write the frames of a recording as PLY, GLB, OBJ or PNG files", [](CLI::App& app) {
            auto options = std::make_shared<Options>();
            app.add_option("file", options->file, "Recording")->type_name("FILE")->required();
            app.add_option("--out", options->folder, "Folder; a file is named after its camera frame")
                ->type_name("DIR")
                ->required();
            app.add_option("--format", options->format,
                           "ply, glb, obj (the textured surface) or png (the texture)")
                ->check(CLI::IsMember({"ply", "glb", "obj", "png"}))
                ->capture_default_str();
            app.add_option("--stream", options->stream, "Which stream, where the file holds several")
                ->type_name("NAME");
            options->range = add_range_options(app);
            app.add_flag("--json", options->json, "Print the result as JSON");
            app.footer("Example:\n  relievo export face.mcap --format glb --frames 30:59 --out DIR");
            return [options](StopSignal& stop) { return run(*options, stop); };
          }};
}

}  // namespace relievo
