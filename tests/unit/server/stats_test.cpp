// SPDX-License-Identifier: Apache-2.0
#include "server/stats.h"

#include <gtest/gtest.h>

#include <thread>
#include <vector>

#include "base/time.h"

namespace relievo {
namespace {

constexpr std::int64_t kMs = 1'000'000;
constexpr std::int64_t kNow = 1'700'000'000 * kNanosecondsPerSecond;

TEST(RollingMedian, OfTheLastValues) {
  RollingMedian median;
  EXPECT_EQ(median.median(), 0);
  median.add(5);
  EXPECT_EQ(median.median(), 5);
  median.add(1);
  median.add(9);
  EXPECT_EQ(median.median(), 5);
  for (int i = 0; i < 1000; ++i) median.add(1000);  // the first values are long gone
  EXPECT_EQ(median.median(), 1000);
  for (int i = 0; i < 65; ++i) median.add(2);  // just over half of the 128 that count
  EXPECT_EQ(median.median(), 2);
}

TEST(PipelineStats, CountsAndMedians) {
  PipelineStats stats;
  for (int i = 0; i < 10; ++i) stats.captured();
  stats.lost_in_capture(2);
  stats.lost_in_capture(1);
  for (const double ms : {3.0, 1.0, 2.0}) stats.reconstructed(ms);
  for (const double ms : {8.0, 6.0, 7.0}) stats.encoded(ms);
  stats.published(kNow - 20 * kMs, kNow);
  const ServerStatus s = stats.snapshot(kNow + kMs);
  EXPECT_EQ(s.frames_captured, 10U);
  EXPECT_EQ(s.frames_published, 1U);
  EXPECT_EQ(s.drops_capture, 3U);
  EXPECT_DOUBLE_EQ(s.reconstruct_ms, 2);
  EXPECT_DOUBLE_EQ(s.encode_ms, 7);
  EXPECT_NEAR(s.latency_ms, 20, 1e-3);
  EXPECT_EQ(s.frame_rate, 0);  // one frame makes no rate
  EXPECT_EQ(s.time_ns, kNow + kMs);
}

TEST(PipelineStats, RateOfAnEvenStream) {
  for (const int frames : {2, 10, 64, 65, 500}) {
    PipelineStats stats;
    const std::int64_t end = kNow - kMs;
    for (int i = 0; i < frames; ++i) {
      const std::int64_t at = end - (frames - 1 - i) * 25 * kMs;
      stats.published(at - kMs, at);
    }
    EXPECT_NEAR(stats.snapshot(kNow).frame_rate, 40, 1e-6) << frames;
  }
}

TEST(PipelineStats, RateFallsWhenFramesStop) {
  PipelineStats stats;
  const std::int64_t end = kNow - 10 * kNanosecondsPerSecond;  // the last one was 10 s ago
  for (int i = 0; i < 40; ++i) stats.published(end, end - (39 - i) * 25 * kMs);
  EXPECT_NEAR(stats.snapshot(kNow).frame_rate, 39 / (39 * 0.025 + 10 - 0.025), 1e-6);
}

TEST(PipelineStats, FromManyThreads) {
  PipelineStats stats;
  std::vector<std::thread> threads;
  for (int t = 0; t < 4; ++t) {
    threads.emplace_back([&] {
      for (int i = 0; i < 500; ++i) {
        stats.captured();
        stats.reconstructed(1);
        stats.encoded(2);
        stats.published(kNow - 3 * kMs, kNow);
        if (i % 50 == 0) {
          EXPECT_LE(stats.snapshot(kNow).frames_captured, 2000U);
        }
      }
    });
  }
  for (auto& thread : threads) thread.join();
  EXPECT_EQ(stats.snapshot(kNow).frames_captured, 2000U);
  EXPECT_EQ(stats.snapshot(kNow).frames_published, 2000U);
}

}  // namespace
}  // namespace relievo
