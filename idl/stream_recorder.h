// SPDX-License-Identifier: Apache-2.0
// Records one live stream when told to, with what came before: the recorder of a server whose API starts and
// stops recordings.
#pragma once

#include <condition_variable>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <thread>

#include "base/recording_state.h"
#include "base/result.h"
#include "idl/recorder.h"
#include "idl/sample_ring.h"
#include "idl/transport.h"

namespace relievo {

/// What is kept in memory of a stream, before a recording and while its disk is slow.
inline constexpr std::uint64_t kPreRollBytes = 256'000'000;

/// Every function may be called from any thread and returns without waiting for the disk's data: files are
/// written by a thread of its own. What a slow disk leaves no room for is counted as lost.
class StreamRecorder {
 public:
  struct Options {
    std::filesystem::path folder;
    std::string stream;
    double pre_roll_s = 0;
    std::uint64_t keep_bytes = kPreRollBytes;
    RecordingOptions recording{};  // `keep` is of one recording's files: no wish removes another one's
    std::function<void()> key_frame_wanted{};  // by a file that is to end; on a thread of the recorder's
  };
  explicit StreamRecorder(Options options);
  StreamRecorder(const StreamRecorder&) = delete;
  StreamRecorder& operator=(const StreamRecorder&) = delete;
  /// Completes what is being recorded.
  ~StreamRecorder();

  /// What a Subscriber of the stream is to call; the recorder must outlive it.
  Subscriber::Callbacks callbacks();

  /// A new file in the folder, STREAM-2026-11-22T07-05-00Z.mcap, or where it is to be split the first of
  /// several, ...Z_000000.mcap, that begins with the pre-roll. Fails where
  /// one is being recorded. What the disk has against it shows in state(), as does another name where it has
  /// a file of this one.
  Status start();
  /// What came until now is in the file; it is whole when is_open() no longer says so. Fails where nothing is
  /// being recorded.
  Status stop();
  /// Of this recording, or of the last one.
  RecordingState state() const;
  /// This file is being written.
  bool is_open(const std::string& file) const;
  /// What is whole of this file, where it is being written or was written last; else null.
  std::shared_ptr<const GrowingRecording> growing(const std::string& file) const;
  /// After the stream's last frame, the `published`th: waits a moment until it is here, and until the file is
  /// whole.
  void finish(std::uint64_t published);

 private:
  void add(const RawSample& sample);
  void run();
  void write_some(std::unique_lock<std::mutex>& lock);
  void write(const RawSample& sample);
  bool has_work() const;
  void look_at_disk(std::unique_lock<std::mutex>& lock);

  const Options options_;
  mutable std::mutex mutex_;  // of all up to the thread's own
  std::condition_variable wake_;
  SampleRing ring_;
  std::optional<RawSample> info_;  // as received last
  RecordingState state_;
  std::shared_ptr<const GrowingRecording> growing_;  // of state_.file
  std::filesystem::path target_;                     // as Recorder::Options::file, while that is unused
  std::int64_t named_s_ = 0;                         // UTC, in its name
  bool open_ = false;                                // state_.file is being written
  std::uint64_t next_ = 0;                           // the first of the ring that is not in it
  std::optional<std::uint64_t> end_;                 // where it ends, once that is asked for
  std::uint64_t frames_seen_ = 0;
  bool ending_ = false;

  std::unique_ptr<Recorder> recorder_;  // of the thread alone
  Subscriber::Callbacks to_recorder_;
  std::optional<std::int64_t> looked_ns_;  // at the disk
  std::thread thread_;
};

}  // namespace relievo
