// SPDX-License-Identifier: Apache-2.0
#include <utility>  // before Asio 1.74 in C++20

#include <array>
#include <boost/asio.hpp>
#include <boost/beast/core.hpp>
#include <boost/beast/websocket.hpp>
#include <chrono>

#include "base/time.h"
#include "web/gateway/connection.h"
#include "web/gateway/limits.h"

namespace relievo {
namespace {

namespace net = boost::asio;
namespace beast = boost::beast;
namespace http = beast::http;
namespace ws = beast::websocket;
using ErrorCode = boost::system::error_code;
using namespace std::chrono_literals;

constexpr auto kHandshakeTimeout = 10s;
constexpr auto kIdleTimeout = 30s;  // half of it quiet sends a ping
constexpr std::size_t kMessageLimit = 4 * 1024;
constexpr Rate kMessageRate{.per_s = 500, .burst = 1000};

/// A transport as Beast's stream wants it.
class BeastStream {
 public:
  using executor_type = net::io_context::executor_type;

  /// `early` was read already.
  BeastStream(net::io_context& loop, std::shared_ptr<Transport> transport, std::string early)
      : loop_(&loop), transport_(std::move(transport)), early_(std::move(early)) {}
  executor_type get_executor() const { return loop_->get_executor(); }
  Transport& transport() { return *transport_; }

  template <typename Buffers, typename Handler>
  auto async_read_some(const Buffers& buffers, Handler&& handler) {
    return net::async_initiate<Handler, void(ErrorCode, std::size_t)>(
        [this](auto done, const auto& where) {
          const net::mutable_buffer first = beast::buffers_front(where);
          if (!early_.empty()) {
            const std::size_t n = net::buffer_copy(first, net::buffer(early_));
            early_.erase(0, n);
            return net::post(*loop_, beast::bind_front_handler(std::move(done), ErrorCode(), n));
          }
          transport_->read_some({static_cast<std::uint8_t*>(first.data()), first.size()},
                                callback(std::move(done)));
        },
        handler, buffers);
  }

  template <typename Buffers, typename Handler>
  auto async_write_some(const Buffers& buffers, Handler&& handler) {
    return net::async_initiate<Handler, void(ErrorCode, std::size_t)>(
        [this](auto done, const auto& what) {
          std::vector<Transport::Part> parts;
          for (const net::const_buffer part : beast::buffers_range_ref(what)) {
            parts.emplace_back(static_cast<const std::uint8_t*>(part.data()), part.size());
          }
          transport_->write(parts, callback(std::move(done)));
        },
        handler, buffers);
  }

 private:
  static ErrorCode error_of(Io io) {
    if (io == Io::kDone) return {};
    return io == Io::kTimeout ? net::error::timed_out : net::error::connection_reset;
  }
  // Beast's handlers can only be moved, functions only hold what can be copied.
  template <typename Handler>
  static Transport::Done callback(Handler handler) {
    return [done = std::make_shared<Handler>(std::move(handler))](Io io, std::size_t bytes) {
      (*done)(error_of(io), bytes);
    };
  }

  net::io_context* loop_;
  std::shared_ptr<Transport> transport_;
  std::string early_;
};

// Beast finds these three by their argument.
template <typename Handler>
void async_teardown(beast::role_type, BeastStream& stream, Handler&& handler) {
  using Kept = std::decay_t<Handler>;
  stream.transport().linger(
      [done = std::make_shared<Kept>(std::forward<Handler>(handler))] { (*done)(ErrorCode()); });
}
[[maybe_unused]] void teardown(beast::role_type, BeastStream& stream, ErrorCode& error) {
  stream.transport().close();
  error = {};
}
[[maybe_unused]] void beast_close_socket(BeastStream& stream) {
  stream.transport().close();
}

class WsConnection : public Connection, public std::enable_shared_from_this<WsConnection> {
 public:
  WsConnection(ConnectionHost& host, WsUpgrade upgrade)
      : host_(host),
        transport_(upgrade.transport),
        ws_(host.loop(), upgrade.transport, std::move(upgrade.early)),
        head_(std::move(upgrade.request)),
        subprotocol_(std::move(upgrade.subprotocol)),
        feed_(std::move(upgrade.feed)),
        messages_(kMessageRate, steady_now_ns()) {}

  void start();
  void close() override;
  void abort() override { finish(); }

 private:
  void open();
  void on_no_upgrade();
  void read();
  void on_message();
  void pump();
  void refuse(const WsClose& close);
  void fail(ErrorCode error);
  void finish();

  ConnectionHost& host_;
  const std::shared_ptr<Transport> transport_;
  ws::stream<BeastStream> ws_;
  const std::string head_;
  http::request_parser<http::empty_body> request_;
  const std::string subprotocol_;
  std::unique_ptr<WsFeed> feed_;  // until finished
  Bucket messages_;
  beast::flat_buffer incoming_{kMessageLimit};
  std::optional<WsOutgoing> outgoing_;  // being written
  bool started_ = false;
  bool closing_ = false;
  bool finished_ = false;
};

void WsConnection::start() {
  ++host_.counts().clients;
  transport_->expire_never();
  ws_.set_option(ws::stream_base::timeout{kHandshakeTimeout, kIdleTimeout, true});
  ws_.set_option(ws::stream_base::decorator([protocol = subprotocol_](ws::response_type& response) {
    response.set(beast::http::field::server, "relievo/" RELIEVO_VERSION);
    if (!protocol.empty()) response.set(beast::http::field::sec_websocket_protocol, protocol);
  }));
  ws_.read_message_max(kMessageLimit);
  // Pings count as messages do. Nothing can be said from within.
  ws_.control_callback([this](ws::frame_type kind, beast::string_view) {
    if (kind != ws::frame_type::ping || finished_ || messages_.take(steady_now_ns())) return;
    host_.counts().refuse(Refusal::kMessage);
    net::post(host_.loop(), [self = shared_from_this()] { self->finish(); });
  });
  ws_.auto_fragment(false);  // a frame leaves as one, straight from the bytes all clients share
  // Given as bytes it may have 1.5 kB at most, which cookies of others exceed.
  request_.header_limit(static_cast<std::uint32_t>(head_.size()));
  ErrorCode error;
  request_.put(net::buffer(head_), error);
  if (error) return finish();
  ws_.async_accept(request_.get(), [self = shared_from_this()](ErrorCode failed) {
    if (self->finished_) return;
    if (failed == ws::condition::handshake_failed) return self->on_no_upgrade();
    if (failed) return self->fail(failed);
    self->open();
  });
}

/// Beast has answered it, with 400 or 426.
void WsConnection::on_no_upgrade() {
  host_.counts().refuse(Refusal::kMessage);
  transport_->linger([self = shared_from_this()] { self->finish(); });
}

void WsConnection::open() {
  started_ = true;
  feed_->start([weak = weak_from_this(), &loop = host_.loop()] {
    net::post(loop, [weak] {
      if (const auto connection = weak.lock()) connection->pump();
    });
  });
  read();
  pump();
}

void WsConnection::read() {
  ws_.async_read(incoming_, [self = shared_from_this()](ErrorCode error, std::size_t) {
    if (error == ws::error::message_too_big || error == ws::error::buffer_overflow ||
        error == ws::condition::protocol_violation) {
      self->host_.counts().refuse(Refusal::kMessage);  // Beast has said 1009 or 1002
    }
    if (error) return self->fail(error);
    self->on_message();
  });
}

void WsConnection::on_message() {
  if (finished_) return;
  const auto data = incoming_.cdata();
  const std::span bytes(static_cast<const std::uint8_t*>(data.data()), data.size());
  if (!closing_) {
    std::optional<WsClose> wrong;
    if (!messages_.take(steady_now_ns())) {
      wrong = WsClose{1008, "too many messages"};
    } else if (ws_.got_text()) {
      wrong = feed_->on_text({static_cast<const char*>(data.data()), data.size()});
    } else {
      wrong = feed_->on_binary(bytes);
    }
    if (wrong) refuse(*wrong);
  }
  incoming_.clear();
  pump();
  read();
}

void WsConnection::pump() {
  if (outgoing_ || !started_ || closing_ || finished_) return;
  outgoing_ = feed_->next();
  if (!outgoing_) return;
  transport_->expire_after(host_.message_time());
  ws_.text(outgoing_->text != nullptr);
  std::array<net::const_buffer, 2> parts;
  if (outgoing_->text) {
    parts[0] = net::buffer(*outgoing_->text);
  } else {
    parts[0] = net::buffer(outgoing_->head);
    if (outgoing_->data) parts[1] = net::buffer(*outgoing_->data);
  }
  ws_.async_write(parts, [self = shared_from_this()](ErrorCode error, std::size_t) {
    if (error || self->finished_) return self->fail(error);
    self->transport_->expire_never();
    self->feed_->on_sent(*self->outgoing_);
    self->outgoing_.reset();
    self->pump();
  });
}

void WsConnection::refuse(const WsClose& close) {
  host_.counts().refuse(Refusal::kMessage);
  closing_ = true;
  ws_.async_close({static_cast<ws::close_code>(close.code), close.why},
                  [self = shared_from_this()](ErrorCode) { self->finish(); });
}

/// Reading and writing both do where the client did not take its message in time: the first of them counts.
void WsConnection::fail(ErrorCode error) {
  if (!finished_ && error == net::error::timed_out) host_.counts().refuse(Refusal::kSlow);
  finish();
}

void WsConnection::close() {
  if (closing_ || !ws_.is_open()) return finish();
  closing_ = true;
  ws_.async_close({ws::close_code::going_away, "the server is stopping"},
                  [self = shared_from_this()](ErrorCode) { self->finish(); });
}

void WsConnection::finish() {
  if (std::exchange(finished_, true)) return;
  --host_.counts().clients;
  feed_.reset();
  transport_->close();
  host_.remove(shared_from_this());
}

}  // namespace

void start_websocket(ConnectionHost& host, WsUpgrade upgrade) {
  const auto connection = std::make_shared<WsConnection>(host, std::move(upgrade));
  host.add(connection);
  connection->start();
}

}  // namespace relievo
