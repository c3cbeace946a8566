// SPDX-License-Identifier: Apache-2.0
// Which part of a recording: --from, --to and --frames, of every verb that reads one.
#pragma once

#include <cstdint>
#include <memory>
#include <string>

#include "base/result.h"
#include "client/recorded_stream.h"

namespace CLI {
class App;
}

namespace relievo {

/// As given; empty: not limited.
struct RangeOptions {
  std::string from, to;  // seconds after the recording's start, or UTC as 2026-01-02T03:04:05.5Z
  std::string frames;    // "A:B", "A:", ":B" or "A": positions in the recording from 0, both included
};

/// --from, --to and --frames, checked and filled while parsing.
std::shared_ptr<RangeOptions> add_range_options(CLI::App& app);

/// Times at which samples were received, both included.
struct TimeRange {
  std::int64_t from_ns = 0;
  std::int64_t to_ns = 0;
  std::uint64_t frames = 0;  // that lie in it

  bool contains(std::int64_t time_ns) const { return time_ns >= from_ns && time_ns <= to_ns; }
};

/// Fails where no frame lies in the range, saying how many there are and for how long. `--frames` and times
/// together: where they overlap.
Result<TimeRange> find_range(const RangeOptions& options, RecordedStream& recorded);

/// A time of --from or --to, in a recording that starts at `start_ns`.
Result<std::int64_t> parse_recorded_time_ns(const std::string& text, std::int64_t start_ns);

}  // namespace relievo
