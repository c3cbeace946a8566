// SPDX-License-Identifier: Apache-2.0
// The sockets. Everything here runs on the gateway's own thread, except the functions of Gateway itself,
// which go through the hub.
#include <utility>  // before Asio 1.74 in C++20

#include "web/gateway/gateway.h"

#include <array>
#include <boost/asio.hpp>
#include <boost/beast/core.hpp>
#include <boost/beast/http.hpp>
#include <boost/beast/websocket.hpp>
#include <chrono>
#include <deque>
#include <set>
#include <thread>

#include "base/log.h"
#include "base/time.h"
#include "web/gateway/hub.h"
#include "web/gateway/protocol.h"
#include "web/gateway/routes.h"

namespace relievo {
namespace {

namespace net = boost::asio;
namespace beast = boost::beast;
namespace http = beast::http;
namespace ws = beast::websocket;
using net::ip::tcp;
using ErrorCode = boost::system::error_code;
using namespace std::chrono_literals;

constexpr auto kHttpTimeout = 15s;  // for a request to arrive whole, and for its answer to leave
constexpr auto kHandshakeTimeout = 10s;
constexpr auto kIdleTimeout = 30s;     // WebSocket: half of it quiet sends a ping
constexpr auto kWriteTimeout = 20s;    // WebSocket: a client that takes longer for one message is gone
constexpr auto kShutdownTime = 500ms;  // for the goodbye, at destruction
constexpr auto kAcceptPause = 100ms;   // after accept() failed, as for want of descriptors
constexpr std::uint32_t kHeaderLimit = 8 * 1024;
constexpr std::uint64_t kBodyLimit = 4 * 1024;
constexpr std::size_t kMessageLimit = 4 * 1024;
constexpr std::size_t kReplyLimit = 16;  // answers owed to a client that sends but does not read
constexpr int kSpareConnections = 64;    // beyond max_clients, for plain HTTP

class Connection {
 public:
  virtual ~Connection() = default;
  virtual void close() = 0;  // politely
  virtual void abort() = 0;  // now
};

class Server;

class WsConnection : public Connection, public std::enable_shared_from_this<WsConnection> {
 public:
  WsConnection(Server& server, tcp::socket socket, std::string stream);
  void start(http::request<http::string_body> request);
  void close() override;
  void abort() override { finish(); }

 private:
  void read();
  void on_message();
  void pump();
  void write_text(std::shared_ptr<const std::string> text);
  void write_frame(FrameMessage frame, std::uint64_t drops);
  void on_written(ErrorCode error);
  void refuse(ws::close_code code, const std::string& why);
  void finish();

  Server& server_;
  ws::stream<tcp::socket> ws_;
  net::steady_timer write_deadline_;
  const std::string stream_;
  http::request<http::string_body> request_;
  std::shared_ptr<Hub::Watcher> watcher_;
  beast::flat_buffer incoming_{kMessageLimit};
  std::deque<std::shared_ptr<const std::string>> replies_;
  std::shared_ptr<const std::string> text_;               // being written, as is
  std::optional<FrameMessage> frame_;                     // this
  std::array<std::uint8_t, kFramePrefixBytes> prefix_{};  // behind this
  int credit_ = 0;
  bool writing_ = false;
  bool closing_ = false;
  bool finished_ = false;
};

class HttpConnection : public Connection, public std::enable_shared_from_this<HttpConnection> {
 public:
  HttpConnection(Server& server, tcp::socket socket) : server_(server), stream_(std::move(socket)) {}
  void start() { read(); }
  void close() override { finish(); }
  void abort() override { finish(); }

 private:
  using Response = http::response<http::span_body<const char>>;

  void read();
  void on_request();
  void on_bad_request(ErrorCode error);
  void reply(HttpReply content, bool head, unsigned version, bool keep_alive);
  void linger();
  void drain();
  void finish();

  Server& server_;
  beast::tcp_stream stream_;
  beast::flat_buffer buffer_{kHeaderLimit + kBodyLimit + 4096};
  std::optional<http::request_parser<http::string_body>> parser_;
  HttpReply content_;
  std::optional<Response> response_;
  std::optional<http::response_serializer<http::span_body<const char>>> serializer_;
  std::array<char, 4096> waste_{};
  std::size_t wasted_ = 0;
};

class Server : public Gateway {
 public:
  explicit Server(const GatewayOptions& options)
      : options_(options), hub_(options.empty_hint, options.key_frame_wanted) {}
  ~Server() override;

  Status listen();
  void run();

  std::uint16_t port() const override { return port_; }
  void announce(const StreamInfo& info) override { hub_.announce(info); }
  void publish(const std::string& stream, const FrameMessage& frame) override { hub_.publish(stream, frame); }
  void publish(const ServerStatus& status) override { hub_.publish(status); }
  void withdraw(const std::string& stream) override { hub_.withdraw(stream); }

  // For connections, on the gateway's thread.
  net::io_context& io() { return io_; }
  Hub& hub() { return hub_; }
  GatewayCounts& counts() { return counts_; }
  RouteContext route_context() const { return {hub_, counts_, options_.max_clients, loopback_}; }
  void add(std::shared_ptr<Connection> connection) { connections_.insert(std::move(connection)); }
  void remove(const std::shared_ptr<Connection>& connection);

 private:
  void accept();
  void on_accept(ErrorCode error, tcp::socket socket);
  void shut_down();

  const GatewayOptions options_;
  Hub hub_;
  net::io_context io_{1};
  tcp::acceptor acceptor_{io_};
  net::steady_timer accept_pause_{io_};
  net::steady_timer shutdown_deadline_{io_};
  std::set<std::shared_ptr<Connection>> connections_;
  GatewayCounts counts_;
  std::uint16_t port_ = 0;
  bool loopback_ = true;
  bool stopping_ = false;
  std::thread thread_;
};

// ---------------------------------------------------------------- WebSocket

WsConnection::WsConnection(Server& server, tcp::socket socket, std::string stream)
    : server_(server), ws_(std::move(socket)), write_deadline_(server.io()), stream_(std::move(stream)) {}

void WsConnection::start(http::request<http::string_body> request) {
  ++server_.counts().clients;
  request_ = std::move(request);
  ws_.set_option(ws::stream_base::timeout{kHandshakeTimeout, kIdleTimeout, true});
  ws_.set_option(ws::stream_base::decorator(
      [](ws::response_type& response) { response.set(http::field::server, "relievo/" RELIEVO_VERSION); }));
  ws_.read_message_max(kMessageLimit);
  ws_.auto_fragment(false);  // a frame leaves as one, straight from the bytes all clients share
  ws_.async_accept(request_, [self = shared_from_this()](ErrorCode error) {
    if (error || self->finished_) return self->finish();
    const std::weak_ptr<WsConnection> weak = self;
    self->watcher_ = self->server_.hub().watch(self->stream_, [weak, &io = self->server_.io()] {
      net::post(io, [weak] {
        if (const auto connection = weak.lock()) connection->pump();
      });
    });
    self->read();
    self->pump();
  });
}

void WsConnection::read() {
  ws_.async_read(incoming_, [self = shared_from_this()](ErrorCode error, std::size_t) {
    if (error) return self->finish();
    self->on_message();
  });
}

void WsConnection::on_message() {
  if (closing_) {
    incoming_.clear();
    return read();
  }
  if (!ws_.got_text()) return refuse(ws::close_code::unknown_data, "text messages only");
  const auto data = incoming_.cdata();
  const auto message = parse_client_message({static_cast<const char*>(data.data()), data.size()});
  if (!message.ok()) return refuse(ws::close_code::policy_error, message.error().message);
  if (message->type == ClientMessage::Type::kCredit) {
    credit_ = std::min(credit_ + message->credit, kMaxCredit);
  } else if (message->type == ClientMessage::Type::kTime) {
    if (replies_.size() >= kReplyLimit) return refuse(ws::close_code::policy_error, "too many questions");
    replies_.push_back(std::make_shared<const std::string>(time_message(message->t0, utc_now_ns())));
  }
  incoming_.clear();
  pump();
  read();
}

void WsConnection::pump() {
  if (writing_ || closing_ || finished_ || !watcher_) return;
  if (!replies_.empty()) {
    auto text = std::move(replies_.front());
    replies_.pop_front();
    return write_text(std::move(text));
  }
  auto delivery = server_.hub().take(*watcher_, credit_ > 0);
  if (!delivery) return;
  if (delivery->text) return write_text(std::move(delivery->text));
  --credit_;
  write_frame(std::move(*delivery->frame), delivery->drops);
}

void WsConnection::write_text(std::shared_ptr<const std::string> text) {
  writing_ = true;
  text_ = std::move(text);
  write_deadline_.expires_after(kWriteTimeout);
  write_deadline_.async_wait([self = shared_from_this()](ErrorCode error) {
    if (!error) self->finish();
  });
  ws_.text(true);
  ws_.async_write(net::buffer(*text_),
                  [self = shared_from_this()](ErrorCode error, std::size_t) { self->on_written(error); });
}

void WsConnection::write_frame(FrameMessage frame, std::uint64_t drops) {
  writing_ = true;
  prefix_ = frame_prefix(frame, drops, utc_now_ns());
  frame_ = std::move(frame);
  write_deadline_.expires_after(kWriteTimeout);
  write_deadline_.async_wait([self = shared_from_this()](ErrorCode error) {
    if (!error) self->finish();
  });
  ws_.binary(true);
  const std::array<net::const_buffer, 2> parts{net::buffer(prefix_), net::buffer(*frame_->data)};
  ws_.async_write(parts, [self = shared_from_this()](ErrorCode error, std::size_t) {
    if (!error) self->server_.hub().count_sent(*self->watcher_, self->frame_->data->size());
    self->frame_.reset();
    self->on_written(error);
  });
}

void WsConnection::on_written(ErrorCode error) {
  writing_ = false;
  text_.reset();
  write_deadline_.cancel();
  if (error) return finish();
  pump();
}

void WsConnection::refuse(ws::close_code code, const std::string& why) {
  ++server_.counts().refused;
  closing_ = true;
  ws_.async_close({code, why}, [self = shared_from_this()](ErrorCode) { self->finish(); });
}

void WsConnection::close() {
  if (closing_ || !ws_.is_open()) return finish();
  closing_ = true;
  ws_.async_close({ws::close_code::going_away, "the server is stopping"},
                  [self = shared_from_this()](ErrorCode) { self->finish(); });
}

void WsConnection::finish() {
  if (std::exchange(finished_, true)) return;
  --server_.counts().clients;
  write_deadline_.cancel();
  if (watcher_) server_.hub().unwatch(watcher_);
  ErrorCode ignored;
  ws_.next_layer().close(ignored);
  server_.remove(shared_from_this());
}

// ---------------------------------------------------------------- HTTP

void HttpConnection::read() {
  parser_.emplace();
  parser_->header_limit(kHeaderLimit);
  parser_->body_limit(kBodyLimit);
  stream_.expires_after(kHttpTimeout);
  http::async_read(stream_, buffer_, *parser_, [self = shared_from_this()](ErrorCode error, std::size_t) {
    if (error) return self->on_bad_request(error);
    self->on_request();
  });
}

void HttpConnection::on_bad_request(ErrorCode error) {
  const bool told = error.category() == make_error_code(http::error::bad_method).category() &&
                    error != http::error::end_of_stream && error != http::error::partial_message;
  if (!told) return finish();
  HttpReply content;
  content.status = error == http::error::header_limit || error == http::error::buffer_overflow ? 431
                   : error == http::error::body_limit                                          ? 413
                                                                                               : 400;
  content.body = content.status == 431   ? "the request's headers are too long\n"
                 : content.status == 413 ? "the request's body is too long\n"
                                         : "this is no HTTP request\n";
  reply(std::move(content), false, 11, false);
}

void HttpConnection::on_request() {
  const auto& request = parser_->get();
  const auto value = [&](http::field name) {
    const auto text = request[name];
    return std::string_view(text.data(), text.size());
  };
  const std::string_view method(request.method_string().data(), request.method_string().size());
  const HttpRequest asked{.method = method,
                          .target = {request.target().data(), request.target().size()},
                          .host = value(http::field::host),
                          .origin = value(http::field::origin),
                          .if_none_match = value(http::field::if_none_match),
                          .upgrade = ws::is_upgrade(request)};
  HttpReply content = answer(asked, server_.route_context());
  ++server_.counts().requests;
  if (!content.websocket_stream.empty()) {
    stream_.expires_never();
    const auto connection = std::make_shared<WsConnection>(server_, stream_.release_socket(),
                                                           std::move(content.websocket_stream));
    server_.add(connection);
    connection->start(parser_->release());
    return finish();
  }
  if (content.status == 403 || content.status == 421 || content.status == 503) ++server_.counts().refused;
  reply(std::move(content), method == "HEAD", request.version(), request.keep_alive());
}

void HttpConnection::reply(HttpReply content, bool head, unsigned version, bool keep_alive) {
  content_ = std::move(content);
  response_.emplace(static_cast<http::status>(content_.status), version);
  response_->set(http::field::server, "relievo/" RELIEVO_VERSION);
  response_->set(http::field::content_type, content_.content_type);
  for (const auto& [name, text] : security_headers()) response_->set(name, text);
  for (const auto& [name, text] : content_.headers) response_->set(name, text);
  response_->keep_alive(keep_alive);
  const std::string_view bytes = content_.bytes();
  if (content_.status != 304) response_->content_length(bytes.size());
  if (!head && content_.status != 304) response_->body() = {bytes.data(), bytes.size()};

  serializer_.emplace(*response_);
  stream_.expires_after(kHttpTimeout);
  auto done = [self = shared_from_this(), keep_alive](ErrorCode error, std::size_t) {
    if (error) return self->finish();
    if (!keep_alive) return self->linger();
    self->read();
  };
  if (head || content_.status == 304) {
    http::async_write_header(stream_, *serializer_, std::move(done));
  } else {
    http::async_write(stream_, *serializer_, std::move(done));
  }
}

// Closing with unread bytes would reset the connection, and the client might never read why.
void HttpConnection::linger() {
  ErrorCode ignored;
  stream_.socket().shutdown(tcp::socket::shutdown_send, ignored);
  stream_.expires_after(1s);
  drain();
}

void HttpConnection::drain() {
  stream_.async_read_some(net::buffer(waste_), [self = shared_from_this()](ErrorCode error, std::size_t n) {
    self->wasted_ += n;
    if (error || self->wasted_ > 256 * 1024) return self->finish();
    self->drain();
  });
}

void HttpConnection::finish() {
  stream_.close();
  server_.remove(shared_from_this());
}

// ---------------------------------------------------------------- the server

std::string explain(ErrorCode error) {
  if (error == net::error::address_in_use) {
    return "the port is in use: stop what listens there or give another";
  }
  if (error == net::error::access_denied) return "not allowed: give a port above 1023";
  return error.message() + ": give an address of this machine";
}

Status Server::listen() {
  ErrorCode error;
  const std::string place = options_.host + ":" + std::to_string(options_.port);
  tcp::resolver resolver(io_);
  const auto found = resolver.resolve(options_.host, std::to_string(options_.port),
                                      tcp::resolver::passive | tcp::resolver::numeric_service, error);
  if (error || found.empty()) return Error{"cannot listen on " + place + ": " + explain(error)};
  const tcp::endpoint endpoint = found.begin()->endpoint();
  acceptor_.open(endpoint.protocol(), error);
  if (!error) acceptor_.set_option(net::socket_base::reuse_address(true), error);
  if (!error) acceptor_.bind(endpoint, error);
  if (!error) acceptor_.listen(net::socket_base::max_listen_connections, error);
  if (!error) port_ = acceptor_.local_endpoint(error).port();
  if (error) return Error{"cannot listen on " + place + ": " + explain(error)};
  loopback_ = endpoint.address().is_loopback();
  if (!loopback_) {
    log_warning("anyone who reaches " + place + " can watch: there is no password and no encryption yet");
  }
  return {};
}

void Server::run() {
  accept();
  thread_ = std::thread([this] {
    for (;;) {
      try {
        io_.run();
        return;
      } catch (const std::exception& failure) {
        log_error(std::string("web gateway: a connection failed: ") + failure.what());
      }
    }
  });
}

void Server::accept() {
  acceptor_.async_accept(
      [this](ErrorCode error, tcp::socket socket) { on_accept(error, std::move(socket)); });
}

void Server::on_accept(ErrorCode error, tcp::socket socket) {
  if (stopping_) return;
  if (error) {
    accept_pause_.expires_after(kAcceptPause);
    accept_pause_.async_wait([this](ErrorCode cancelled) {
      if (!cancelled && !stopping_) accept();
    });
    return;
  }
  ++counts_.connections;
  if (connections_.size() >= static_cast<std::size_t>(options_.max_clients + kSpareConnections)) {
    ++counts_.refused;
  } else {
    ErrorCode ignored;
    socket.set_option(tcp::no_delay(true), ignored);
    const auto connection = std::make_shared<HttpConnection>(*this, std::move(socket));
    add(connection);
    connection->start();
  }
  accept();
}

void Server::remove(const std::shared_ptr<Connection>& connection) {
  connections_.erase(connection);
  // Timers inside Beast's streams may still be pending; nobody waits for them.
  if (stopping_ && connections_.empty()) io_.stop();
}

void Server::shut_down() {
  stopping_ = true;
  ErrorCode ignored;
  acceptor_.close(ignored);
  accept_pause_.cancel();
  const auto closing = connections_;  // each leaves the set as it closes
  for (const auto& connection : closing) connection->close();
  if (connections_.empty()) return io_.stop();
  shutdown_deadline_.expires_after(kShutdownTime);
  shutdown_deadline_.async_wait([this](ErrorCode) {
    const auto rest = connections_;
    for (const auto& connection : rest) connection->abort();
  });
}

Server::~Server() {
  if (!thread_.joinable()) return;
  net::post(io_, [this] { shut_down(); });
  thread_.join();
}

}  // namespace

Result<std::unique_ptr<Gateway>> Gateway::start(const GatewayOptions& options) {
  auto server = std::make_unique<Server>(options);
  if (auto status = server->listen(); !status) return status.error();
  server->run();
  return std::unique_ptr<Gateway>(std::move(server));
}

}  // namespace relievo
