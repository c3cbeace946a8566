// SPDX-License-Identifier: Apache-2.0
#include "cli/stop_signal.h"

#include <fcntl.h>
#include <signal.h>
#include <unistd.h>

#include <cassert>
#include <cerrno>
#include <condition_variable>
#include <mutex>
#include <thread>
#include <utility>

namespace relievo {
namespace {

constexpr char kStop = 's';
constexpr char kReload = 'r';
constexpr char kQuit = 'q';
constexpr int kSignalsUntilExit = 3;

int g_pipe_write = -1;  // set before the handler is, read by it
volatile sig_atomic_t g_signals = 0;

// Only what may run in a signal handler: everything else happens on the thread that reads the pipe.
void handle(int signal_number) {
  const int saved = errno;
  g_signals = g_signals + 1;
  if (g_signals >= kSignalsUntilExit) _exit(128 + signal_number);
  [[maybe_unused]] const auto written = write(g_pipe_write, &kStop, 1);
  errno = saved;
}

void handle_reload(int) {
  const int saved = errno;
  [[maybe_unused]] const auto written = write(g_pipe_write, &kReload, 1);
  errno = saved;
}

}  // namespace

struct StopSignal::State {
  mutable std::mutex mutex;
  mutable std::condition_variable changed;
  bool stopped = false;
  std::mutex callback_mutex;  // held while the callback runs
  std::function<void()> callback, reload;
  int pipe[2] = {-1, -1};
  bool takes_hangup = false;
  struct sigaction old_int {
  }, old_term{}, old_pipe{}, old_hangup{};
  std::thread thread;

  void run() {
    char byte = 0;
    for (;;) {
      const ssize_t n = read(pipe[0], &byte, 1);
      if (n < 0 && errno == EINTR) continue;
      if (n != 1 || byte == kQuit) return;
      if (byte == kReload) {
        std::lock_guard lock(callback_mutex);
        if (reload) reload();
        continue;
      }
      {
        std::lock_guard lock(mutex);
        stopped = true;
      }
      changed.notify_all();
      call();
    }
  }
  void call() {
    std::lock_guard lock(callback_mutex);
    if (const auto once = std::exchange(callback, nullptr)) once();
  }
};

StopSignal::StopSignal() : state_(new State) {
  assert(g_pipe_write < 0);
  if (pipe2(state_->pipe, O_CLOEXEC) != 0) {
    state_->pipe[0] = state_->pipe[1] = -1;  // out of descriptors: signals keep their default, which ends us
    return;
  }
  g_signals = 0;
  g_pipe_write = state_->pipe[1];
  state_->thread = std::thread([s = state_] { s->run(); });
  struct sigaction action {};
  action.sa_handler = handle;
  action.sa_flags = SA_RESTART;
  sigemptyset(&action.sa_mask);
  sigaction(SIGINT, &action, &state_->old_int);
  sigaction(SIGTERM, &action, &state_->old_term);
  action.sa_handler = SIG_IGN;
  sigaction(SIGPIPE, &action, &state_->old_pipe);
}

StopSignal::~StopSignal() {
  if (state_->thread.joinable()) {
    sigaction(SIGINT, &state_->old_int, nullptr);
    sigaction(SIGTERM, &state_->old_term, nullptr);
    sigaction(SIGPIPE, &state_->old_pipe, nullptr);
    if (state_->takes_hangup) sigaction(SIGHUP, &state_->old_hangup, nullptr);
    [[maybe_unused]] const auto written = write(state_->pipe[1], &kQuit, 1);
    state_->thread.join();
    g_pipe_write = -1;
    close(state_->pipe[0]);
    close(state_->pipe[1]);
  }
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
  std::lock_guard lock(state_->callback_mutex);
  state_->reload = std::move(callback);
  if (state_->takes_hangup || !state_->thread.joinable()) return;
  state_->takes_hangup = true;
  struct sigaction action {};
  action.sa_handler = handle_reload;
  action.sa_flags = SA_RESTART;
  sigemptyset(&action.sa_mask);
  sigaction(SIGHUP, &action, &state_->old_hangup);
}

void StopSignal::clear_on_reload() {
  std::lock_guard lock(state_->callback_mutex);
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
