// SPDX-License-Identifier: Apache-2.0
// The server: its thread, who may connect, and how it ends. Everything here runs on the gateway's own thread,
// except the functions of Gateway itself, which go through the hub.
#include <utility>  // before Asio 1.74 in C++20

#include "web/gateway/gateway.h"

#include <algorithm>
#include <boost/asio/io_context.hpp>
#include <boost/asio/post.hpp>
#include <boost/asio/steady_timer.hpp>
#include <boost/asio/thread_pool.hpp>
#include <limits>
#include <set>
#include <thread>

#include "base/log.h"
#include "base/thread_name.h"
#include "base/time.h"
#include "web/gateway/access.h"
#include "web/gateway/connection.h"
#include "web/gateway/cut_recordings.h"
#include "web/gateway/foxglove_feed.h"
#include "web/gateway/hub.h"
#include "web/gateway/limits.h"
#include "web/gateway/routes.h"
#include "web/gateway/stream_feed.h"

namespace relievo {
namespace {

namespace net = boost::asio;
using namespace std::chrono_literals;

constexpr auto kShutdownTime = 500ms;  // for the goodbye, at destruction
constexpr int kSpareConnections = 64;  // beyond max_clients, for plain HTTP
constexpr int kPerAddress = 32;
constexpr int kDiskThreads = 2;  // one that a disk keeps waiting leaves one for others
constexpr double kRequestsPerSecond = 200;
constexpr double kBurst_s = 5;  // of requests at that rate, at once
constexpr double kUnlimited = std::numeric_limits<int>::max();

/// Of one address that is not this machine, or of each, where the options say so.
int connections_of(const WebOptions& options, bool loopback) {
  return options.max_per_address.value_or(loopback ? std::numeric_limits<int>::max() : kPerAddress);
}
Rate requests_of(const WebOptions& options, bool loopback) {
  const double rate = options.max_rate.value_or(loopback ? kUnlimited : kRequestsPerSecond);
  return {.per_s = rate, .burst = std::max(1.0, kBurst_s * rate)};
}

/// What the options' files hold.
struct Credentials {
  Tokens tokens = Tokens::none();
  std::optional<TlsFiles> tls;

  static Result<Credentials> load(const WebOptions& web) {
    Credentials out;
    if (!web.token_file.empty()) {
      auto loaded = Tokens::load(web.token_file);
      if (!loaded) return loaded.error();
      out.tokens = *std::move(loaded);
    }
    if (!web.tls_cert.empty()) {
      auto loaded = TlsFiles::load(web.tls_cert, web.tls_key);
      if (!loaded) return loaded.error();
      out.tls = *std::move(loaded);
    }
    return out;
  }
  void replace_with(Credentials newer) {
    tokens = std::move(newer.tokens);
    if (tls && newer.tls)
      tls->replace_with(*std::move(newer.tls));
    else
      tls = std::move(newer.tls);
    if (tls) tls->warn_of_dates();
  }
};

class Server : public Gateway, private ConnectionHost {
 public:
  Server(const GatewayOptions& options, Credentials credentials)
      : options_(options),
        web_(options.web),
        credentials_(std::move(credentials)),
        hub_(options.empty_hint, options.key_frame_wanted),
        limits_(connections_of(web_, false), requests_of(web_, false)),
        own_limits_(connections_of(web_, true), requests_of(web_, true)) {}
  ~Server() override;

  Status listen();
  void run();

  std::uint16_t port() const override { return listener_->port(); }
  std::string made_token() const override { return made_ ? made_->first() : std::string(); }
  Status apply(const WebOptions& web) override;
  void announce(const StreamInfo& info, ServerClock clock) override { hub_.announce(info, clock); }
  void publish(const std::string& stream, const FrameMessage& frame) override { hub_.publish(stream, frame); }
  void publish(const ServerStatus& status) override;
  void offer(const std::string& stream, const OfferedRecording& recording) override {
    hub_.offer(stream, recording);
  }
  int watchers(const std::string& stream, Rung rung) const override { return hub_.watchers(stream, rung); }
  void set_clock(const std::string& stream, std::int64_t offset_ns) override {
    hub_.set_clock(stream, offset_ns);
  }
  void withdraw(const std::string& stream) override { hub_.withdraw(stream); }

 private:
  net::io_context& loop() override { return io_; }
  GatewayCounts& counts() override { return counts_; }
  HttpReply answer(const HttpRequest& request, const Peer& peer) override;
  std::unique_ptr<WsFeed> make_feed(const HttpReply& reply) override {
    if (reply.websocket->stream.empty()) return make_foxglove_feed(hub_, *options_.samples, session_);
    return make_stream_feed(hub_, reply.websocket->stream);
  }
  std::chrono::milliseconds request_time() const override { return options_.request_time; }
  std::chrono::milliseconds message_time() const override { return options_.message_time; }
  void from_disk(std::function<void()> read, std::function<void()> done, bool takes_long) override {
    net::post(takes_long ? walks_ : disk_, [this, read = std::move(read), done = std::move(done)]() mutable {
      read();
      // `read` goes along: what it holds, the last of a session perhaps, ends on the loop's thread.
      net::post(io_, [read = std::move(read), done = std::move(done)] { done(); });
    });
  }
  void add(std::shared_ptr<Connection> connection) override { connections_.insert(std::move(connection)); }
  void remove(const std::shared_ptr<Connection>& connection) override;

  AddressLimits& limits_for(const Peer& peer) { return peer.loopback ? own_limits_ : limits_; }
  void on_accept(std::shared_ptr<Transport> transport);
  bool make_room();
  void shut_down();

  const GatewayOptions options_;
  const std::string session_ = std::to_string(utc_now_ns());  // by which clients know this run again
  WebOptions web_;                                            // as they are now
  Credentials credentials_;
  std::optional<Tokens> made_;  // for this run
  Hub hub_;
  AddressLimits limits_, own_limits_;
  net::io_context io_{1};
  CutRecordings cuts_;                   // outlives what reads them
  net::thread_pool disk_{kDiskThreads};  // waits for slow disks, so that the loop does not
  net::thread_pool walks_{1};            // goes through long files, so that those do not
  std::unique_ptr<Listener> listener_;
  net::steady_timer shutdown_deadline_{io_};
  std::set<std::shared_ptr<Connection>> connections_;
  GatewayCounts counts_;
  bool stopping_ = false;
  std::thread thread_;
};

HttpReply Server::answer(const HttpRequest& request, const Peer& peer) {
  if (!limits_for(peer).request(peer.address, steady_now_ns())) {
    HttpReply reply;
    reply.status = 429;
    reply.body = "too many requests from " + peer.address + "\n";
    reply.headers = {{"Retry-After", "1"}, {"Cache-Control", "no-store"}};
    reply.refusal = Refusal::kRate;
    return reply;
  }
  credentials_.tokens.reload();  // also on a connection that has been open since before
  counts_.certificate_expiry_s.reset();
  if (credentials_.tls) counts_.certificate_expiry_s = credentials_.tls->expiry_s();
  return relievo::answer(request, {.hub = hub_,
                                   .counts = counts_,
                                   .tokens = credentials_.tokens,
                                   .options = web_,
                                   .cuts = cuts_,
                                   .recordings = options_.recordings,
                                   .rigs = options_.rigs,
                                   .calibrations = options_.calibrations,
                                   .stages = options_.stages,
                                   .refused_peers = options_.refused_peers,
                                   .foxglove = options_.samples.has_value(),
                                   .port = listener_->port(),
                                   .loopback = listener_->loopback()});
}

Status Server::listen() {
  auto listener = Listener::open(io_, options_.host, options_.port);
  if (!listener) return listener.error();
  listener_ = *std::move(listener);
  if (credentials_.tls) credentials_.tls->warn_of_dates();
  if (listener_->loopback()) return {};
  const std::string place = options_.host + ":" + std::to_string(listener_->port());
  Tokens& tokens = credentials_.tokens;
  if (!web_.open.value_or(false) && !tokens.needed()) {
    auto made = Tokens::make();
    if (!made) return made.error();
    made_ = tokens = *std::move(made);
  }
  if (!tokens.needed()) log_warning("anyone who reaches " + place + " can watch");
  if (!credentials_.tls)
    log_warning("what is watched at " + place + " can be read on the way" +
                (tokens.needed() ? ", and so can the token" : "") + ": --tls-cert and --tls-key encrypt it");
  return {};
}

void Server::publish(const ServerStatus& status) {
  hub_.publish(status);
  if (options_.recordings == nullptr) return;
  net::post(io_, [this, stream = status.stream] {
    const auto state = options_.recordings->state(stream);
    if (state && !state->file.empty()) hub_.publish_recording(stream, *state);
  });
}

Status Server::apply(const WebOptions& web) {
  auto loaded = Credentials::load(web);
  if (!loaded) return loaded.error();
  const bool needs_token = !listener_->loopback() && !web.open.value_or(false) && !loaded->tokens.needed();
  if (needs_token && !made_)
    return Error{"others reach " + (options_.host.empty() ? "every interface" : options_.host) +
                 ": name a token file, or say open, or restart for a token that is made and printed"};
  net::post(io_, [this, web, needs_token, credentials = *std::move(loaded)]() mutable {
    if (needs_token) credentials.tokens = *made_;
    credentials_.replace_with(std::move(credentials));
    web_ = std::move(web);
    const std::int64_t now_ns = steady_now_ns();
    limits_.change(connections_of(web_, false), requests_of(web_, false), now_ns);
    own_limits_.change(connections_of(web_, true), requests_of(web_, true), now_ns);
  });
  return {};
}

void Server::run() {
  listener_->accept([this](std::shared_ptr<Transport> transport) { on_accept(std::move(transport)); });
  thread_ = std::thread([this] {
    name_this_thread("gateway");
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

/// A connection's place among those of its address, free again when nobody uses it any more.
struct Place {
  std::shared_ptr<Transport> transport;
  AddressLimits& limits;

  Place(std::shared_ptr<Transport> held, AddressLimits& counted)
      : transport(std::move(held)), limits(counted) {}
  Place(const Place&) = delete;
  Place& operator=(const Place&) = delete;
  ~Place() { limits.disconnect(transport->peer().address); }
};

void Server::on_accept(std::shared_ptr<Transport> transport) {
  if (stopping_) return;
  ++counts_.connections;
  AddressLimits& limits = limits_for(transport->peer());
  if (!limits.connect(transport->peer().address, steady_now_ns())) return counts_.refuse(Refusal::kAddress);
  auto place = std::make_shared<Place>(std::move(transport), limits);
  if (!make_room()) return counts_.refuse(Refusal::kPlaces);
  Transport* held = place->transport.get();
  const auto connection = HttpConnection::make(*this, std::shared_ptr<Transport>(std::move(place), held),
                                               credentials_.tls ? credentials_.tls->context() : nullptr);
  add(connection);
  connection->start();
}

/// Where all places are taken, the connection that has waited longest for its client goes: who only holds
/// connections open holds nobody else up.
bool Server::make_room() {
  if (connections_.size() < static_cast<std::size_t>(web_.max_clients.value_or(kClients) + kSpareConnections))
    return true;
  std::shared_ptr<Connection> longest;
  std::int64_t since_ns = std::numeric_limits<std::int64_t>::max();
  for (const auto& connection : connections_) {
    const auto waiting_ns = connection->waiting_since_ns();
    if (!waiting_ns || *waiting_ns >= since_ns) continue;
    longest = connection;
    since_ns = *waiting_ns;
  }
  if (!longest) return false;
  counts_.refuse(Refusal::kPlaces);
  longest->abort();
  return true;
}

void Server::remove(const std::shared_ptr<Connection>& connection) {
  connections_.erase(connection);
  // Timers inside Beast's streams may still be pending; nobody waits for them.
  if (stopping_ && connections_.empty()) io_.stop();
}

void Server::shut_down() {
  stopping_ = true;
  cuts_.stop();
  listener_->close();
  const auto closing = connections_;  // each leaves the set as it closes
  for (const auto& connection : closing) connection->close();
  if (connections_.empty()) return io_.stop();
  shutdown_deadline_.expires_after(kShutdownTime);
  shutdown_deadline_.async_wait([this](boost::system::error_code) {
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
  auto credentials = Credentials::load(options.web);
  if (!credentials) return credentials.error();
  auto server = std::make_unique<Server>(options, *std::move(credentials));
  if (auto status = server->listen(); !status) return status.error();
  server->run();
  return std::unique_ptr<Gateway>(std::move(server));
}

}  // namespace relievo
