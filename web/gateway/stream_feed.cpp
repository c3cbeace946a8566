// SPDX-License-Identifier: Apache-2.0
#include "web/gateway/stream_feed.h"

#include <algorithm>
#include <deque>
#include <utility>

#include "base/time.h"

namespace relievo {
namespace {

constexpr std::size_t kReplyLimit = 16;  // answers owed to a client that sends but does not read

class StreamFeed : public WsFeed {
 public:
  StreamFeed(Hub& hub, std::string stream) : hub_(hub), stream_(std::move(stream)) {}
  StreamFeed(const StreamFeed&) = delete;
  StreamFeed& operator=(const StreamFeed&) = delete;
  ~StreamFeed() override {
    if (watcher_) hub_.unwatch(watcher_);
  }

  void start(std::function<void()> wake) override { watcher_ = hub_.watch(stream_, std::move(wake)); }
  std::optional<WsClose> on_text(std::string_view text) override;
  std::optional<WsClose> on_binary(std::span<const std::uint8_t>) override {
    return WsClose{1003, "text messages only"};
  }
  std::optional<WsOutgoing> next() override;
  void on_sent(const WsOutgoing& message) override {
    if (message.data) hub_.count_sent(*watcher_, message.data->size(), capture_time_ns_);
  }

 private:
  Hub& hub_;
  const std::string stream_;
  std::shared_ptr<Hub::Watcher> watcher_;
  std::deque<std::shared_ptr<const std::string>> replies_;
  int credit_ = 0;
  std::int64_t capture_time_ns_ = 0;  // of the frame that is being sent
};

std::optional<WsClose> StreamFeed::on_text(std::string_view text) {
  const auto message = parse_client_message(text);
  if (!message.ok()) return WsClose{1008, message.error().message};
  if (message->type == ClientMessage::Type::kCredit) {
    credit_ = std::min(credit_ + message->credit, kMaxCredit);
  } else if (message->type == ClientMessage::Type::kTime) {
    if (replies_.size() >= kReplyLimit) return WsClose{1008, "too many questions"};
    replies_.push_back(std::make_shared<const std::string>(time_message(message->t0, utc_now_ns())));
  }
  return std::nullopt;
}

std::optional<WsOutgoing> StreamFeed::next() {
  if (!replies_.empty()) {
    WsOutgoing out{.text = std::move(replies_.front())};
    replies_.pop_front();
    return out;
  }
  auto delivery = hub_.take(*watcher_, credit_ > 0);
  if (!delivery) return std::nullopt;
  if (delivery->text) return WsOutgoing{.text = std::move(delivery->text)};
  --credit_;
  capture_time_ns_ = delivery->frame->capture_time_ns;
  const auto prefix = frame_prefix(*delivery->frame, delivery->drops, utc_now_ns());
  return WsOutgoing{.head = {prefix.begin(), prefix.end()}, .data = delivery->frame->data};
}

}  // namespace

std::unique_ptr<WsFeed> make_stream_feed(Hub& hub, std::string stream) {
  return std::make_unique<StreamFeed>(hub, std::move(stream));
}

}  // namespace relievo
