// SPDX-License-Identifier: Apache-2.0
// HTTP and WebSocket server of the viewer: the page itself, /healthz, /metrics, /api/streams and /ws/STREAM
// (protocol: docs/WEB.md). Fed by a server's pipeline or by a DDS subscriber; knows neither.
#pragma once

#include <chrono>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <string>

#include "base/refused_peers.h"
#include "base/result.h"
#include "base/rung.h"
#include "base/stream.h"
#include "base/web_options.h"
#include "web/gateway/calibration_control.h"
#include "web/gateway/offered_recording.h"
#include "web/gateway/recording_control.h"
#include "web/gateway/rig_control.h"
#include "web/gateway/server_clock.h"
#include "web/gateway/stage_times.h"

namespace relievo {

/// Frames as DDS carries them, for readers of such samples: the Foxglove protocol.
struct SampleFormat {
  std::string type_name;  // "relievo::Frame"
  std::string idl;        // its OMG IDL, self-contained
  // CDR with its encapsulation header. On the gateway's thread.
  std::function<Bytes(const std::string& stream, const FrameMessage& frame)> encode;
};

struct GatewayOptions {
  std::string host = "127.0.0.1";  // empty: every interface, by IPv6 and IPv4
  std::uint16_t port = 8080;       // 0: any free one, see Gateway::port()
  WebOptions web{};
  std::string empty_hint{};  // what the viewer says while there are no streams
  // A client has to wait for a key frame of the stream; at most once a second a stream, and ten times
  // while clients join, from any thread. Must return at once and not call back.
  std::function<void(const std::string& stream)> key_frame_wanted{};
  std::function<RefusedPeers()> refused_peers{};   // of DDS; any thread. Empty: there are none
  std::optional<SampleFormat> samples{};           // none: no /foxglove
  RecordingControl* recordings = nullptr;          // must outlive the gateway; null: nothing is recorded here
  RigControl* rigs = nullptr;                      // likewise; null: no camera is here
  CalibrationControl* calibrations = nullptr;      // likewise
  const StageReport* stages = nullptr;             // likewise; null: no stream is made here
  std::chrono::milliseconds request_time{15'000};  // for a request to arrive; its answer may stand still
  std::chrono::milliseconds message_time{20'000};  // for a WebSocket message to leave
};

/// Runs on a thread of its own from start() to destruction. Every function may be called from any thread and
/// returns without waiting for a client: each client has a credit and a latest-frame slot, and frames it has
/// no credit for are dropped there and counted; so are those that build on a dropped one.
class Gateway {
 public:
  /// Fails where the address cannot be had (port in use), or a certificate, key or token cannot be read,
  /// saying which and what to do.
  static Result<std::unique_ptr<Gateway>> start(const GatewayOptions& options);
  virtual ~Gateway() = default;  // closes every client with 1001 and joins

  virtual std::uint16_t port() const = 0;
  /// On an address that others reach, where the options neither name tokens nor say `open`: the one that was
  /// made for this run. Otherwise empty.
  virtual std::string made_token() const = 0;

  /// Tokens, certificate, origins and limits are these from now on; who watches goes on watching. Fails, and
  /// then nothing changes, as start() does, and where nobody could get the token that would be needed.
  virtual Status apply(const WebOptions& web) = 0;

  /// A new stream, or new information on a known one. What is published of a stream before is ignored.
  virtual void announce(const StreamInfo& info, ServerClock clock) = 0;
  void announce(const StreamInfo& info) { announce(info, ServerClock::kHere); }
  /// Frames of lower rungs (FrameMessage::rung) go to the clients that wish for those.
  virtual void publish(const std::string& stream, const FrameMessage& frame) = 0;
  virtual void publish(const ServerStatus& status) = 0;
  /// The stream, which was announced, is played from this file: clients may read it
  /// (/recordings/STREAM.mcap), each at its own place, and is it while it grows. Until it is withdrawn, or
  /// another is offered.
  virtual void offer(const std::string& stream, const OfferedRecording& recording) = 0;
  /// Clients of that rung of a stream, which are to be given its frames by publish().
  virtual int watchers(const std::string& stream, Rung rung) const = 0;
  /// How far the clock of the stream's server, which is elsewhere, is ahead of this machine's.
  virtual void set_clock(const std::string& stream, std::int64_t offset_ns) = 0;
  /// The stream is gone: clients are told and stay connected, since it may come back.
  virtual void withdraw(const std::string& stream) = 0;
};

}  // namespace relievo
