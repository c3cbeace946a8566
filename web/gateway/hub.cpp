// SPDX-License-Identifier: Apache-2.0
#include "web/gateway/hub.h"

#include <algorithm>
#include <utility>

#include "base/time.h"
#include "codec/decodable_frames.h"
#include "codec/frame_layout.h"
#include "web/gateway/protocol.h"

namespace relievo {
namespace {

// A connection that loses frames is not helped by many large ones; who joins has no picture until the first.
constexpr std::int64_t kKeyRequestInterval_ns = kNanosecondsPerSecond;
constexpr std::int64_t kJoinInterval_ns = 100'000'000;

BuildsOn builds_on(const FrameMessage& frame) {
  return what_it_builds_on(*frame.data);
}

}  // namespace

struct Hub::Watcher {
  std::string stream;
  std::function<void()> wake;
  bool woken = false;                  // since it last found nothing
  std::optional<FrameMessage> latest;  // the slot
  bool needs_key = false;              // it lacks a frame that others build on
  bool joins = true;                   // no key frame was asked for since it is there
  std::uint64_t drops = 0;
  std::uint64_t drops_before = 0;   // the frame in the slot
  Rung rung = Rung::kFull;          // it is on,
  Rung wished = Rung::kFull;        // and is to be on:
  Rung detail = Rung::kFull;        // this, or
  bool stills = false;              // the same with JPEG textures, where the stream has that
  std::uint64_t renumber = 0;       // to add to its rung's numbers
  std::uint64_t last_sequence = 0;  // with that
  std::uint64_t seen_info = 0;      // versions it has been sent; 0: none
  std::uint64_t seen_status = 0;
  std::uint64_t seen_recording = 0;
  bool told_live = false;
  bool told_waiting = false;
};

struct Hub::Entry {
  StreamSnapshot facts;
  ServerClock clock = ServerClock::kHere;
  bool live = false;  // announced and not withdrawn
  std::shared_ptr<const std::string> info_text, status_text, recording_text;
  std::uint64_t info_version = 0, status_version = 0, recording_version = 0;
  // So that a late joiner sees a stalled stream's last picture: the last frame, and where that builds on
  // others the last one that does not.
  std::optional<FrameMessage> latest, latest_key;
  std::array<DecodableFrames, kRungs.size()> decodable;  // of each rung
  std::optional<std::int64_t> key_asked_ns;
  std::vector<std::shared_ptr<Watcher>> watchers;

  /// Of the server's clock to this one, where it is known.
  std::optional<std::int64_t> clock_offset_ns() const {
    if (clock == ServerClock::kElsewhere || facts.clock_offset_ns) return facts.clock_offset_ns;
    return 0;
  }
  void add_since(std::int64_t capture_time_ns, Histogram& histogram) const {
    if (const auto offset_ns = clock_offset_ns())
      histogram.add(seconds(utc_now_ns() + *offset_ns - capture_time_ns));
  }
};

bool Hub::is_on(const Watcher& watcher, Rung rung) {
  return watcher.rung == rung || watcher.wished == rung;
}

/// Whether that changes where it is to be.
bool Hub::resolve(const Entry& entry, Watcher& watcher) {
  const auto has = [&](Rung rung) {
    const auto& status = entry.facts.status;
    return status && std::ranges::any_of(status->rungs, [&](const RungStatus& r) { return r.rung == rung; });
  };
  Rung wished = watcher.detail;
  if (watcher.stills) {
    const Rung jpeg = *jpeg_of(has(wished) ? wished : Rung::kFull);
    if (has(jpeg)) wished = jpeg;
  }
  return std::exchange(watcher.wished, wished) != wished && watcher.rung != wished;
}

Hub::Hub(std::string empty_hint, std::function<void(const std::string&)> key_frame_wanted)
    : empty_hint_(std::move(empty_hint)), key_frame_wanted_(std::move(key_frame_wanted)) {}
Hub::~Hub() = default;

void Hub::wake_all(Entry& entry) {
  for (const auto& watcher : entry.watchers) {
    if (std::exchange(watcher->woken, true)) continue;
    watcher->wake();
  }
}

void Hub::wake_list() {
  std::erase_if(list_watchers_, [](const auto& watcher) { return watcher.expired(); });
  for (const auto& watcher : list_watchers_)
    if (const auto wake = watcher.lock()) (*wake)();
}

std::shared_ptr<void> Hub::watch_list(std::function<void()> wake) {
  auto watcher = std::make_shared<std::function<void()>>(std::move(wake));
  const std::lock_guard lock(mutex_);
  list_watchers_.push_back(watcher);
  return watcher;
}

void Hub::erase_if_unused(const std::string& stream) {
  const auto it = streams_.find(stream);
  if (it != streams_.end() && !it->second->live && it->second->watchers.empty()) streams_.erase(it);
}

void Hub::announce(const StreamInfo& info, ServerClock clock) {
  auto text = std::make_shared<const std::string>(info_message(info));
  const std::lock_guard lock(mutex_);
  auto& entry = streams_[info.stream];
  if (!entry) entry = std::make_unique<Entry>();
  if (entry->live && *entry->info_text == *text) return;  // DDS repeats it to every late joiner
  // A server that was replaced before anyone noticed; one that goes on may have been told where it stands.
  if (entry->live && entry->facts.info.started_ns != info.started_ns) forget_frames(*entry);
  entry->facts.info = info;
  entry->clock = clock;
  entry->info_text = std::move(text);
  entry->info_version = next_version_++;
  const bool is_new = !std::exchange(entry->live, true);
  wake_all(*entry);
  if (is_new) wake_list();
}

void Hub::publish(const std::string& stream, const FrameMessage& frame) {
  const std::lock_guard lock(mutex_);
  const auto it = streams_.find(stream);
  if (it == streams_.end() || !it->second->live || !frame.data) return;
  Entry& entry = *it->second;
  const bool is_key = builds_on(frame) == BuildsOn::kNothing;
  const bool is_broken =
      !entry.decodable[static_cast<std::size_t>(frame.rung)].add(frame.sequence, frame.data);
  if (frame.rung == Rung::kFull) {
    ++entry.facts.published;
    entry.facts.published_after.add(seconds(frame.publish_time_ns - frame.capture_time_ns));
    entry.add_since(frame.capture_time_ns, entry.facts.here_after);
    entry.latest = frame;
    if (is_key) entry.latest_key = frame;
  }
  bool key_needed = false;
  for (const auto& watcher : entry.watchers) {
    if (is_key && watcher->rung != watcher->wished && watcher->wished == frame.rung) {
      watcher->rung = frame.rung;
      watcher->renumber = watcher->last_sequence + 1 - frame.sequence;
    }
    if (watcher->rung != frame.rung) continue;
    watcher->needs_key = watcher->needs_key || is_broken;
    offer(entry, *watcher, frame);
    key_needed = key_needed || watcher->needs_key;
  }
  if (key_needed) ask_for_key_frame(entry);
  wake_all(entry);
}

/// Into the watcher's slot, unless the frame there or one that it never got is what this one builds on.
void Hub::offer(Entry& entry, Watcher& watcher, const FrameMessage& frame) {
  const BuildsOn needed = builds_on(frame);
  const bool slot_is_key = watcher.latest && builds_on(*watcher.latest) == BuildsOn::kNothing;
  if (needed == BuildsOn::kNothing) watcher.needs_key = false;
  const bool useless = watcher.needs_key || (needed == BuildsOn::kFrameBefore && watcher.latest) ||
                       (needed == BuildsOn::kKeyFrame && slot_is_key);
  if (useless || watcher.latest) {
    ++watcher.drops;
    ++entry.facts.client_drops;
  }
  watcher.last_sequence = frame.sequence + watcher.renumber;
  if (!useless) {
    watcher.latest = frame;
    watcher.latest->sequence = watcher.last_sequence;
    watcher.drops_before = watcher.drops;
  }
  if (useless && needed == BuildsOn::kFrameBefore) watcher.needs_key = true;
}

void Hub::ask_for_key_frame(Entry& entry) {
  const std::int64_t now_ns = steady_now_ns();
  const auto waits = [](const auto& watcher) { return watcher->needs_key && watcher->joins; };
  const std::int64_t interval_ns =
      std::ranges::any_of(entry.watchers, waits) ? kJoinInterval_ns : kKeyRequestInterval_ns;
  if (!key_frame_wanted_ || (entry.key_asked_ns && now_ns - *entry.key_asked_ns < interval_ns)) return;
  for (const auto& watcher : entry.watchers) watcher->joins = false;
  entry.key_asked_ns = now_ns;
  ++entry.facts.key_requests;
  key_frame_wanted_(entry.facts.info.stream);
}

void Hub::publish(const ServerStatus& status) {
  auto text = std::make_shared<const std::string>(status_message(status));
  const std::lock_guard lock(mutex_);
  const auto it = streams_.find(status.stream);
  if (it == streams_.end() || !it->second->live) return;
  it->second->facts.status = status;
  it->second->status_text = std::move(text);
  it->second->status_version = next_version_++;
  bool any_moves = false;
  for (const auto& watcher : it->second->watchers) any_moves |= resolve(*it->second, *watcher);
  if (any_moves) ask_for_key_frame(*it->second);
  wake_all(*it->second);
}

void Hub::publish_recording(const std::string& stream, const RecordingState& state) {
  auto text = std::make_shared<const std::string>(recording_event(state));
  const std::lock_guard lock(mutex_);
  const auto it = streams_.find(stream);
  if (it == streams_.end() || !it->second->live) return;
  Entry& entry = *it->second;
  if (entry.recording_text && *entry.recording_text == *text) return;
  entry.recording_text = std::move(text);
  entry.recording_version = next_version_++;
  wake_all(entry);
}

/// What was of a session that is over: nothing that comes builds on it, and other qualities may be there.
void Hub::forget_frames(Entry& entry) {
  entry.latest.reset();
  entry.latest_key.reset();
  entry.facts.status.reset();
  entry.decodable = {};
  entry.status_version = 0;
  for (const auto& watcher : entry.watchers) {
    watcher->needs_key = true;  // whatever comes next
    watcher->rung = Rung::kFull;
    watcher->renumber = watcher->last_sequence = 0;
    if (!watcher->latest) continue;
    watcher->latest.reset();
    ++watcher->drops;
    ++entry.facts.client_drops;
  }
}

void Hub::withdraw(const std::string& stream) {
  const std::lock_guard lock(mutex_);
  const auto it = streams_.find(stream);
  if (it == streams_.end() || !it->second->live) return;
  Entry& entry = *it->second;
  entry.live = false;
  forget_frames(entry);
  entry.facts.recording = {};
  entry.facts.clock_offset_ns.reset();
  entry.recording_version = 0;
  entry.recording_text.reset();
  wake_all(entry);
  wake_list();
  erase_if_unused(stream);
}

void Hub::offer(const std::string& stream, const OfferedRecording& recording) {
  const std::lock_guard lock(mutex_);
  const auto it = streams_.find(stream);
  if (it != streams_.end() && it->second->live) it->second->facts.recording = recording;
}

std::optional<OfferedRecording> Hub::recording_of(const std::string& stream) const {
  const std::lock_guard lock(mutex_);
  const auto it = streams_.find(stream);
  if (it == streams_.end() || !it->second->facts.recording.readable()) return std::nullopt;
  return it->second->facts.recording;
}

std::shared_ptr<Hub::Watcher> Hub::watch(const std::string& stream, std::function<void()> wake) {
  auto watcher = std::make_shared<Watcher>();
  watcher->stream = stream;
  watcher->wake = std::move(wake);
  const std::lock_guard lock(mutex_);
  auto& entry = streams_[stream];
  if (!entry) entry = std::make_unique<Entry>();
  const BuildsOn needed = entry->latest ? builds_on(*entry->latest) : BuildsOn::kNothing;
  watcher->latest = needed == BuildsOn::kNothing ? entry->latest : entry->latest_key;
  // An older key frame stands for all up to the last one: those between are no loss to who was not here.
  if (watcher->latest) watcher->last_sequence = watcher->latest->sequence = entry->latest->sequence;
  watcher->needs_key = !watcher->latest || needed == BuildsOn::kFrameBefore;
  entry->watchers.push_back(watcher);
  if (watcher->needs_key && entry->latest) ask_for_key_frame(*entry);
  return watcher;
}

void Hub::unwatch(const std::shared_ptr<Watcher>& watcher) {
  const std::lock_guard lock(mutex_);
  const auto it = streams_.find(watcher->stream);
  if (it == streams_.end()) return;
  std::erase(it->second->watchers, watcher);
  erase_if_unused(watcher->stream);
}

void Hub::choose(Watcher& watcher, Rung rung, bool stills) {
  const std::lock_guard lock(mutex_);
  watcher.detail = rung;
  watcher.stills = stills;
  const auto it = streams_.find(watcher.stream);
  if (it != streams_.end() && resolve(*it->second, watcher) && it->second->live)
    ask_for_key_frame(*it->second);
}

std::vector<Rung> Hub::rungs(const Watcher& watcher) const {
  const std::lock_guard lock(mutex_);
  std::vector<Rung> out;
  const auto it = streams_.find(watcher.stream);
  if (it == streams_.end() || !it->second->facts.status) return out;
  for (const RungStatus& rung : it->second->facts.status->rungs)
    if (rung.rung != Rung::kSlow && !is_jpeg(rung.rung)) out.push_back(rung.rung);
  return out;
}

int Hub::watchers(const std::string& stream, Rung rung) const {
  const std::lock_guard lock(mutex_);
  const auto it = streams_.find(stream);
  if (it == streams_.end()) return 0;
  return static_cast<int>(
      std::ranges::count_if(it->second->watchers, [&](const auto& w) { return is_on(*w, rung); }));
}

void Hub::set_clock(const std::string& stream, std::int64_t offset_ns) {
  const std::lock_guard lock(mutex_);
  const auto it = streams_.find(stream);
  if (it != streams_.end() && it->second->live) it->second->facts.clock_offset_ns = offset_ns;
}

std::optional<std::int64_t> Hub::clock_offset_ns(const std::string& stream) const {
  const std::lock_guard lock(mutex_);
  const auto it = streams_.find(stream);
  return it == streams_.end() ? std::nullopt : it->second->clock_offset_ns();
}

std::optional<Hub::Delivery> Hub::take(Watcher& watcher, bool want_frame) {
  const std::lock_guard lock(mutex_);
  const auto it = streams_.find(watcher.stream);
  if (it == streams_.end()) return std::nullopt;
  Entry& entry = *it->second;
  if (!entry.live) {
    if (std::exchange(watcher.told_live, false)) {
      watcher.told_waiting = true;
      return Delivery{.text = std::make_shared<const std::string>(gone_message())};
    }
    if (!std::exchange(watcher.told_waiting, true)) {
      return Delivery{.text = std::make_shared<const std::string>(waiting_message(empty_hint_))};
    }
    watcher.woken = false;
    return std::nullopt;
  }
  if (std::exchange(watcher.seen_info, entry.info_version) != entry.info_version) {
    watcher.told_live = true;
    watcher.told_waiting = false;
    return Delivery{.text = entry.info_text};
  }
  if (entry.status_version != 0 &&
      std::exchange(watcher.seen_status, entry.status_version) != entry.status_version) {
    return Delivery{.text = entry.status_text};
  }
  if (entry.recording_version != 0 &&
      std::exchange(watcher.seen_recording, entry.recording_version) != entry.recording_version) {
    return Delivery{.text = entry.recording_text};
  }
  if (want_frame && watcher.latest) {
    return Delivery{.frame = std::exchange(watcher.latest, std::nullopt), .drops = watcher.drops_before};
  }
  watcher.woken = false;
  return std::nullopt;
}

void Hub::count_sent(const Watcher& watcher, std::size_t bytes, std::int64_t capture_time_ns) {
  const std::lock_guard lock(mutex_);
  const auto it = streams_.find(watcher.stream);
  if (it == streams_.end()) return;
  ++it->second->facts.sent;
  it->second->facts.sent_bytes += bytes;
  it->second->add_since(capture_time_ns, it->second->facts.sent_after);
}

void Hub::count_taken(const Watcher& watcher, std::int64_t capture_time_ns) {
  const std::lock_guard lock(mutex_);
  const auto it = streams_.find(watcher.stream);
  if (it == streams_.end()) return;
  it->second->add_since(capture_time_ns, it->second->facts.taken_after);
}

std::vector<StreamSnapshot> Hub::snapshot() const {
  const std::lock_guard lock(mutex_);
  std::vector<StreamSnapshot> out;
  for (const auto& [name, entry] : streams_) {
    if (!entry->live) continue;
    out.push_back(entry->facts);
    out.back().watchers = entry->watchers.size();
    for (const Rung rung : kWebRungs)
      for (const auto& watcher : entry->watchers)
        out.back().watchers_of[static_cast<std::size_t>(rung)] +=
            is_on(*watcher, rung) || is_on(*watcher, *jpeg_of(rung));
  }
  return out;
}

}  // namespace relievo
