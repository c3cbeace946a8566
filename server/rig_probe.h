// SPDX-License-Identifier: Apache-2.0
// Looks at a stream's frames for somebody who sets up its rig: only while that person asks, on a thread of
// its own, and never so that the pipeline waits.
#pragma once

#include <atomic>
#include <condition_variable>
#include <cstdint>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "base/pattern.h"
#include "base/rig.h"
#include "capture/upright.h"
#include "server/frame_tap.h"
#include "web/gateway/rig_control.h"

namespace relievo {

class RigProbe final : public FrameTap {
 public:
  /// What the projector shows, and how frames are decoded: upright() of that.
  RigProbe(std::string stream, const Rig& rig, const Pattern& pattern, UprightRig seen);
  RigProbe(const RigProbe&) = delete;
  RigProbe& operator=(const RigProbe&) = delete;
  ~RigProbe() override;

  // The pipeline's thread.
  bool wants(bool has_surface) override;
  void put(TappedFrame&& frame) override;

  /// As RigControl::look(). Any thread.
  std::shared_ptr<const RigView> look(const std::vector<std::string>& pictures);

  const Rig& rig() const { return rig_; }
  const Pattern& pattern() const { return pattern_; }

 private:
  void work();
  std::shared_ptr<const RigView> make(const TappedFrame& frame,
                                      const std::vector<std::string>& pictures) const;

  const std::string stream_;
  const Rig rig_;
  const Pattern pattern_;
  const UprightRig seen_;
  std::atomic<bool> wanted_{false};
  int without_surface_ = 0;  // frames since one was wanted; of the pipeline's thread

  std::mutex mutex_;  // of what follows
  std::condition_variable changed_;
  std::map<std::string, std::int64_t> asked_ns_;  // when each picture was asked for last
  std::optional<TappedFrame> next_;               // to be looked at
  bool busy_ = false;                             // one is wanted, waiting or being looked at
  bool stopping_ = false;
  std::shared_ptr<const RigView> view_;  // the last one
  std::int64_t view_ns_ = 0;             // when it was made
  std::thread thread_;
};

}  // namespace relievo
