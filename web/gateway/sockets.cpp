// SPDX-License-Identifier: Apache-2.0
#include <utility>  // before Asio 1.74 in C++20

#include "web/gateway/sockets.h"

#include <array>
#include <boost/asio.hpp>
#include <boost/asio/ssl.hpp>
#include <optional>
#include <vector>

#include "web/gateway/tcp_state.h"

namespace relievo {
namespace {

namespace net = boost::asio;
namespace ssl = net::ssl;
using net::ip::tcp;
using ErrorCode = boost::system::error_code;
using namespace std::chrono_literals;

constexpr auto kLingerTime = 1s;
constexpr std::size_t kLingerBytes = 256 * 1024;
constexpr std::uint64_t kNotStuck_bytes = 4 * 1024;  // taken until a deadline
constexpr auto kAcceptPause = 100ms;                 // after accept() failed, as for want of descriptors
constexpr std::uint8_t kTlsHandshakeRecord = 22;     // RFC 8446, 5.1

Peer peer_of(const tcp::socket& socket) {
  ErrorCode error;
  net::ip::address address = socket.remote_endpoint(error).address();
  if (address.is_v6() && address.to_v6().is_v4_mapped()) {
    address = net::ip::make_address_v4(net::ip::v4_mapped, address.to_v6());
  }
  if (address.is_v6() && !address.is_loopback()) {
    // Whoever has one address has its whole network of 64 bits.
    auto bytes = address.to_v6().to_bytes();
    std::fill(bytes.begin() + 8, bytes.end(), std::uint8_t{0});
    return {net::ip::address_v6(bytes).to_string() + "/64", false};
  }
  return {address.to_string(), address.is_loopback()};
}

class TcpTransport : public Transport, public std::enable_shared_from_this<TcpTransport> {
 public:
  explicit TcpTransport(tcp::socket socket)
      : socket_(std::move(socket)), timer_(socket_.get_executor()), peer_(peer_of(socket_)) {
    ErrorCode ignored;
    socket_.set_option(tcp::no_delay(true), ignored);
    socket_.non_blocking(true, ignored);
  }

  void handshake(std::shared_ptr<ssl::context> tls, std::function<void(Io)> done) override;
  bool is_tls() const override { return tls_.has_value(); }
  void read_some(std::span<std::uint8_t> into, Done done) override;
  void write(std::span<const Part> parts, Done done) override;
  void expire_after(std::chrono::milliseconds time) override { set_deadline(time, std::nullopt); }
  void expire_where_stuck(std::chrono::milliseconds time) override {
    set_deadline(time, acknowledged_bytes(socket_.native_handle()));
  }
  void expire_never() override;
  void expire_where_left(std::chrono::milliseconds time, std::function<void()> left) override;
  void linger(std::function<void()> done) override;
  void close() override;
  const Peer& peer() const override { return peer_; }

 private:
  Io outcome(const ErrorCode& error) const {
    return !error ? Io::kDone : timed_out_ ? Io::kTimeout : Io::kClosed;
  }
  void set_deadline(std::chrono::milliseconds time, std::optional<std::uint64_t> acknowledged);
  void drain(std::shared_ptr<std::function<void()>> done);

  tcp::socket socket_;
  net::steady_timer timer_;
  std::uint64_t deadline_ = 0;  // which one is the last
  bool timed_out_ = false;
  const Peer peer_;
  std::shared_ptr<ssl::context> context_;  // outlives tls_
  std::optional<ssl::stream<tcp::socket&>> tls_;
  std::array<std::uint8_t, 4096> waste_{};
  std::size_t wasted_ = 0;
};

void TcpTransport::handshake(std::shared_ptr<ssl::context> tls, std::function<void(Io)> done) {
  if (!tls) {
    net::post(socket_.get_executor(), [done = std::move(done)] { done(Io::kDone); });
    return;
  }
  socket_.async_wait(tcp::socket::wait_read, [self = shared_from_this(), tls = std::move(tls),
                                              done = std::move(done)](ErrorCode error) mutable {
    std::uint8_t first = 0;
    if (!error) {
      self->socket_.receive(net::buffer(&first, 1), tcp::socket::message_peek, error);
      if (error == net::error::would_block) return self->handshake(std::move(tls), std::move(done));
    }
    if (error || first != kTlsHandshakeRecord) return done(self->outcome(error));
    self->context_ = std::move(tls);
    self->tls_.emplace(self->socket_, *self->context_);
    self->tls_->async_handshake(ssl::stream_base::server, [self, done = std::move(done)](ErrorCode failed) {
      done(self->outcome(failed));
    });
  });
}

void TcpTransport::read_some(std::span<std::uint8_t> into, Done done) {
  auto handler = [self = shared_from_this(), done = std::move(done)](ErrorCode error, std::size_t n) {
    done(self->outcome(error), n);
  };
  const auto buffer = net::buffer(into.data(), into.size());
  if (tls_) {
    tls_->async_read_some(buffer, std::move(handler));
  } else {
    socket_.async_read_some(buffer, std::move(handler));
  }
}

void TcpTransport::write(std::span<const Part> parts, Done done) {
  std::vector<net::const_buffer> buffers;
  for (const Part& part : parts) buffers.emplace_back(part.data(), part.size());
  auto handler = [self = shared_from_this(), done = std::move(done)](ErrorCode error, std::size_t n) {
    done(self->outcome(error), n);
  };
  if (tls_) {
    net::async_write(*tls_, std::move(buffers), std::move(handler));
  } else {
    net::async_write(socket_, std::move(buffers), std::move(handler));
  }
}

/// `acknowledged`: by then, of which a client that is not stuck acknowledges more; nothing: none has more
/// time.
void TcpTransport::set_deadline(std::chrono::milliseconds time, std::optional<std::uint64_t> acknowledged) {
  const std::uint64_t deadline = ++deadline_;
  timer_.expires_after(time);
  timer_.async_wait([weak = weak_from_this(), deadline, time, acknowledged](ErrorCode error) {
    const auto self = weak.lock();
    if (error || !self || self->deadline_ != deadline) return;
    if (acknowledged && acknowledged_bytes(self->socket_.native_handle()) >= *acknowledged + kNotStuck_bytes)
      return self->expire_where_stuck(time);
    self->timed_out_ = true;
    self->close();
  });
}

void TcpTransport::expire_never() {
  ++deadline_;
  timer_.cancel();
}

void TcpTransport::expire_where_left(std::chrono::milliseconds time, std::function<void()> left) {
  const std::uint64_t deadline = ++deadline_;
  timer_.expires_after(time);
  timer_.async_wait([weak = weak_from_this(), deadline, time, left = std::move(left)](ErrorCode error) {
    const auto self = weak.lock();
    if (error || !self || self->deadline_ != deadline) return;
    if (!has_left(self->socket_.native_handle())) return self->expire_where_left(time, left);
    left();
  });
}

void TcpTransport::linger(std::function<void()> done) {
  expire_after(kLingerTime);
  if (tls_) {
    tls_->async_shutdown([self = shared_from_this(), done = std::move(done)](ErrorCode) {
      self->close();
      done();
    });
    return;
  }
  ErrorCode ignored;
  socket_.shutdown(tcp::socket::shutdown_send, ignored);
  drain(std::make_shared<std::function<void()>>(std::move(done)));
}

void TcpTransport::drain(std::shared_ptr<std::function<void()>> done) {
  socket_.async_read_some(net::buffer(waste_),
                          [self = shared_from_this(), done](ErrorCode error, std::size_t n) {
                            self->wasted_ += n;
                            if (!error && self->wasted_ <= kLingerBytes) return self->drain(done);
                            self->close();
                            (*done)();
                          });
}

void TcpTransport::close() {
  expire_never();
  ErrorCode ignored;
  socket_.close(ignored);
}

std::string explain(const ErrorCode& error) {
  if (error == net::error::address_in_use) {
    return "the port is in use: stop what listens there or give another";
  }
  if (error == net::error::access_denied) return "not allowed: give a port above 1023";
  return error.message() + ": give an address of this machine";
}

class TcpListener : public Listener {
 public:
  explicit TcpListener(net::io_context& loop) : acceptor_(loop), pause_(loop) {}

  Status listen(const std::string& host, std::uint16_t port);
  std::uint16_t port() const override { return port_; }
  bool loopback() const override { return loopback_; }
  void accept(std::function<void(std::shared_ptr<Transport>)> accepted) override {
    accepted_ = std::move(accepted);
    accept_next();
  }
  void close() override {
    closed_ = true;
    ErrorCode ignored;
    acceptor_.close(ignored);
    pause_.cancel();
  }

 private:
  ErrorCode listen(const tcp::endpoint& endpoint, bool also_ipv4);
  ErrorCode listen_everywhere(std::uint16_t port);
  void accept_next();

  tcp::acceptor acceptor_;
  net::steady_timer pause_;
  std::function<void(std::shared_ptr<Transport>)> accepted_;
  std::uint16_t port_ = 0;
  bool loopback_ = true;
  bool closed_ = false;
};

Status TcpListener::listen(const std::string& host, std::uint16_t port) {
  const std::string place = host + ":" + std::to_string(port);
  ErrorCode error;
  if (host.empty()) {
    error = listen_everywhere(port);
  } else {
    tcp::resolver resolver(acceptor_.get_executor());
    const auto found = resolver.resolve(host, std::to_string(port),
                                        tcp::resolver::passive | tcp::resolver::numeric_service, error);
    if (error || found.empty()) return Error{"cannot listen on " + place + ": " + explain(error)};
    error = listen(found.begin()->endpoint(), false);
  }
  if (!error) port_ = acceptor_.local_endpoint(error).port();
  if (error) return Error{"cannot listen on " + place + ": " + explain(error)};
  loopback_ = acceptor_.local_endpoint(error).address().is_loopback();
  return {};
}

/// By IPv6, which takes IPv4 along, unless this machine has none.
ErrorCode TcpListener::listen_everywhere(std::uint16_t port) {
  const ErrorCode error = listen({tcp::v6(), port}, true);
  if (!error || error == net::error::address_in_use || error == net::error::access_denied) return error;
  return listen({tcp::v4(), port}, false);
}

ErrorCode TcpListener::listen(const tcp::endpoint& endpoint, bool also_ipv4) {
  ErrorCode error;
  acceptor_.close(error);
  acceptor_.open(endpoint.protocol(), error);
  if (!error) acceptor_.set_option(net::socket_base::reuse_address(true), error);
  if (!error && also_ipv4) acceptor_.set_option(net::ip::v6_only(false), error);
  if (!error) acceptor_.bind(endpoint, error);
  if (!error) acceptor_.listen(net::socket_base::max_listen_connections, error);
  return error;
}

void TcpListener::accept_next() {
  acceptor_.async_accept([this](ErrorCode error, tcp::socket socket) {
    if (closed_) return;
    if (!error) {
      accepted_(std::make_shared<TcpTransport>(std::move(socket)));
      return accept_next();
    }
    pause_.expires_after(kAcceptPause);
    pause_.async_wait([this](ErrorCode cancelled) {
      if (!cancelled && !closed_) accept_next();
    });
  });
}

}  // namespace

Result<std::unique_ptr<Listener>> Listener::open(net::io_context& loop, const std::string& host,
                                                 std::uint16_t port) {
  auto listener = std::make_unique<TcpListener>(loop);
  if (const Status listening = listener->listen(host, port); !listening) return listening.error();
  return std::unique_ptr<Listener>(std::move(listener));
}

}  // namespace relievo
