// SPDX-License-Identifier: Apache-2.0
#include "bench/usage.h"

#include <time.h>
#include <unistd.h>

#include <chrono>
#include <condition_variable>
#include <filesystem>
#include <fstream>
#include <map>
#include <mutex>
#include <string>
#include <system_error>
#include <thread>
#include <utility>

#include "base/time.h"

namespace relievo::bench {
namespace {

using namespace std::chrono_literals;
constexpr auto kWindow = 500ms;

/// Processor time so far, nanoseconds, of each thread that there is, by its number.
struct ThreadTime {
  std::string name;
  double cpu_ns = 0;
};
void read_threads(std::map<std::string, ThreadTime>& threads) {
  std::error_code gone;
  for (const auto& task : std::filesystem::directory_iterator("/proc/self/task", gone)) {
    std::ifstream comm(task.path() / "comm"), schedstat(task.path() / "schedstat");
    ThreadTime now;
    if (std::getline(comm, now.name) && schedstat >> now.cpu_ns) threads[task.path().filename()] = now;
  }
}

}  // namespace

std::int64_t process_cpu_ns() {
  timespec used{};
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &used);  // as getrusage, but finer
  return used.tv_sec * kNanosecondsPerSecond + used.tv_nsec;
}

double resident_mb() {
  std::ifstream statm("/proc/self/statm");
  double size = 0;
  double resident = 0;
  statm >> size >> resident;
  return resident * static_cast<double>(sysconf(_SC_PAGESIZE)) / 1e6;
}

struct UsageMeter::State {
  std::function<std::int64_t()> client_cpu_ns;
  std::mutex mutex;
  std::condition_variable wake;
  bool ending = false;
  Usage usage;
  std::thread thread;

  void work() {
    std::int64_t wall = steady_now_ns();
    std::int64_t total = process_cpu_ns();
    std::int64_t clients = client_cpu_ns();
    std::map<std::string, ThreadTime> threads_before;
    read_threads(threads_before);
    std::map<std::string, ThreadTime> threads = threads_before;
    const std::int64_t begin = wall;
    std::unique_lock lock(mutex);
    for (bool last = false; !last;) {
      last = wake.wait_for(lock, kWindow, [&] { return ending; });
      const std::int64_t wall_now = steady_now_ns();
      const std::int64_t total_now = process_cpu_ns();
      const std::int64_t clients_now = client_cpu_ns();
      const auto elapsed = static_cast<double>(wall_now - std::exchange(wall, wall_now));
      const double total_cores = static_cast<double>(total_now - std::exchange(total, total_now)) / elapsed;
      const double client_cores =
          static_cast<double>(clients_now - std::exchange(clients, clients_now)) / elapsed;
      // What is left of a window at the end is too short to say much, unless it is all there is; and threads
      // of what was measured have ended in it.
      if (last && !usage.total_cores.empty()) return;
      read_threads(threads);
      usage.thread_cores.clear();
      for (const auto& [number, now] : threads)
        usage.thread_cores[now.name] +=
            (now.cpu_ns - threads_before[number].cpu_ns) / static_cast<double>(wall_now - begin);
      usage.total_cores.push_back(total_cores);
      usage.client_cores.push_back(client_cores);
      usage.server_cores.push_back(total_cores - client_cores);
      usage.resident_mb.push_back(bench::resident_mb());
    }
  }
};

UsageMeter::UsageMeter(std::function<std::int64_t()> client_cpu_ns) : state_(std::make_unique<State>()) {
  state_->client_cpu_ns = std::move(client_cpu_ns);
  state_->thread = std::thread([state = state_.get()] { state->work(); });
}

UsageMeter::~UsageMeter() {
  finish();
}

Usage UsageMeter::finish() {
  {
    std::lock_guard lock(state_->mutex);
    state_->ending = true;
  }
  state_->wake.notify_all();
  if (state_->thread.joinable()) state_->thread.join();
  return std::move(state_->usage);
}

}  // namespace relievo::bench
