// SPDX-License-Identifier: Apache-2.0
// Starts and stops `relievo-server project` in a process of its own: windows want a main thread, and a
// display that fails takes no stream with it.
#pragma once

#include <sys/types.h>

#include <condition_variable>
#include <cstdint>
#include <mutex>
#include <optional>
#include <string>
#include <thread>

#include "base/pattern.h"
#include "base/projector_state.h"
#include "base/result.h"
#include "base/rig.h"
#include "server/config.h"

namespace relievo {

/// Every function may be called from any thread, and returns at once but for the destructor.
class ProjectorDriver {
 public:
  explicit ProjectorDriver(ProjectorConfig config);
  ProjectorDriver(const ProjectorDriver&) = delete;
  ProjectorDriver& operator=(const ProjectorDriver&) = delete;
  /// The projector is off.
  ~ProjectorDriver();

  ProjectorState state() const;

  /// What there is to be shown, of whose stream.
  struct Order {
    std::string stream;
    std::string shows;  // "pattern", or one picture all the time: "white", "black", "slide1", ...
    Rig rig;
    Pattern pattern;
  };
  /// In place of what is shown now. Fails where the server drives no projector, or knows no such picture.
  Status start(Order order);
  /// Fails where nothing is shown.
  Status stop();

 private:
  void work();
  /// On the worker's thread: the process's end, and what it said at its end.
  std::string run(const Order& order, int& exit_code);
  void end_child();
  void look_at_child();

  const ProjectorConfig config_;
  mutable std::mutex mutex_;  // of what follows
  std::condition_variable changed_;
  ProjectorState state_;
  std::optional<Order> next_;    // to be shown
  pid_t child_ = 0;              // 0: none
  bool told_to_end_ = false;     // the child,
  std::int64_t ends_by_ns_ = 0;  // or else it is killed
  bool ending_ = false;
  std::thread thread_;
};

}  // namespace relievo
