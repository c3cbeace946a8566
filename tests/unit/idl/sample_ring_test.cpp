// SPDX-License-Identifier: Apache-2.0
// Proves: what is kept of a stream goes back far enough, begins with a frame that decodes alone, and never
// takes more memory than it may.
#include "idl/sample_ring.h"

#include <gtest/gtest.h>

#include "idl/cdr.h"
#include "tests/support/key_frames.h"

namespace relievo {
namespace {

constexpr std::uint64_t kPlenty = 1'000'000'000;
constexpr std::int64_t kSecond = kNanosecondsPerSecond;

/// Frames a tenth of a second apart, each tenth a key frame.
std::shared_ptr<const RawSample> sample(std::uint64_t n, std::uint64_t key_interval = 10) {
  RawSample out;
  out.stream = "face";
  out.topic = Topic::kFrame;
  out.receive_time_ns = static_cast<std::int64_t>(n) * kSecond / 10;
  out.cdr = write_frame_cdr("face", test::frame_of_group(n, key_interval));
  return std::make_shared<const RawSample>(std::move(out));
}

TEST(SampleRing, GoesBackToTheKeyFrameBeforeWhatIsWanted) {
  SampleRing ring(2.5, kPlenty);
  for (std::uint64_t n = 0; n < 100; ++n) {
    EXPECT_EQ(ring.push(sample(n), std::nullopt), 0U);
    // 25 frames before this one, and from there to the last multiple of ten; at first all there are.
    EXPECT_EQ(ring.begin(), n < 25 ? 0 : (n - 25) / 10 * 10) << n;
    EXPECT_EQ(ring.end(), n + 1);
    EXPECT_EQ(ring.at(n)->receive_time_ns, sample(n)->receive_time_ns);
  }
}

TEST(SampleRing, WithoutPreRollItBeginsWithTheLastKeyFrame) {
  SampleRing ring(0, kPlenty);
  for (std::uint64_t n = 0; n < 35; ++n) ring.push(sample(n), std::nullopt);
  EXPECT_EQ(ring.begin(), 30U);
}

TEST(SampleRing, AClockThatIsSetMakesNothingOlderOrYounger) {
  for (const std::int64_t set_by_ns : {3600 * kSecond, -3600 * kSecond}) {
    SampleRing ring(2.5, kPlenty);
    for (std::uint64_t n = 0; n < 100; ++n) {
      RawSample one = *sample(n);
      one.steady_time_ns = 1 + one.receive_time_ns;
      if (n >= 50) one.receive_time_ns += set_by_ns;
      ring.push(std::make_shared<const RawSample>(std::move(one)), std::nullopt);
      EXPECT_EQ(ring.begin(), n < 25 ? 0 : (n - 25) / 10 * 10) << n;
    }
  }
}

TEST(SampleRing, WithoutKeyFramesAgeAloneCounts) {
  SampleRing ring(1, kPlenty);
  for (std::uint64_t n = 1; n < 100; ++n) ring.push(sample(n, 1000), std::nullopt);
  EXPECT_EQ(ring.end() - ring.begin(), 11U);
}

TEST(SampleRing, BeginsWithTheFirstKeyFrameThereIs) {
  SampleRing ring(60, kPlenty);
  for (std::uint64_t n = 5; n < 25; ++n) ring.push(sample(n), std::nullopt);
  EXPECT_EQ(ring.at(ring.begin())->receive_time_ns, kSecond);
}

TEST(SampleRing, TakesNoMoreMemoryThanItMay) {
  const std::uint64_t bytes = 20 * sample(0)->cdr.size();
  SampleRing ring(60, bytes);
  for (std::uint64_t n = 0; n < 100; ++n) {
    ring.push(sample(n), std::nullopt);
    EXPECT_LE(ring.bytes(), bytes);
  }
  EXPECT_EQ(ring.begin(), 80U);  // a key frame, as it happens
  ring.push(sample(100), std::nullopt);
  EXPECT_EQ(ring.begin(), 90U) << "what no longer follows a key frame goes with it";
}

TEST(SampleRing, WhatIsUnreadGoesForWantOfRoomAlone) {
  const std::uint64_t bytes = 50 * sample(0)->cdr.size();
  SampleRing ring(0, bytes);
  std::uint64_t lost = 0;
  for (std::uint64_t n = 0; n < 50; ++n) lost += ring.push(sample(n), 0);
  EXPECT_EQ(ring.begin(), 0U);
  EXPECT_EQ(lost, 0U);
  for (std::uint64_t n = 50; n < 60; ++n) lost += ring.push(sample(n), 0);
  EXPECT_EQ(lost, 10U);
  EXPECT_EQ(ring.begin(), 10U);
}

}  // namespace
}  // namespace relievo
