// SPDX-License-Identifier: Apache-2.0
// Sources and sinks that do what a test says, for the pipeline.
#pragma once

#include <unistd.h>

#include <atomic>
#include <chrono>
#include <condition_variable>
#include <deque>
#include <filesystem>
#include <fstream>
#include <functional>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

#include "capture/source/field_source.h"
#include "server/pipeline.h"
#include "tests/support/patience.h"
#include "tests/support/striped_scene.h"

namespace relievo::test {

/// Calls `script` with 0, 1, 2, ... for each frame. Blocks there, as a camera does, where the script calls
/// block().
class ScriptedSource final : public FieldSource {
 public:
  using Next = Result<std::optional<CapturedFrame>>;
  using Script = std::function<Next(ScriptedSource&, std::uint64_t)>;

  ScriptedSource(const StripedScene& scene, Script script, bool live = false) : script_(std::move(script)) {
    info_.name = "scripted";
    info_.rig = scene.rig;
    info_.pattern = scene.pattern;
    info_.live = live;
  }

  const SourceInfo& info() const override { return info_; }
  Next next() override {
    ++calls;
    if (stopped()) return std::optional<CapturedFrame>{};
    return script_(*this, asked_++);
  }
  void request_stop() override {
    {
      std::lock_guard lock(mutex_);
      stopped_ = true;
    }
    wake_.notify_all();
  }

  /// Waits for request_stop(), then ends.
  Next block() {
    std::unique_lock lock(mutex_);
    blocked = true;
    wake_.wait(lock, [&] { return stopped_; });
    return std::optional<CapturedFrame>{};
  }
  static Next end() { return std::optional<CapturedFrame>{}; }
  bool stopped() const {
    std::lock_guard lock(mutex_);
    return stopped_;
  }

  std::atomic<bool> blocked{false};
  std::atomic<int> calls{0};

 private:
  SourceInfo info_;
  Script script_;
  std::uint64_t asked_ = 0;
  mutable std::mutex mutex_;
  std::condition_variable wake_;
  bool stopped_ = false;
};

/// Frames of `scene`, drawn once: the same two pictures in turn.
class Frames {
 public:
  explicit Frames(const StripedScene& scene)
      : scene_(scene), frames_{draw_frame(scene, 0), draw_frame(scene, 1)} {}
  CapturedFrame operator()(std::uint64_t number) const {
    const CapturedFrame& drawn = frames_[number % 2];
    CapturedFrame out;
    out.number = number;
    out.time_ns = std::llround(static_cast<double>(number) * 1e9 / scene_.rig.frame_rate);
    out.scan = drawn.scan;
    out.picture = drawn.picture.clone();
    out.complement = drawn.complement.clone();
    return out;
  }

 private:
  StripedScene scene_;
  CapturedFrame frames_[2];
};

/// A source of `count` frames.
inline ScriptedSource::Script count_to(const Frames& frames, std::uint64_t count) {
  return [&frames, count](ScriptedSource&, std::uint64_t n) -> ScriptedSource::Next {
    if (n >= count) return ScriptedSource::end();
    return std::optional(frames(n));
  };
}

/// Keeps what it is given.
class CollectingSink final : public FrameSink {
 public:
  Status consume(const FrameMessage& frame) override {
    if (on_frame) {
      if (const Status done = on_frame(frame); !done) return done;
    }
    std::lock_guard lock(mutex_);
    frames_.push_back(frame);
    return {};
  }
  Status consume(const ServerStatus& status) override {
    if (on_status) {
      if (const Status done = on_status(status); !done) return done;
    }
    std::lock_guard lock(mutex_);
    statuses_.push_back(status);
    return {};
  }
  std::vector<FrameMessage> frames() const {
    std::lock_guard lock(mutex_);
    return frames_;
  }
  std::vector<ServerStatus> statuses() const {
    std::lock_guard lock(mutex_);
    return statuses_;
  }

  std::function<Status(const FrameMessage&)> on_frame;  // set before the run
  std::function<Status(const ServerStatus&)> on_status;

 private:
  mutable std::mutex mutex_;
  std::vector<FrameMessage> frames_;
  std::vector<ServerStatus> statuses_;
};

/// Opened by one thread, waited for by others.
class Gate {
 public:
  void open() {
    {
      std::lock_guard lock(mutex_);
      open_ = true;
    }
    wake_.notify_all();
  }
  bool wait(std::chrono::milliseconds timeout = kPatience) {
    std::unique_lock lock(mutex_);
    return wake_.wait_for(lock, timeout, [&] { return open_; });
  }

 private:
  std::mutex mutex_;
  std::condition_variable wake_;
  bool open_ = false;
};

/// Every other thread of this process sleeps: what was under way is done, or waits for this one. How often a
/// thread has run is counted, so that one which woke and slept again between two looks is seen too.
inline bool at_rest() {
  const auto self = std::to_string(gettid());
  const auto look = [&] {
    std::string seen;
    for (const auto& thread : std::filesystem::directory_iterator("/proc/self/task")) {
      if (thread.path().filename() == self) continue;
      std::ifstream file(thread.path() / "status");
      for (std::string line; std::getline(file, line);) {
        if (line.starts_with("State:") && line.find("S (sleeping)") == std::string::npos)
          return std::string();
        if (line.starts_with("Pid:") || line.find("ctxt_switches:") != std::string::npos) seen += line + '\n';
      }
    }
    return seen;
  };
  const std::string first = look();
  return !first.empty() && look() == first;
}

/// run() on a thread of its own; stopped and joined at the end whatever happens.
class Running {
 public:
  explicit Running(Pipeline& pipeline)
      : pipeline_(pipeline), thread_([this] {
          result_ = pipeline_.run();
          done_.open();
        }) {}
  ~Running() {
    if (!thread_.joinable()) return;
    pipeline_.stop();
    thread_.join();
  }
  bool ended(std::chrono::milliseconds timeout = kPatience) { return done_.wait(timeout); }
  Status result() {
    thread_.join();
    return result_;
  }

 private:
  Pipeline& pipeline_;
  Status result_;
  Gate done_;
  std::thread thread_;
};

}  // namespace relievo::test
