// SPDX-License-Identifier: Apache-2.0
// Threads that render camera frames before they are asked for.
#pragma once

#include <atomic>
#include <condition_variable>
#include <cstdint>
#include <deque>
#include <functional>
#include <memory>
#include <mutex>
#include <thread>
#include <vector>

#include "capture/source/sim/renderer.h"

namespace relievo::sim {

/// Renders frames 0, 1, 2, ... in order on its own threads. get() is for one thread; stop() for any.
class RenderAhead {
 public:
  struct Options {
    std::uint64_t count = 0;  // frames to render
    std::uint64_t ahead = 0;  // how far beyond the last one got
    bool keep = false;        // what was got stays: it can be got again
    bool truth = false;
    int threads = 1;
    double paced_rate =
        0;  // where above 0, the first get() waits (2 s at most) until playback at this rate cannot starve
  };

  RenderAhead(std::shared_ptr<const Renderer> renderer, const Options& options);
  ~RenderAhead();  // frames in the making are left

  /// Waits for frame `index` < count; null once stopped. Without `keep`, indices must not go back.
  std::shared_ptr<const RenderedFrame> get(std::uint64_t index);

  void stop();

 private:
  void work();
  bool may_start() const;  // with the lock held

  const std::shared_ptr<const Renderer> renderer_;
  const Options options_;
  std::mutex mutex_;
  std::condition_variable changed_;
  std::deque<std::shared_ptr<const RenderedFrame>> frames_;  // frames_[i] is frame first_ + i; null: not done
  std::uint64_t first_ = 0;
  std::uint64_t claimed_ = 0;  // next to render
  std::uint64_t done_ = 0;
  std::int64_t started_ns_ = 0;
  bool started_ = false;
  std::atomic<bool> stopped_ = false;  // set with the lock held
  std::vector<std::thread> threads_;
};

}  // namespace relievo::sim
