// SPDX-License-Identifier: Apache-2.0
#include "cli/stop_signal.h"

#include <pthread.h>
#include <signal.h>
#include <unistd.h>

#include <atomic>
#include <cassert>
#include <condition_variable>
#include <mutex>
#include <thread>
#include <utility>

#include "base/thread_name.h"

namespace relievo {
namespace {

constexpr int kSignalsUntilExit = 3;

pthread_t g_taker;  // set before the handlers are
std::atomic<bool> g_taken = false;

/// On threads that are older than ours, which block nothing: a library may start some when it is loaded.
void pass_on(int signal_number) {
  pthread_kill(g_taker, signal_number);
}

/// Once the command has ended: its result stays, but what hangs on the way out can still be ended.
void come_late(int signal_number) {
  static volatile sig_atomic_t times = 0;
  times = times + 1;
  if (times >= kSignalsUntilExit) _exit(128 + signal_number);
}

sigset_t taken_signals() {
  sigset_t signals;
  sigemptyset(&signals);
  for (const int one : {SIGINT, SIGTERM, SIGHUP}) sigaddset(&signals, one);
  return signals;
}

void set_handler(int signal_number, void (*handler)(int), struct sigaction* old = nullptr) {
  struct sigaction action {};
  action.sa_handler = handler;
  action.sa_flags = SA_RESTART;
  sigemptyset(&action.sa_mask);
  sigaction(signal_number, &action, old);
}

}  // namespace

// A handler interrupts whichever thread the kernel picks, where next to nothing may be done, and the thread
// sanitizer puts it off until that thread comes by. So signals are blocked in every thread of ours, and wait
// for the one that asks for them.
struct StopSignal::State {
  mutable std::mutex mutex;
  mutable std::condition_variable changed;
  bool stopped = false, ending = false;
  int reloads = 0;                          // asked for and not yet done
  std::mutex callback_mutex, reload_mutex;  // each held while its callback runs
  std::function<void()> callback, reload;
  std::atomic<bool> reads_again = false;  // at SIGHUP
  std::atomic<bool> no_more_signals = false;
  bool ignores_hangup = false;  // as under nohup
  sigset_t old_mask{};
  struct sigaction old_pipe {};
  // The third signal must end what hangs in a callback, and a stop overtakes a reload that takes long.
  std::thread takes_signals, calls, reloads_again;

  void take() {
    name_this_thread("signals");
    const sigset_t signals = taken_signals();
    for (int stops = 0;;) {
      int number = 0;
      if (sigwait(&signals, &number) != 0) continue;
      if (no_more_signals) return;
      const bool is_reload = number == SIGHUP && reads_again;
      if (number == SIGHUP && !is_reload && ignores_hangup) continue;
      if (!is_reload && ++stops >= kSignalsUntilExit) _exit(128 + number);
      {
        std::lock_guard lock(mutex);
        if (is_reload) {
          ++reloads;
        } else {
          stopped = true;
        }
      }
      changed.notify_all();
    }
  }

  void run() {
    name_this_thread("on-signal");
    std::unique_lock lock(mutex);
    changed.wait(lock, [&] { return ending || stopped; });
    if (ending) return;
    lock.unlock();
    call();
  }
  void call() {
    std::lock_guard lock(callback_mutex);
    if (const auto once = std::exchange(callback, nullptr)) once();
  }
  void run_reloads() {
    name_this_thread("on-reload");
    for (;;) {
      {
        std::unique_lock lock(mutex);
        changed.wait(lock, [&] { return ending || reloads > 0; });
        if (ending) return;
        --reloads;
      }
      const std::lock_guard lock(reload_mutex);
      if (reload) reload();
    }
  }
};

StopSignal::StopSignal() : state_(new State) {
  [[maybe_unused]] const bool taken = g_taken.exchange(true);
  assert(!taken);
  const sigset_t signals = taken_signals();
  pthread_sigmask(SIG_BLOCK, &signals, &state_->old_mask);
  struct sigaction action {};
  sigaction(SIGHUP, nullptr, &action);
  state_->ignores_hangup = action.sa_handler == SIG_IGN;
  set_handler(SIGPIPE, SIG_IGN, &state_->old_pipe);
  state_->takes_signals = std::thread([s = state_] { s->take(); });
  g_taker = state_->takes_signals.native_handle();
  set_handler(SIGINT, pass_on);
  set_handler(SIGTERM, pass_on);
  if (!state_->ignores_hangup) set_handler(SIGHUP, pass_on);
  state_->calls = std::thread([s = state_] { s->run(); });
}

StopSignal::~StopSignal() {
  set_handler(SIGINT, come_late);
  set_handler(SIGTERM, come_late);
  if (state_->reads_again) {
    set_handler(SIGHUP, SIG_IGN);
  } else if (!state_->ignores_hangup) {
    set_handler(SIGHUP, come_late);
  }
  state_->no_more_signals = true;
  pthread_kill(state_->takes_signals.native_handle(), SIGTERM);
  state_->takes_signals.join();
  {
    std::lock_guard lock(state_->mutex);
    state_->ending = true;
  }
  state_->changed.notify_all();
  state_->calls.join();
  if (state_->reloads_again.joinable()) state_->reloads_again.join();
  sigaction(SIGPIPE, &state_->old_pipe, nullptr);
  pthread_sigmask(SIG_SETMASK, &state_->old_mask, nullptr);
  g_taken = false;
  delete state_;
}

bool StopSignal::stopped() const {
  std::lock_guard lock(state_->mutex);
  return state_->stopped;
}

bool StopSignal::wait_for(std::chrono::nanoseconds timeout) const {
  std::unique_lock lock(state_->mutex);
  return state_->changed.wait_for(lock, timeout, [&] { return state_->stopped; });
}

void StopSignal::wait() const {
  std::unique_lock lock(state_->mutex);
  state_->changed.wait(lock, [&] { return state_->stopped; });
}

void StopSignal::on_stop(std::function<void()> callback) {
  {
    std::lock_guard lock(state_->callback_mutex);
    state_->callback = std::move(callback);
  }
  if (stopped()) state_->call();
}

void StopSignal::clear_on_stop() {
  std::lock_guard lock(state_->callback_mutex);
  state_->callback = nullptr;
}

void StopSignal::on_reload(std::function<void()> callback) {
  std::lock_guard lock(state_->reload_mutex);
  state_->reload = std::move(callback);
  if (state_->reads_again.exchange(true)) return;
  set_handler(SIGHUP, pass_on);
  state_->reloads_again = std::thread([s = state_] { s->run_reloads(); });
}

void StopSignal::clear_on_reload() {
  std::lock_guard lock(state_->reload_mutex);
  state_->reload = nullptr;
}

void StopSignal::request() {
  {
    std::lock_guard lock(state_->mutex);
    state_->stopped = true;
  }
  state_->changed.notify_all();
  state_->call();
}

}  // namespace relievo
