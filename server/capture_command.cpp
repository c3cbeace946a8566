// SPDX-License-Identifier: Apache-2.0
#include <CLI/CLI.hpp>
#include <algorithm>
#include <cstdio>
#include <deque>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>
#include <utility>

#include "base/counted.h"
#include "base/json_text.h"
#include "base/log.h"
#include "capture/source/field_source.h"
#include "capture/source/take_writer.h"
#include "cli/checks.h"
#include "cli/progress.h"
#include "server/camera_flags.h"
#include "server/commands.h"

namespace relievo {
namespace {

constexpr std::size_t kMostBytes = std::size_t{4} << 30;
constexpr int kMostErrors = 30;  // in a row

struct Options {
  std::string source;
  std::string out;
  std::uint64_t frames = 0;
  CameraOptions camera;
  bool json = false;
};

/// Frames that are in memory already: writing them takes longer than a camera waits.
class Captured final : public FieldSource {
 public:
  explicit Captured(SourceInfo info) : info_(std::move(info)) {}

  void keep(CapturedFrame&& frame) { frames_.push_back(std::move(frame)); }
  std::size_t size() const { return frames_.size(); }

  const SourceInfo& info() const override { return info_; }
  Result<std::optional<CapturedFrame>> next() override {
    if (frames_.empty()) return std::optional<CapturedFrame>{};
    std::optional<CapturedFrame> frame(std::move(frames_.front()));
    frames_.pop_front();
    return frame;
  }
  void request_stop() override { frames_.clear(); }

 private:
  const SourceInfo info_;
  std::deque<CapturedFrame> frames_;
};

/// Until there are as many as wanted, the source ends or it is stopped. Fails where the source gives only
/// errors.
Status fill(FieldSource& source, const Options& options, Captured& captured) {
  const Rig& rig = source.info().rig;
  const std::size_t pictures = rig.scan == Scan::kProgressive ? 2 : 1;
  const std::size_t frame_bytes =
      3 * pictures * static_cast<std::size_t>(rig.camera.width) * static_cast<std::size_t>(rig.camera.height);
  const std::size_t most = kMostBytes / std::max<std::size_t>(frame_bytes, 1);
  if (options.frames > most)
    log_warning("4 GiB of memory hold " + std::to_string(most) + " of the " + std::to_string(options.frames) +
                " frames: it will end after them");
  const std::uint64_t wanted = std::min<std::uint64_t>(options.frames, most);
  Progress progress("capture", "frames", wanted);
  for (int errors = 0; captured.size() < wanted;) {
    auto frame = source.next();
    if (!frame) {
      if (++errors == kMostErrors) return frame.error();
      log_warning(frame.error().message);
      continue;
    }
    if (!*frame) break;
    errors = 0;
    captured.keep(*std::move(*frame));
    progress.update(captured.size());
  }
  progress.finish();
  return {};
}

/// To the end, whatever was asked for meanwhile: there is no second take of it.
Status write(const Options& options, Captured& captured) {
  Progress progress("write", "frames", captured.size());
  return write_take(options.out, captured,
                    {.progress = [&](std::uint64_t done) { progress.update(done); }, .keep_written = true});
}

Status run(const Options& options, StopSignal& stop) {
  if (const Status known = check_rig(options.source, options.camera); !known) return known;
  // What was filmed may not come again: that it cannot be kept is said before.
  if (const Status target = check_take_target(options.out); !target) return target;
  auto source = open_source(options.source, {.camera = options.camera});
  if (!source) return source.error();
  Captured captured((*source)->info());
  stop.on_stop([&] { (*source)->request_stop(); });
  const Status filled = fill(**source, options, captured);
  stop.clear_on_stop();
  if (!filled && captured.size() == 0) return filled;
  const SourceCounts counts = (*source)->counts();
  source->reset();  // the camera is free while the take is written
  const std::size_t frames = captured.size();
  if (frames == 0 && stop.stopped()) {
    log_info("stopped before the first frame: nothing was written to " + options.out);
    return {};
  }
  if (const Status written = write(options, captured); !written) return written;
  if (options.json) {
    const nlohmann::json json = {{"take", options.out},
                                 {"frames", frames},
                                 {"lost_frames", counts.lost_frames},
                                 {"damaged_pictures", counts.damaged_pictures},
                                 {"restarts", counts.restarts},
                                 {"reconnects", counts.reconnects}};
    std::puts(json_text(json).c_str());
  } else {
    std::printf("%s in %s; lost %llu, damaged pictures %llu\n", counted(frames, "frame").c_str(),
                options.out.c_str(), static_cast<unsigned long long>(counts.lost_frames),
                static_cast<unsigned long long>(counts.damaged_pictures));
  }
  if (filled) return {};
  return Error{filled.error().message + "; " + options.out + " has the " + counted(frames, "frame") +
               " before"};
}

}  // namespace

Command capture_command() {
  return {"capture", "Keep what a camera sees as a take", [](CLI::App& app) {
            auto options = std::make_shared<Options>();
            app.add_option("--source", options->source, "v4l2:DEVICE, or any other source")
                ->type_name("SOURCE")
                ->required();
            app.add_option("--frames", options->frames,
                           "Frames to keep, in memory until all are there, 4 GiB at most")
                ->check(whole_number(1, 1'000'000))
                ->required();
            app.add_option("--out", options->out, "Take folder to make")->type_name("TAKE")->required();
            app.add_flag("--json", options->json, "Print the result as JSON");
            add_rig_flags(app, options->camera);
            add_camera_flags(app, options->camera);
            app.footer(
                "Example:\n"
                "  relievo-server capture --source v4l2:/dev/video0 --rig rig.yaml --frames 300 --out TAKE");
            return [options](StopSignal& stop) { return run(*options, stop); };
          }};
}

}  // namespace relievo
