// SPDX-License-Identifier: Apache-2.0
// A live stream, decoded as it comes, in the quality that suits who reads it.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "base/clock_offset.h"
#include "base/frame3d.h"
#include "base/quality_choice.h"
#include "base/result.h"
#include "idl/transport.h"

namespace relievo {

/// Reads, decodes and chooses on a thread of its own. Every function may be called from any thread.
class LiveReader {
 public:
  struct Options {
    DomainOptions domain;
    std::string stream;
    std::optional<Rung>
        quality;  // nothing: whatever suits, measured by frames that are lost or late, and the time they take
    QualityChoice::Options choice;  // how that is decided
    // Each frame, on the reader's thread; what it takes here counts as what decoding takes.
    std::function<void(const Frame3D& frame, const FrameMessage& message)> frame;
  };
  struct Report {
    bool live = false;          // the stream is there now
    Rung rung = Rung::kFull;    // of the last frame
    std::vector<Rung> rungs;    // lower ones that there are
    std::uint64_t frames = 0;   // decoded
    std::uint64_t bytes = 0;    // of those
    std::uint64_t lost = 0;     // on the way here
    std::uint64_t skipped = 0;  // that build on a lost one, or do not decode
    std::uint64_t moves = 0;    // from rung to rung
    double decode_ms = 0;       // median of the last frames, as is:
    // From capture until decoded: across machines right within half of clock's delay; nothing before there
    // was a frame with the clock known.
    std::optional<double> latency_ms;
    std::optional<ClockOffset> clock;  // of the server, from here; nothing: not known
  };

  /// Fails where the domain cannot be joined or nothing can be called so. A stream that is not there is
  /// waited for.
  static Result<std::unique_ptr<LiveReader>> create(const Options& options);
  virtual ~LiveReader() = default;

  virtual Report report() const = 0;
  /// Asks the server for its time and tells it what is decoded here: to be called once a second or so.
  virtual void compare_clocks() = 0;
};

}  // namespace relievo
