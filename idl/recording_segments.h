// SPDX-License-Identifier: Apache-2.0
// A recording in several files, so that it may go on for ever: when one ends, how the next is called, and
// which old ones go.
#pragma once

#include <cstdint>
#include <filesystem>
#include <vector>

#include "base/result.h"

namespace relievo {

struct SegmentOptions {
  std::uint64_t split_bytes = 0;  // a file ends when it is as large; 0: no limit
  double split_s = 0;             // or as long; 0: no limit
  std::uint64_t keep_bytes = 0;   // of all files together, the oldest go; 0: all stay
  double keep_s = 0;              // files that ended longer ago go; 0: all stay

  bool split() const { return split_bytes > 0 || split_s > 0; }
};

/// The files face_000000.mcap, face_000001.mcap ... beside `face.mcap`. The file system is all it remembers:
/// a recorder that is started again goes on counting. One thread.
class RecordingSegments {
 public:
  RecordingSegments(std::filesystem::path file, const SegmentOptions& options)
      : file_(std::move(file)), options_(options) {}

  /// The one after the last that is there.
  std::filesystem::path next() const;
  /// True where a segment of this size and length is to end.
  bool is_full(std::uint64_t bytes, double duration_s) const;
  /// Removes what `keep_bytes` and `keep_s` no longer allow, oldest first, never `open`. Fails, after having
  /// gone on, where a file could not be removed.
  Status remove_old(const std::filesystem::path& open) const;

 private:
  std::vector<std::filesystem::path> there() const;  // in order of their numbers

  const std::filesystem::path file_;
  const SegmentOptions options_;
};

}  // namespace relievo
