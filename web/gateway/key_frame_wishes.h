// SPDX-License-Identifier: Apache-2.0
// Brings the gateway's wishes for key frames to whoever encodes, which comes later and goes earlier.
#pragma once

#include <functional>
#include <mutex>
#include <string>
#include <utility>

namespace relievo {

/// Every function may be called from any thread.
class KeyFrameWishes {
 public:
  using Answer = std::function<void(const std::string& stream)>;

  /// From now on `answer` is called, which must return at once and not call back; an empty one: nobody is.
  /// When this returns, the one before is not called any more.
  void answer_with(Answer answer) {
    const std::lock_guard lock(mutex_);
    answer_ = std::move(answer);
  }
  void wish(const std::string& stream) {
    const std::lock_guard lock(mutex_);
    if (answer_) answer_(stream);
  }

 private:
  std::mutex mutex_;
  Answer answer_;
};

}  // namespace relievo
