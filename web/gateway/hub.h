// SPDX-License-Identifier: Apache-2.0
// The gateway's streams and who watches them. Level-triggered: a watcher is woken at most once until it
// looks, and then finds the latest of everything, so nothing queues up behind a slow client.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "base/histogram.h"
#include "base/recording_state.h"
#include "base/rung.h"
#include "base/stream.h"
#include "web/gateway/offered_recording.h"
#include "web/gateway/server_clock.h"
#include "web/gateway/stage_times.h"

namespace relievo {

/// What one stream has been doing, for /api/streams and /metrics.
struct StreamSnapshot {
  StreamInfo info;
  std::optional<ServerStatus> status;
  std::uint64_t published = 0;     // frames handed to the gateway
  std::uint64_t sent = 0;          // frames written to clients, all of them together
  std::uint64_t sent_bytes = 0;    // of those frames
  std::uint64_t client_drops = 0;  // frames that a client had no credit for, and those that build on them
  std::uint64_t key_requests = 0;  // wishes for a key frame, for clients that wait for one
  std::size_t watchers = 0;
  std::array<std::size_t, kWebRungs.size()> watchers_of{};  // of each detail, on it or on their way to it
  std::optional<std::int64_t> clock_offset_ns;  // of the server's clock to this one, where it is known
  OfferedRecording recording;                   // that it is played from, if it is
  std::optional<RecordingState> recorded;       // on request; not the hub's to know, filled in by who asks
  std::optional<StageTimes> stages;             // likewise, of a stream that is made in this process
  bool looked_at = false;                       // likewise: its camera's frames can be (/api/rig)
  // From the capture of each frame until it was published, was here, was handed to a client's connection, and
  // the client asked for another in its place.
  Histogram published_after, here_after, sent_after, taken_after;
};

/// Every function may be called from any thread and returns without waiting for a client.
class Hub {
 public:
  struct Watcher;

  /// One thing for a watcher to send.
  struct Delivery {
    std::shared_ptr<const std::string> text{};  // JSON, or
    std::optional<FrameMessage> frame{};        // a frame
    std::uint64_t drops = 0;                    // with a frame: this watcher's so far
  };

  /// `key_frame_wanted`, which may be empty: see GatewayOptions; called with the hub locked.
  explicit Hub(std::string empty_hint, std::function<void(const std::string& stream)> key_frame_wanted = {});
  Hub(const Hub&) = delete;
  Hub& operator=(const Hub&) = delete;
  ~Hub();

  void announce(const StreamInfo& info, ServerClock clock = ServerClock::kHere);
  /// Frames and status of a stream that is not announced are ignored.
  void publish(const std::string& stream, const FrameMessage& frame);
  void publish(const ServerStatus& status);
  /// What to add to this machine's time for that of the stream's server, which is elsewhere; before that no
  /// time since capture is counted. Forgotten when the stream is withdrawn.
  void set_clock(const std::string& stream, std::int64_t offset_ns);
  /// Of its server's clock to this machine's; nothing where it is not known.
  std::optional<std::int64_t> clock_offset_ns(const std::string& stream) const;
  void withdraw(const std::string& stream);
  /// A stream that was announced is played from this file, until it is withdrawn.
  void offer(const std::string& stream, const OfferedRecording& recording);
  /// To its clients, also to those that come later, where it differs from what they were told last.
  void publish_recording(const std::string& stream, const RecordingState& state);
  /// Nothing where there is none that can be read.
  std::optional<OfferedRecording> recording_of(const std::string& stream) const;

  /// `wake` is called, from any thread and with the hub locked, when take() has something; it must not call
  /// back.
  std::shared_ptr<Watcher> watch(const std::string& stream, std::function<void()> wake);
  /// `wake` is called, as above, when a stream has come or gone; until what this returns is destroyed.
  std::shared_ptr<void> watch_list(std::function<void()> wake);
  void unwatch(const std::shared_ptr<Watcher>& watcher);
  /// Its frames are of this rung from the rung's next key frame on, and until then those of before. The
  /// numbers of its frames go on. Where the stream has no such rung nothing changes. `stills`: of that detail
  /// with JPEG textures, as long as the stream says that it has it.
  void choose(Watcher& watcher, Rung rung, bool stills);
  /// Lower rungs that the stream says it has.
  std::vector<Rung> rungs(const Watcher& watcher) const;
  /// On that rung of a stream, or on their way to it.
  int watchers(const std::string& stream, Rung rung) const;

  /// The next thing to send, `want_frame` saying whether a frame may be among it; nothing where there is
  /// none, and then the watcher will be woken.
  std::optional<Delivery> take(Watcher& watcher, bool want_frame);
  void count_sent(const Watcher& watcher, std::size_t bytes, std::int64_t capture_time_ns);
  void count_taken(const Watcher& watcher, std::int64_t capture_time_ns);

  std::vector<StreamSnapshot> snapshot() const;  // announced streams, by name
  const std::string& empty_hint() const { return empty_hint_; }

 private:
  struct Entry;
  static void forget_frames(Entry& entry);
  void wake_all(Entry& entry);
  void wake_list();
  void offer(Entry& entry, Watcher& watcher, const FrameMessage& frame);
  void ask_for_key_frame(Entry& entry);
  static bool resolve(const Entry& entry, Watcher& watcher);
  static bool is_on(const Watcher& watcher, Rung rung);
  void erase_if_unused(const std::string& stream);

  const std::string empty_hint_;
  const std::function<void(const std::string& stream)> key_frame_wanted_;
  mutable std::mutex mutex_;
  std::map<std::string, std::unique_ptr<Entry>> streams_;
  std::vector<std::weak_ptr<std::function<void()>>> list_watchers_;
  std::uint64_t next_version_ = 1;
};

}  // namespace relievo
