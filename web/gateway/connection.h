// SPDX-License-Identifier: Apache-2.0
// Connections of the gateway: HTTP, and what one may become, a WebSocket that carries a feed. Everything here
// is of the gateway's thread.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>

#include "base/stream.h"
#include "web/gateway/protocol.h"
#include "web/gateway/routes.h"
#include "web/gateway/sockets.h"

namespace relievo {

class Connection {
 public:
  virtual ~Connection() = default;
  virtual void close() = 0;  // politely
  virtual void abort() = 0;  // now
  /// Since when it has been waiting for its client to send or to read something; nothing where it may.
  virtual std::optional<std::int64_t> waiting_since_ns() const { return std::nullopt; }
};

/// One message to a WebSocket client: text, or `head` and behind it `data`.
struct WsOutgoing {
  std::shared_ptr<const std::string> text{};
  std::vector<std::uint8_t> head{};
  std::shared_ptr<const Bytes> data{};
};

/// Why the server closes a WebSocket.
struct WsClose {
  int code = 1008;  // RFC 6455, 7.4.1
  std::string why;  // 120 bytes at most
};

/// What a WebSocket carries: one protocol, one client.
class WsFeed {
 public:
  virtual ~WsFeed() = default;
  /// `wake` may be called from any thread, when next() has something again.
  virtual void start(std::function<void()> wake) = 0;
  virtual std::optional<WsClose> on_text(std::string_view text) = 0;
  virtual std::optional<WsClose> on_binary(std::span<const std::uint8_t> bytes) = 0;
  /// What to send next. Where there is nothing, the feed will wake or be sent something.
  virtual std::optional<WsOutgoing> next() = 0;
  /// It was handed to the system whole.
  virtual void on_sent(const WsOutgoing& message) = 0;
};

/// What connections need of the gateway.
class ConnectionHost {
 public:
  virtual ~ConnectionHost() = default;
  virtual boost::asio::io_context& loop() = 0;
  virtual GatewayCounts& counts() = 0;
  virtual HttpReply answer(const HttpRequest& request, const Peer& peer) = 0;
  virtual std::unique_ptr<WsFeed> make_feed(const HttpReply& reply) = 0;
  /// How long a request may take to arrive whole, and how long its answer may stand still.
  virtual std::chrono::milliseconds request_time() const = 0;
  /// How long a WebSocket message may take to leave.
  virtual std::chrono::milliseconds message_time() const = 0;
  /// Calls `read`, which may wait for a disk, on a thread beside the loop's, and then `done` on the loop's.
  /// `takes_long`: on a thread of which there is one.
  virtual void from_disk(std::function<void()> read, std::function<void()> done, bool takes_long) = 0;
  virtual void add(std::shared_ptr<Connection> connection) = 0;
  virtual void remove(const std::shared_ptr<Connection>& connection) = 0;
};

/// `tls`: none for plain HTTP. Add it to the host, then start it.
class HttpConnection : public Connection {
 public:
  static std::shared_ptr<HttpConnection> make(ConnectionHost& host, std::shared_ptr<Transport> transport,
                                              std::shared_ptr<boost::asio::ssl::context> tls);
  virtual void start() = 0;
};

/// A request to upgrade that was granted.
struct WsUpgrade {
  std::shared_ptr<Transport> transport;
  std::string request;      // its head
  std::string early;        // what came behind it: the client did not wait for the answer
  std::string subprotocol;  // the one agreed on, may be empty
  std::unique_ptr<WsFeed> feed;
};

/// Adds itself to the host.
void start_websocket(ConnectionHost& host, WsUpgrade upgrade);

}  // namespace relievo
