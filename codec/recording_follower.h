// SPDX-License-Identifier: Apache-2.0
// An index of a recording that another program is writing, so that it can be read meanwhile as if it were
// whole.
#pragma once

#include <atomic>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <utility>

#include "base/growing_recording.h"
#include "base/result.h"
#include "codec/mcap_scan.h"
#include "codec/mcap_writer_index.h"

namespace relievo {

/// One thread; what growing() returns may be asked by any.
class RecordingFollower {
 public:
  enum class Found : std::uint8_t {
    kMore,      // than the last time
    kNothing,   // new
    kFinished,  // the file has an index of its own
    kAnother,   // recording is there in its place: this one is done with
  };

  /// `stop`, where there is one, outlives it: once it is set, look() fails soon.
  explicit RecordingFollower(std::filesystem::path file, const std::atomic<bool>* stop = nullptr)
      : file_(std::move(file)), stop_(stop) {}

  /// Reads what was added since the last call; to be called every few tenths of a second. A chunk counts when
  /// something is behind it, or nothing came since the call before: its message indexes come after it. Fails
  /// where the file cannot be read, is none, or is damaged: what was whole until then stays.
  Result<Found> look();
  /// Whether the last chunk does not count, since its message indexes are yet to come; or never do.
  bool holds_back() const { return chunk_.has_value(); }
  /// Never null.
  std::shared_ptr<const GrowingRecording> growing() const { return index_; }

 private:
  /// A chunk's first bytes, with its times and its CRC: another one's differ.
  struct ChunkHead {
    std::uint64_t at = 0;
    Bytes bytes;
  };
  static bool is_there(const ChunkHead& head, const mcap::File& file);
  Status take(const mcap::RecordPlace& record, const mcap::File& file);
  void commit();

  const std::filesystem::path file_;
  const std::atomic<bool>* const stop_;
  std::uint64_t at_ = 0;    // how far it was read: whole records
  std::uint64_t size_ = 0;  // when it was last looked at
  bool behind_data_ = false, has_footer_ = false, finished_ = false;
  std::optional<mcap::ChunkIndex> chunk_;  // the last one, while message indexes may follow it
  ChunkHead first_, last_;                 // of those that were read; empty: there is none yet
  const std::shared_ptr<mcap::WriterIndex> index_ = std::make_shared<mcap::WriterIndex>();
};

}  // namespace relievo
