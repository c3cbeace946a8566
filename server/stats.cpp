// SPDX-License-Identifier: Apache-2.0
#include "server/stats.h"

#include <algorithm>
#include <numeric>
#include <vector>

#include "base/time.h"

namespace relievo {

void RollingMedian::add(double value) {
  values_[count_++ % values_.size()] = static_cast<float>(value);
}

double RollingMedian::median() const {
  const std::size_t n = std::min(count_, values_.size());
  if (n == 0) return 0;
  std::vector<float> sorted(values_.begin(), values_.begin() + static_cast<std::ptrdiff_t>(n));
  const auto middle = sorted.begin() + static_cast<std::ptrdiff_t>(n / 2);
  std::nth_element(sorted.begin(), middle, sorted.end());
  return static_cast<double>(*middle);
}

void PipelineStats::captured() {
  std::lock_guard lock(mutex_);
  ++captured_;
}

void PipelineStats::lost_in_capture(std::uint64_t frames) {
  std::lock_guard lock(mutex_);
  lost_ += frames;
}

void PipelineStats::reconstructed(double ms, const FilterCounts& filters) {
  std::lock_guard lock(mutex_);
  filters_ += filters;
  reconstruct_ms_.add(ms);
  stages_.reconstruct.add(ms * 1e-3);
}

void PipelineStats::encoded(double ms) {
  std::lock_guard lock(mutex_);
  encode_ms_.add(ms);
}

void PipelineStats::encoded_parts(double geometry_ms, double texture_ms) {
  std::lock_guard lock(mutex_);
  stages_.encode_geometry.add(geometry_ms * 1e-3);
  stages_.encode_texture.add(texture_ms * 1e-3);
}

void PipelineStats::handed_over(double ms) {
  std::lock_guard lock(mutex_);
  stages_.publish.add(ms * 1e-3);
}

StageTimes PipelineStats::stages() const {
  std::lock_guard lock(mutex_);
  return stages_;
}

void PipelineStats::rate_level(std::uint32_t level) {
  std::lock_guard lock(mutex_);
  rate_level_ = level;
}

void PipelineStats::published(std::int64_t capture_time_ns, std::int64_t publish_time_ns, std::size_t bytes) {
  std::lock_guard lock(mutex_);
  publish_bytes_[published_ % publish_bytes_.size()] = bytes;
  publish_times_[published_++ % publish_times_.size()] = publish_time_ns;
  latency_ms_.add(milliseconds(publish_time_ns - capture_time_ns));
}

ServerStatus PipelineStats::snapshot(std::int64_t now_ns) const {
  std::lock_guard lock(mutex_);
  ServerStatus s;
  s.time_ns = now_ns;
  s.frames_captured = captured_;
  s.frames_published = published_;
  s.drops_capture = lost_;
  s.reconstruct_ms = reconstruct_ms_.median();
  s.encode_ms = encode_ms_.median();
  s.latency_ms = latency_ms_.median();
  s.filters = filters_;
  s.rate_level = rate_level_;
  // Rate over the ring, but falling at once when frames stop coming: the time since the last one counts too.
  const std::uint64_t n = std::min<std::uint64_t>(published_, publish_times_.size());
  if (n >= 2) {
    const std::int64_t first = publish_times_[(published_ - n) % publish_times_.size()];
    const std::int64_t last = publish_times_[(published_ - 1) % publish_times_.size()];
    const double mean_gap_s = seconds(last - first) / static_cast<double>(n - 1);
    const double since_last_s = seconds(s.time_ns - last);
    const double span_s = seconds(last - first) + std::max(0.0, since_last_s - mean_gap_s);
    if (span_s > 0) s.frame_rate = static_cast<double>(n - 1) / span_s;
    const auto bytes = std::accumulate(
        publish_bytes_.begin(), publish_bytes_.begin() + static_cast<std::ptrdiff_t>(n), std::size_t{0});
    s.bit_rate = 8 * static_cast<double>(bytes) / static_cast<double>(n) * s.frame_rate;
  }
  return s;
}

}  // namespace relievo
