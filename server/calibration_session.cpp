// SPDX-License-Identifier: Apache-2.0
#include "server/calibration_session.h"

#include <filesystem>
#include <utility>

#include "base/log.h"
#include "base/time.h"
#include "capture/evaluate/pictures.h"
#include "codec/jpeg_texture.h"
#include "server/keep_rig.h"

namespace relievo {
namespace {

constexpr std::int64_t kBetweenPictures_ns = 200'000'000;
constexpr std::int64_t kMostLate_ns =
    200'000'000;                 // behind its own times before a source's clock is set back
constexpr int kMostErrors = 30;  // of the source, in a row
constexpr int kQuality = 85;

std::shared_ptr<const Bytes> jpeg_of(const Image8& picture) {
  auto out = std::make_shared<Bytes>();
  if (const Status drawn = append_jpeg(picture.view(), kQuality, *out); !drawn) {
    log_warning("a picture of the calibration: " + drawn.error().message);
    return nullptr;
  }
  return out;
}

/// Both exposures together: the pattern cancels, and what it lights is seen.
Image8 without_pattern(const CapturedFrame& frame) {
  Image8 out = draw_field(frame, false);
  const Image8 other = draw_field(frame, true);
  for (std::size_t i = 0; i < out.size(); ++i)
    out.data()[i] = static_cast<std::uint8_t>((out.data()[i] + other.data()[i] + 1) / 2);
  return out;
}

CalibrationKind kind_of(const CalibrationOrder& order) {
  return order.kind == "colour" ? CalibrationKind::kColour : CalibrationKind::kGeometry;
}

}  // namespace

CalibrationSession::CalibrationSession(const CalibrationPlace& place, StreamConfig config,
                                       CalibrationOrder order)
    : place_(place), config_(std::move(config)), order_(std::move(order)), watched_ns_(steady_now_ns()) {
  state_.phase = CalibrationPhase::kPausing;
  state_.stream = order_.stream;
  state_.kind = order_.kind;
  state_.board = order_.board;
  state_.next = "The stream lets go of the camera.";
  thread_ = std::thread([this] { work(); });
}

CalibrationSession::~CalibrationSession() {
  (void)order("cancel");
  thread_.join();
}

CalibrationState CalibrationSession::state() {
  const std::lock_guard lock(mutex_);
  watched_ns_ = steady_now_ns();
  return state_;
}

std::shared_ptr<const Bytes> CalibrationSession::picture(const std::string& name) const {
  const std::lock_guard lock(mutex_);
  return name == "camera" ? state_.camera : state_.coverage;
}

bool CalibrationSession::ended() const {
  const std::lock_guard lock(mutex_);
  return ended_;
}

Status CalibrationSession::order(const std::string& action) {
  const std::lock_guard lock(mutex_);
  if (ended_) return Error{"no calibration is under way"};
  watched_ns_ = steady_now_ns();
  if (action == "cancel") {
    cancelled_ = true;
    if (source_ != nullptr) source_->request_stop();
    changed_.notify_all();
    return {};
  }
  const bool solved = state_.phase == CalibrationPhase::kSolved;
  if (action == "keep" || action == "more") {
    if (!solved) return Error{"there is no result yet"};
    wish_ = action == "keep" ? Wish::kKeep : Wish::kMore;
    return {};
  }
  if (state_.phase != CalibrationPhase::kWatching) return Error{"not now: " + state_.next};
  if (action == "calculate") {
    if (!state_.can_solve) return Error{"there are too few views: take more"};
    wish_ = Wish::kSolve;
  } else if (action == "take") {
    state_.armed = true;
    armed_ns_ = watched_ns_;
    armed_frames_ = frames_;
  } else {
    state_.automatic = action == "automatic";
  }
  return {};
}

void CalibrationSession::work() {
  const Status done = calibrate();
  place_.streams.resume(order_.stream);
  end(done);
}

void CalibrationSession::end(const Status& done) {
  if (!done) log_warning("the calibration of " + order_.stream + ": " + done.error().message);
  const std::lock_guard lock(mutex_);
  state_.phase = CalibrationPhase::kOff;
  state_.next.clear();
  state_.camera = state_.coverage = nullptr;
  state_.armed = state_.automatic = false;
  state_.failed = !done;
  if (!done)
    state_.message = done.error().message;
  else if (state_.file.empty())
    state_.message = "Given up: the stream goes on with its rig as it was.";
  ended_ = true;
}

Status CalibrationSession::calibrate() {
  if (const Status paused = place_.streams.pause(order_.stream); !paused) return paused;
  auto before = rig_so_far(config_.camera.rig);
  if (!before) return before.error();
  auto source = open_calibration_source(config_, place_.config, kind_of(order_), order_.board);
  if (!source) return source.error();
  auto task = make_calibration_task(kind_of(order_), order_.board, (*source)->info(), *before);
  if (!task) return task.error();
  const SourceInfo& info = (*source)->info();
  const ProjectorState projected = place_.projector.state();
  if (projected.activity != ProjectorActivity::kNone) {
    projector_shows_ = (*task)->projector_shows();
    const Status shown = place_.projector.start({order_.stream, projector_shows_, info.rig, info.pattern});
    if (!shown) return shown;
  }
  {
    const std::lock_guard lock(mutex_);
    source_ = source->get();
    if (cancelled_) source_->request_stop();
  }
  const Status watched = watch(**source, **task);
  {
    const std::lock_guard lock(mutex_);
    source_ = nullptr;
  }
  if (!projector_shows_.empty()) restore(projected, info.pattern);
  return watched;
}

/// The projector as it was; where the rig is another now, with that.
void CalibrationSession::restore(const ProjectorState& before, const Pattern& pattern) {
  const auto rig = rig_so_far(config_.camera.rig);
  const bool again = before.activity == ProjectorActivity::kOn && before.stream == order_.stream;
  if (again && rig && rig->whole)
    (void)place_.projector.start({order_.stream, before.shows, *rig->whole, pattern});
  else
    (void)place_.projector.stop();
}

Status CalibrationSession::watch(FieldSource& source, CalibrationTask& task) {
  StillCollector collector(task.cycle());
  tell(CalibrationPhase::kWatching, task);
  draw_coverage(task);
  for (int errors = 0;;) {
    auto frame = source.next();
    if (const Status sound = check(); !sound) return sound;
    if (!frame && ++errors == kMostErrors) return frame.error();
    if (!frame) continue;
    errors = 0;
    {
      const std::lock_guard lock(mutex_);
      if (cancelled_) return {};
    }
    if (!*frame) return Error{source.info().name + " ended"};
    if (!pace(source.info(), (*frame)->time_ns)) return {};
    show(**frame);
    if (const Status done = go_on(task, collector, collector.add(**frame)); !done) return done;
    if (keep(source.info().pattern)) return {};
  }
}

/// A source that is not live comes as fast as it can. False once cancelled.
bool CalibrationSession::pace(const SourceInfo& info, std::int64_t time_ns) {
  if (info.live) return true;
  const std::int64_t now = steady_now_ns();
  if (started_ns_ + time_ns < now - kMostLate_ns) started_ns_ = now - time_ns;
  std::unique_lock lock(mutex_);
  return !changed_.wait_for(lock, std::chrono::nanoseconds(started_ns_ + time_ns - now),
                            [this] { return cancelled_; });
}

void CalibrationSession::show(const CapturedFrame& frame) {
  const std::int64_t now = steady_now_ns();
  if (now - shown_ns_ < kBetweenPictures_ns) return;
  shown_ns_ = now;
  auto picture = jpeg_of(without_pattern(frame));
  const std::lock_guard lock(mutex_);
  state_.camera = std::move(picture);
}

void CalibrationSession::draw_coverage(const CalibrationTask& task) {
  const auto drawn = task.coverage();
  if (!drawn) return;
  auto picture = jpeg_of(*drawn);
  const std::lock_guard lock(mutex_);
  state_.coverage = std::move(picture);
  state_.tilts = task.tilts();
}

/// Whether it may go on.
Status CalibrationSession::check() const {
  if (!projector_shows_.empty()) {
    const ProjectorState now = place_.projector.state();
    if (now.activity == ProjectorActivity::kFailed) return Error{"the projector: " + now.message};
    if (now.activity != ProjectorActivity::kOn || now.shows != projector_shows_)
      return Error{"the projector was switched off, or to another picture"};
  }
  const std::lock_guard lock(mutex_);
  if (steady_now_ns() - watched_ns_ > place_.unwatched_for.count())
    return Error{"given up, since no page watched it any more"};
  return {};
}

Status CalibrationSession::go_on(CalibrationTask& task, StillCollector& collector, bool came_to_rest) {
  const bool rests = collector.at_rest() >= task.cycle();
  std::unique_lock lock(mutex_);
  state_.at_rest = collector.at_rest();
  ++frames_;
  if (state_.phase == CalibrationPhase::kSolved) {
    if (wish_ != Wish::kMore) return {};
    wish_ = Wish::kNone;
    state_.result.clear();
    lock.unlock();
    tell(CalibrationPhase::kWatching, task);
    return {};
  }
  const bool takes = rests && (state_.armed || (state_.automatic && came_to_rest));
  const bool too_late = state_.armed && !rests && steady_now_ns() - armed_ns_ > place_.rest_within.count() &&
                        frames_ - armed_frames_ >= place_.rest_cycles * task.cycle();
  const bool solves = std::exchange(wish_, wish_ == Wish::kSolve ? Wish::kNone : wish_) == Wish::kSolve;
  if (takes || too_late) state_.armed = false;
  if (too_late)
    state_.message =
        "Nothing was taken: " + std::to_string(state_.at_rest) + " of the projector's " +
        std::to_string(task.cycle()) +
        " slides were seen at rest. Hold it still; does the projector show them, brightly enough?";
  lock.unlock();
  if (takes) take(task, collector);
  if (solves) solve(task);
  return {};
}

void CalibrationSession::take(CalibrationTask& task, const StillCollector& collector) {
  tell(CalibrationPhase::kBusy, task);
  TakenView view = task.take(collector);
  {
    const std::lock_guard lock(mutex_);
    state_.message.clear();
    state_.views.push_back(std::move(view));
  }
  draw_coverage(task);
  if (kind_of(order_) == CalibrationKind::kColour && task.can_solve()) return solve(task);
  tell(CalibrationPhase::kWatching, task);
}

void CalibrationSession::solve(CalibrationTask& task) {
  tell(CalibrationPhase::kBusy, task);
  auto solved = task.solve();
  {
    const std::lock_guard lock(mutex_);
    state_.message = solved ? "" : solved.error().message;
    state_.result = solved ? solved->report : "";
    if (solved) state_.automatic = false;
  }
  if (solved) result_ = *std::move(solved);
  tell(solved ? CalibrationPhase::kSolved : CalibrationPhase::kWatching, task);
}

void CalibrationSession::tell(CalibrationPhase phase, const CalibrationTask& task) {
  const std::lock_guard lock(mutex_);
  state_.phase = phase;
  state_.cycle = task.cycle();
  state_.can_solve = task.can_solve();
  state_.enough = task.enough();
  state_.next = phase == CalibrationPhase::kBusy     ? "Measuring."
                : phase == CalibrationPhase::kSolved ? "Look at the result: keep it, or take more."
                                                     : task.next();
}

bool CalibrationSession::keep(const Pattern& pattern) {
  {
    const std::lock_guard lock(mutex_);
    if (wish_ != Wish::kKeep) return false;
    wish_ = Wish::kNone;
  }
  const std::filesystem::path file = config_.camera.rig;
  const auto old = keep_rig(file, result_.rig, pattern, utc_now_ns());
  const std::lock_guard lock(mutex_);
  if (!old) {
    state_.message = old.error().message;
    return false;
  }
  state_.file = file.filename().string();
  state_.old = *old;
  state_.message = "Written to " + state_.file + (old->empty() ? "." : "; the one before is " + *old + ".");
  log_info("stream " + order_.stream + " was calibrated: " + file.string() + " is new");
  return true;
}

}  // namespace relievo
