// SPDX-License-Identifier: Apache-2.0
// Ctrl-C, SIGTERM and the terminal's end (SIGHUP) as a flag, a wait and a callback, so that a command ends
// with nothing lost; SIGHUP as a callback of its own for commands that read their configuration again.
#pragma once

#include <chrono>
#include <functional>

namespace relievo {

/// Takes over SIGINT, SIGTERM and SIGHUP, this but where it is ignored as under nohup, and ignores SIGPIPE
/// for its life; one a process, made by run_program before any other thread: all block them, and children
/// until they unblock them. The third signal ends the process at once, for a command that hangs while
/// stopping; one that comes after its life changes nothing, but the third ends the process, too. Every
/// function may be called from any thread.
class StopSignal {
 public:
  StopSignal();
  StopSignal(const StopSignal&) = delete;
  StopSignal& operator=(const StopSignal&) = delete;
  ~StopSignal();

  bool stopped() const;
  /// Returns true as soon as stopped, false after `timeout`.
  bool wait_for(std::chrono::nanoseconds timeout) const;
  /// Waits until stopped.
  void wait() const;

  /// Calls `callback` once when stopped, on a thread of its own, at once where that was before. It must not
  /// call on_stop or clear_on_stop. Clear it before what it refers to is destroyed: clear_on_stop() waits
  /// for a running callback.
  void on_stop(std::function<void()> callback);
  void clear_on_stop();

  /// From now on SIGHUP, also where it was ignored, calls `callback` instead of stopping, once for each and
  /// on another thread of its own: on_stop()'s may be called meanwhile. Once; clear it before what it refers
  /// to is destroyed, as on_stop().
  void on_reload(std::function<void()> callback);
  void clear_on_reload();

  /// Stops as a signal would.
  void request();

 private:
  struct State;
  State* state_;
};

}  // namespace relievo
