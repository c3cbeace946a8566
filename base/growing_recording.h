// SPDX-License-Identifier: Apache-2.0
// A recording that is read while it is written.
#pragma once

#include <cstdint>
#include <memory>

#include "base/stream.h"

namespace relievo {

/// What is whole of a file that is being written. Any thread; nothing here waits for the disk.
class GrowingRecording {
 public:
  virtual ~GrowingRecording() = default;
  /// Up to the end of its last whole chunk, which stay as they are; 0: there is none yet.
  virtual std::uint64_t bytes() const = 0;
  /// What makes a recording of the file's first `bytes`, with an index: always the same for the same number.
  /// Null where bytes() was never that.
  virtual std::shared_ptr<const Bytes> end_at(std::uint64_t bytes) const = 0;
};

}  // namespace relievo
