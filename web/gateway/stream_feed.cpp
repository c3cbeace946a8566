// SPDX-License-Identifier: Apache-2.0
#include "web/gateway/stream_feed.h"

#include <algorithm>
#include <deque>
#include <utility>

#include "base/quality_choice.h"
#include "base/time.h"

namespace relievo {
namespace {

constexpr std::int64_t kLongGap_ns = 3 * kNanosecondsPerSecond;  // without a frame
constexpr std::size_t kReplyLimit = 16;  // answers that wait for a frame on its way; the last ones

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
  void look_at(const Hub::Delivery& delivery);
  void count_taken(int credit);
  void on_sent(const WsOutgoing& message) override {
    if (message.data) hub_.count_sent(*watcher_, message.data->size(), capture_time_ns_);
  }

 private:
  Hub& hub_;
  const std::string stream_;
  std::shared_ptr<Hub::Watcher> watcher_;
  std::deque<std::shared_ptr<const std::string>> replies_;
  std::optional<Hub::Delivery> held_;  // what is said of its quality goes first
  bool chooses_ = false;               // the client has said what quality it wants,
  bool automatic_ = false;             // namely whatever suits it,
  bool stills_ = false;                // and that it decodes no H.264
  QualityChoice choice_;
  std::optional<Rung> told_;
  std::uint64_t seen_drops_ = 0;
  std::int64_t seen_ns_ = 0;
  std::int64_t long_until_ns_ = -kLongGap_ns;  // the end of the last gap that long
  int credit_ = 0;
  std::int64_t capture_time_ns_ = 0;  // of the frame that is being sent
  std::deque<std::int64_t> untaken_;  // of those for which no credit has come back
};

/// What credit comes back for, oldest first.
void StreamFeed::count_taken(int credit) {
  for (; credit > 0 && !untaken_.empty(); --credit) {
    hub_.count_taken(*watcher_, untaken_.front());
    untaken_.pop_front();
  }
}

std::optional<WsClose> StreamFeed::on_text(std::string_view text) {
  const auto message = parse_client_message(text);
  if (!message.ok()) return WsClose{1008, message.error().message};
  if (message->type == ClientMessage::Type::kCredit) {
    credit_ = std::min(credit_ + message->credit, kMaxCredit);
    count_taken(message->credit);
  } else if (message->type == ClientMessage::Type::kTime) {
    if (replies_.size() >= kReplyLimit) replies_.pop_front();  // it waited too long to tell anything
    std::optional<std::int64_t> server_ns = hub_.clock_offset_ns(stream_);
    if (server_ns) *server_ns += utc_now_ns();
    replies_.push_back(std::make_shared<const std::string>(time_message(message->t0, server_ns)));
  } else if (message->type == ClientMessage::Type::kQuality) {
    chooses_ = true;
    automatic_ = !message->want;
    stills_ = !message->video;
    choice_ = QualityChoice();
    told_.reset();
    hub_.choose(*watcher_, message->want.value_or(Rung::kFull), stills_);
  }
  return std::nullopt;
}

std::optional<WsOutgoing> StreamFeed::next() {
  if (!replies_.empty()) {
    WsOutgoing out{.text = std::move(replies_.front())};
    replies_.pop_front();
    return out;
  }
  auto delivery = held_ ? std::exchange(held_, std::nullopt) : hub_.take(*watcher_, credit_ > 0);
  if (!delivery) return std::nullopt;
  if (delivery->text) return WsOutgoing{.text = std::move(delivery->text)};
  const Rung detail = detail_of(delivery->frame->rung);
  if (chooses_ && told_ != detail) {
    told_ = detail;
    held_ = std::move(delivery);
    return WsOutgoing{
        .text = std::make_shared<const std::string>(quality_message(*told_, hub_.rungs(*watcher_)))};
  }
  if (automatic_) look_at(*delivery);
  --credit_;
  capture_time_ns_ = delivery->frame->capture_time_ns;
  untaken_.push_back(capture_time_ns_);
  const auto prefix = frame_prefix(*delivery->frame, delivery->drops, utc_now_ns());
  return WsOutgoing{.head = {prefix.begin(), prefix.end()}, .data = delivery->frame->data};
}

/// Frames that the client had no credit for, or that its connection was too slow for, are what is wrong with
/// its quality. A page in the background, which wants none, is not judged by those: a long gap is taken for
/// that where it followed until then. A page whose long gaps are hardly apart is slow.
void StreamFeed::look_at(const Hub::Delivery& delivery) {
  const std::int64_t now_ns = steady_now_ns();
  const bool is_long = now_ns - seen_ns_ > kLongGap_ns;
  const bool was_away = is_long && seen_ns_ - long_until_ns_ >= kLongGap_ns;
  if (is_long) long_until_ns_ = now_ns;
  const std::uint64_t lost = was_away ? 0 : delivery.drops - seen_drops_;
  seen_ns_ = now_ns;
  seen_drops_ = delivery.drops;
  choice_.offer(hub_.rungs(*watcher_));
  hub_.choose(*watcher_, choice_.add(now_ns, {.arrived = 1, .lost = lost}), stills_);
}

}  // namespace

std::unique_ptr<WsFeed> make_stream_feed(Hub& hub, std::string stream) {
  return std::make_unique<StreamFeed>(hub, std::move(stream));
}

}  // namespace relievo
