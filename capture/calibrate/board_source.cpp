// SPDX-License-Identifier: Apache-2.0
#include "capture/calibrate/board_source.h"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <functional>
#include <optional>
#include <utility>
#include <vector>

#include "capture/calibrate/board_scene.h"
#include "capture/pattern/bcsl.h"
#include "capture/source/sim/renderer.h"

namespace relievo {
namespace {

constexpr std::uint64_t kPoseFrames = 20, kStillFrames = 14;
constexpr int kSamples = 2, kMovingSamples = 1;  // rays a pixel and axis

/// Both pictures of camera frame `index`, lost ones counted.
using Render = std::function<StripePair(std::uint64_t index)>;

/// Gives what is rendered as a camera would: counted, timed, woven where it is interlaced.
class RenderedSource final : public FieldSource {
 public:
  RenderedSource(SourceInfo info, const sim::SimOptions& options, bool loop, Render render)
      : info_(std::move(info)),
        drop_(static_cast<std::uint64_t>(options.drop)),
        loop_(loop),
        render_(std::move(render)) {}

  const SourceInfo& info() const override { return info_; }

  Result<std::optional<CapturedFrame>> next() override {
    if (stopped_ || (!loop_ && number_ == *info_.frames)) return std::optional<CapturedFrame>{};
    const std::uint64_t index =
        drop_ ? number_ + number_ / (drop_ - 1) : number_;  // the last of each is lost
    StripePair pair = render_(index);
    CapturedFrame frame;
    frame.number = number_++;
    frame.time_ns = std::llround(static_cast<double>(index) * 1e9 / info_.rig.frame_rate);
    frame.scan = info_.rig.scan;
    frame.field_order = info_.rig.field_order;
    frame.picture = std::move(pair.lit);
    if (frame.scan == Scan::kProgressive) {
      frame.complement = std::move(pair.complement);
    } else {
      for (int y = first_row(frame.field_order, 1); y < frame.picture.height(); y += 2)
        std::copy_n(pair.complement.row(y), pair.complement.stride(), frame.picture.row(y));
    }
    return std::optional(std::move(frame));
  }

  void request_stop() override { stopped_ = true; }

 private:
  const SourceInfo info_;
  const std::uint64_t drop_;
  const bool loop_;
  const Render render_;
  std::uint64_t number_ = 0;
  std::atomic<bool> stopped_{false};
};

BoardSceneOptions look_of(const sim::SimOptions& options, std::uint64_t index) {
  return {.noise = options.noise,
          .ambient = options.ambient,
          .chroma = options.chroma,
          .exposure = options.exposure,
          .samples = kSamples,
          .seed = options.seed + 2 * static_cast<std::uint32_t>(index)};
}

/// The board and the projector's slides.
class BoardScene {
 public:
  BoardScene(const sim::SimOptions& options, const Rig& rig, const Board& board, const Pattern& pattern,
             std::vector<Pose> poses)
      : options_(options), rig_(rig), surface_(board), poses_(std::move(poses)) {
    const Pattern rows = row_pattern(pattern, rig.projector.width, rig.projector.height);
    for (const bool along_rows : {false, true}) {
      for (int slide = 0; slide < pattern.slides; ++slide) {
        lights_.emplace_back(along_rows ? rows : pattern, slide,
                             along_rows ? rig.projector.height : rig.projector.width, options.defocus);
      }
    }
  }

  StripePair render(std::uint64_t index) {
    const std::uint64_t in_period = index % static_cast<std::uint64_t>(options_.period);
    const std::size_t at = in_period / kPoseFrames % poses_.size();
    const std::uint64_t within = in_period % kPoseFrames;
    const bool still = within < kStillFrames;
    if (!still || seen_at_ != at) {
      Pose pose = poses_[at];
      if (!still) {
        const Pose& to = poses_[(at + 1) % poses_.size()];
        const double share = static_cast<double>(within - kStillFrames + 1) /
                             static_cast<double>(kPoseFrames - kStillFrames + 1);
        for (std::size_t i = 0; i < pose.size(); ++i) pose[i] += share * (to[i] - pose[i]);
      }
      seen_.emplace(rig_, surface_, pose, still ? kSamples : kMovingSamples);
      seen_at_ = still ? std::optional(at) : std::nullopt;
    }
    const std::size_t slide = index % lights_.size();
    const bool along_rows = slide >= lights_.size() / 2;
    BoardSceneOptions look = look_of(options_, index);
    StripePair out;
    out.lit = seen_->under({&lights_[slide], along_rows, false}, look);
    ++look.seed;
    out.complement = seen_->under({&lights_[slide], along_rows, true}, look);
    return out;
  }

 private:
  sim::SimOptions options_;
  Rig rig_;
  BoardSurface surface_;
  std::vector<Pose> poses_;
  std::vector<sim::StripeLight> lights_;
  std::optional<SeenBoard> seen_;
  std::optional<std::size_t> seen_at_;  // the pose at rest that seen_ shows
};

struct Opened {
  sim::SimOptions options;
  SourceInfo info;
};

Result<Opened> open(const std::string& spec) {
  const std::string name = "sim:" + spec;
  auto options = sim::parse_sim_options(spec);
  if (!options) return options.error().in(name);
  auto pattern =
      make_pattern(options->base, options->slides, options->first, options->stripes, options->path);
  if (!pattern) return pattern.error().in(name);
  Opened out{*options, {}};
  out.info.name = name;
  out.info.rig = sim::make_rig(*options, sim::SceneView{});
  out.info.pattern = *std::move(pattern);
  const auto passed = static_cast<std::uint64_t>(options->frames > 0 ? options->frames : options->period);
  const auto drop = static_cast<std::uint64_t>(options->drop);
  out.info.frames = options->frames > 0 || drop == 0 ? passed : passed - passed / drop;
  return out;
}

std::string board_name(const std::string& scene) {
  return scene.size() > 6 ? scene.substr(6) : "chessboard:9x7:25mm";
}

Result<Board> board_of(const Opened& opened) {
  const std::string& scene = opened.options.scene;
  if (scene != "board" && !scene.starts_with("board:"))
    return Error{opened.info.name + ": no scene \"" + scene + "\"; there is board, or board:BOARD"};
  auto board = parse_board(board_name(scene));
  return board ? std::move(board) : board.error().in(opened.info.name);
}

Status is_sheet(const Opened& opened) {
  if (opened.options.scene == "sheet") return {};
  return Error{opened.info.name + ": no scene \"" + opened.options.scene + "\"; there is sheet"};
}

}  // namespace

Status check_board(const std::string& rest) {
  const auto opened = open("board" + rest);
  if (!opened) return opened.error();
  const auto board = board_of(*opened);
  return board ? Status() : board.error();
}

Status check_sheet(const std::string& rest) {
  const auto opened = open("sheet" + rest);
  return opened ? is_sheet(*opened) : opened.error();
}

Result<std::unique_ptr<FieldSource>> open_board(const std::string& rest, const SourceOptions& options) {
  auto opened = open("board" + rest);
  if (!opened) return opened.error();
  const auto board = board_of(*opened);
  if (!board) return board.error();
  const int count = static_cast<int>(
      std::max<std::uint64_t>(1, static_cast<std::uint64_t>(opened->options.period) / kPoseFrames));
  auto poses =
      example_poses(opened->info.rig, *board, sim::SceneView{}.distance_m, count, opened->options.seed);
  if (poses.empty()) {
    return Error{board_name(opened->options.scene) + " does not fit before the rig: give a smaller board"};
  }
  auto shown = std::make_shared<BoardScene>(opened->options, opened->info.rig, *board, opened->info.pattern,
                                            std::move(poses));
  return std::unique_ptr<FieldSource>(
      std::make_unique<RenderedSource>(std::move(opened->info), opened->options, options.loop,
                                       [shown](std::uint64_t index) { return shown->render(index); }));
}

Result<std::unique_ptr<FieldSource>> open_sheet(const std::string& rest, const SourceOptions& options) {
  auto opened = open("sheet" + rest);
  if (!opened) return opened.error();
  if (const Status known = is_sheet(*opened); !known) return known.error();
  const sim::SimOptions how = opened->options;
  const Rig rig = opened->info.rig;
  const Render render = [how, rig](std::uint64_t index) {
    static constexpr Primary kShown[] = {0, 1, 2, 4};
    const Primary colour = kShown[index % 4];
    const double distance_m = sim::SceneView{}.distance_m;
    const BoardSceneOptions look = look_of(how, index);
    return StripePair{render_colour_capture(rig, colour, distance_m, look),
                      render_colour_capture(rig, colour ^ 7, distance_m, look)};
  };
  return std::unique_ptr<FieldSource>(
      std::make_unique<RenderedSource>(std::move(opened->info), how, options.loop, render));
}

}  // namespace relievo
