// SPDX-License-Identifier: Apache-2.0
// TCP with or without TLS, as callbacks on the gateway's thread. Nothing of Asio leaves these two files but
// the names of its loop and of a TLS context.
#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <span>
#include <string>

#include "base/result.h"

namespace boost::asio {
class io_context;
namespace ssl {
class context;
}
}  // namespace boost::asio

namespace relievo {

/// How reading or writing ended.
enum class Io : std::uint8_t { kDone, kClosed, kTimeout };

/// Where a connection comes from.
struct Peer {
  std::string address;  // what limits count by: an IPv4 address, or the first 64 bits of an IPv6 one
  bool loopback = false;
};

/// One connection. Callbacks come on the loop's thread, never from within the call that asks for them, and
/// keep the transport alive. At most one read and one write at a time.
class Transport {
 public:
  using Done = std::function<void(Io, std::size_t bytes)>;
  using Part = std::span<const std::uint8_t>;

  virtual ~Transport() = default;

  /// With a context: TLS, where the client begins with it. One that does not stays readable as it is, so that
  /// it can be told.
  virtual void handshake(std::shared_ptr<boost::asio::ssl::context> tls, std::function<void(Io)> done) = 0;
  virtual bool is_tls() const = 0;

  /// At least one byte into `into`, which must live until `done`.
  virtual void read_some(std::span<std::uint8_t> into, Done done) = 0;
  /// All of `parts`, whose bytes must live until `done`.
  virtual void write(std::span<const Part> parts, Done done) = 0;

  /// From now: what is under way then ends with kTimeout, and the connection is closed. The last call counts.
  virtual void expire_after(std::chrono::milliseconds time) = 0;
  /// The same while something is written; but the client has as long again where it has taken 4 kB until
  /// then.
  virtual void expire_where_stuck(std::chrono::milliseconds time) = 0;
  virtual void expire_never() = 0;
  /// The same; but `left` is called, once, where the client is found to have left: it is looked every `time`,
  /// until another of these calls.
  virtual void expire_where_left(std::chrono::milliseconds time, std::function<void()> left) = 0;

  /// Says that nothing more is sent, and waits, a second at most, until the client closes too: closing with
  /// unread bytes would reset the connection, and the client might never read the last answer.
  virtual void linger(std::function<void()> done) = 0;
  virtual void close() = 0;

  virtual const Peer& peer() const = 0;
};

class Listener {
 public:
  /// Fails where the address cannot be had, saying which and what to do. `loop` must outlive it.
  static Result<std::unique_ptr<Listener>> open(boost::asio::io_context& loop, const std::string& host,
                                                std::uint16_t port);
  virtual ~Listener() = default;

  virtual std::uint16_t port() const = 0;
  virtual bool loopback() const = 0;  // an address that only this machine reaches
  /// Calls `accepted` with each connection until closed; pauses while the system has no descriptors.
  virtual void accept(std::function<void(std::shared_ptr<Transport>)> accepted) = 0;
  virtual void close() = 0;
};

}  // namespace relievo
