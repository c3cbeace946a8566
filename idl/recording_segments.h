// SPDX-License-Identifier: Apache-2.0
// A recording in several files, so that it may go on for ever: when one ends, how the next is called, and
// which old ones go.
#pragma once

#include <cstdint>
#include <filesystem>
#include <vector>

#include "base/recording_options.h"
#include "base/result.h"

namespace relievo {

/// The files face_000000.mcap, face_000001.mcap ... beside `face.mcap`. The file system is all it remembers:
/// a recorder that is started again goes on counting. One thread.
class RecordingSegments {
 public:
  RecordingSegments(std::filesystem::path file, const SegmentOptions& options)
      : file_(std::move(file)), options_(options) {}

  /// The one of this number.
  std::filesystem::path at(std::uint64_t number) const;
  /// The one after the last that is there.
  std::filesystem::path next() const;
  /// True where a segment of this size and length is to end, before the next frame that decodes alone.
  bool is_full(std::uint64_t bytes, double duration_s) const;
  /// True where one of this size and length leaves no room for others.
  bool is_all_kept(std::uint64_t bytes, double duration_s) const;
  /// Removes what `keep_bytes` and `keep_s` no longer allow, oldest first, never `open`. Fails, after having
  /// gone on, where a file could not be removed.
  Status remove_old(const std::filesystem::path& open) const;
  /// Removes the oldest file that can be, never `open`, and returns it; empty where there is none. Fails
  /// where there are some, and none can be removed.
  Result<std::filesystem::path> remove_oldest(const std::filesystem::path& open) const;

 private:
  std::vector<std::filesystem::path> there() const;  // in order of their numbers
  std::vector<std::filesystem::path> there_but(const std::filesystem::path& open) const;

  const std::filesystem::path file_;
  const SegmentOptions options_;
};

/// `file`, or where there is one already, its name with -2, -3 ...
std::filesystem::path unused_name(const std::filesystem::path& file);

/// Fails where this user can make no file in a folder that is there.
Status check_record_folder(const std::filesystem::path& folder);

/// Fails where `file` cannot be recorded to, found out before anything is received: it exists already (unless
/// it is to be split, which names other files), its folder does not, or is closed.
Status check_recording_target(const std::filesystem::path& file, bool split);

}  // namespace relievo
