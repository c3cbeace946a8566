// SPDX-License-Identifier: Apache-2.0
// What the gateway says: the WebSocket messages of docs/WEB.md, /api/streams and /metrics, as bytes. Pure.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "base/refused_peers.h"
#include "base/result.h"
#include "base/rung.h"
#include "base/stream.h"
#include "web/gateway/hub.h"

namespace relievo {

std::string info_message(const StreamInfo& info);
std::string status_message(const ServerStatus& status);
std::string waiting_message(const std::string& hint);
std::string gone_message();

/// Which rung a client that chose its quality is on from the next frame on, and which there are.
std::string quality_message(Rung now, const std::vector<Rung>& lower);

/// The answer to a client's {"type":"time","t0":T}: T unchanged and the server's UTC, or nothing where how
/// far its clock is off is not known yet.
std::string time_message(double t0, std::optional<std::int64_t> now_ns);

constexpr std::size_t kFramePrefixBytes = 48;

/// What precedes the bytes of codec/FORMAT.md in a binary message, little endian.
std::array<std::uint8_t, kFramePrefixBytes> frame_prefix(const FrameMessage& frame, std::uint64_t drops,
                                                         std::int64_t sent_time_ns);

/// A text message of a client. `kOther`: well formed, of a type this version does not know.
struct ClientMessage {
  enum class Type { kCredit, kTime, kQuality, kOther } type = Type::kOther;
  int credit = 0;  // 1..kMaxCredit
  double t0 = 0;
  std::optional<Rung> want{};  // nothing: whatever suits it
  bool video = true;           // it decodes H.264 textures
};
constexpr int kMaxCredit = 8;

/// Any input; the error is what the client is told as it is closed.
Result<ClientMessage> parse_client_message(std::string_view text);

/// Why somebody was turned away.
enum class Refusal : std::uint8_t {
  kPlaces,     // all connections are taken
  kAddress,    // all of one address
  kRate,       // too many requests of one address
  kClients,    // all places of WebSocket clients are taken
  kToken,      // none, or a wrong one
  kOrigin,     // a page of another site
  kHost,       // under a foreign name
  kTls,        // no handshake came about
  kMalformed,  // no request, or too large
  kSlow,       // a request that did not come to its end, or an answer that was not read
  kMessage,    // a WebSocket message that is wrong, too large, or one too many
};
constexpr std::size_t kRefusals = 11;
std::string_view to_string(Refusal refusal);

/// Counts of the gateway itself, and its certificate.
struct GatewayCounts {
  std::uint64_t connections = 0;  // TCP, accepted so far
  std::uint64_t requests = 0;     // HTTP, answered so far
  std::array<std::uint64_t, kRefusals> refused{};
  int clients = 0;                                   // WebSocket, now
  std::optional<std::int64_t> certificate_expiry_s;  // Unix time; of the one that browsers are shown

  void refuse(Refusal why) { ++refused[static_cast<std::size_t>(why)]; }
};

/// What /api/recording/STREAM answers.
std::string recording_message(const RecordingState& state);
/// The same for those who watch the stream.
std::string recording_event(const RecordingState& state);

std::string streams_json(const std::vector<StreamSnapshot>& streams, const std::string& hint);
std::string metrics_text(const std::vector<StreamSnapshot>& streams, const GatewayCounts& counts,
                         const RefusedPeers& peers);

}  // namespace relievo
