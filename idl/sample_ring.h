// SPDX-License-Identifier: Apache-2.0
// The last samples of a stream, from a frame on that decodes alone.
#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>
#include <memory>
#include <optional>

#include "idl/transport.h"

namespace relievo {

/// Samples have places, counted from 0 as they come. One thread.
class SampleRing {
 public:
  /// At least the last `keep_s` seconds, and back to the key frame before; but never more than `keep_bytes`.
  SampleRing(double keep_s, std::uint64_t keep_bytes);

  /// Of frames and status. Nothing from `unread` on goes for its age, only for want of room: returns how many
  /// such frames did.
  std::uint64_t push(std::shared_ptr<const RawSample> sample, std::optional<std::uint64_t> unread);

  std::uint64_t begin() const { return begin_; }
  std::uint64_t end() const { return begin_ + samples_.size(); }
  std::uint64_t bytes() const { return bytes_; }
  /// `place` is in begin() .. end() - 1.
  const std::shared_ptr<const RawSample>& at(std::uint64_t place) const {
    return samples_[static_cast<std::size_t>(place - begin_)];
  }

 private:
  std::uint64_t begin_wanted(std::optional<std::uint64_t> unread);
  void pop();

  const std::int64_t keep_ns_;
  const std::uint64_t keep_bytes_;
  std::deque<std::shared_ptr<const RawSample>> samples_;
  std::deque<std::uint64_t> keys_;  // places of the key frames among them
  std::uint64_t begin_ = 0, bytes_ = 0;
};

}  // namespace relievo
