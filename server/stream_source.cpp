// SPDX-License-Identifier: Apache-2.0
#include "server/stream_source.h"

#include <filesystem>
#include <utility>

#include "capture/pattern/bcsl.h"
#include "server/options.h"

namespace relievo {
namespace {

namespace fs = std::filesystem;

constexpr int kBase = 6, kSlides = 2, kStripes = 90;  // of a pattern that no file says: as `pattern` makes it
constexpr double kGuessedFocal = 1.5;                 // of a picture's width
constexpr double kGuessedBaseline_m = 0.2;            // the projector stands to the right

bool is_simulated(const std::string& source) {
  return source.starts_with("sim:");
}

/// A source whose rig another one says.
class WithRig final : public FieldSource {
 public:
  WithRig(std::unique_ptr<FieldSource> source, const Rig& rig, Pattern pattern)
      : source_(std::move(source)), info_(source_->info()) {
    info_.rig = rig;
    info_.pattern = std::move(pattern);
  }
  const SourceInfo& info() const override { return info_; }
  Result<std::optional<CapturedFrame>> next() override { return source_->next(); }
  void request_stop() override { source_->request_stop(); }
  SourceCounts counts() const override { return source_->counts(); }

 private:
  const std::unique_ptr<FieldSource> source_;
  SourceInfo info_;
};

PinholeModel guessed_lens(int width, int height) {
  const double focal = kGuessedFocal * width;
  return {width, height, {focal, 0, (width - 1) / 2.0, 0, focal, (height - 1) / 2.0, 0, 0, 1}, {}};
}

/// Sizes, scan and rate are the source's.
Rig guessed_rig(const Rig& source, const RigPart& part) {
  Rig rig = source;
  rig.camera = guessed_lens(source.camera.width, source.camera.height);
  rig.projector = guessed_lens(source.projector.width, source.projector.height);
  rig.projector_from_camera_rotation = {1, 0, 0, 0, 1, 0, 0, 0, 1};
  rig.projector_from_camera_translation = {-kGuessedBaseline_m, 0, 0};
  set_colours(part.colours.value_or(CameraColours{}), rig);
  return rig;
}

Status fits(const Rig& file, const Rig& source, const StreamConfig& config) {
  const auto same = [](const PinholeModel& a, const PinholeModel& b) {
    return a.width == b.width && a.height == b.height;
  };
  if (same(file.camera, source.camera) && same(file.projector, source.projector)) return {};
  return Error{config.camera.rig + " is of another camera or projector than " + config.source +
               ": their pictures differ in size"};
}

/// What a camera needs that has no calibration: which pattern is projected, and how large it is.
Status prepare_uncalibrated(CameraOptions& camera, const ProjectorConfig& projector) {
  if (projector.width == 0)
    return Error{camera.rig +
                 " does not say yet how large the projector's picture is: start the server with "
                 "--projector-size WIDTHxHEIGHT, and calibrate on the page /rig"};
  camera.projector_width = projector.width;
  camera.projector_height = projector.height;
  std::error_code ignored;
  const fs::path beside = fs::path(camera.rig).replace_filename("pattern.yaml");
  if (camera.pattern.empty() && fs::exists(beside, ignored)) camera.pattern = beside.string();
  camera.rig.clear();
  return {};
}

}  // namespace

Result<RigPart> rig_so_far(const std::string& file) {
  std::error_code ignored;
  if (!fs::exists(file, ignored)) return RigPart{};
  return read_rig_part(file);
}

Result<StreamSource> open_stream_source(const StreamConfig& config, const ProjectorConfig& projector) {
  const auto uri = with_scheme(config.source, config.scheme);
  if (!uri) return uri.error();
  const bool simulated = is_simulated(config.source);
  SourceOptions options{.loop = config.loop || simulated, .camera = config.camera};
  RigPart part;
  const bool may_be_guessed = simulated || !projector.output.empty();
  const bool has_file =
      !config.camera.rig.empty() && (simulated || (config.source.starts_with("v4l2:") && may_be_guessed));
  if (has_file) {
    auto read = rig_so_far(config.camera.rig);
    if (!read) return read.error();
    part = *std::move(read);
  }
  const bool calibrated = !has_file || part.whole.has_value();
  if (!calibrated && !simulated) {
    if (const Status known = prepare_uncalibrated(options.camera, projector); !known) return known.error();
  }
  auto source = open_source(*uri, options);
  if (!source) return source.error();
  StreamSource out{.source = *std::move(source), .uri = *uri, .calibrated = calibrated};
  const SourceInfo& info = out.source->info();
  Pattern pattern = info.pattern;
  if (!calibrated && pattern.stripes() == 0) {
    auto made = make_pattern(kBase, kSlides, 0, kStripes);
    if (!made) return made.error();
    pattern = *std::move(made);
  }
  if (!calibrated) {
    const Rig guess = guessed_rig(info.rig, part);
    out.source = std::make_unique<WithRig>(std::move(out.source), guess, std::move(pattern));
  } else if (simulated && part.whole) {
    if (const Status same = fits(*part.whole, info.rig, config); !same) return same.error();
    out.source = std::make_unique<WithRig>(std::move(out.source), *part.whole, std::move(pattern));
  }
  return out;
}

Result<std::unique_ptr<FieldSource>> open_calibration_source(const StreamConfig& config,
                                                             const ProjectorConfig& projector,
                                                             CalibrationKind kind, const std::string& board) {
  if (!is_simulated(config.source)) {
    auto opened = open_stream_source(config, projector);
    if (!opened) return opened.error();
    return std::move(opened->source);
  }
  const auto comma = config.source.find(',');
  const std::string keys = comma == std::string::npos ? "" : config.source.substr(comma);
  const std::string poses = keys.find(",period=") == std::string::npos ? ",period=240" : "";  // enough
  const std::string uri =
      kind == CalibrationKind::kColour ? "sim:sheet" + keys : "sim:board:" + board + poses + keys;
  return open_source(uri, {.loop = true});
}

}  // namespace relievo
