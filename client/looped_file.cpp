// SPDX-License-Identifier: Apache-2.0
#include "client/looped_file.h"

#include <atomic>
#include <chrono>
#include <filesystem>
#include <thread>
#include <utility>

#include "base/log.h"
#include "base/time.h"
#include "client/player.h"
#include "codec/recording_follower.h"
#include "idl/cdr.h"

namespace relievo {
namespace {

constexpr double kLongestPause_s = 5;  // of a recording, whose time line shows the whole of it
constexpr std::int64_t kLeft_ns = 5 * kNanosecondsPerSecond;  // nobody writes a file that long unchanged

}  // namespace

Result<FoundRecording> FoundRecording::open(const std::string& file) {
  const FileMark mark = settled_mark_of(file);  // before: a file that comes between is found to be another
  auto recorded = RecordedStream::open(file, "");
  if (!recorded) return recorded.error();
  const bool may_grow = recorded->summary().recovered && utc_now_ns() - mark.time_ns <= kLeft_ns;
  if (recorded->frames() == 0 && !may_grow)
    return Error{file + " holds no frame" +
                 (recorded->summary().recovered ? ": it was cut short before one was recorded" : "")};
  return FoundRecording{file, mark, *std::move(recorded)};
}

struct LoopedFile::Playing {
  explicit Playing(FoundRecording found)
      : mark(found.mark),
        recorded(std::move(found.recorded)),
        name(recorded.stream()),
        whole(!recorded.summary().recovered) {
    if (!whole && utc_now_ns() - mark.time_ns < kLeft_ns) follower.emplace(found.file);
  }

  const FileMark mark;
  RecordedStream recorded;
  const std::string name;
  const bool whole;
  std::optional<RecordingFollower> follower;  // of what is, or was, being written
  std::int64_t came_ns = steady_now_ns();     // when it was last longer than before
  bool damaged = false;
  std::atomic<bool> left{false}, ended{false};
  std::thread thread;
};

LoopedFile::LoopedFile(FoundRecording found, std::set<std::string>& streams, Gateway& gateway,
                       StopSignal& stop)
    : file_(found.file), streams_(streams), gateway_(gateway), stop_(stop), seen_(found.mark) {
  start(std::move(found));
  look();
}

LoopedFile::~LoopedFile() {
  if (playing_) playing_->thread.join();
  for (const auto& playing : left_) playing->thread.join();
}

void LoopedFile::start(FoundRecording found) {
  playing_ = std::make_unique<Playing>(std::move(found));
  Playing& playing = *playing_;
  streams_.insert(playing.name);
  // Before anyone is told the address: who follows it at once finds the stream.
  if (auto info = playing.recorded.find_info(); info && *info) (void)publish(playing, **info).ok();
  playing.thread = std::thread([this, &playing] { run(playing); });
}

void LoopedFile::leave() {
  if (!playing_) return;
  {
    const std::lock_guard lock(mutex_);
    playing_->left = true;
    gateway_.withdraw(playing_->name);
  }
  streams_.erase(playing_->name);
  left_.push_back(std::move(playing_));
}

void LoopedFile::look() {
  std::erase_if(left_, [](const auto& playing) {
    if (playing->ended) playing->thread.join();
    return !playing->thread.joinable();
  });
  const FileMark mark = mark_of(file_);
  const bool gone = mark.inode == 0, empty = !gone && mark.bytes == 0;
  if (gone || empty) {
    tell_of(gone ? "is gone" : "has become empty");
    if (gone && playing_) return gateway_.offer(playing_->name, {});  // played on as far as it is open
    return leave();
  }
  const bool was_cut = playing_ && was_left_unread(mark);
  if (playing_ && (was_cut || is_another(mark))) leave();
  if (!playing_) take_up(mark, was_cut);
  seen_ = mark;
  if (playing_) offer();
}

/// Moved in its place, or written over. One that is being written grows: the follower says what else it is.
bool LoopedFile::is_another(const FileMark& mark) const {
  const FileMark& mine = playing_->mark;
  if (mark.inode != mine.inode || mark.device != mine.device) return true;
  return playing_->follower ? mark.bytes < seen_.bytes : mark != mine;
}

/// Of a writer that was killed behind a chunk's messages: who opens the file now has all of them. Or before
/// the first chunk: it has nothing to open.
bool LoopedFile::was_left_unread(const FileMark& mark) const {
  const auto& follower = playing_->follower;
  return follower && (follower->holds_back() || follower->growing()->bytes() == 0) &&
         utc_now_ns() - mark.time_ns > kLeft_ns && steady_now_ns() - playing_->came_ns > kLeft_ns;
}

void LoopedFile::take_up(const FileMark& mark, bool was_cut) {
  const bool is_written_over = mark.inode == seen_.inode && mark.bytes == seen_.bytes && mark != seen_;
  if (is_written_over) return;                 // perhaps not to its end yet
  if (mark == refused_) return tell_of(why_);  // once it stays as it is: it may be on its way there
  auto found = FoundRecording::open(file_);
  const bool taken = found && streams_.contains(found->recorded.stream());
  if (found && !taken) {
    if (missing_.empty() && !was_cut) log_info(file_ + " is another file now, which is played from here on");
    return start(*std::move(found));
  }
  refused_ = mark;
  why_ = "cannot be played: " +
         (taken ? "stream '" + found->recorded.stream() + "', which it holds, is there already"
                : found.error().message);
}

void LoopedFile::offer() {
  tell_of("");
  OfferedRecording offered{.file = file_, .whole = playing_->whole};
  if (auto& follower = playing_->follower) {
    const auto found = follower->look();
    if (found && *found == RecordingFollower::Found::kAnother) return leave();  // it is taken up next time
    if (!found && !std::exchange(playing_->damaged, true))
      log_warning(found.error().message + ": pages have what is before that");
    const std::int64_t now_ns = steady_now_ns();
    if (found && *found == RecordingFollower::Found::kMore) playing_->came_ns = now_ns;
    offered.growing = follower->growing();
    offered.has_index = found && *found == RecordingFollower::Found::kFinished;
    // With a chunk that is held back something is yet to come, from whoever wrote it or by
    // was_left_unread(): pages ask for it once this no longer grows.
    const bool is_awaited = follower->holds_back() || now_ns - playing_->came_ns < kLeft_ns;
    offered.grows = found && !offered.has_index && is_awaited;
  }
  gateway_.offer(playing_->name, offered);
}

/// Each change once; "": all is well.
void LoopedFile::tell_of(const std::string& missing) {
  if (missing == missing_) return;
  if (!missing.empty()) log_warning(file_ + " " + missing + "; pages cannot read it");
  if (missing.empty()) log_info(file_ + " is there again");
  missing_ = missing;
}

void LoopedFile::run(Playing& playing) {
  const Status status = play(playing.recorded,
                             {.loop = true,
                              .follow = true,
                              .longest_pause_s = kLongestPause_s,
                              .ended = [&] { return playing.left.load(); }},
                             stop_, [&](const RawSample& sample) { return publish(playing, sample); });
  if (!status) {
    const std::lock_guard lock(mutex_);
    if (!playing.left) {
      log_error(file_ + ": " + status.error().message);
      gateway_.withdraw(playing.name);
    }
  }
  playing.ended = true;
}

// Unreadable samples are skipped: the viewer counts the gap.
Status LoopedFile::publish(const Playing& playing, const RawSample& sample) {
  const std::lock_guard lock(mutex_);
  if (playing.left) return {};
  if (sample.topic == Topic::kInfo) {
    if (auto info = read_info_cdr(sample.cdr)) gateway_.announce(*info);
  } else if (sample.topic == Topic::kStatus) {
    auto status = read_status_cdr(sample.cdr);
    if (!status) return {};
    status->rungs.clear();  // its server's then: here there is what was recorded
    gateway_.publish(*status);
  } else if (auto frame = read_frame_cdr(sample.cdr)) {
    FrameMessage message;
    message.sequence = sequence_++;  // goes on over the loop's seam, and into another file
    message.number = frame->number;
    // As if it were captured now with its latency of then: viewers show the way from here to them.
    message.publish_time_ns = utc_now_ns();
    message.capture_time_ns = message.publish_time_ns - (frame->publish_time_ns - frame->capture_time_ns);
    message.data = std::make_shared<const Bytes>(frame->data.begin(), frame->data.end());
    gateway_.publish(frame->stream, message);
  }
  return {};
}

}  // namespace relievo
