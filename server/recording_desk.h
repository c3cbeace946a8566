// SPDX-License-Identifier: Apache-2.0
// The recorders of a server's streams, as the gateway asks for them.
#pragma once

#include <filesystem>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <set>
#include <string>

#include "idl/recorder.h"
#include "idl/stream_recorder.h"
#include "web/gateway/recording_control.h"

namespace relievo {

/// Every function may be called from any thread.
class RecordingDesk final : public RecordingControl {
 public:
  explicit RecordingDesk(std::filesystem::path folder) : folder_(std::move(folder)) {}

  /// `recorder` must live until it is removed. What it did last, and what it is to say of that, is told of
  /// the stream until the next recorder's first recording.
  void add(const std::string& stream, StreamRecorder& recorder);
  void remove(const std::string& stream, const RecordingState& last);
  /// One whose files, beside `file`, are made without being asked for, in this folder perhaps. Lives until it
  /// is removed.
  void add(const Recorder& recorder, const std::filesystem::path& file);
  void remove(const Recorder& recorder);

  std::optional<RecordingState> state(const std::string& stream) const override;
  Status start(const std::string& stream) override;
  Status stop(const std::string& stream) override;
  std::filesystem::path folder() const override { return folder_; }
  bool is_open(const std::string& file) const override;
  std::shared_ptr<const GrowingRecording> growing(const std::string& file) const override;

 private:
  const std::filesystem::path folder_;
  mutable std::mutex mutex_;
  std::map<std::string, StreamRecorder*> recorders_;
  std::map<std::string, RecordingState> last_;
  std::set<const Recorder*> others_;  // that write to this folder
};

}  // namespace relievo
