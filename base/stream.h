// SPDX-License-Identifier: Apache-2.0
// What is said about a stream: its description for late joiners and the server's running counts. Plain data
// that transports (DDS, WebSocket, recordings) carry.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "base/filter_counts.h"
#include "base/pattern.h"
#include "base/rig.h"
#include "base/rung.h"

namespace relievo {

using Bytes = std::vector<std::uint8_t>;

/// Sent once to every reader, early or late; enough to interpret every frame of the stream.
struct StreamInfo {
  std::string stream;           // unique name in its DDS domain: [A-Za-z0-9_.-]{1,64}
  std::string source;           // what it was captured from, e.g. "sim:face"
  std::int64_t started_ns = 0;  // UTC
  Rig rig;
  Pattern pattern;
};

/// One encoded frame on its way: the bytes of codec/FORMAT.md and what a transport needs to know beside them.
struct FrameMessage {
  std::uint64_t sequence = 0;         // counts published frames of the stream without gaps, from 0
  std::uint64_t number = 0;           // Frame3D::number
  std::int64_t capture_time_ns = 0;   // UTC, start of the camera frame's first field
  std::int64_t publish_time_ns = 0;   // UTC, when the server handed it to its sinks
  std::shared_ptr<const Bytes> data;  // shared by all sinks, never changed
  // The rung of the ladder it is of; each rung counts its own sequence.
  Rung rung = Rung::kFull;
};

enum class StreamState : std::uint8_t { kStarting, kRunning, kStalled, kEnded };

/// "starting", "running", "stalled" or "ended".
inline std::string_view to_string(StreamState state) {
  switch (state) {
    case StreamState::kStarting:
      return "starting";
    case StreamState::kRunning:
      return "running";
    case StreamState::kStalled:
      return "stalled";
    case StreamState::kEnded:
      return "ended";
  }
  return "unknown";
}

/// A projector and a camera that are, or are not, in step (docs/RIG.md).
struct StepStatus {
  std::uint64_t mixed = 0;      // frames dropped because their exposures were under two slides each
  std::uint64_t regrouped = 0;  // frames made of one's second and the next one's first exposure
  std::optional<double> phase;  // 0..2, in exposures: 0 in step, 0.3 three tenths under the next slide
  std::optional<double> drift_fields_s;  // fields a second that the projector gains

  bool operator==(const StepStatus&) const = default;
};

/// A lower rung of a stream's quality ladder, which costs nothing while nobody reads it.
struct RungStatus {
  Rung rung = Rung::kReduced;
  std::uint32_t readers = 0;  // now: of DDS, and browsers of the server's own gateway
  std::uint64_t frames = 0;   // published since the start
  std::uint64_t drops = 0;    // not encoded, since the one before took too long
  double encode_ms = 0;       // median over the last frames
  double bit_rate = 0;        // bits a second over the last few seconds

  bool operator==(const RungStatus&) const = default;
};

/// Running counts of one stream, published about once a second.
struct ServerStatus {
  std::string stream;
  std::int64_t time_ns = 0;  // UTC
  StreamState state = StreamState::kStarting;
  std::string message;    // for a person; empty when all is well
  double frame_rate = 0;  // published frames a second over the last few seconds
  std::uint64_t frames_captured = 0;
  std::uint64_t frames_published = 0;
  std::uint64_t drops_capture = 0;  // lost between camera and queue, known from sequence numbers or content
  std::uint64_t drops_reconstruct = 0;  // queue before reconstruction was full
  std::uint64_t drops_encode = 0;       // queue before encoding was full
  std::uint64_t drops_publish = 0;      // queue before publishing was full
  double reconstruct_ms = 0;            // medians over the last few seconds
  double encode_ms = 0;
  double latency_ms = 0;  // capture to publish
  double bit_rate = 0;    // bits a second published over the last few seconds
  std::uint32_t rate_level =
      0;                 // of a stream that keeps a bit rate: how much coarser than asked for, 0 not at all
  FilterCounts filters;  // since the start
  StepStatus step;       // its mixed frames are among drops_capture
  std::vector<RungStatus> rungs;  // of the ladder, best first, without the stream itself
};

/// True where `name` may name a stream: [A-Za-z0-9_.-]{1,64}, not starting with a dot.
inline bool valid_stream_name(const std::string& name) {
  if (name.empty() || name.size() > 64 || name[0] == '.') return false;
  for (const char c : name) {
    const bool ok = (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '_' ||
                    c == '-' || c == '.';
    if (!ok) return false;
  }
  return true;
}

}  // namespace relievo
