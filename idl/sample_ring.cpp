// SPDX-License-Identifier: Apache-2.0
#include "idl/sample_ring.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "idl/cdr.h"

namespace relievo {

SampleRing::SampleRing(double keep_s, std::uint64_t keep_bytes)
    : keep_ns_(std::llround(keep_s * 1e9)), keep_bytes_(keep_bytes) {}

std::uint64_t SampleRing::push(std::shared_ptr<const RawSample> sample, std::optional<std::uint64_t> unread) {
  if (sample->topic == Topic::kFrame && holds_key_frame(sample->cdr)) keys_.push_back(end());
  bytes_ += sample->cdr.size();
  samples_.push_back(std::move(sample));
  std::uint64_t lost = 0;
  while (bytes_ > keep_bytes_ && samples_.size() > 1) {
    lost += unread && begin_ >= *unread && samples_.front()->topic == Topic::kFrame;
    pop();
  }
  for (const std::uint64_t wanted = begin_wanted(unread); begin_ < wanted;) pop();
  return lost;
}

/// The last key frame that is old enough; where there is no key frame, nothing decodes, and age alone counts.
std::uint64_t SampleRing::begin_wanted(std::optional<std::uint64_t> unread) {
  const std::int64_t old_ns = samples_.back()->even_time_ns() - keep_ns_;
  std::uint64_t wanted = begin_;
  if (keys_.empty()) {
    while (wanted < end() && at(wanted)->even_time_ns() < old_ns) ++wanted;
  } else {
    wanted = keys_.front();
    for (const std::uint64_t key : keys_) {
      if (at(key)->even_time_ns() > old_ns) break;
      wanted = key;
    }
  }
  return unread ? std::min(wanted, *unread) : wanted;
}

void SampleRing::pop() {
  if (!keys_.empty() && keys_.front() == begin_) keys_.pop_front();
  bytes_ -= samples_.front()->cdr.size();
  samples_.pop_front();
  ++begin_;
}

}  // namespace relievo
