// SPDX-License-Identifier: Apache-2.0
// When the next frame of the slow rung is due: its readers ask for each, so that none waits on the way to one
// that is narrower than the stream.
#pragma once

#include <cstdint>
#include <map>

namespace relievo {

/// All readers get the same frames, so the slowest of them decides; who has not asked for a while is waited
/// for no longer. Not thread-safe. Pure: no clock of its own.
class AskedFrames {
 public:
  static constexpr std::int64_t kPatience_ns = 10'000'000'000;

  /// `who`: any number that is this reader's.
  void ask(std::uint64_t who, std::int64_t now_ns);
  /// A reader that has just come gets a frame unasked.
  void joined() { joined_ = true; }
  bool due(std::int64_t now_ns);
  void sent();

 private:
  struct Reader {
    std::int64_t asked_ns = 0;
    bool waits = false;  // has had no frame since
  };
  std::map<std::uint64_t, Reader> readers_;
  bool joined_ = false;
};

}  // namespace relievo
