// SPDX-License-Identifier: Apache-2.0
// The protocol: https://github.com/foxglove/ws-protocol, docs/spec.md.
#include "web/gateway/foxglove_feed.h"

#include <atomic>
#include <deque>
#include <limits>
#include <map>
#include <nlohmann/json.hpp>
#include <set>
#include <utility>

#include "base/json_text.h"
#include "base/time.h"

namespace relievo {
namespace {

using Json = nlohmann::ordered_json;

constexpr std::size_t kMostSubscriptions = 64;
constexpr std::size_t kMostTexts = 256;  // owed to a client that sends but does not read
constexpr std::uint8_t kMessageData = 1;
constexpr int kWarning = 1;

std::shared_ptr<const std::string> text_of(const Json& json) {
  return std::make_shared<const std::string>(json_line(json));
}

void append_le(std::vector<std::uint8_t>& out, std::uint64_t value, int bytes) {
  for (int i = 0; i < bytes; ++i) out.push_back(static_cast<std::uint8_t>(value >> (8 * i)));
}

/// Of a subscription or a channel: 32 bits.
std::optional<std::uint32_t> id_of(const nlohmann::json& value) {
  if (!value.is_number_unsigned()) return std::nullopt;
  const auto id = value.get<std::uint64_t>();
  return id <= std::numeric_limits<std::uint32_t>::max() ? std::optional(static_cast<std::uint32_t>(id))
                                                         : std::nullopt;
}

/// Numbers of a JSON list, as far as they are some that an id can be.
std::vector<std::uint32_t> ids_in(const nlohmann::json& message, const char* name) {
  std::vector<std::uint32_t> ids;
  const auto list = message.find(name);
  if (list == message.end() || !list->is_array()) return ids;
  for (const auto& value : *list)
    if (const auto id = id_of(value)) ids.push_back(*id);
  return ids;
}

class FoxgloveFeed : public WsFeed {
 public:
  FoxgloveFeed(Hub& hub, const SampleFormat& format, std::string session)
      : hub_(hub), format_(format), session_(std::move(session)) {}
  FoxgloveFeed(const FoxgloveFeed&) = delete;
  FoxgloveFeed& operator=(const FoxgloveFeed&) = delete;
  ~FoxgloveFeed() override {
    for (auto& [id, subscription] : subscriptions_) hub_.unwatch(subscription.watcher);
  }

  void start(std::function<void()> wake) override;
  std::optional<WsClose> on_text(std::string_view text) override;
  std::optional<WsClose> on_binary(std::span<const std::uint8_t>) override {
    return WsClose{1003, "clients publish nothing here"};
  }
  std::optional<WsOutgoing> next() override;
  void on_sent(const WsOutgoing& message) override;

 private:
  struct Subscription {
    std::uint32_t channel = 0;
    std::string stream;
    std::shared_ptr<Hub::Watcher> watcher;
  };
  void list_streams();
  void subscribe(const nlohmann::json& wanted);
  void drop_subscription(std::map<std::uint32_t, Subscription>::iterator at);
  std::optional<WsOutgoing> next_frame(std::uint32_t id, const Subscription& subscription);
  void warn(const std::string& why) {
    texts_.push_back(text_of({{"op", "status"}, {"level", kWarning}, {"message", why}}));
  }

  Hub& hub_;
  const SampleFormat& format_;
  const std::string session_;
  std::function<void()> wake_;
  std::shared_ptr<std::atomic<bool>> changed_ =
      std::make_shared<std::atomic<bool>>(true);  // the list of streams
  std::shared_ptr<void> list_watch_;
  std::deque<std::shared_ptr<const std::string>> texts_;
  std::map<std::string, std::uint32_t> channels_;  // of the streams that were advertised
  std::uint32_t next_channel_ = 1;
  std::map<std::uint32_t, Subscription> subscriptions_;
  std::uint32_t served_ = 0;  // the subscription that a frame was sent to last
  std::optional<std::pair<std::shared_ptr<Hub::Watcher>, std::int64_t>> sending_;  // to whom; captured when
};

void FoxgloveFeed::start(std::function<void()> wake) {
  wake_ = std::move(wake);
  texts_.push_back(text_of({{"op", "serverInfo"},
                            {"name", "relievo " RELIEVO_VERSION},
                            {"capabilities", Json::array()},
                            {"supportedEncodings", Json::array()},
                            {"metadata", Json::object()},
                            {"sessionId", session_}}));
  list_watch_ = hub_.watch_list([changed = changed_, wake_up = wake_] {
    *changed = true;
    wake_up();
  });
}

void FoxgloveFeed::list_streams() {
  std::set<std::string> live;
  Json added = Json::array(), gone = Json::array();
  for (const StreamSnapshot& stream : hub_.snapshot()) {
    live.insert(stream.info.stream);
    const auto [channel, is_new] = channels_.try_emplace(stream.info.stream, next_channel_);
    if (!is_new) continue;
    ++next_channel_;
    added.push_back({{"id", channel->second},
                     {"topic", "relievo/frame/" + stream.info.stream},
                     {"encoding", "cdr"},
                     {"schemaName", format_.type_name},
                     {"schema", format_.idl},
                     {"schemaEncoding", "omgidl"}});
  }
  for (auto channel = channels_.begin(); channel != channels_.end();) {
    if (live.count(channel->first) != 0) {
      ++channel;
      continue;
    }
    gone.push_back(channel->second);
    for (auto at = subscriptions_.begin(); at != subscriptions_.end();) {
      const auto one = at++;
      if (one->second.channel == channel->second) drop_subscription(one);
    }
    channel = channels_.erase(channel);
  }
  if (!added.empty()) texts_.push_back(text_of({{"op", "advertise"}, {"channels", added}}));
  if (!gone.empty()) texts_.push_back(text_of({{"op", "unadvertise"}, {"channelIds", gone}}));
}

void FoxgloveFeed::drop_subscription(std::map<std::uint32_t, Subscription>::iterator at) {
  hub_.unwatch(at->second.watcher);
  subscriptions_.erase(at);
}

std::optional<WsClose> FoxgloveFeed::on_text(std::string_view text) {
  const auto message = nlohmann::json::parse(text, nullptr, false);
  if (!message.is_object()) return WsClose{1008, "not a JSON object"};
  const auto op = message.find("op");
  if (op == message.end() || !op->is_string()) return WsClose{1008, "no \"op\""};
  if (texts_.size() > kMostTexts) return WsClose{1008, "too many wishes"};
  if (*op == "subscribe") {
    const auto list = message.find("subscriptions");
    if (list == message.end() || !list->is_array())
      return WsClose{1008, "subscribe without \"subscriptions\""};
    for (const auto& wanted : *list) subscribe(wanted);
  } else if (*op == "unsubscribe") {
    for (const std::uint32_t id : ids_in(message, "subscriptionIds")) {
      const auto at = subscriptions_.find(id);
      if (at != subscriptions_.end()) drop_subscription(at);
    }
  }
  return std::nullopt;
}

void FoxgloveFeed::subscribe(const nlohmann::json& wanted) {
  const auto number = [&](const char* name) -> std::optional<std::uint32_t> {
    return wanted.is_object() && wanted.contains(name) ? id_of(wanted[name]) : std::nullopt;
  };
  const auto id = number("id"), channel = number("channelId");
  if (!id || !channel) return warn("a subscription needs an id and a channelId, numbers of 32 bits");
  if (subscriptions_.count(*id) != 0) return warn("subscription " + std::to_string(*id) + " exists");
  if (subscriptions_.size() >= kMostSubscriptions) return warn("too many subscriptions");
  for (const auto& [stream, known] : channels_) {
    if (known != *channel) continue;
    subscriptions_[*id] = {known, stream, hub_.watch(stream, wake_)};
    return;
  }
  warn("there is no channel " + std::to_string(*channel));
}

std::optional<WsOutgoing> FoxgloveFeed::next() {
  if (texts_.empty() && changed_->exchange(false)) list_streams();
  if (!texts_.empty()) {
    WsOutgoing out{.text = std::move(texts_.front())};
    texts_.pop_front();
    return out;
  }
  // In turn, so that a fast stream leaves room for the others.
  auto at = subscriptions_.upper_bound(served_);
  for (std::size_t looked = 0; looked < subscriptions_.size(); ++looked, ++at) {
    if (at == subscriptions_.end()) at = subscriptions_.begin();
    if (auto frame = next_frame(at->first, at->second)) return frame;
  }
  return std::nullopt;
}

std::optional<WsOutgoing> FoxgloveFeed::next_frame(std::uint32_t id, const Subscription& subscription) {
  auto delivery = hub_.take(*subscription.watcher, true);
  while (delivery && !delivery->frame) delivery = hub_.take(*subscription.watcher, true);  // said by channels
  if (!delivery) return std::nullopt;
  served_ = id;
  sending_ = {subscription.watcher, delivery->frame->capture_time_ns};
  WsOutgoing out;
  out.head.push_back(kMessageData);
  append_le(out.head, id, 4);
  append_le(out.head, static_cast<std::uint64_t>(delivery->frame->capture_time_ns), 8);
  out.data = std::make_shared<const Bytes>(format_.encode(subscription.stream, *delivery->frame));
  return out;
}

void FoxgloveFeed::on_sent(const WsOutgoing& message) {
  if (message.data && sending_) hub_.count_sent(*sending_->first, message.data->size(), sending_->second);
}

}  // namespace

std::unique_ptr<WsFeed> make_foxglove_feed(Hub& hub, const SampleFormat& format, std::string session) {
  return std::make_unique<FoxgloveFeed>(hub, format, std::move(session));
}

}  // namespace relievo
