// SPDX-License-Identifier: Apache-2.0
#include "base/parallel.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <mutex>
#include <set>
#include <thread>
#include <vector>

namespace relievo {
namespace {

TEST(WorkerPool, EveryIndexOnceAnyCountAnyThreads) {
  for (const int threads : {1, 2, 3, 7, 16}) {
    WorkerPool pool(threads);
    EXPECT_TRUE(threads == 1 ? pool.workers() == 1 : pool.workers() >= threads) << pool.workers();
    for (const int count : {0, 1, 2, 5, 6, 7, 8, 100, 1001}) {
      std::vector<int> seen(static_cast<std::size_t>(count));  // not atomic: tsan sees any sharing
      std::vector<int> calls(static_cast<std::size_t>(pool.workers()));
      pool.for_ranges(count, [&](int begin, int end, int worker) {
        ASSERT_TRUE(0 <= begin && begin < end && end <= count);
        ASSERT_TRUE(0 <= worker && worker < pool.workers());
        ++calls[static_cast<std::size_t>(worker)];
        for (int i = begin; i < end; ++i) ++seen[static_cast<std::size_t>(i)];
      });
      for (const int n : seen) ASSERT_EQ(n, 1) << count << " on " << threads;
      for (const int n : calls) ASSERT_LE(n, 1);
    }
  }
}

TEST(WorkerPool, SharesHoldAboutAsMuchEach) {
  for (const int threads : {1, 2, 3, 7}) {
    WorkerPool pool(threads);
    for (const std::uint32_t heavy : {0U, 1U, 50U}) {  // the work of every row of the last third
      std::vector<std::uint32_t> before{0};
      for (std::uint32_t i = 0; i < 90; ++i) before.push_back(before.back() + (i < 60 ? 1 : heavy));
      std::vector<int> seen(90);
      std::vector<std::uint32_t> work(static_cast<std::size_t>(pool.workers()));
      pool.for_shares(before, [&](int begin, int end, int worker) {
        ASSERT_TRUE(0 <= begin && begin < end && end <= 90);
        for (int i = begin; i < end; ++i) ++seen[static_cast<std::size_t>(i)];
        work[static_cast<std::size_t>(worker)] +=
            before[static_cast<std::size_t>(end)] - before[static_cast<std::size_t>(begin)];
      });
      for (const int n : seen) ASSERT_EQ(n, 1) << heavy << " on " << threads;
      // No more than its share, and a row that lies across two of them.
      for (const std::uint32_t w : work)
        ASSERT_LE(w, before.back() / static_cast<std::uint32_t>(pool.workers()) + std::max(1U, heavy) + 1);
    }
    int calls = 0;
    pool.for_shares({}, [&](int, int, int) { ++calls; });
    pool.for_shares({0}, [&](int, int, int) { ++calls; });
    EXPECT_EQ(calls, 0);
    std::vector<int> seen(4);
    pool.for_shares({0, 0, 0, 0, 0}, [&](int begin, int end, int) {
      for (int i = begin; i < end; ++i) ++seen[static_cast<std::size_t>(i)];
    });
    EXPECT_EQ(seen, (std::vector{1, 1, 1, 1}));
  }
}

/// Long enough that helpers go to sleep between the calls.
TEST(WorkerPool, HelpersWakeAgain) {
  WorkerPool pool(3);
  for (int round = 0; round < 5; ++round) {
    std::this_thread::sleep_for(std::chrono::milliseconds(5));
    std::atomic<int> sum{0};
    pool.for_ranges(30, [&](int begin, int end, int) { sum += end - begin; });
    ASSERT_EQ(sum, 30);
  }
}

TEST(WorkerPool, ARangeAlwaysGoesToTheSameWorker) {
  WorkerPool pool(3);
  std::set<std::tuple<int, int, int>> ranges;
  std::mutex mutex;
  for (int round = 0; round < 50; ++round) {
    pool.for_ranges(10, [&](int begin, int end, int worker) {
      std::lock_guard lock(mutex);
      ranges.emplace(begin, end, worker);
    });
  }
  EXPECT_EQ(ranges.size(), std::min<std::size_t>(10, static_cast<std::size_t>(pool.workers())));
}

/// One that is kept in a range of its own holds up that range alone.
TEST(WorkerPool, AThreadThatIsHeldUpLeavesTheRestToTheOthers) {
  WorkerPool pool(2);
  const int ranges = pool.workers();
  std::atomic<int> others{0};
  pool.for_ranges(ranges, [&](int, int, int worker) {
    if (worker != 0) {
      ++others;
      return;
    }
    // The first range waits for all others; its thread cannot do them.
    while (others < ranges - 1) std::this_thread::yield();
  });
  EXPECT_EQ(others, ranges - 1);
}

TEST(WorkerPool, WorkOfOneCallIsSeenByTheNext) {
  WorkerPool pool(4);
  std::vector<int> values(64, 0);
  for (int round = 0; round < 200; ++round) {
    // Each worker reads what another wrote in the round before.
    std::vector<int> next(values.size());
    pool.for_ranges(64, [&](int begin, int end, int) {
      for (int i = begin; i < end; ++i)
        next[static_cast<std::size_t>(i)] = values[static_cast<std::size_t>((i + 17) % 64)] + 1;
    });
    values.swap(next);
  }
  for (const int v : values) EXPECT_EQ(v, 200);
}

TEST(WorkerPool, OneThreadRunsOnTheCallers) {
  WorkerPool pool(1);
  std::thread::id id;
  pool.for_ranges(3, [&](int, int, int) { id = std::this_thread::get_id(); });
  EXPECT_EQ(id, std::this_thread::get_id());
}

TEST(WorkerPool, NoThreadsIsOne) {
  for (const int threads : {0, -3}) {
    WorkerPool pool(threads);
    EXPECT_EQ(pool.workers(), 1);
  }
}

TEST(WorkerPool, ManyPoolsComeAndGo) {
  std::atomic<int> sum{0};
  for (int i = 0; i < 100; ++i) {
    WorkerPool pool(3);
    if (i % 2 == 0) pool.for_ranges(3, [&](int begin, int end, int) { sum += end - begin; });
  }
  EXPECT_EQ(sum, 150);
}

}  // namespace
}  // namespace relievo
