// SPDX-License-Identifier: Apache-2.0
// A web_watcher at work, and what it has seen.
#pragma once

#include <cstdint>
#include <sstream>
#include <string>
#include <vector>

#include "tests/support/process.h"

namespace relievo::test {

struct WatchedFrame {
  int connection = 0;
  std::uint64_t sequence = 0;
  std::uint64_t dropped = 0;  // on this connection, as the gateway says
  std::int64_t published_ns = 0, came_ns = 0;
};

class WebWatch {
 public:
  /// `command` runs web_watcher, here or elsewhere.
  explicit WebWatch(const std::vector<std::string>& command) : process_(command) {}

  Process& process() { return process_; }
  /// Those that came so far.
  std::vector<WatchedFrame> frames() const {
    std::vector<WatchedFrame> out;
    std::istringstream lines(process_.out());
    for (WatchedFrame f; lines >> f.connection >> f.sequence >> f.dropped >> f.published_ns >> f.came_ns;)
      out.push_back(f);
    return out;
  }

 private:
  Process process_;
};

}  // namespace relievo::test
