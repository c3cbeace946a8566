// SPDX-License-Identifier: Apache-2.0
#include "server/pipeline.h"

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cmath>
#include <condition_variable>
#include <mutex>
#include <thread>
#include <utility>

#include "base/bounded_queue.h"
#include "base/clock_steps.h"
#include "base/log.h"
#include "base/thread_name.h"
#include "base/time.h"
#include "codec/decodable_frames.h"
#include "server/paced_reconstructor.h"
#include "server/slides_seen.h"
#include "server/stats.h"
#include "server/step_watch.h"
#include "server/texture_look.h"
#include "server/working_volume.h"

namespace relievo {
namespace {

constexpr std::size_t kQueueFrames = 3;
constexpr std::int64_t kStatusInterval_ns = kNanosecondsPerSecond;
constexpr std::int64_t kMaxLate_ns =
    100'000'000;                      // behind its own time stamps before a source's clock is set back
constexpr int kMaxSourceErrors = 30;  // in a row: a second of a camera that delivers nothing
constexpr double kSilentFrames = 10;  // times a frame's without one: the source has stalled
constexpr std::int64_t kSilentAtLeast_ns = kNanosecondsPerSecond;
constexpr std::int64_t kLookInterval_ns = kNanosecondsPerSecond;  // between pictures whose error is measured
constexpr std::uint64_t kFramesForASurface = 30;                  // far more than any schedule needs
constexpr std::uint64_t kMixedForASurface =
    300;  // frames under two slides each: ten seconds of a drifting rig

constexpr const char* kGuessed =
    "The rig is not calibrated: its shapes are guesses until it is, on the page /rig.";

struct Captured {
  CapturedFrame frame;
  std::int64_t capture_time_ns;
  std::uint64_t number;  // counts what the source gave and what it lost
};
struct Reconstructed {
  Frame3D frame;
  std::int64_t capture_time_ns;
  int line_stride;
};
struct Encoded {
  FrameMessage message;
  std::uint64_t number;   // counts encoded frames
  std::int64_t begin_ns;  // of its encoding
  double place;           // RateControl::place()
};
struct Taken {
  double ms, place;
};

class ThreadedPipeline final : public Pipeline {
 public:
  ThreadedPipeline(FieldSource& source, std::vector<FrameSink*> sinks, const PipelineOptions& options,
                   Reconstructor reconstructor)
      : source_(source),
        sinks_(std::move(sinks)),
        options_(options),
        label_(options.label.empty() ? "" : options.label + ": "),
        paced_(source.info(), {label_, options.reconstruct, options.auto_pace}, std::move(reconstructor)),
        encoder_(paced_.now().rig(), paced_.now().pattern()),
        volume_(options.encode.volume) {}

  Status run() override {
    if (options_.rungs != nullptr)
      options_.rungs->give_back_to([this](Frame3D&& used) { paced_.recycle(std::move(used)); });
    std::thread reconstruct([this] { reconstruct_stage(); });
    std::thread encode([this] { encode_stage(); });
    std::thread publish([this] { publish_stage(); });
    const Status captured = capture_stage();
    to_reconstruct_.close();
    reconstruct.join();
    to_encode_.close();
    encode.join();
    to_publish_.close();
    publish.join();
    if (options_.rungs != nullptr) options_.rungs->end();
    const Status done = outcome(captured);
    set_state(StreamState::kEnded, done ? "" : done.error().message);
    to_sinks(status());
    return outcome(captured);
  }

  void stop() override {
    {
      std::lock_guard lock(mutex_);
      stopping_ = true;
    }
    stopped_.notify_all();
    source_.request_stop();
  }

  void request_key_frame() override { key_wanted_ = true; }

  ServerStatus status() const override {
    ServerStatus s = stats_.snapshot(utc_now_ns());
    s.stream = options_.stream;
    s.drops_reconstruct = dropped();
    s.drops_encode = to_encode_.drops();
    s.drops_publish = to_publish_.drops() + undecodable_;
    if (options_.rungs != nullptr) s.rungs = options_.rungs->status();
    std::lock_guard lock(mutex_);
    s.state = state_;
    s.message = !message_.empty() ? message_ : options_.calibrated ? step_message_ : kGuessed;
    s.step = step_;
    if (state_ == StreamState::kRunning && asked_ns_ && steady_now_ns() - *asked_ns_ > silence_ns()) {
      s.state = StreamState::kStalled;
      s.message = "The source gives no frames.";
    }
    return s;
  }

  StageTimes stages() const override {
    StageTimes times = stats_.stages();
    const Pace pace = paced_.pace();
    times.decoder = decoder_name(pace.decoder);
    times.line_stride = pace.line_stride;
    times.waiting_reconstruct = to_reconstruct_.size();
    times.waiting_encode = to_encode_.size();
    times.waiting_publish = to_publish_.size();
    return times;
  }

 private:
  template <typename T>
  void push(BoundedQueue<T>& queue, T item) {
    if (options_.lossless) {
      queue.push_wait(std::move(item));
    } else {
      queue.push_drop_oldest(std::move(item));
    }
  }

  /// What run() returns: the first failure of a stage or a sink, else the source's.
  Status outcome(const Status& captured) const {
    std::lock_guard lock(mutex_);
    return failure_ ? Status(*failure_) : captured;
  }

  /// Frames, for want of time to reconstruct them.
  std::uint64_t dropped() const { return to_reconstruct_.drops() + observed_; }

  bool stopping() const {
    std::lock_guard lock(mutex_);
    return stopping_;
  }

  /// The source's next frame; while it is waited for, status() can say so.
  Result<std::optional<CapturedFrame>> next_frame() {
    const auto asked = [this](std::optional<std::int64_t> since_ns) {
      std::lock_guard lock(mutex_);
      asked_ns_ = since_ns;
    };
    asked(steady_now_ns());
    auto next = source_.next();
    asked(std::nullopt);
    return next;
  }

  /// How long a source may be silent.
  std::int64_t silence_ns() const {
    const double rate = source_.info().rig.frame_rate;
    return std::max(kSilentAtLeast_ns, static_cast<std::int64_t>(kSilentFrames * 1e9 / rate));
  }

  /// By how much a gap in the time stamps is longer than a source may be silent: nobody waits for hours.
  std::int64_t too_long(std::int64_t gap_ns) const {
    const std::int64_t too_long_ns = gap_ns - silence_ns();
    if (too_long_ns <= 0) return 0;
    log_info(label_ + source_.info().name + " has a gap of " + std::to_string(std::llround(seconds(gap_ns))) +
             " s in its time stamps: it goes on after " +
             std::to_string(std::llround(seconds(silence_ns()))) + " s");
    return too_long_ns;
  }

  /// False once stopping.
  bool sleep_until(std::int64_t steady_ns) {
    std::unique_lock lock(mutex_);
    const auto wait = std::chrono::nanoseconds(steady_ns - steady_now_ns());
    return !stopped_.wait_for(lock, wait, [&] { return stopping_; });
  }

  Status capture_stage() {
    const SourceInfo& info = source_.info();
    const bool paced = options_.paced && !info.live;
    ClockSteps clock;
    std::optional<std::int64_t> epoch_ns;  // of the source's time 0, by the monotonic clock
    std::int64_t before_ns = 0;            // of the source's last frame, by its stamp
    std::uint64_t delivered = 0, lost = 0;
    int errors_in_a_row = 0;
    Error last_error;
    while (!options_.frames || delivered < *options_.frames) {
      auto next = next_frame();
      if (!next) {
        // Logged at once of a camera, which somebody may have to see to. Else once the source goes on behind
        // it, or returned where it does not.
        const bool another = errors_in_a_row == 0 || last_error.message != next.error().message;
        if (info.live && another) log_warning(label_ + next.error().message);
        if (!info.live && another && errors_in_a_row > 0) log_warning(label_ + last_error.message);
        last_error = next.error();
        if (!info.live) {  // a camera counts its own
          stats_.lost_in_capture(1);
          ++lost;
        }
        set_state(StreamState::kStalled, last_error.message);
        if (++errors_in_a_row >= kMaxSourceErrors) return last_error;
        continue;
      }
      if (!*next) return errors_in_a_row > 0 && !stopping() ? Status(last_error) : Status();
      if (errors_in_a_row > 0 && info.live) log_info(label_ + info.name + " gives frames again");
      if (errors_in_a_row > 0 && !info.live) log_warning(label_ + last_error.message);
      errors_in_a_row = 0;
      set_state(StreamState::kRunning, "");
      CapturedFrame frame = *std::move(*next);
      std::int64_t capture_time_ns = utc_now_ns();
      if (info.live) {
        capture_time_ns = frame.time_ns + clock.set_by_ns();
      } else if (paced) {
        const std::int64_t now = steady_now_ns();
        if (epoch_ns) *epoch_ns -= too_long(frame.time_ns - before_ns);
        before_ns = frame.time_ns;
        // A source that cannot keep its own pace is played as fast as it comes, not in bursts to catch up.
        if (!epoch_ns || *epoch_ns + frame.time_ns < now - kMaxLate_ns) epoch_ns = now - frame.time_ns;
        const std::int64_t due_ns = *epoch_ns + frame.time_ns;
        if (!sleep_until(due_ns)) return {};
        capture_time_ns = due_ns + clock.utc_from_steady_ns();
      }
      stats_.captured();
      stats_.lost_in_capture(frame.lost_before);
      ++delivered;
      lost += frame.lost_before;
      push(to_reconstruct_, Captured{std::move(frame), capture_time_ns, delivered + lost});
    }
    return {};
  }

  void reconstruct_stage() {
    name_this_thread("reconstruct");
    std::optional<std::uint64_t> previous;
    std::uint64_t without_surface = 0;  // frames, before the first surface
    bool any_surface = false;
    StepWatch steps(source_.info().pattern, source_.info().rig);
    SlidesSeen slides;
    const bool dropping = !options_.lossless && source_.info().pattern.scheme == Scheme::kComplementary;
    const auto not_alone = [&](const Captured& item) {
      return dropping && slides.other_is_old(item.number, item.frame.time_ns);
    };
    for (;;) {
      auto [item, next] = to_reconstruct_.pop_with_next_if(not_alone);
      if (!item) break;
      if (next) {
        if (auto seen = paced_.now().observe(item->frame); !seen) fail(seen.error());
        steps.add(item->frame.time_ns, paced_.now().report());
        slides.add(item->number, item->frame.time_ns);
        previous = item->number;
        ++observed_;
        item = std::move(next);
      }
      slides.add(item->number, item->frame.time_ns);
      const std::int64_t begin = steady_now_ns();
      auto result = paced_.now().add(item->frame);
      if (!result) {
        fail(result.error());
        continue;
      }
      // The same slide twice tells of a frame that never came, unless it was dropped in the queue above, the
      // source has counted it, or a take starts again.
      const auto pass = source_.info().frames;
      steps.add(item->frame.time_ns, paced_.now().report());
      say_step(steps);
      if (!*result) offer(item->frame, nullptr, steps);
      if (paced_.now().report().step.mixed) {
        stats_.lost_in_capture(1);
        // A projector that drifts comes round; a source that can be played again is given up in the end.
        if (!any_surface && options_.calibrated && !source_.info().live &&
            steps.status().mixed == std::max(kMixedForASurface, 2 * pass.value_or(0)))
          fail(Error{source_.info().name + " gave no surface in " + std::to_string(steps.status().mixed) +
                     " frames: " + steps.advice()});
        continue;
      }
      const bool consecutive = previous && item->number == *previous + 1 && !item->frame.starts_again;
      if (paced_.now().report().same_slide && consecutive) stats_.lost_in_capture(1);
      previous = item->number;
      if (!*result) {
        // A take that is looped would go on so for ever.
        if (!any_surface && options_.calibrated &&
            ++without_surface == std::max(kFramesForASurface, 2 * pass.value_or(0)))
          fail(Error{source_.info().name + " gave no surface in " + std::to_string(without_surface) +
                     " frames: a surface needs two frames under different slides"});
        continue;
      }
      any_surface = true;
      const double ms = milliseconds(steady_now_ns() - begin);
      for (std::optional<Frame3D> made = *std::move(result); made; made = paced_.now().next()) {
        stats_.reconstructed(ms, paced_.now().report().filters);
        if (!made->between) offer(item->frame, &made->surface, steps);
        const std::int64_t later_ns = made->time_ns - item->frame.time_ns;  // below 0: of a field before
        push(to_encode_,
             Reconstructed{*std::move(made), item->capture_time_ns + later_ns, paced_.pace().line_stride});
      }
      const double all_ms = milliseconds(steady_now_ns() - begin);
      if (const Status paced = paced_.took(item->frame, all_ms, dropped()); !paced) fail(paced.error());
    }
  }

  /// To somebody who looks at single frames: a copy, where one was asked for.
  void offer(const CapturedFrame& captured, const Surface* surface, const StepWatch& steps) {
    if (options_.tap == nullptr || !options_.tap->wants(surface != nullptr)) return;
    const CapturedFrame* decoded = paced_.now().decoded();
    TappedFrame out{.captured = captured.clone(),
                    .report = paced_.now().report(),
                    .step = steps.status(),
                    .step_advice = steps.message(),
                    .calibrated = options_.calibrated};
    if (decoded != nullptr) out.decoded = decoded->clone();
    if (surface != nullptr) out.grid = surface->grid;
    options_.tap->put(std::move(out));
  }

  void encode_stage() {
    name_this_thread("encode");
    std::int64_t key_ns = steady_now_ns() - kWishedKeyInterval_ns;  // of the last key frame
    std::int64_t look_ns = steady_now_ns();  // when the texture's error is measured next
    std::optional<RateControl> rate;
    if (options_.rate.any()) rate.emplace(options_.rate, source_.info().rig.frame_rate, options_.encode);
    std::uint64_t encoded = 0;
    while (auto item = to_encode_.pop()) {
      const std::int64_t begin = steady_now_ns();
      if (begin - key_ns >= kWishedKeyInterval_ns && key_wanted_.exchange(false))
        encoder_.request_key_frame();
      encoder_.set_line_stride(item->line_stride);
      EncodeOptions encode = options_.encode;
      encode.volume = volume_.fit(item->frame.surface.positions);
      if (const int bits = volume_.bits(options_.depth_resolution); bits > 0) encode.position_bits = bits;
      double place = 0;
      if (rate) {
        for (const Taken& taken : take_times()) rate->took(taken.ms, taken.place);
        rate->apply(encode);
        place = rate->place();
      }
      std::int64_t geometry_ns = begin;
      auto bytes = encoder_.encode(item->frame, encode, [&] { geometry_ns = steady_now_ns(); });
      if (!bytes) {
        fail(bytes.error());
        continue;
      }
      if (const std::string notice = encoder_.take_notice(); !notice.empty()) log_warning(label_ + notice);
      stats_.encoded_parts(milliseconds(geometry_ns - begin), milliseconds(steady_now_ns() - geometry_ns));
      const bool is_key = is_key_frame(*bytes);
      if (is_key) key_ns = begin;
      if (rate) {
        rate->add(bytes->size(), is_key, encode.key_interval);
        stats_.rate_level(static_cast<std::uint32_t>(rate->level()));
      }
      stats_.encoded(milliseconds(steady_now_ns() - begin));
      FrameMessage message;
      message.number = item->frame.number;
      message.capture_time_ns = item->capture_time_ns;
      message.data = std::make_shared<const Bytes>(*std::move(bytes));
      const auto data = message.data;
      const std::uint64_t dropped = to_publish_.drops();
      push(to_publish_, Encoded{std::move(message), encoded++, begin, place});
      if (to_publish_.drops() > dropped) encoder_.request_key_frame();  // later frames may build on that one
      if (options_.rate.texture_db > 0 && is_key && begin >= look_ns) {
        look_ns = begin + kLookInterval_ns;
        if (const auto db = texture_db(*data, item->frame.texture)) rate->looked(*db, place);
      }
      if (options_.rungs != nullptr && options_.rungs->wanted())
        options_.rungs->take(std::move(item->frame), item->capture_time_ns, item->line_stride);
      else
        paced_.recycle(std::move(item->frame));
    }
  }

  void publish_stage() {
    name_this_thread("publish");
    std::uint64_t sequence = 0;
    DecodableFrames decodable;
    std::int64_t status_due_ns = steady_now_ns();
    while (!to_publish_.finished()) {
      const std::int64_t wait_ns = std::max<std::int64_t>(0, status_due_ns - steady_now_ns());
      auto encoded = to_publish_.pop_for(std::chrono::nanoseconds(wait_ns));
      if (encoded && !decodable.add(encoded->number, encoded->message.data)) {
        ++undecodable_;  // readers would see no gap
      } else if (encoded) {
        FrameMessage& message = encoded->message;
        message.sequence = sequence++;
        message.publish_time_ns = utc_now_ns();
        stats_.published(message.capture_time_ns, message.publish_time_ns, message.data->size());
        const std::int64_t begin_ns = steady_now_ns();
        to_sinks(message);
        stats_.handed_over(milliseconds(steady_now_ns() - begin_ns));
        add_time({milliseconds(steady_now_ns() - encoded->begin_ns), encoded->place});
      }
      if (steady_now_ns() < status_due_ns) continue;
      status_due_ns = steady_now_ns() + kStatusInterval_ns;
      to_sinks(status());
    }
  }

  template <typename T>
  void to_sinks(const T& message) {
    for (FrameSink* sink : sinks_) {
      if (const Status sent = sink->consume(message); !sent) fail(sent.error());
    }
  }

  /// Of a frame that is published, for the rate control.
  void add_time(const Taken& taken) {
    if (options_.rate.deadline_ms <= 0) return;
    std::lock_guard lock(mutex_);
    times_.push_back(taken);
  }
  std::vector<Taken> take_times() {
    std::lock_guard lock(mutex_);
    return std::exchange(times_, {});
  }

  /// The first failure ends the run; the stages go on emptying their queues.
  void fail(const Error& error) {
    {
      std::lock_guard lock(mutex_);
      if (!failure_) failure_ = error;
    }
    stop();
  }

  /// Logged when it begins to be said.
  void say_step(const StepWatch& steps) {
    std::lock_guard lock(mutex_);
    step_ = steps.status();
    if (steps.message() == step_message_) return;
    if (step_message_.empty()) log_warning(label_ + steps.message());
    step_message_ = steps.message();
  }

  void set_state(StreamState state, const std::string& message) {
    std::lock_guard lock(mutex_);
    state_ = state;
    message_ = message;
  }

  FieldSource& source_;
  std::vector<FrameSink*> sinks_;
  const PipelineOptions options_;
  const std::string label_;
  PacedReconstructor paced_;
  FrameEncoder encoder_;
  WorkingVolume volume_;
  std::atomic<bool> key_wanted_{false};
  std::atomic<std::uint64_t> observed_{0};     // frames that gave no surface so that the next one's is of now
  std::atomic<std::uint64_t> undecodable_{0};  // frames that build on one dropped before publishing
  BoundedQueue<Captured> to_reconstruct_{kQueueFrames};
  BoundedQueue<Reconstructed> to_encode_{kQueueFrames};
  BoundedQueue<Encoded> to_publish_{kQueueFrames};
  PipelineStats stats_;

  mutable std::mutex mutex_;  // of what follows
  std::condition_variable stopped_;
  bool stopping_ = false;
  StreamState state_ = StreamState::kStarting;
  std::string message_;
  StepStatus step_;
  std::string step_message_;              // of projector and camera
  std::vector<Taken> times_;              // of frames published since the last one was encoded
  std::optional<std::int64_t> asked_ns_;  // the source for a frame that has not come yet
  std::optional<Error> failure_;
};

}  // namespace

Result<std::unique_ptr<Pipeline>> Pipeline::create(FieldSource& source, std::vector<FrameSink*> sinks,
                                                   const PipelineOptions& options) {
  auto reconstructor = Reconstructor::create(source.info().rig, source.info().pattern, options.reconstruct);
  if (!reconstructor) return reconstructor.error();
  return std::unique_ptr<Pipeline>(
      std::make_unique<ThreadedPipeline>(source, std::move(sinks), options, *std::move(reconstructor)));
}

}  // namespace relievo
