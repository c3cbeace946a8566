// SPDX-License-Identifier: Apache-2.0
// What the gateway says: the WebSocket messages of docs/WEB.md, /api/streams and /metrics, as bytes. Pure.
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "base/result.h"
#include "base/stream.h"
#include "web/gateway/hub.h"

namespace relievo {

std::string info_message(const StreamInfo& info);
std::string status_message(const ServerStatus& status);
std::string waiting_message(const std::string& hint);
std::string gone_message();

/// The answer to a client's {"type":"time","t0":T}: T unchanged and the server's UTC.
std::string time_message(double t0, std::int64_t now_ns);

constexpr std::size_t kFramePrefixBytes = 48;

/// What precedes the bytes of codec/FORMAT.md in a binary message, little endian.
std::array<std::uint8_t, kFramePrefixBytes> frame_prefix(const FrameMessage& frame, std::uint64_t drops,
                                                         std::int64_t sent_time_ns);

/// A text message of a client. `kOther`: well formed, of a type this version does not know.
struct ClientMessage {
  enum class Type { kCredit, kTime, kOther } type = Type::kOther;
  int credit = 0;  // 1..kMaxCredit
  double t0 = 0;
};
constexpr int kMaxCredit = 8;

/// Any input; the error is what the client is told as it is closed.
Result<ClientMessage> parse_client_message(std::string_view text);

/// Counts of the gateway itself.
struct GatewayCounts {
  std::uint64_t connections = 0;  // TCP, accepted so far
  std::uint64_t requests = 0;     // HTTP, answered so far
  std::uint64_t refused = 0;      // connections and upgrades refused, by a limit or a foreign origin
  int clients = 0;                // WebSocket, now
};

std::string streams_json(const std::vector<StreamSnapshot>& streams, const std::string& hint);
std::string metrics_text(const std::vector<StreamSnapshot>& streams, const GatewayCounts& counts);

}  // namespace relievo
