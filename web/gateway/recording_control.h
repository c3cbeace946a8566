// SPDX-License-Identifier: Apache-2.0
// What the gateway needs of who records its streams.
#pragma once

#include <filesystem>
#include <memory>
#include <optional>
#include <string>

#include "base/growing_recording.h"
#include "base/recording_state.h"
#include "base/result.h"

namespace relievo {

/// Called on the gateway's thread, so that every function must return at once; what is const on others, too.
class RecordingControl {
 public:
  virtual ~RecordingControl() = default;

  /// Nothing: no such stream.
  virtual std::optional<RecordingState> state(const std::string& stream) const = 0;
  /// Of a stream that there is. They fail, saying why, where it is, or is not, being recorded.
  virtual Status start(const std::string& stream) = 0;
  virtual Status stop(const std::string& stream) = 0;
  /// Where the files are.
  virtual std::filesystem::path folder() const = 0;
  /// This file of the folder is being written.
  virtual bool is_open(const std::string& file) const = 0;
  /// What is whole of this file of the folder, where it is being written or was lately; else null.
  virtual std::shared_ptr<const GrowingRecording> growing(const std::string& file) const = 0;
};

}  // namespace relievo
