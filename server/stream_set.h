// SPDX-License-Identifier: Apache-2.0
// The streams of a server, each on a thread of its own: one that fails does not end the others, and what they
// are can change while they run.
#pragma once

#include <atomic>
#include <condition_variable>
#include <map>
#include <memory>
#include <mutex>
#include <set>
#include <string>
#include <thread>
#include <vector>

#include "base/result.h"
#include "server/calibration_session.h"
#include "server/config.h"
#include "server/served_stream.h"

namespace relievo {

/// Every function may be called from any thread; apply() by one at a time.
class StreamSet final : public StreamPauses {
 public:
  /// `retries`: a stream that could not be opened, or failed, is tried again a few seconds later, and never
  /// ends with an error, unless it fails while it is being stopped. Those of a second apply() always are.
  StreamSet(const Surroundings& surroundings, bool retries) : around_(surroundings), retries_(retries) {}
  StreamSet(const StreamSet&) = delete;
  StreamSet& operator=(const StreamSet&) = delete;
  /// Stops and waits.
  ~StreamSet() override;

  /// From now on these run: those that do already, as they are configured and with the same rig and pattern
  /// in the files that they name, go on untouched; others end, or begin. Returns when those have ended, whose
  /// failures are logged. Nothing begins once stop() was called, also meanwhile.
  void apply(const std::vector<StreamConfig>& configs);
  /// Until all have ended. The first failure.
  Status wait();
  /// All end soon. Any number of times.
  void stop();
  void request_key_frame(const std::string& stream);

  std::optional<StreamConfig> config_of(const std::string& stream) const override;
  Status pause(const std::string& stream) override;
  void resume(const std::string& stream) override;

  /// Waits until each was opened or could not be. The names of those that were, though some may have ended
  /// since.
  std::vector<std::string> opened() const;

 private:
  struct Entry {
    StreamConfig config;
    std::string files;  // that it names, as they were when it began
    bool retries = false;
    bool again = false;         // it ran before: what is recorded goes to another file
    bool tried_before = false;  // or it is of a second apply(): its coming up is logged
    std::thread thread;
    ServedStream* stream = nullptr;      // while it runs
    std::atomic<bool> stopping = false;  // set under the mutex
    bool paused = false;                 // to be, or is
    bool waiting = false;                // it is: nothing of it is open
    bool tried = false;                  // to open it
    bool opened = false;
    bool ended = false;
    Status result;
  };

  void run(Entry& entry);
  Status run_once(Entry& entry);
  bool wait_to_retry(Entry& entry);
  bool wait_while_paused(Entry& entry);
  void end(Entry& entry);

  const Surroundings around_;
  const bool retries_;
  mutable std::mutex mutex_;  // of all that follows, but for an entry's first six
  mutable std::condition_variable changed_;
  std::map<std::string, std::unique_ptr<Entry>> entries_;
  std::set<std::string>
      paused_;  // by calibrations, which have their cameras whatever is configured meanwhile
  bool stopping_ = false;
  bool applying_ = false;
  bool was_applied_ = false;
};

}  // namespace relievo
