// SPDX-License-Identifier: Apache-2.0
#include "web/gateway/cut_recordings.h"

#include <algorithm>
#include <cstdlib>
#include <string>
#include <utility>

#include "base/log.h"
#include "base/time.h"
#include "codec/cut_recording.h"
#include "codec/recording_follower.h"

namespace relievo {
namespace {

constexpr std::size_t kMostKept = 8;                          // of twelve hours 8 MB each
constexpr std::int64_t kLeft_ns = 5 * kNanosecondsPerSecond;  // nobody writes a file that long unchanged

}  // namespace

std::shared_ptr<CutRecordings::Entry> CutRecordings::entry_of(const FileMark& mark) {
  const std::lock_guard lock(mutex_);
  const auto found = std::ranges::find_if(entries_, [&](const auto& entry) { return entry->mark == mark; });
  if (found != entries_.end()) {
    entries_.splice(entries_.begin(), entries_, found);
  } else {
    entries_.push_front(std::make_shared<Entry>());
    entries_.front()->mark = mark;
    if (entries_.size() > kMostKept) entries_.pop_back();
  }
  return entries_.front();
}

std::shared_ptr<const GrowingRecording> CutRecordings::find(Found& found, Walk& walk, const Make& make) {
  std::unique_lock lock(found.making, std::defer_lock);
  walk.allowed ? lock.lock() : void(lock.try_lock());
  if (!lock || (!found.made && !walk.allowed)) {
    walk.needed = true;
    return nullptr;
  }
  if (!std::exchange(found.made, true)) found.recording = make();
  return found.recording;
}

std::shared_ptr<const GrowingRecording> CutRecordings::index_of(const std::filesystem::path& file,
                                                                const struct stat& status, Walk& walk) {
  const FileMark mark = mark_of(status);
  if (std::abs(utc_now_ns() - mark.time_ns) < kLeft_ns) return nullptr;
  return find(entry_of(mark)->index, walk, [&] {
    const auto index = index_cut_recording(file, &stopped_);
    if (stopped_) return std::shared_ptr<const GrowingRecording>();
    const auto found = index ? *index : nullptr;
    const std::string advice = "; `relievo recover` makes a sound copy";
    if (found)
      log_warning(file.string() + " was cut short: pages are given what is whole of it, " +
                  std::to_string(found->bytes()) + " of " + std::to_string(mark.bytes) +
                  " bytes, with an index that is not in it" + advice);
    else
      log_warning(file.string() + " was cut short, or is damaged: pages read all of it to open it" + advice);
    return found;
  });
}

std::shared_ptr<const GrowingRecording> CutRecordings::growth_of(const std::filesystem::path& file,
                                                                 const struct stat& status, Walk& walk) {
  return find(entry_of(mark_of(status))->growth, walk, [&] {
    RecordingFollower follower(file, &stopped_);
    // The second time for the last chunk, with nothing behind it. What is damaged ends what there is.
    if (follower.look()) static_cast<void>(follower.look().ok());
    return follower.growing();
  });
}

}  // namespace relievo
