// SPDX-License-Identifier: Apache-2.0
#include <utility>  // before Asio 1.74 in C++20

#include <array>
#include <boost/beast/core.hpp>
#include <boost/beast/http.hpp>
#include <boost/beast/websocket/rfc6455.hpp>
#include <sstream>

#include "base/time.h"
#include "web/gateway/connection.h"
#include "web/gateway/recording_route.h"
#include "web/gateway/request_target.h"

namespace relievo {
namespace {

namespace net = boost::asio;
namespace beast = boost::beast;
namespace http = beast::http;
using ErrorCode = boost::system::error_code;

constexpr std::uint32_t kHeaderLimit = 8 * 1024;
constexpr std::uint64_t kBodyLimit = 4 * 1024;
constexpr std::size_t kReadAtOnce = 4096;
constexpr std::size_t kFileAtOnce = 256 * 1024;

constexpr std::string_view kGoOn = "HTTP/1.1 100 Continue\r\n\r\n";

std::string_view view(beast::string_view text) {
  return {text.data(), text.size()};
}

std::span<const std::uint8_t> bytes_of(std::string_view text) {
  return {reinterpret_cast<const std::uint8_t*>(text.data()), text.size()};
}

class HttpSession : public HttpConnection, public std::enable_shared_from_this<HttpSession> {
 public:
  HttpSession(ConnectionHost& host, std::shared_ptr<Transport> transport,
              std::shared_ptr<net::ssl::context> tls)
      : host_(host), transport_(std::move(transport)), tls_(std::move(tls)) {}

  void start() override;
  void close() override { finish(); }
  void abort() override { finish(); }
  std::optional<std::int64_t> waiting_since_ns() const override { return waiting_since_ns_; }

 private:
  void await_request();
  void parse();
  void read();
  void on_head();
  void on_bad_request(ErrorCode error);
  void on_request();
  std::string list_of(http::field name) const;
  void upgrade(const HttpReply& granted);
  void answer(HttpReply content, bool head, unsigned version, bool keep_alive);
  void reply(HttpReply content, bool head, unsigned version, bool keep_alive);
  void send_file(std::uint64_t offset, bool keep_alive);
  void send_part(std::uint64_t offset, std::size_t n, bool keep_alive);
  void on_replied(bool keep_alive);
  void on_failed(Io io, Refusal why);
  void wait_for_disk(std::function<void()> read, std::function<void()> done, bool takes_long = false);
  void finish();

  ConnectionHost& host_;
  std::shared_ptr<Transport> transport_;  // until finished
  const std::shared_ptr<net::ssl::context> tls_;
  beast::flat_buffer buffer_{kHeaderLimit + kBodyLimit + kReadAtOnce};
  std::optional<http::request_parser<http::string_body>> parser_;
  HttpReply content_;
  std::string head_;
  std::vector<std::uint8_t> file_bytes_;  // on their way, from the disk or to the client
  std::int64_t waiting_since_ns_ = steady_now_ns();
  RequestTarget target_;  // of the request at hand
  bool head_read_ = false;
  bool any_request_ = false;
  bool awaits_request_ = false;
  bool finished_ = false;
};

void HttpSession::start() {
  transport_->expire_after(host_.request_time());
  transport_->handshake(tls_, [self = shared_from_this()](Io io) {
    if (self->finished_) return;
    if (io != Io::kDone) return self->on_failed(io, Refusal::kTls);
    self->await_request();
  });
}

void HttpSession::await_request() {
  parser_.emplace();
  parser_->eager(true);
  parser_->header_limit(kHeaderLimit);
  parser_->body_limit(kBodyLimit);
  head_read_ = false;
  waiting_since_ns_ = steady_now_ns();
  awaits_request_ = true;
  transport_->expire_after(host_.request_time());  // for all of it, however it trickles
  if (buffer_.size() > 0) return parse();
  read();
}

void HttpSession::read() {
  const auto room = buffer_.prepare(kReadAtOnce);
  transport_->read_some({static_cast<std::uint8_t*>(room.data()), room.size()},
                        [self = shared_from_this()](Io io, std::size_t bytes) {
                          if (self->finished_) return;
                          if (io != Io::kDone) return self->on_failed(io, Refusal::kSlow);
                          self->buffer_.commit(bytes);
                          self->parse();
                        });
}

void HttpSession::parse() {
  ErrorCode error;
  buffer_.consume(parser_->put(buffer_.data(), error));
  if (error == http::error::need_more) error = {};
  if (error) return on_bad_request(error);
  if (parser_->is_header_done() && !std::exchange(head_read_, true)) return on_head();
  if (parser_->is_done()) return on_request();
  if (buffer_.size() + kReadAtOnce > buffer_.max_size()) return on_bad_request(http::error::header_limit);
  read();
}

/// What of a request's head leaves no doubt where it goes and where it ends, for which Beast does not look.
void HttpSession::on_head() {
  const auto& request = parser_->get();
  const auto hosts = request.count(http::field::host);
  const auto target = request_target(view(request.target()), view(request[http::field::host]));
  if (!target || hosts > 1 || (hosts == 0 && request.version() >= 11))
    return on_bad_request(http::error::bad_field);
  target_ = *target;
  // Of any other encoding the end cannot be known (RFC 9112, 6.3): what comes would be taken for a request.
  if (request.count(http::field::transfer_encoding) > 0 &&
      !beast::iequals(request[http::field::transfer_encoding], "chunked"))
    return on_bad_request(http::error::bad_transfer_encoding);
  const auto expects = request[http::field::expect];
  if (expects.empty() || request.version() < 11) return parser_->is_done() ? on_request() : parse();
  if (!beast::iequals(expects, "100-continue")) {
    HttpReply content = text_reply(417, "no such expectation is met");
    return reply(std::move(content), false, request.version(), false);
  }
  if (parser_->is_done()) return on_request();
  const std::array parts{bytes_of(kGoOn)};
  transport_->write(parts, [self = shared_from_this()](Io io, std::size_t) {
    if (self->finished_) return;
    if (io != Io::kDone) return self->on_failed(io, Refusal::kSlow);
    self->read();
  });
}

void HttpSession::on_bad_request(ErrorCode error) {
  HttpReply content;
  content.status = error == http::error::header_limit || error == http::error::buffer_overflow ? 431
                   : error == http::error::body_limit                                          ? 413
                                                                                               : 400;
  content.body = content.status == 431   ? "the request's headers are too long\n"
                 : content.status == 413 ? "the request's body is too long\n"
                                         : "this is no HTTP request\n";
  content.refusal = Refusal::kMalformed;
  reply(std::move(content), false, 11, false);
}

/// A header whose value is a list may be given several times (RFC 9110, 5.3).
std::string HttpSession::list_of(http::field name) const {
  std::string list;
  const auto range = parser_->get().equal_range(name);
  for (auto field = range.first; field != range.second; ++field)
    list.append(list.empty() ? "" : ", ").append(view(field->value()));
  return list;
}

void HttpSession::on_request() {
  any_request_ = true;
  const auto& request = parser_->get();
  const auto value = [&](http::field name) { return view(request[name]); };
  const std::string if_match = list_of(http::field::if_match);
  const std::string if_none_match = list_of(http::field::if_none_match);
  const std::string_view method = view(request.method_string());
  HttpReply content = host_.answer({.method = method,
                                    .target = target_.path,
                                    .host = target_.host,
                                    .origin = value(http::field::origin),
                                    .if_match = if_match,
                                    .if_none_match = if_none_match,
                                    .authorization = value(http::field::authorization),
                                    .cookie = value(http::field::cookie),
                                    .range = value(http::field::range),
                                    .if_range = value(http::field::if_range),
                                    .content_type = value(http::field::content_type),
                                    .subprotocols = value(http::field::sec_websocket_protocol),
                                    .body = request.body(),
                                    .upgrade = beast::websocket::is_upgrade(request),
                                    .tls = transport_->is_tls()},
                                   transport_->peer());
  ++host_.counts().requests;
  if (content.websocket) return upgrade(content);
  const bool may_go_on = content.refusal != Refusal::kRate;
  answer(std::move(content), method == "HEAD", request.version(), may_go_on && request.keep_alive());
}

void HttpSession::answer(HttpReply content, bool head, unsigned version, bool keep_alive) {
  if (!content.from_disk) return reply(std::move(content), head, version, keep_alive);
  const auto made = std::make_shared<HttpReply>();
  wait_for_disk([make = std::move(content.from_disk), made] { *made = make(); },
                [this, made, headers = std::move(content.headers), head, version, keep_alive] {
                  made->headers.insert(made->headers.end(), headers.begin(), headers.end());
                  answer(std::move(*made), head, version, keep_alive);
                },
                content.takes_long);
}

/// Not for the client, which has time until then, but is let go where it leaves.
void HttpSession::wait_for_disk(std::function<void()> read, std::function<void()> done, bool takes_long) {
  const auto self = shared_from_this();
  transport_->expire_where_left(host_.request_time(), [self] { self->finish(); });
  host_.from_disk([self, read = std::move(read)] { read(); },
                  [self, done = std::move(done)] {
                    if (!self->finished_) done();
                  },
                  takes_long);
}

void HttpSession::upgrade(const HttpReply& granted) {
  std::ostringstream request;
  request << parser_->get().base();
  const auto behind = buffer_.cdata();
  start_websocket(host_, {.transport = transport_,
                          .request = request.str(),
                          .early = {static_cast<const char*>(behind.data()), behind.size()},
                          .subprotocol = granted.websocket->subprotocol,
                          .feed = host_.make_feed(granted)});
  finished_ = true;  // the transport is the WebSocket's now
  host_.remove(shared_from_this());
}

void HttpSession::reply(HttpReply content, bool head, unsigned version, bool keep_alive) {
  waiting_since_ns_ = steady_now_ns();
  awaits_request_ = false;
  content_ = std::move(content);
  if (content_.refusal) host_.counts().refuse(*content_.refusal);
  http::response<http::empty_body> response(static_cast<http::status>(content_.status), version);
  response.set(http::field::server, "relievo/" RELIEVO_VERSION);
  response.set(http::field::date, utc_text(utc_now_ns(), "%a, %d %b %Y %H:%M:%S GMT"));
  response.set(http::field::content_type, content_.content_type);
  for (const auto& [name, text] : security_headers()) response.set(name, text);
  for (const auto& [name, text] : content_.headers) response.set(name, text);
  response.keep_alive(keep_alive);
  const bool no_body = content_.status == 304 || content_.status == 204;
  if (!no_body) response.content_length(content_.file ? content_.file->length() : content_.bytes().size());
  std::ostringstream text;
  text << response.base();
  head_ = text.str();

  transport_->expire_where_stuck(host_.request_time());
  const std::array parts{bytes_of(head_), bytes_of(head || no_body ? std::string_view() : content_.bytes())};
  if (head) content_.file.reset();
  transport_->write(parts, [self = shared_from_this(), keep_alive](Io io, std::size_t) {
    if (self->finished_) return;
    if (io != Io::kDone) return self->on_failed(io, Refusal::kSlow);
    if (self->content_.file) return self->send_file(0, keep_alive);
    self->on_replied(keep_alive);
  });
}

void HttpSession::send_file(std::uint64_t offset, bool keep_alive) {
  const std::uint64_t left = content_.file->length() - offset;
  if (left == 0) {
    file_bytes_ = {};
    return on_replied(keep_alive);
  }
  file_bytes_.resize(static_cast<std::size_t>(std::min<std::uint64_t>(kFileAtOnce, left)));
  const auto n = std::make_shared<std::size_t>(0);
  wait_for_disk([this, file = content_.file, offset, n] { *n = file->read(offset, file_bytes_); },
                [this, offset, n, keep_alive] { send_part(offset, *n, keep_alive); });
}

void HttpSession::send_part(std::uint64_t offset, std::size_t n, bool keep_alive) {
  if (n == 0) return finish();  // it has become shorter: the client sees that some is missing
  waiting_since_ns_ = steady_now_ns();
  transport_->expire_where_stuck(host_.request_time());
  const std::array parts{Transport::Part(file_bytes_.data(), n)};
  transport_->write(parts, [self = shared_from_this(), offset, n, keep_alive](Io io, std::size_t) {
    if (self->finished_) return;
    if (io != Io::kDone) return self->on_failed(io, Refusal::kSlow);
    self->send_file(offset + n, keep_alive);
  });
}

void HttpSession::on_replied(bool keep_alive) {
  content_.file.reset();
  if (keep_alive) return await_request();
  transport_->linger([self = shared_from_this()] { self->finish(); });
}

void HttpSession::on_failed(Io io, Refusal why) {
  const bool began = awaits_request_ && (buffer_.size() > 0 || parser_->got_some());
  // Between requests browsers keep connections that they do not need: nobody is slow then.
  const bool idle = any_request_ && awaits_request_ && !began;
  if (io == Io::kTimeout ? !idle : why == Refusal::kTls) {
    host_.counts().refuse(why);
  } else if (io == Io::kClosed && began) {
    host_.counts().refuse(Refusal::kMalformed);  // a request without an end
  }
  finish();
}

void HttpSession::finish() {
  if (std::exchange(finished_, true)) return;
  transport_->close();
  transport_.reset();  // and its place, whatever the disk keeps
  host_.remove(shared_from_this());
}

}  // namespace

std::shared_ptr<HttpConnection> HttpConnection::make(ConnectionHost& host,
                                                     std::shared_ptr<Transport> transport,
                                                     std::shared_ptr<net::ssl::context> tls) {
  return std::make_shared<HttpSession>(host, std::move(transport), std::move(tls));
}

}  // namespace relievo
