// SPDX-License-Identifier: Apache-2.0
#include <CLI/CLI.hpp>
#include <charconv>
#include <cstdio>
#include <filesystem>
#include <limits>
#include <nlohmann/json.hpp>

#include "base/log.h"
#include "base/time.h"
#include "cli/checks.h"
#include "cli/progress.h"
#include "client/commands.h"
#include "client/options.h"
#include "client/recorded_stream.h"
#include "codec/export.h"
#include "codec/frame3d_codec.h"
#include "idl/cdr.h"

namespace relievo {
namespace {

/// Positions in the recording, from 0, both ends included.
struct FrameRange {
  std::uint64_t first = 0;
  std::uint64_t last = std::numeric_limits<std::uint64_t>::max();
};

struct Options {
  std::string file;
  std::string stream;
  std::filesystem::path folder;
  std::string format = "ply";
  std::string frames;
  FrameRange range;
  double from_s = 0;
  double to_s = std::numeric_limits<double>::infinity();
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

bool parse_number(std::string_view text, std::uint64_t& number) {
  if (text.empty()) return true;  // an open end
  const auto [end, failed] = std::from_chars(text.data(), text.data() + text.size(), number);
  return failed == std::errc() && end == text.data() + text.size();
}

// "A:B", "A:", ":B" or "A".
bool parse_range(const std::string& text, FrameRange& range) {
  const std::size_t colon = text.find(':');
  if (colon == std::string::npos) {
    if (text.empty() || !parse_number(text, range.first)) return false;
    range.last = range.first;
    return true;
  }
  return parse_number(std::string_view(text).substr(0, colon), range.first) &&
         parse_number(std::string_view(text).substr(colon + 1), range.last) && range.first <= range.last;
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
  const auto view = read_frame_cdr(sample.cdr);
  if (view && is_key_frame(view->data)) (void)decoder.remember(view->data);
}

Result<Exported> export_frames(const Options& options, RecordedStream& recorded, StopSignal& stop) {
  Exported exported;
  FrameDecoder decoder;
  const std::uint64_t there = recorded.frames();
  const std::uint64_t beyond = std::min(there, options.range.last == std::numeric_limits<std::uint64_t>::max()
                                                   ? there
                                                   : options.range.last + 1);
  Progress progress("export", "frames", beyond > options.range.first ? beyond - options.range.first : 0);
  for (std::uint64_t position = 0; position <= options.range.last;) {
    auto sample = recorded.next();
    if (!sample) return sample.error();
    if (!*sample) break;
    if ((*sample)->topic != Topic::kFrame) continue;
    const double time_s = seconds((*sample)->receive_time_ns - recorded.summary().start_ns);
    if (time_s > options.to_s) break;
    if (position++ < options.range.first || time_s < options.from_s) {
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
  if (exported->written == 0) {
    return Error{options.file + " has no frame in that range: `relievo info` says how many there are"};
  }
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
  return {
      "export", "Write the frames of a recording as PLY, GLB, OBJ or PNG files", [](CLI::App& app) {
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
        app.add_option("--frames", options->frames,
                       "Positions in the recording from 0, both included; A:, :B and A work too")
            ->type_name("A:B")
            ->check([options](const std::string& text) {
              return parse_range(text, options->range) ? std::string()
                                                       : "'" + text + "' is no range such as 10:19";
            });
        app.add_option("--from", options->from_s, "Seconds after the recording's start")
            ->check(number(0, 1e9));
        app.add_option("--to", options->to_s, "Seconds after the recording's start")->check(number(0, 1e9));
        app.add_flag("--json", options->json, "Print the result as JSON");
        app.footer("Example:\n  relievo export face.mcap --format glb --frames 30:59 --out DIR");
        return [options](StopSignal& stop) { return run(*options, stop); };
      }};
}

}  // namespace relievo
