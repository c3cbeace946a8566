// SPDX-License-Identifier: Apache-2.0
// The file that a stream is played from, as clients may read it. Plain data.
#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>

#include "base/growing_recording.h"

namespace relievo {

struct OfferedRecording {
  std::filesystem::path file{};  // empty: there is none
  // What is whole of one that is being written, or was when clients began to read it; null: it was whole
  // then.
  std::shared_ptr<const GrowingRecording> growing{};
  bool has_index = true;  // else it is read as `growing` has it
  bool grows = false;     // more may come
  bool whole = true;      // else it was cut short: somebody may mend it, or go on in it

  /// Whether there is anything to read.
  bool readable() const {
    return !file.empty() && (has_index || (growing != nullptr && growing->bytes() > 0));
  }
  /// How much of it can be read, without an index, while it grows.
  std::optional<std::uint64_t> growing_bytes() const {
    return grows && growing ? std::optional(growing->bytes()) : std::nullopt;
  }
};

}  // namespace relievo
