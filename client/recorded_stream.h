// SPDX-License-Identifier: Apache-2.0
// One stream of a recording, read back as the DDS samples it was recorded from.
#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <set>
#include <span>
#include <string>
#include <vector>

#include "base/result.h"
#include "codec/recording.h"
#include "idl/transport.h"

namespace relievo {

/// Whether frames after this sample may build on it: it is a key frame, or its texture is video; and
/// descriptions always. What comes before a range that is to be decoded, and is itself not wanted.
bool needed_later(const RawSample& sample);

/// A description of the stream, as it was received. A server that was started again sends another one.
struct RecordedInfo {
  RawSample sample;
  StreamInfo info;
};

/// The one that holds for a frame: the last received of those that its server published before it, since
/// frames may be received before their description; where there is none, the first. Null where `infos` is
/// empty.
const RecordedInfo* info_of(const RawSample& frame, std::span<const RecordedInfo> infos);

/// The last that was received until this time; where there is none, the first. Null where `infos` is empty.
const RecordedInfo* info_at(std::int64_t time_ns, std::span<const RecordedInfo> infos);

/// One thread.
class RecordedStream {
 public:
  /// `stream` empty: the only one there is. Fails where the file is no recording, or holds no such stream, or
  /// several, naming them.
  static Result<RecordedStream> open(const std::filesystem::path& file, const std::string& stream);

  const std::string& stream() const { return stream_; }
  /// Logs that only a part of what was recorded may be there, where that is so: a file that is cut short
  /// reads like a shorter one.
  void warn_if_cut() const;
  const RecordingSummary& summary() const { return reader_->summary(); }
  /// Number of frames, as the file's index has it.
  std::uint64_t frames() const;

  /// The next sample in the order they were received (RawSample::receive_time_ns is the log time); nothing at
  /// the end. A damaged part of the file is skipped and counted, and the first ones are logged.
  Result<std::optional<RawSample>> next();
  /// Whether more was written since, with which next() goes on: of a file that is still without its index.
  Result<bool> read_on();
  /// The next next() returns the first sample again.
  Status rewind();
  /// The times of all frames, in order, from the file's index; those of damaged parts may be among them.
  Result<std::vector<std::int64_t>> frame_times();
  /// The next next() returns the last key frame at or before this time, or where there is none the first
  /// sample at or after it: what comes then can be decoded from `time_ns` on.
  Status seek(std::int64_t time_ns);
  /// Damaged parts skipped since opening.
  std::uint64_t damaged() const { return damaged_; }

  /// Fails where `out` is the file that is read.
  Status check_output(const std::filesystem::path& out) const;
  /// The first description in the file, attached or among the first samples; rewinds. Nothing where there is
  /// none.
  Result<std::optional<RawSample>> find_info();
  /// All descriptions in the order in which they were received, but those that repeat the one before. Empty
  /// where none can be read; rewinds.
  Result<std::vector<RecordedInfo>> read_infos();

 private:
  RecordedStream() = default;
  void read_channels();
  Result<std::vector<std::int64_t>> times_of(Topic topic);
  Result<std::vector<RawSample>> info_samples();
  std::vector<RawSample> attached_infos() const;
  void tell_of_damage(const std::string& what);

  std::filesystem::path file_;
  std::string stream_;
  std::unique_ptr<RecordingReader> reader_;
  std::vector<std::optional<Topic>> topics_;  // of each channel; nothing where it is not of this stream
  std::uint64_t damaged_ = 0;
  std::set<std::string> said_;  // of damaged parts: each once, however often it is played
};

}  // namespace relievo
