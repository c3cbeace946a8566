// SPDX-License-Identifier: Apache-2.0
#include "idl/stream_recorder.h"

#include <algorithm>
#include <chrono>
#include <utility>
#include <vector>

#include "base/log.h"
#include "base/thread_name.h"
#include "base/time.h"
#include "idl/cdr.h"

namespace relievo {
namespace {

using namespace std::chrono_literals;

constexpr auto kTick = 100ms;
constexpr auto kLook = 5s;                 // at the disk's room
constexpr auto kArrival = 500ms;           // of a stream's last frames
constexpr std::int64_t kMostAhead_s = 60;  // of its time in a recording's name
constexpr std::size_t kAtOnce = 32;        // samples, before who asks for the state may look

/// "face-2026-11-22T07-05-00Z.mcap", in the folder.
std::filesystem::path new_target(const std::filesystem::path& folder, const std::string& stream,
                                 std::int64_t time_s) {
  return folder / (stream + utc_text(time_s * kNanosecondsPerSecond, "-%Y-%m-%dT%H-%M-%SZ") + ".mcap");
}

/// What is written first of it, unless that is there already.
std::filesystem::path first_file(const std::filesystem::path& target, const SegmentOptions& segments) {
  return segments.split() ? RecordingSegments(target, segments).at(0) : target;
}

}  // namespace

StreamRecorder::StreamRecorder(Options options)
    : options_(std::move(options)), ring_(options_.pre_roll_s, options_.keep_bytes) {
  state_.pre_roll_s = options_.pre_roll_s;
  thread_ = std::thread([this] { run(); });
}

StreamRecorder::~StreamRecorder() {
  {
    const std::lock_guard lock(mutex_);
    ending_ = true;
    if (open_ && !end_) end_ = ring_.end();
  }
  wake_.notify_all();
  thread_.join();
}

Subscriber::Callbacks StreamRecorder::callbacks() {
  Subscriber::Callbacks callbacks;
  callbacks.raw = [this](const RawSample& sample) { add(sample); };
  callbacks.lost = [this](const std::string&, std::uint64_t count) {
    const std::lock_guard lock(mutex_);
    frames_seen_ += count;
    if (open_ && !end_) state_.lost += count;
  };
  return callbacks;
}

void StreamRecorder::add(const RawSample& sample) {
  const std::lock_guard lock(mutex_);
  if (sample.topic == Topic::kInfo) {
    info_ = sample;
  } else {
    frames_seen_ += sample.topic == Topic::kFrame;
    const std::uint64_t lost =
        ring_.push(std::make_shared<const RawSample>(sample), open_ ? std::optional(next_) : std::nullopt);
    if (!end_) state_.lost += lost;
  }
  if (open_) wake_.notify_all();
}

Status StreamRecorder::start() {
  const std::lock_guard lock(mutex_);
  if (open_)
    return Error{end_ ? "the recording before is still being written to its end: try again"
                      : "'" + options_.stream + "' is being recorded already"};
  const std::int64_t now_ns = utc_now_ns();
  // No two of ours are called the same, so that the disk, which may be slow, need not be asked here.
  const std::int64_t now_s = now_ns / kNanosecondsPerSecond;
  const bool is_taken = now_s <= named_s_ && named_s_ - now_s < kMostAhead_s;  // else the clock was set back
  named_s_ = is_taken ? named_s_ + 1 : now_s;
  target_ = new_target(options_.folder, options_.stream, named_s_);
  state_ = {.activity = RecordingActivity::kRecording,
            .file = first_file(target_, options_.recording.segments).filename(),
            .room_bytes = state_.room_bytes,
            .started_ns = now_ns,
            .pre_roll_s = options_.pre_roll_s,
            .message = {}};
  growing_.reset();
  open_ = true;
  next_ = ring_.begin();
  end_.reset();
  wake_.notify_all();
  return {};
}

Status StreamRecorder::stop() {
  const std::lock_guard lock(mutex_);
  if (!open_ || end_) return Error{"'" + options_.stream + "' is not being recorded"};
  end_ = ring_.end();
  state_.activity = RecordingActivity::kOff;
  state_.message = "its last frames are still being written";
  wake_.notify_all();
  return {};
}

RecordingState StreamRecorder::state() const {
  const std::lock_guard lock(mutex_);
  RecordingState state = state_;
  if (growing_) state.whole_bytes = growing_->bytes();
  return state;
}

bool StreamRecorder::is_open(const std::string& file) const {
  const std::lock_guard lock(mutex_);
  if (!open_ || state_.file == file) return open_;
  // The next one may have been begun since the state was last told.
  return options_.recording.segments.split() && file > state_.file &&
         file.starts_with(target_.stem().string() + '_');
}

std::shared_ptr<const GrowingRecording> StreamRecorder::growing(const std::string& file) const {
  const std::lock_guard lock(mutex_);
  return state_.file == file ? growing_ : nullptr;
}

void StreamRecorder::finish(std::uint64_t published) {
  std::unique_lock lock(mutex_);
  if (!open_) return;
  wake_.wait_for(lock, kArrival, [&] { return frames_seen_ >= published; });
  if (!end_) end_ = ring_.end();
  wake_.notify_all();
  wake_.wait(lock, [&] { return !open_; });
}

bool StreamRecorder::has_work() const {
  return ending_ || (open_ && info_ && next_ < ring_.end()) || (open_ && end_);
}

void StreamRecorder::run() {
  name_this_thread("recorder");
  std::unique_lock lock(mutex_);
  for (;;) {
    look_at_disk(lock);
    if (open_)
      wake_.wait_for(lock, kTick, [&] { return has_work(); });
    else
      wake_.wait_for(lock, kLook, [&] { return open_ || ending_; });
    if (open_)
      write_some(lock);
    else if (ending_)
      return;
  }
}

void StreamRecorder::look_at_disk(std::unique_lock<std::mutex>& lock) {
  const std::int64_t now_ns = steady_now_ns();
  if (looked_ns_ && now_ns - *looked_ns_ < std::chrono::nanoseconds(kLook).count()) return;
  looked_ns_ = now_ns;
  lock.unlock();  // a disk may be slow
  std::error_code ignored;
  const auto room = std::filesystem::space(options_.folder, ignored).available;
  lock.lock();
  state_.room_bytes = ignored ? 0 : room;
}

/// Of the ring into the file, which ends where that is asked for or the disk takes no more.
void StreamRecorder::write_some(std::unique_lock<std::mutex>& lock) {
  std::vector<std::shared_ptr<const RawSample>> samples;
  next_ = std::max(next_, ring_.begin());
  const std::uint64_t end = std::min(end_.value_or(ring_.end()), ring_.end());
  while (info_ && next_ < end && samples.size() < kAtOnce) samples.push_back(ring_.at(next_++));
  const bool is_last = end_ && (next_ >= *end_ || !info_);
  const std::filesystem::path target = target_;
  std::optional<RawSample> info;
  if (!recorder_ && !samples.empty()) {
    info = info_;
    info->receive_time_ns = samples.front()->receive_time_ns;  // before the frames that it describes
    info->steady_time_ns = samples.front()->steady_time_ns;
  }
  lock.unlock();

  if (info) {
    recorder_ = std::make_unique<Recorder>(
        Recorder::Options{.file = options_.recording.segments.split() ? target : unused_name(target),
                          .stream = options_.stream,
                          .recording = options_.recording,
                          .keeps_name = true});
    to_recorder_ = recorder_->callbacks();
    write(*info);
  }
  for (const auto& sample : samples) write(*sample);
  Status written;
  Recorder::Counts counts;
  std::filesystem::path file;
  std::shared_ptr<const GrowingRecording> growing;
  if (recorder_) {
    const std::int64_t now_ns = steady_now_ns();
    recorder_->tick(now_ns);
    if (options_.key_frame_wanted && recorder_->wants_key_frame(now_ns)) options_.key_frame_wanted();
    written = recorder_->status();
    if (is_last && written) written = recorder_->finish();
    counts = recorder_->counts();
    file = recorder_->file();
    growing = recorder_->growing();
    if (is_last || !written) recorder_.reset();  // which closes the file
  }
  if (!written) log_warning(written.error().message + "; the stream goes on without a recording");

  lock.lock();
  state_.frames = counts.frames;
  state_.bytes = counts.bytes;
  if (!file.empty()) {
    state_.file = file.filename();
    growing_ = std::move(growing);
  }
  if (!is_last && written) return;
  state_.activity = written ? RecordingActivity::kOff : RecordingActivity::kFailed;
  state_.message = written ? "" : written.error().message;
  if (written && counts.files == 0) state_.file.clear();  // nothing came
  open_ = false;
  wake_.notify_all();
}

void StreamRecorder::write(const RawSample& sample) {
  to_recorder_.raw(sample);
  if (sample.topic != Topic::kInfo) return;
  if (const auto info = read_info_cdr(sample.cdr)) to_recorder_.info(*info);
}

}  // namespace relievo
