// SPDX-License-Identifier: Apache-2.0
// How a stream is recorded: what `relievo record` and a server that records have in common.
#pragma once

#include <cstdint>

namespace relievo {

struct SegmentOptions {
  std::uint64_t split_bytes = 0;  // a file ends when it is as large; 0: no limit
  double split_s = 0;             // or as long; 0: no limit
  std::uint64_t keep_bytes = 0;   // of all files together, the oldest go; 0: all stay
  double keep_s = 0;              // files that ended longer ago go; 0: all stay

  bool split() const { return split_bytes > 0 || split_s > 0; }
  bool keep() const { return keep_bytes > 0 || keep_s > 0; }
};

struct RecordingOptions {
  SegmentOptions segments;
  double sync_s = 0;  // what was written is put on the disk as often; 0: each chunk; below 0: at the end
};

}  // namespace relievo
