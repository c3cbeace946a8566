// SPDX-License-Identifier: Apache-2.0
// A fixed set of threads that share the rows of a picture. Results must not depend on how rows are shared
// out.
#pragma once

#include <cstdint>
#include <memory>
#include <vector>

namespace relievo {

/// One caller at a time. A pool of one thread runs everything on the caller's. Between calls that follow each
/// other closely the threads stay awake; otherwise they sleep.
class WorkerPool {
 public:
  explicit WorkerPool(int threads);
  ~WorkerPool();
  WorkerPool(const WorkerPool&) = delete;
  WorkerPool& operator=(const WorkerPool&) = delete;

  /// Ranges that rows are shared out in: 1 of one thread; several of each of more, so that one kept from
  /// running leaves little for the others to wait for.
  int workers() const;

  /// Calls work(begin, end, worker) over disjoint ranges that cover [0, count); returns when all are done.
  /// `worker` in [0, workers()) tells which scratch memory a call may use: range i always has worker i's, on
  /// whichever thread it runs, so a run repeats exactly. Allocates nothing.
  template <typename Work>
  void for_ranges(int count, const Work& work) {
    run(task_of(work, count, nullptr));
  }

  /// The same over rows that hold unequal amounts of work, in ranges with about as much each: `before[i]` is
  /// how much all rows before row i hold, and one more, the last, how much all of them do.
  template <typename Work>
  void for_shares(const std::vector<std::uint32_t>& before, const Work& work) {
    run(task_of(work, static_cast<int>(before.size()) - 1, before.data()));
  }

 private:
  struct State;
  struct Task {
    int count = 0;
    const std::uint32_t* before = nullptr;  // null: every row holds as much
    const void* work = nullptr;
    void (*call)(const void* work, int begin, int end, int worker) = nullptr;
  };
  template <typename Work>
  static Task task_of(const Work& work, int count, const std::uint32_t* before) {
    return {count, before, &work, [](const void* w, int begin, int end, int worker) {
              (*static_cast<const Work*>(w))(begin, end, worker);
            }};
  }
  void run(const Task& task);

  std::unique_ptr<State> state_;
};

}  // namespace relievo
