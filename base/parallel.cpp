// SPDX-License-Identifier: Apache-2.0
#include "base/parallel.h"

#include <algorithm>
#include <atomic>
#include <thread>

#include "base/thread_name.h"

#if defined(__x86_64__)
#include <immintrin.h>
#endif

namespace relievo {
namespace {

// How often a thread looks for what it waits for before it sleeps: some tens of microseconds, about what
// waking it would take. A frame has some tens of calls close to each other: sleeping at once costs not less
// processor time but 7 % more, and 18 % of the frame's time (640x480, two threads).
constexpr int kLooks = 1500;

constexpr int kRangesEach = 8;  // of a thread; with 4 frames took 6 % longer where cores were unequally busy

void pause_shortly() {
#if defined(__x86_64__)
  _mm_pause();
#else
  std::this_thread::yield();
#endif
}

/// Returns when `value` is no longer `old`.
template <typename Int>
void wait_for_change(const std::atomic<Int>& value, Int old) {
  for (int i = 0; i < kLooks; ++i) {
    if (value.load(std::memory_order_acquire) != old) return;
    pause_shortly();
  }
  value.wait(old, std::memory_order_acquire);
}

}  // namespace

struct WorkerPool::State {
  Task task;
  std::atomic<std::uint32_t> round{0};  // of tasks; wraps
  std::atomic<int> pending{0};          // ranges that are not done in this one
  std::unique_ptr<std::atomic<std::uint32_t>[]>
      claimed;  // of each range: the last round in which somebody took it
  std::atomic<bool> stop{
      false};  // set before the last round; a helper that was late for one looks at any time
  int ranges = 1;
  std::vector<std::thread> helpers;

  int bound(int i) const {
    if (task.before == nullptr) return static_cast<int>(static_cast<std::int64_t>(task.count) * i / ranges);
    if (i == ranges) return task.count;
    const auto least =
        static_cast<std::uint32_t>(std::uint64_t{task.before[task.count]} * static_cast<std::uint64_t>(i) /
                                   static_cast<std::uint64_t>(ranges));
    return static_cast<int>(std::lower_bound(task.before, task.before + task.count, least) - task.before);
  }

  /// A range of a round, unless somebody has taken it.
  void try_range(int range, std::uint32_t now) {
    std::uint32_t before = now - 1;
    if (!claimed[static_cast<std::size_t>(range)].compare_exchange_strong(before, now)) return;
    const int begin = bound(range);
    const int end = bound(range + 1);
    if (begin < end) task.call(task.work, begin, end, range);
    if (pending.fetch_sub(1, std::memory_order_acq_rel) == 1) pending.notify_one();
  }

  /// A thread's own ranges, then those that the others have not come to.
  void try_ranges(int thread, std::uint32_t now) {
    for (int i = 0; i < ranges; ++i) try_range((thread * kRangesEach + i) % ranges, now);
  }

  void helper(int thread) {
    name_this_thread("worker");
    for (std::uint32_t seen = 0;;) {
      wait_for_change(round, seen);
      seen = round.load(std::memory_order_acquire);
      if (stop) return;
      try_ranges(thread, seen);
    }
  }

  void start_round() {
    round.fetch_add(1, std::memory_order_release);
    round.notify_all();
  }
};

WorkerPool::WorkerPool(int threads) : state_(std::make_unique<State>()) {
  if (threads <= 1) return;
  state_->ranges = threads * kRangesEach;
  state_->claimed = std::make_unique<std::atomic<std::uint32_t>[]>(static_cast<std::size_t>(state_->ranges));
  for (int i = 1; i < threads; ++i) state_->helpers.emplace_back([this, i] { state_->helper(i); });
}

WorkerPool::~WorkerPool() {
  state_->stop = true;
  state_->start_round();
  for (auto& helper : state_->helpers) helper.join();
}

int WorkerPool::workers() const {
  return state_->ranges;
}

void WorkerPool::run(const Task& task) {
  State& s = *state_;
  if (s.helpers.empty()) {
    if (task.count > 0) task.call(task.work, 0, task.count, 0);
    return;
  }
  s.task = task;
  s.pending.store(s.ranges, std::memory_order_relaxed);
  s.start_round();
  s.try_ranges(0, s.round.load(std::memory_order_relaxed));
  while (const int left = s.pending.load(std::memory_order_acquire)) wait_for_change(s.pending, left);
}

}  // namespace relievo
