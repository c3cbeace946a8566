// SPDX-License-Identifier: Apache-2.0
#include "client/live_reader.h"

#include <algorithm>
#include <array>
#include <atomic>
#include <mutex>
#include <utility>

#include "base/lateness.h"
#include "base/log.h"
#include "base/time.h"
#include "codec/frame3d_codec.h"

namespace relievo {
namespace {

constexpr std::int64_t kKeyInterval_ns = kNanosecondsPerSecond;  // between wishes for a key frame
constexpr std::int64_t kClockInterval_ns = 100'000'000;          // between questions until the first answer

/// Median of the last values.
class LastValues {
 public:
  void add(double value) { values_[count_++ % values_.size()] = value; }
  /// Nothing where there are none.
  std::optional<double> median() const {
    const std::size_t n = std::min(count_, values_.size());
    if (n == 0) return std::nullopt;
    auto sorted = values_;
    const auto middle = sorted.begin() + static_cast<std::ptrdiff_t>(n / 2);
    std::nth_element(sorted.begin(), middle, sorted.begin() + static_cast<std::ptrdiff_t>(n));
    return *middle;
  }

 private:
  std::array<double, 64> values_{};
  std::size_t count_ = 0;
};

class DdsLiveReader final : public LiveReader {
 public:
  explicit DdsLiveReader(const Options& options)
      : options_(options), rung_(options.quality.value_or(Rung::kFull)), choice_(options.choice) {}

  Status open() {
    auto clock = ClockProbe::create(options_.domain, options_.stream);
    if (clock)
      clock_ = *std::move(clock);
    else
      log_debug("clocks cannot be compared: " + clock.error().message);
    Subscriber::Callbacks callbacks;
    callbacks.info = [this](const StreamInfo&) { set_live(true); };
    callbacks.gone = [this](const std::string&) { set_live(false); };
    callbacks.status = [this](const ServerStatus& status) { offer(status); };
    callbacks.lost = [this](const std::string&, std::uint64_t count) { seen_.lost += count; };
    callbacks.frame = [this](const std::string&, const FrameMessage& message) { take(message); };
    auto subscriber =
        Subscriber::create(options_.domain, options_.stream, std::move(callbacks), options_.quality);
    if (!subscriber) return subscriber.error();
    held_ = *std::move(subscriber);
    subscriber_ = held_.get();
    return {};
  }

  Report report() const override {
    const std::lock_guard lock(mutex_);
    Report out = report_;
    out.decode_ms = decode_ms_.median().value_or(0);
    out.latency_ms = latency_ms_.median();
    if (clock_) out.clock = clock_->offset();
    return out;
  }

  void compare_clocks() override {
    if (!clock_) return;
    std::unique_lock lock(mutex_);
    ClientReport told = told_;
    lock.unlock();
    clock_->ask(told);
  }

 private:
  void set_live(bool live) {
    const std::lock_guard lock(mutex_);
    report_.live = live;
  }

  void offer(const ServerStatus& status) {
    std::vector<Rung> rungs;
    for (const RungStatus& rung : status.rungs)
      if (!is_jpeg(rung.rung)) rungs.push_back(rung.rung);  // video is decoded here
    choice_.offer(rungs);
    if (const std::uint64_t missed = missed_by(status); missed > 0) choose({.lost = missed});
    const std::lock_guard lock(mutex_);
    report_.rungs = std::move(rungs);
  }

  void take(const FrameMessage& message) {
    const std::int64_t begin_ns = steady_now_ns();
    seen_.late_ns = lateness_of(message, begin_ns);
    if (message.rung != rung_) decoder_ = FrameDecoder();
    const bool moved = std::exchange(rung_, message.rung) != message.rung;
    const bool decoded = decode(message);
    const std::int64_t end_ns = steady_now_ns();
    if (decoded && options_.frame) options_.frame(frame_, message);
    seen_.arrived = 1;
    seen_.busy_ns = steady_now_ns() - begin_ns;
    count(message, decoded, moved, end_ns - begin_ns);
    if (moved && rung_ == Rung::kSlow && !options_.quality)
      log_warning("the way here carries less than the lowest quality of " + options_.stream +
                  ": its texture comes one frame at a time, as many as get through");
    any_since_status_ = true;
    choose(seen_);
    seen_ = {};
  }

  std::int64_t lateness_of(const FrameMessage& message, std::int64_t now_ns) {
    std::int64_t way_ns = 0;
    if (__builtin_sub_overflow(utc_now_ns(), message.publish_time_ns, &way_ns)) return 0;  // a hostile peer's
    return lateness_.add(now_ns, way_ns);
  }

  void choose(const QualityChoice::Seen& seen) {
    const Rung suits = choice_.add(steady_now_ns(), seen);
    if (Subscriber* const subscriber = subscriber_; subscriber != nullptr && !options_.quality)
      subscriber->set_rung(suits);
  }

  /// Frames that were published since the last status, where not one of them came through: the next one that
  /// does would say what was lost, but there may be none.
  std::uint64_t missed_by(const ServerStatus& status) {
    std::uint64_t published = status.frames_published;
    for (const RungStatus& rung : status.rungs)
      if (rung.rung == rung_) published = rung.frames;
    const std::uint64_t before = std::exchange(published_, published);
    const bool any = std::exchange(any_since_status_, false) || std::exchange(published_of_, rung_) != rung_;
    return any || before == 0 || published < before ? 0 : published - before;
  }

  bool decode(const FrameMessage& message) {
    if (decoder_.can_decode(*message.data)) {
      const Status done = decoder_.decode(*message.data, frame_);
      if (!done) log_debug("a frame does not decode: " + done.error().message);
      return done.ok();
    }
    const std::int64_t now_ns = steady_now_ns();
    Subscriber* const subscriber = subscriber_;
    if (subscriber != nullptr && now_ns - key_asked_ns_ > kKeyInterval_ns) {
      key_asked_ns_ = now_ns;
      subscriber->request_key_frame(options_.stream);
    }
    return false;
  }

  void count(const FrameMessage& message, bool decoded, bool moved, std::int64_t took_ns) {
    const std::int64_t now_ns = utc_now_ns();
    const auto clock = clock_ ? clock_->offset() : std::nullopt;
    const std::lock_guard lock(mutex_);
    report_.rung = message.rung;
    report_.moves += moved;
    report_.lost += seen_.lost;
    told_.lost = report_.lost;
    if (!decoded) {
      if (report_.frames > 0) ++report_.skipped;  // before, it was not yet there
      told_.skipped = report_.skipped;
      return;
    }
    ++report_.frames;
    report_.bytes += message.data->size();
    decode_ms_.add(milliseconds(took_ns));
    told_.decode.add(seconds(took_ns));
    if (!clock) return ask_for_clock();
    const std::int64_t latency_ns = now_ns + clock->offset_ns - message.capture_time_ns;
    latency_ms_.add(milliseconds(latency_ns));
    told_.decoded_after.add(seconds(latency_ns));
  }

  /// Soon again, since no latency is known before the first answer.
  void ask_for_clock() {
    const std::int64_t now_ns = steady_now_ns();
    if (!clock_ || now_ns - clock_asked_ns_ < kClockInterval_ns) return;
    clock_asked_ns_ = now_ns;
    clock_->ask();
  }

  const Options options_;
  std::unique_ptr<ClockProbe> clock_;
  // Of the reader's thread:
  FrameDecoder decoder_;
  Frame3D frame_;
  Rung rung_;
  QualityChoice choice_;
  QualityChoice::Seen seen_;
  Lateness lateness_;
  std::int64_t key_asked_ns_ = 0, clock_asked_ns_ = 0;
  std::uint64_t published_ = 0;      // when the last status was sent,
  Rung published_of_ = Rung::kFull;  // of that rung
  bool any_since_status_ = true;

  mutable std::mutex mutex_;  // of what follows
  Report report_;
  ClientReport told_;  // to the server
  LastValues decode_ms_, latency_ms_;

  std::atomic<Subscriber*> subscriber_{nullptr};
  std::unique_ptr<Subscriber> held_;  // last: it calls until it is gone
};

}  // namespace

Result<std::unique_ptr<LiveReader>> LiveReader::create(const Options& options) {
  if (options.stream.empty()) return Error{"a reader is of one stream: name it"};
  auto reader = std::make_unique<DdsLiveReader>(options);
  if (const Status opened = reader->open(); !opened) return opened.error();
  return std::unique_ptr<LiveReader>(std::move(reader));
}

}  // namespace relievo
