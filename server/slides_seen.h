// SPDX-License-Identifier: Apache-2.0
// What a frame can be decoded with, where slides alternate and frames are dropped: two slides make a code, so
// that dropping every second frame of a camera would leave the frames of one slide without the other's.
#pragma once

#include <cstdint>
#include <optional>

namespace relievo {

/// The last frames under either slide, by the camera's numbers, which count what was dropped. One thread.
class SlidesSeen {
 public:
  /// Of a person who walks at 1 m/s the quick decoder finds 0.99 with the other slide from 33 ms ago and
  /// 0.94, less and less, from 0.1 s on. At 60 Hz one frame may be dropped.
  static constexpr std::int64_t kOldest_ns = 60'000'000;

  /// Whether frames were dropped since the other slide was seen that the next one would be decoded with, and
  /// that was too long ago or never.
  bool other_is_old(std::uint64_t number, std::int64_t time_ns) const {
    if (!last_) return false;
    const std::uint64_t since = number - last_->number;
    const std::optional<Seen>& other = since % 2 == 1 ? last_ : other_;
    return since > 1 && (!other || time_ns - other->time_ns > kOldest_ns);
  }
  void add(std::uint64_t number, std::int64_t time_ns) {
    if (last_ && (number - last_->number) % 2 == 1) other_ = last_;
    last_ = Seen{number, time_ns};
  }

 private:
  struct Seen {
    std::uint64_t number;
    std::int64_t time_ns;
  };
  std::optional<Seen> last_, other_;
};

}  // namespace relievo
