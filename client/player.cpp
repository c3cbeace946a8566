// SPDX-License-Identifier: Apache-2.0
#include "client/player.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <limits>
#include <optional>
#include <utility>
#include <vector>

#include "base/time.h"
#include "idl/cdr.h"

namespace relievo {
namespace {

constexpr std::int64_t kShortestPass_ns = 30'000'000;
constexpr double kLongestStep_s = 1e8;  // of any times that a file may have

// For more of a file that is being written, which comes by chunks of half a second.
constexpr auto kLookAgain = std::chrono::milliseconds(100);
constexpr std::int64_t kLeft_ns = 5 * kNanosecondsPerSecond;  // a file of which nothing came for so long

TimeRange range_of(const PlayOptions& options, const RecordedStream& recorded) {
  return options.range.value_or(
      TimeRange{.from_ns = recorded.summary().start_ns, .to_ns = std::numeric_limits<std::int64_t>::max()});
}

/// `sample` as if it were due to be received at this UTC time.
RawSample restamped(RawSample sample, std::int64_t due_utc_ns, double speed) {
  if (sample.topic != Topic::kFrame) return sample;
  auto frame = read_frame_cdr(sample.cdr);
  if (!frame) return sample;  // it is refused as it is
  const auto moved = [&](std::int64_t time_ns) {
    const auto before_ns = static_cast<double>(sample.receive_time_ns - time_ns);
    return due_utc_ns - std::llround(before_ns / speed);
  };
  frame->capture_time_ns = moved(frame->capture_time_ns);
  frame->publish_time_ns = moved(frame->publish_time_ns);
  sample.cdr = write_frame_cdr(*frame);
  return sample;
}

/// Publishes samples with, before each frame, the description that holds for it where that changes: wherever
/// in the recording it was received.
class Described {
 public:
  Described(std::vector<RecordedInfo> infos, const std::function<Status(const RawSample&)>& publish)
      : infos_(std::move(infos)), publish_(publish) {}

  Status publish(const RawSample& sample) {
    if (sample.topic == Topic::kInfo) return add(sample);
    if (sample.topic == Topic::kFrame) {
      const RecordedInfo* info = info_of(sample, infos_);
      if (info && info->sample.cdr != current_) {
        current_ = info->sample.cdr;
        if (auto status = publish_(info->sample); !status) return status;
      }
    }
    return publish_(sample);
  }

 private:
  /// Of a file that is being written.
  Status add(const RawSample& sample) {
    if (!infos_.empty() && sample.receive_time_ns <= infos_.back().sample.receive_time_ns) return {};
    auto info = read_info_cdr(sample.cdr);
    if (!info) return publish_(sample);
    infos_.push_back({sample, *std::move(info)});
    return {};
  }

  std::vector<RecordedInfo> infos_;
  Bytes current_;
  const std::function<Status(const RawSample&)>& publish_;
};

Status play_once(RecordedStream& recorded, const PlayOptions& options, StopSignal& stop,
                 Described& described) {
  const TimeRange range = range_of(options, recorded);
  std::int64_t due_ns = steady_now_ns();
  const std::int64_t utc_from_steady_ns = utc_now_ns() - due_ns;
  const auto give = [&](RawSample sample) {
    return described.publish(options.restamp
                                 ? restamped(std::move(sample), due_ns + utc_from_steady_ns, options.speed)
                                 : std::move(sample));
  };
  std::optional<std::int64_t> last_ns;
  std::int64_t came_ns = steady_now_ns();
  for (;;) {
    if (options.ended && options.ended()) return {};
    auto sample = recorded.next();
    if (!sample) return sample.error();
    if (!*sample && options.follow) {
      const auto more = recorded.read_on();
      if (!more) return more.error();
      if (!*more && !recorded.summary().recovered) return {};
      if (!*more && options.loop && steady_now_ns() - came_ns > kLeft_ns) return {};
      if (!*more && stop.wait_for(kLookAgain)) return {};
      due_ns = std::max(due_ns, steady_now_ns());  // what comes late is not caught up with in a rush
      continue;
    }
    if (!*sample || (*sample)->receive_time_ns > range.to_ns) return {};
    came_ns = steady_now_ns();
    if ((*sample)->receive_time_ns < range.from_ns) {
      if (!needed_later(**sample)) continue;
      if (auto status = give(**std::move(sample)); !status) return status;
      continue;
    }
    const std::int64_t time_ns = (*sample)->receive_time_ns;
    const double step_s = std::max(0.0, seconds(time_ns - last_ns.value_or(time_ns)));
    last_ns = time_ns;
    const double wait_s = std::min(step_s, options.longest_pause_s) / options.speed;
    due_ns += std::llround(std::min(wait_s, kLongestStep_s) * 1e9);
    if (stop.wait_for(std::chrono::nanoseconds(due_ns - steady_now_ns()))) return {};
    if (auto status = give(**std::move(sample)); !status) return status;
  }
}

}  // namespace

Status play(RecordedStream& recorded, const PlayOptions& options, StopSignal& stop,
            const std::function<Status(const RawSample&)>& publish) {
  auto infos = recorded.read_infos();
  if (!infos) return infos.error();
  bool any = false;
  const std::function<Status(const RawSample&)> counted = [&](const RawSample& sample) {
    any = true;
    return publish(sample);
  };
  Described described(*std::move(infos), counted);
  do {
    if (auto status = recorded.seek(range_of(options, recorded).from_ns); !status) return status;
    const std::int64_t start_ns = steady_now_ns();
    any = false;
    if (auto status = play_once(recorded, options, stop, described); !status) return status;
    // A recording of a single moment, or of which nothing is left, must not loop as fast as the machine can.
    const std::int64_t pass_ns = any ? kShortestPass_ns : kNanosecondsPerSecond;
    if (options.loop) stop.wait_for(std::chrono::nanoseconds(start_ns + pass_ns - steady_now_ns()));
  } while (options.loop && !stop.stopped() && !(options.ended && options.ended()));
  return {};
}

}  // namespace relievo
