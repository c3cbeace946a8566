// SPDX-License-Identifier: Apache-2.0
#include "server/rig_probe.h"

#include <algorithm>
#include <utility>

#include "base/log.h"
#include "base/time.h"
#include "capture/evaluate/pictures.h"
#include "capture/evaluate/rig_check.h"
#include "codec/jpeg_texture.h"
#include "server/rig_report.h"

namespace relievo {
namespace {

constexpr std::int64_t kBetween_ns = 150'000'000;   // looks, at least: streaming goes first
constexpr std::int64_t kAsked_ns = 10'000'000'000;  // a picture is drawn for so long after it was asked for
constexpr std::int64_t kFresh_ns = 5'000'000'000;   // an older look tells nothing of the rig as it is
constexpr int kWithoutSurface = 8;  // frames in a row after which one is looked at that gave none
constexpr int kQuality = 85;

Image8 draw(std::string_view name, const TappedFrame& frame, const RigCheck& check, const Rig& rig,
            const Pattern& pattern) {
  const CapturedFrame& decoded = frame.decoded ? *frame.decoded : frame.captured;
  if (name == "camera") return draw_field(frame.captured, false);
  if (name == "complement") return draw_field(frame.captured, true);
  if (name == "exposure") return draw_exposure(frame.captured);
  if (name == "difference") return draw_difference(decoded, rig);
  if (name == "coverage") return draw_coverage(decoded, check);
  if (name == "order") return draw_order(decoded, check);
  Surface surface;
  surface.grid = frame.grid;
  return draw_boundaries(decoded, surface, pattern, check.slide.value_or(0));
}

}  // namespace

RigProbe::RigProbe(std::string stream, const Rig& rig, const Pattern& pattern, UprightRig seen)
    : stream_(std::move(stream)), rig_(rig), pattern_(pattern), seen_(std::move(seen)), thread_([this] {
        work();
      }) {}

RigProbe::~RigProbe() {
  {
    const std::lock_guard lock(mutex_);
    stopping_ = true;
  }
  changed_.notify_all();
  thread_.join();
}

bool RigProbe::wants(bool has_surface) {
  if (!wanted_) {
    without_surface_ = 0;
    return false;
  }
  return has_surface || ++without_surface_ >= kWithoutSurface;
}

void RigProbe::put(TappedFrame&& frame) {
  wanted_ = false;
  without_surface_ = 0;
  {
    const std::lock_guard lock(mutex_);
    next_ = std::move(frame);
  }
  changed_.notify_all();
}

std::shared_ptr<const RigView> RigProbe::look(const std::vector<std::string>& pictures) {
  const std::int64_t now = steady_now_ns();
  const std::lock_guard lock(mutex_);
  for (const std::string& name : pictures) asked_ns_[name] = now;
  if (!busy_ && now - view_ns_ >= kBetween_ns) busy_ = wanted_ = true;
  return view_ && now - view_ns_ < kFresh_ns ? view_ : nullptr;
}

void RigProbe::work() {
  std::unique_lock lock(mutex_);
  for (;;) {
    changed_.wait(lock, [this] { return stopping_ || next_; });
    if (stopping_) return;
    const TappedFrame frame = *std::exchange(next_, std::nullopt);
    std::vector<std::string> pictures;
    for (const auto& [name, asked_ns] : asked_ns_)
      if (steady_now_ns() - asked_ns < kAsked_ns) pictures.push_back(name);
    lock.unlock();
    auto made = make(frame, pictures);
    lock.lock();
    view_ = std::move(made);
    view_ns_ = steady_now_ns();
    busy_ = false;
  }
}

std::shared_ptr<const RigView> RigProbe::make(const TappedFrame& frame,
                                              const std::vector<std::string>& pictures) const {
  RigCheck check;
  if (frame.decoded) {
    check = check_rig(frame.captured, *frame.decoded, frame.grid, seen_.rig, seen_.pattern);
  } else {
    check.exposure = check_exposure(frame.captured);
  }
  auto out = std::make_shared<RigView>();
  for (const std::string& name : pictures) {
    Bytes jpeg;
    const Status drawn =
        append_jpeg(draw(name, frame, check, seen_.rig, seen_.pattern).view(), kQuality, jpeg);
    if (drawn) {
      out->pictures.emplace(name, std::move(jpeg));
    } else {
      log_warning("the rig's picture " + name + ": " + drawn.error().message);
    }
  }
  out->report = rig_report(stream_, frame, check, *out, rig_);
  return out;
}

}  // namespace relievo
