// SPDX-License-Identifier: Apache-2.0
#include "base/parallel.h"

#include <algorithm>
#include <condition_variable>
#include <cstdint>
#include <mutex>
#include <thread>
#include <vector>

namespace relievo {

struct WorkerPool::State {
  std::mutex mutex;
  std::condition_variable start;
  std::condition_variable done;
  Task task;
  int pending = 0;
  std::uint64_t round = 0;
  bool stop = false;
  int threads = 1;
  std::vector<std::thread> helpers;

  void run_range(int worker) const {
    const auto bound = [&](int i) {
      return static_cast<int>(static_cast<std::int64_t>(task.count) * i / threads);
    };
    const int begin = bound(worker);
    const int end = bound(worker + 1);
    if (begin < end) task.call(task.work, begin, end, worker);
  }

  void helper(int worker) {
    std::uint64_t seen = 0;
    std::unique_lock lock(mutex);
    while (true) {
      start.wait(lock, [&] { return stop || round != seen; });
      if (stop) return;
      seen = round;
      lock.unlock();
      run_range(worker);
      lock.lock();
      if (--pending == 0) done.notify_one();
    }
  }
};

WorkerPool::WorkerPool(int threads) : state_(std::make_unique<State>()) {
  state_->threads = std::max(1, threads);
  for (int i = 1; i < state_->threads; ++i) state_->helpers.emplace_back([this, i] { state_->helper(i); });
}

WorkerPool::~WorkerPool() {
  {
    std::lock_guard lock(state_->mutex);
    state_->stop = true;
  }
  state_->start.notify_all();
  for (auto& helper : state_->helpers) helper.join();
}

int WorkerPool::threads() const {
  return state_->threads;
}

void WorkerPool::run(const Task& task) {
  State& s = *state_;
  if (s.threads == 1) {
    if (task.count > 0) task.call(task.work, 0, task.count, 0);
    return;
  }
  {
    std::lock_guard lock(s.mutex);
    s.task = task;
    s.pending = s.threads - 1;
    ++s.round;
  }
  s.start.notify_all();
  s.run_range(0);
  std::unique_lock lock(s.mutex);
  s.done.wait(lock, [&] { return s.pending == 0; });
}

}  // namespace relievo
