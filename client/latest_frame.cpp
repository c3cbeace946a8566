// SPDX-License-Identifier: Apache-2.0
#include "client/latest_frame.h"

namespace relievo {

Subscriber::Callbacks LatestFrame::callbacks() {
  Subscriber::Callbacks callbacks;
  callbacks.info = [this](const StreamInfo& info) {
    std::lock_guard lock(mutex_);
    rig_ = info.rig;
  };
  callbacks.frame = [this](const std::string&, const FrameMessage& message) {
    if (!decoder_.can_decode(*message.data)) return;
    auto frame = decoder_.decode(*message.data);
    std::lock_guard lock(mutex_);
    if (!rig_ || !frame || frame->surface.positions.empty()) return;
    frame_ = *std::move(frame);
    changed_.notify_all();
  };
  return callbacks;
}

std::optional<LatestFrame::Taken> LatestFrame::take(std::chrono::duration<double> patience,
                                                    StopSignal& stop) {
  std::unique_lock lock(mutex_);
  const auto end = std::chrono::steady_clock::now() + patience;
  while (!frame_ && !stop.stopped() && std::chrono::steady_clock::now() < end)
    changed_.wait_for(lock, std::chrono::milliseconds(100));
  if (!frame_) return std::nullopt;
  Taken taken{*std::move(frame_), *rig_};
  frame_.reset();
  return taken;
}

}  // namespace relievo
