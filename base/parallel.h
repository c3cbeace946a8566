// SPDX-License-Identifier: Apache-2.0
// A fixed set of threads that share the rows of a picture. Results must not depend on how rows are shared
// out.
#pragma once

#include <memory>

namespace relievo {

/// One caller at a time. A pool of one thread runs everything on the caller's.
class WorkerPool {
 public:
  explicit WorkerPool(int threads);
  ~WorkerPool();
  WorkerPool(const WorkerPool&) = delete;
  WorkerPool& operator=(const WorkerPool&) = delete;

  int threads() const;

  /// Calls work(begin, end, worker) over disjoint ranges that cover [0, count); returns when all are done.
  /// `worker` in [0, threads()) tells which scratch memory a call may use: range i always goes to worker i,
  /// so a run repeats exactly. Allocates nothing.
  template <typename Work>
  void for_ranges(int count, const Work& work) {
    run({count, &work, [](const void* w, int begin, int end, int worker) {
           (*static_cast<const Work*>(w))(begin, end, worker);
         }});
  }

 private:
  struct State;
  struct Task {
    int count = 0;
    const void* work = nullptr;
    void (*call)(const void* work, int begin, int end, int worker) = nullptr;
  };
  void run(const Task& task);

  std::unique_ptr<State> state_;
};

}  // namespace relievo
