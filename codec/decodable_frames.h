// SPDX-License-Identifier: Apache-2.0
// Which frames of a stream still decode where some of those before were lost (FORMAT.md, "What builds on
// what"): for who passes frames on without decoding them.
#pragma once

#include <cstdint>
#include <memory>

#include "base/stream.h"

namespace relievo {

/// One thread.
class DecodableFrames {
 public:
  /// The next frame that came; a number that is not one more than the last one's tells of a loss. False where
  /// it builds on a lost one, or on one before the first that came. Any bytes; the last key frame's are kept.
  bool add(std::uint64_t number, const std::shared_ptr<const Bytes>& frame);

 private:
  std::uint64_t last_ = 0;            // number
  std::shared_ptr<const Bytes> key_;  // the last one that builds on nothing
  bool lost_ = true;                  // something, since then; before the first all is
};

}  // namespace relievo
