// SPDX-License-Identifier: Apache-2.0
#include "server/calibration_task.h"

#include <algorithm>
#include <cstdio>
#include <utility>
#include <vector>

#include "base/parallel.h"
#include "capture/calibrate/board.h"
#include "capture/calibrate/colour.h"
#include "capture/calibrate/coverage.h"
#include "capture/calibrate/geometry.h"
#include "capture/calibrate/measure_view.h"
#include "capture/calibrate/sheet_colours.h"
#include "capture/calibrate/stripe_stack.h"
#include "server/calibration_report.h"

namespace relievo {
namespace {

constexpr int kThreads = 1;  // the streams of the other rigs go on
constexpr std::size_t kLeastViews = 3, kViewsEnough = 8;
constexpr std::uint8_t kClipped = 254;
constexpr double kClippedMuch = 0.02, kClippedMost = 0.2;  // of a picture's pixels: to be said; refused

/// The share of pixels that a channel clips in.
double clipped_share(const Image8& picture) {
  std::size_t clipped = 0;
  for (std::size_t i = 0; i + 2 < picture.size(); i += 3) {
    const std::uint8_t* p = picture.data() + i;
    clipped += p[0] >= kClipped || p[1] >= kClipped || p[2] >= kClipped;
  }
  return picture.size() == 0 ? 0 : static_cast<double>(clipped) / static_cast<double>(picture.size() / 3);
}

std::string numbered(const char* what, std::size_t number) {
  char name[32];
  std::snprintf(name, sizeof name, "%s %zu", what, number);
  return name;
}

class ColourTask final : public CalibrationTask {
 public:
  explicit ColourTask(RigPart before) : before_(std::move(before)) {}

  std::string projector_shows() const override { return "colours"; }
  std::size_t cycle() const override { return 4; }
  std::string next() const override {
    return result_
               ? "The colours are calibrated: keep them, or take them again."
               : "Hold a matt white sheet still before camera and projector, so that it fills a good part "
                 "of the picture and the projector lights all of it. No other light. Then take it.";
  }

  TakenView take(const StillCollector& collector) override {
    result_.reset();
    TakenView out{.name = numbered("Sheet", ++taken_), .used = false, .says = {}};
    std::vector<Image8> pictures = collector.pictures();
    const auto colours = tell_colours(pictures);
    if (!colours) {
      out.says = colours.error().message;
      return out;
    }
    std::vector<ColourCapture> captures;
    for (std::size_t i = 0; i < pictures.size(); ++i)
      captures.push_back({primary_name((*colours)[i]), (*colours)[i], std::move(pictures[i])});
    auto calibration = calibrate_colour(captures, {});
    if (!calibration) {
      out.says = calibration.error().message;
      return out;
    }
    out.used = true;
    out.says = std::to_string(calibration->target_pixels) + " pixels of the sheet";
    result_ = *std::move(calibration);
    return out;
  }
  bool can_solve() const override { return result_.has_value(); }
  bool enough() const override { return result_.has_value(); }
  Result<CalibrationResult> solve() override {
    if (!result_) return Error{"no capture of the sheet was good enough"};
    before_.colours = result_->camera;
    return CalibrationResult{to_yaml(before_), colour_report(*result_)};
  }

 private:
  RigPart before_;
  std::size_t taken_ = 0;
  std::optional<ColourCalibration> result_;
};

class BoardTask final : public CalibrationTask {
 public:
  BoardTask(Board board, const SourceInfo& info, RigPart before)
      : board_(std::move(board)),
        rig_(info.rig),
        pattern_(info.pattern),
        before_(std::move(before)),
        pool_(kThreads),
        coverage_(info.rig.camera, info.rig.projector) {
    if (before_.colours) colours_ = *before_.colours;
  }

  std::string projector_shows() const override { return "stripes"; }
  std::size_t cycle() const override { return 2 * static_cast<std::size_t>(pattern_.slides); }
  std::string next() const override {
    if (views_.empty())
      return "Hold the board still where camera and projector both see all of it, a little tilted. Then take "
             "a view.";
    if (enough() && coverage_.missing().empty()) return "There are views enough: calculate.";
    const std::string place = coverage_.next();
    return (enough() ? "Calculate, or better first: hold the board " : "Next: hold the board ") +
           (place.empty() ? "at another place, tilted differently" : place) + ".";
  }

  TakenView take(const StillCollector& collector) override {
    TakenView out{.name = numbered("View", ++taken_), .used = false, .says = {}};
    std::vector<StripePair> pairs = collector.pairs();
    double clipped = 0;
    for (const StripePair& pair : pairs) clipped = std::max(clipped, clipped_share(pair.lit));
    if (clipped > kClippedMost) return not_used(std::move(out), "too much light", clipped);
    auto stack = sort_stripes(std::move(pairs), pattern_, rig_.projector.width, rig_.projector.height,
                              colours_, pool_);
    if (!stack) return not_used(std::move(out), stack.error().message, clipped);
    MeasuredView view = measure_view(out.name, *stack, board_, colours_, pool_);
    if (!view.refused.empty()) return not_used(std::move(out), view.refused, clipped);
    if (coverage_.repeats(view))
      return not_used(std::move(out), "the board is where it was in a view before; move it", 0);
    out.used = true;
    out.says = coverage_.add(view) + light_advice(clipped);
    views_.push_back(std::move(view));
    return out;
  }
  bool can_solve() const override { return views_.size() >= kLeastViews; }
  bool enough() const override { return views_.size() >= kViewsEnough; }
  Result<CalibrationResult> solve() override {
    PinholeModel camera, projector;
    camera.width = rig_.camera.width;
    camera.height = rig_.camera.height;
    projector.width = rig_.projector.width;
    projector.height = rig_.projector.height;
    const auto geometry = calibrate_geometry(views_, camera, projector, {});
    if (!geometry) return geometry.error();
    Rig rig = before_.whole.value_or(rig_);
    set_colours(colours_, rig);
    rig = with_geometry(rig, *geometry);
    return CalibrationResult{to_yaml(rig), geometry_report(*geometry)};
  }
  std::optional<Image8> coverage() const override { return coverage_.draw_seen(); }
  std::vector<std::string> tilts() const override { return coverage_.tilts(); }

 private:
  static std::string light_advice(double clipped) {
    if (clipped <= kClippedMuch) return {};
    return "; " + std::to_string(static_cast<int>(100 * clipped)) +
           " % of the picture is clipped: shorten the exposure or close the iris";
  }
  static TakenView not_used(TakenView out, const std::string& why, double clipped) {
    out.says = why + light_advice(clipped);
    return out;
  }

  const Board board_;
  const Rig rig_;  // the source's: its sizes, scan and rate
  const Pattern pattern_;
  const RigPart before_;
  CameraColours colours_;
  WorkerPool pool_;
  Coverage coverage_;
  std::size_t taken_ = 0;
  std::vector<MeasuredView> views_;
};

}  // namespace

Result<std::unique_ptr<CalibrationTask>> make_calibration_task(CalibrationKind kind, const std::string& board,
                                                               const SourceInfo& info,
                                                               const RigPart& before) {
  if (kind == CalibrationKind::kColour)
    return std::unique_ptr<CalibrationTask>(std::make_unique<ColourTask>(before));
  auto parsed = parse_board(board);
  if (!parsed) return parsed.error();
  if (info.pattern.stripes() == 0 || info.rig.projector.width == 0)
    return Error{info.name + " does not say what is projected: name its pattern with --pattern"};
  if (info.pattern.slides > 2)
    return Error{"stripes on 1 or 2 slides calibrate, and this pattern has " +
                 std::to_string(info.pattern.slides)};
  return std::unique_ptr<CalibrationTask>(std::make_unique<BoardTask>(*std::move(parsed), info, before));
}

}  // namespace relievo
