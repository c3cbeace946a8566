// SPDX-License-Identifier: Apache-2.0
// Running counts of one pipeline: counters that only rise, and medians over the last few seconds.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <mutex>

#include "base/stream.h"
#include "web/gateway/stage_times.h"

namespace relievo {

/// The last values of one measured quantity.
class RollingMedian {
 public:
  void add(double value);
  double median() const;  // 0 where there is no value

 private:
  std::array<float, 128> values_{};
  std::size_t count_ = 0;
};

/// Every function may be called from any thread.
class PipelineStats {
 public:
  void captured();
  void lost_in_capture(std::uint64_t frames);
  void reconstructed(double ms, const FilterCounts& filters = {});
  void encoded(double ms);
  /// The same, by the parts of a frame.
  void encoded_parts(double geometry_ms, double texture_ms);
  /// That all sinks have taken a frame.
  void handed_over(double ms);
  void published(std::int64_t capture_time_ns, std::int64_t publish_time_ns, std::size_t bytes = 0);
  void rate_level(std::uint32_t level);

  /// All but `stream`, `state`, `message` and the queues' drops; `now_ns` in UTC.
  ServerStatus snapshot(std::int64_t now_ns) const;
  /// The times alone.
  StageTimes stages() const;

 private:
  mutable std::mutex mutex_;
  std::uint64_t captured_ = 0;
  std::uint64_t lost_ = 0;
  std::uint64_t published_ = 0;
  std::array<std::int64_t, 64> publish_times_{};  // ring of the last publish times, UTC ns
  std::array<std::size_t, 64> publish_bytes_{};   // and sizes
  std::uint32_t rate_level_ = 0;
  FilterCounts filters_;
  StageTimes stages_;
  RollingMedian reconstruct_ms_, encode_ms_, latency_ms_;
};

}  // namespace relievo
