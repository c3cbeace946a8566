// SPDX-License-Identifier: Apache-2.0
#include "server/paced_reconstructor.h"

#include <utility>

#include "base/log.h"
#include "base/time.h"
#include "capture/reconstruct/detection_lines.h"

namespace relievo {
namespace {

constexpr double kSaidBehind_s = 2;  // of frames that may be dropped before the log says so

}  // namespace

PacedReconstructor::PacedReconstructor(const SourceInfo& source, Options options, Reconstructor reconstructor)
    : source_(source),
      options_(std::move(options)),
      control_(line_count(source.rig, 1), source.rig.frame_rate),
      drops_(kSaidBehind_s * source.rig.frame_rate),
      reconstructor_(std::move(reconstructor)),
      pace_{options_.reconstruct.decoder, options_.reconstruct.line_stride} {}

Status PacedReconstructor::took(const CapturedFrame& frame, double ms, std::uint64_t dropped) {
  const std::uint64_t since = dropped - std::exchange(dropped_, dropped);
  if (!options_.auto_pace) {
    say_behind(since);
    return {};
  }
  control_.add(steady_now_ns(), ms, since);
  const Pace pace = control_.now();
  return pace == pace_ ? Status() : change_to(pace, frame);
}

Status PacedReconstructor::change_to(const Pace& pace, const CapturedFrame& frame) {
  ReconstructOptions options = options_.reconstruct;
  options.decoder = pace.decoder;
  options.line_stride = pace.line_stride;
  auto made = Reconstructor::create(source_.rig, source_.pattern, options);
  if (!made) return made.error();
  if (const Status seen = made->observe(frame); !seen) return seen;
  log_info(options_.label + "decoding: " + to_string(pace) +
           ", which suits the camera's rate and this machine");
  const std::lock_guard lock(mutex_);
  std::swap(reconstructor_, *made);
  pace_ = pace;
  return {};
}

void PacedReconstructor::say_behind(std::uint64_t dropped) {
  drops_.add(dropped);
  if (!drops_.too_many() || std::exchange(said_behind_, true)) return;
  log_warning(options_.label + "this machine is too slow for all of the camera's frames with " +
              to_string(pace_) + ": serve with --decoder auto or more --threads");
}

Pace PacedReconstructor::pace() const {
  const std::lock_guard lock(mutex_);
  return pace_;
}

void PacedReconstructor::recycle(Frame3D&& used) {
  const std::lock_guard lock(mutex_);
  reconstructor_.recycle(std::move(used));
}

}  // namespace relievo
