// SPDX-License-Identifier: Apache-2.0
// A sound copy of a damaged recording.
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <string>
#include <vector>

#include "base/result.h"

namespace relievo {

struct RecoveredRecording {
  std::uint64_t messages = 0;         // copied
  std::uint64_t attachments = 0;      // copied
  std::uint64_t lost_bytes = 0;       // that were no records
  std::size_t recordings = 1;         // that the file was joined of
  std::vector<std::string> left_out;  // a line for each damaged part, in the order in which they were met
  bool stopped = false;               // and nothing is written
};

/// Called after each message with the number copied so far; false stops.
using RecoverProgress = std::function<bool(std::uint64_t copied)>;

/// Goes through the whole of `damaged`, trusting no index, and writes every message and attachment whose
/// bytes are right to `copy`, indexed, in log-time order. `damaged` is not changed. Fails where `copy` exists
/// or cannot be written, or where there is nothing to recover; then, and when stopped, no file is left.
Result<RecoveredRecording> recover_recording(const std::filesystem::path& damaged,
                                             const std::filesystem::path& copy,
                                             const RecoverProgress& progress);

}  // namespace relievo
