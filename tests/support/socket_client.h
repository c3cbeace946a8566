// SPDX-License-Identifier: Apache-2.0
// A bare TCP, HTTP and WebSocket client for tests: POSIX sockets only, so that it shares nothing with the
// server it checks. Every wait is bounded.
#pragma once

#include <chrono>
#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "tests/support/patience.h"

namespace relievo::test {

class TcpClient {
 public:
  explicit TcpClient(std::uint16_t port, int receive_buffer_bytes = 0);
  /// To another address, in numbers; not connected where it does not answer within that time.
  TcpClient(const std::string& address, std::uint16_t port, std::chrono::milliseconds patience);
  TcpClient(TcpClient&& other) noexcept;
  TcpClient& operator=(TcpClient&&) = delete;
  virtual ~TcpClient();

  bool connected() const { return fd_ >= 0; }
  virtual bool send(const std::string& bytes);
  /// Waits until at least one byte more is there; false at the end of the stream or after the time.
  bool receive(std::chrono::milliseconds timeout = kPatience);
  bool at_end() const { return at_end_; }  // the server closed
  std::string& buffer() { return buffer_; }

 protected:
  int descriptor() const { return fd_; }
  /// As recv(2), when there is something to read.
  virtual long read(char* into, std::size_t bytes);
  virtual bool has_more() const { return false; }  // was read already, and waits

 private:
  void connect_to(const std::string& address, std::uint16_t port);

  int fd_ = -1;
  bool at_end_ = false;
  std::string buffer_;
};

struct Response {
  int status = 0;                              // 0: none came
  std::map<std::string, std::string> headers;  // names in lower case
  std::string body;
};

/// Reads one response; `head`: it has no body whatever its length says.
Response read_response(TcpClient& client, bool head = false);
/// One request on a connection of its own. `headers` end in \r\n each.
Response request(std::uint16_t port, const std::string& method, const std::string& target,
                 const std::string& headers = {});
Response request(TcpClient& client, std::uint16_t port, const std::string& method, const std::string& target,
                 const std::string& headers = {});

/// A POST of `body` as application/json on a connection of its own.
Response post_json(std::uint16_t port, const std::string& target, const std::string& body,
                   const std::string& headers = {});

struct WsMessage {
  int opcode = 0;  // 1 text, 2 binary, 8 close
  std::string data;
  int close_code() const {
    return data.size() < 2 ? 0
                           : static_cast<unsigned char>(data[0]) * 256 + static_cast<unsigned char>(data[1]);
  }
};

/// A whole message of a client, as it goes over the wire.
std::string ws_message(const std::string& text, int opcode = 1);

class WsClient {
 public:
  /// Connects and upgrades; see status().
  WsClient(std::uint16_t port, const std::string& stream, const std::string& headers = {},
           int receive_buffer_bytes = 0);
  /// Upgrades a connection at any address of `port`, and sends `early` without waiting for the answer.
  WsClient(std::unique_ptr<TcpClient> tcp, std::uint16_t port, const std::string& target,
           const std::string& headers = {}, const std::string& early = {});
  int status() const { return status_; }                           // 101 where upgraded
  const std::string& subprotocol() const { return subprotocol_; }  // that the server agreed on
  bool send(const std::string& text, int opcode = 1);
  bool credit(int n) { return send(R"({"type":"credit","n":)" + std::to_string(n) + "}"); }
  /// The next message that is no ping; nothing after the time or at the end.
  std::optional<WsMessage> next(std::chrono::milliseconds timeout = kPatience);
  /// Skips to the next message of a kind: "info", "status", "gone", "waiting", "time" or "frame".
  std::optional<WsMessage> next_of(const std::string& kind, std::chrono::milliseconds timeout = kPatience);
  bool at_end() const { return tcp_->at_end(); }

 private:
  std::unique_ptr<TcpClient> tcp_;
  int status_ = 0;
  std::string subprotocol_;
};

std::uint64_t u64_at(const std::string& bytes, std::size_t at);

}  // namespace relievo::test
