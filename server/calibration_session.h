// SPDX-License-Identifier: Apache-2.0
// One calibration from the page /rig: has the camera's stream paused, watches the camera on a thread of its
// own, takes what it is told to, and lets the stream go on whatever happens.
#pragma once

#include <chrono>
#include <condition_variable>
#include <cstdint>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <thread>

#include "base/result.h"
#include "server/calibration_state.h"
#include "server/calibration_task.h"
#include "server/config.h"
#include "server/projector_driver.h"
#include "web/gateway/calibration_control.h"

namespace relievo {

/// Who runs the streams. Every function may be called from any thread.
class StreamPauses {
 public:
  virtual ~StreamPauses() = default;
  /// How the stream is configured; nothing where there is none of that name.
  virtual std::optional<StreamConfig> config_of(const std::string& stream) const = 0;
  /// Returns when the stream has let go of its camera. Fails where it is not there, or has ended.
  virtual Status pause(const std::string& stream) = 0;
  /// It goes on, with its rig as it is now. Any number of times.
  virtual void resume(const std::string& stream) = 0;
};

/// What outlives a session.
struct CalibrationPlace {
  StreamPauses& streams;
  ProjectorDriver& projector;
  const ProjectorConfig& config;
  std::chrono::nanoseconds unwatched_for = std::chrono::seconds(20);  // then it is given up
  // Of a view that is to be taken; and in so many of the projector's cycles, where the camera's frames come
  // slowly.
  std::chrono::nanoseconds rest_within = std::chrono::seconds(20);
  std::uint64_t rest_cycles = 10;
};

/// Every function may be called from any thread.
class CalibrationSession {
 public:
  CalibrationSession(const CalibrationPlace& place, StreamConfig config, CalibrationOrder order);
  CalibrationSession(const CalibrationSession&) = delete;
  CalibrationSession& operator=(const CalibrationSession&) = delete;
  /// Gives up, and waits until the stream goes on.
  ~CalibrationSession();

  /// Somebody watches.
  CalibrationState state();
  std::shared_ptr<const Bytes> picture(const std::string& name) const;
  /// All but "start".
  Status order(const std::string& action);
  bool ended() const;

 private:
  enum class Wish { kNone, kSolve, kMore, kKeep };

  // All of the session's thread.
  void work();
  Status calibrate();
  void restore(const ProjectorState& before, const Pattern& pattern);
  Status watch(FieldSource& source, CalibrationTask& task);
  bool pace(const SourceInfo& info, std::int64_t time_ns);
  void show(const CapturedFrame& frame);
  void draw_coverage(const CalibrationTask& task);
  Status check() const;
  Status go_on(CalibrationTask& task, StillCollector& collector, bool came_to_rest);
  void take(CalibrationTask& task, const StillCollector& collector);
  void solve(CalibrationTask& task);
  /// True where the result is written.
  bool keep(const Pattern& pattern);
  void tell(CalibrationPhase phase, const CalibrationTask& task);
  void end(const Status& done);

  const CalibrationPlace place_;
  const StreamConfig config_;
  const CalibrationOrder order_;
  CalibrationResult result_;     // of the session's thread, as what follows
  std::string projector_shows_;  // empty: the server drives none
  std::int64_t started_ns_ = 0;  // when the time of a source that is not live was 0
  std::int64_t shown_ns_ = 0;    // when the camera's picture was drawn last

  mutable std::mutex mutex_;  // of what follows
  std::condition_variable changed_;
  CalibrationState state_;
  Wish wish_ = Wish::kNone;
  bool cancelled_ = false;
  bool ended_ = false;
  std::int64_t armed_ns_ = 0;       // when a view was asked for
  std::uint64_t frames_ = 0;        // seen
  std::uint64_t armed_frames_ = 0;  // of them, when a view was asked for
  std::int64_t watched_ns_;         // when somebody watched last
  FieldSource* source_ = nullptr;   // while it is watched
  std::thread thread_;
};

}  // namespace relievo
