// SPDX-License-Identifier: Apache-2.0
#include "bench/frames.h"

#include <atomic>
#include <cmath>
#include <filesystem>
#include <string_view>

#include "capture/source/npy.h"
#include "capture/source/sim/sim_source.h"
#include "capture/source/take_files.h"
#include "capture/upright.h"
#include "cli/progress.h"

namespace relievo::bench {
namespace {

constexpr std::size_t kMaxBytes = std::size_t{1} << 30;

CapturedFrame copy_of(const CapturedFrame& frame) {
  CapturedFrame out;
  out.number = frame.number;
  out.time_ns = frame.time_ns;
  out.scan = frame.scan;
  out.field_order = frame.field_order;
  out.picture = frame.picture.clone();
  out.complement = frame.complement.clone();
  return out;
}

class LoopSource final : public FieldSource {
 public:
  explicit LoopSource(const FrameLoop& loop) : loop_(loop) {}

  const SourceInfo& info() const override { return loop_.info(); }
  Result<std::optional<CapturedFrame>> next() override {
    if (stopped_) return std::optional<CapturedFrame>{};
    CapturedFrame frame = copy_of(loop_.at(played_));
    frame.number = played_;
    frame.time_ns = std::llround(static_cast<double>(played_) * 1e9 / loop_.info().rig.frame_rate);
    ++played_;
    return std::optional(std::move(frame));
  }
  void request_stop() override { stopped_ = true; }

 private:
  const FrameLoop& loop_;
  std::uint64_t played_ = 0;
  std::atomic<bool> stopped_{false};
};

constexpr std::string_view kSim = "sim:", kTake = "take:";

Result<std::unique_ptr<FieldSource>> open(const std::string& uri, bool with_truth) {
  if (!with_truth || !uri.starts_with(kSim)) return open_source(uri, {});
  auto sim = make_sim(uri.substr(kSim.size()), {.truth = true});
  if (!sim) return sim.error();
  return std::unique_ptr<FieldSource>(*std::move(sim));
}

/// Empty where there is none.
Result<ImageF> truth_of_take(const std::string& uri, std::uint64_t number) {
  if (!uri.starts_with(kTake)) return ImageF();
  const auto file = take_truth(uri.substr(kTake.size()), number);
  return std::filesystem::exists(file) ? read_npy(file) : ImageF();
}

}  // namespace

Result<std::optional<FrameLoop>> FrameLoop::load(const std::string& uri, int count, StopSignal& stop,
                                                 const Options& options) {
  auto source = open(uri, options.truth);
  if (!source) return source.error();
  const auto* sim = options.truth ? dynamic_cast<const SimSource*>(source->get()) : nullptr;
  FrameLoop loop;
  loop.info_ = (*source)->info();
  auto seen = upright(loop.info_.rig, loop.info_.pattern);
  if (!seen) return seen.error();
  loop.info_.rig = seen->rig;
  loop.info_.pattern = std::move(seen->pattern);
  Progress progress("load", "frames", static_cast<std::uint64_t>(count));
  while (loop.frames_.size() < static_cast<std::size_t>(count)) {
    if (stop.stopped()) return std::optional<FrameLoop>{};
    auto next = (*source)->next();
    if (!next) return next.error();
    if (!*next) break;
    loop.frames_.push_back(**std::move(next));
    const std::uint64_t number = loop.frames_.back().number;
    if (sim != nullptr) {
      loop.truths_.emplace(number, sim->truth().clone());
    } else if (options.truth) {
      auto truth = truth_of_take(uri, number);
      if (!truth) return truth.error();
      if (!truth->empty()) loop.truths_.emplace(number, *std::move(truth));
    }
    progress.update(loop.frames_.size());
    if ((loop.frames_.size() + 1) * loop.frame_bytes() > kMaxBytes) break;
  }
  if (loop.frames_.size() < 2)
    return Error{uri + " has fewer than two frames: two under different slides are needed"};
  return std::optional(std::move(loop));
}

std::size_t FrameLoop::frame_bytes() const {
  return frames_.front().picture.size() + frames_.front().complement.size();
}

const CapturedFrame& FrameLoop::at(std::uint64_t n) const {
  const std::uint64_t last = frames_.size() - 1;
  const std::uint64_t phase = n % (2 * last);
  return frames_[phase <= last ? phase : 2 * last - phase];
}

const ImageF* FrameLoop::truth(std::uint64_t number) const {
  const auto found = truths_.find(number);
  return found != truths_.end() ? &found->second : nullptr;
}

std::unique_ptr<FieldSource> FrameLoop::play() const {
  return std::make_unique<LoopSource>(*this);
}

Result<std::optional<Reconstructed>> load_reconstructed(const std::string& uri, int count, StopSignal& stop,
                                                        Decoder decoder, const FrameLoop::Options& options) {
  auto loaded = FrameLoop::load(uri, count, stop, options);
  if (!loaded) return loaded.error();
  if (!*loaded) return std::optional<Reconstructed>();
  FrameLoop& loop = **loaded;
  auto reconstructor = Reconstructor::create(loop.info().rig, loop.info().pattern, {.decoder = decoder});
  if (!reconstructor) return reconstructor.error();
  std::vector<Frame3D> frames;
  Progress progress("reconstruct", "frames", loop.size());
  for (std::uint64_t n = 0; n < loop.size(); ++n) {
    if (stop.stopped()) return std::optional<Reconstructed>();
    auto frame = reconstructor->add(loop.at(n));
    if (!frame) return frame.error();
    if (*frame && !(*frame)->surface.positions.empty()) frames.push_back(**std::move(frame));
    progress.update(n + 1);
  }
  if (frames.empty()) return Error{"no frame of " + loop.info().name + " could be reconstructed"};
  return std::optional<Reconstructed>({std::move(loop), std::move(frames)});
}

}  // namespace relievo::bench
