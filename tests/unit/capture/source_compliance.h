// SPDX-License-Identifier: Apache-2.0
// What every source must keep (capture/source/field_source.h), whatever it reads from: instantiate
// SourceCompliance with a Case for each kind of source.
#pragma once

#include <gtest/gtest.h>

#include <chrono>
#include <cmath>
#include <future>
#include <ostream>
#include <thread>
#include <vector>

#include "capture/source/field_source.h"
#include "small_take.h"

namespace relievo::test {

struct SourceCase {
  const char* name;
  bool loop;
  /// Returns the source's uri; may write files into the folder.
  std::string (*prepare)(const std::filesystem::path& folder);
  CameraOptions camera = {};  // its pattern: "FOLDER/..." is within the folder
};

inline void PrintTo(const SourceCase& c, std::ostream* out) {
  *out << c.name;
}

class SourceCompliance : public testing::TestWithParam<SourceCase> {
 protected:
  void SetUp() override { uri_ = GetParam().prepare(folder_.path()); }

  std::unique_ptr<FieldSource> open() const {
    CameraOptions camera = GetParam().camera;
    if (camera.pattern.starts_with("FOLDER")) camera.pattern.replace(0, 6, folder_.path().string());
    auto source = open_source(uri_, {.loop = GetParam().loop, .camera = camera});
    EXPECT_TRUE(source) << source.error().message;
    return source ? *std::move(source) : nullptr;
  }

  TempFolder folder_;
  std::string uri_;
};

inline constexpr int kMany = 23;  // more than two passes of every case here

TEST_P(SourceCompliance, FramesFitTheRigAndComeInOrder) {
  const auto source = open();
  ASSERT_TRUE(source);
  const SourceInfo& info = source->info();
  EXPECT_EQ(info.name, uri_);
  EXPECT_GE(info.pattern.stripes(), 2);
  ASSERT_TRUE(info.frames || info.live);
  const int expected = GetParam().loop || info.live ? kMany : static_cast<int>(*info.frames);
  const double period_ns = 1e9 / info.rig.frame_rate;
  std::optional<std::uint64_t> last_number;
  std::int64_t last_ns = 0;
  int got = 0;
  for (; got < expected; ++got) {
    auto frame = source->next();
    ASSERT_TRUE(frame) << frame.error().message;
    ASSERT_TRUE(*frame) << "ended after " << got;
    const CapturedFrame& f = **frame;
    EXPECT_EQ(f.scan, info.rig.scan);
    EXPECT_EQ(f.field_order, info.rig.field_order);
    EXPECT_EQ(f.picture.width(), info.rig.camera.width);
    EXPECT_EQ(f.picture.height(), info.rig.camera.height);
    EXPECT_EQ(f.picture.channels(), 3);
    EXPECT_EQ(f.complement.empty(), f.scan == Scan::kInterlaced);
    if (f.scan == Scan::kProgressive) {
      EXPECT_EQ(f.complement.size(), f.picture.size());
    }
    if (last_number) {
      ASSERT_GT(f.time_ns, last_ns);
      // Where a frame was dropped, the time skips whole periods.
      EXPECT_GT(f.number, *last_number);
      const double periods = static_cast<double>(f.time_ns - last_ns) / period_ns;
      EXPECT_NEAR(periods, std::round(periods), info.live ? 0.4 : 0.01);  // a driver's clock may be coarse
    } else {
      EXPECT_EQ(f.number, 0u);
    }
    last_number = f.number;
    last_ns = f.time_ns;
  }
  if (!GetParam().loop && !info.live) {
    for (int again = 0; again < 3; ++again) {
      auto end = source->next();
      ASSERT_TRUE(end);
      EXPECT_FALSE(*end) << "the end must stay the end";
    }
  }
}

TEST_P(SourceCompliance, TheSameSourceGivesTheSameBytes) {
  constexpr int kFrames = 6;
  std::vector<CapturedFrame> runs[2];
  bool live = false;
  for (std::vector<CapturedFrame>& run : runs) {  // one after the other: a camera has one user at a time
    const auto source = open();
    ASSERT_TRUE(source);
    live = source->info().live;
    for (int i = 0; i < kFrames; ++i) {
      auto frame = source->next();
      ASSERT_TRUE(frame) << frame.error().message;
      if (!*frame) break;
      run.push_back(*std::move(*frame));
    }
  }
  ASSERT_EQ(runs[0].size(), runs[1].size());
  ASSERT_FALSE(runs[0].empty());
  for (std::size_t i = 0; i < runs[0].size(); ++i) {
    const CapturedFrame &a = runs[0][i], &b = runs[1][i];
    if (!live) {
      EXPECT_EQ(a.time_ns, b.time_ns);
    }
    const auto same = [](const Image8& x, const Image8& y) {
      return x.size() == y.size() && std::equal(x.data(), x.data() + x.size(), y.data());
    };
    EXPECT_TRUE(same(a.picture, b.picture)) << i;
    EXPECT_TRUE(same(a.complement, b.complement)) << i;
  }
}

TEST_P(SourceCompliance, StopBeforeTheFirstFrameEnds) {
  const auto source = open();
  source->request_stop();
  auto end = source->next();
  ASSERT_TRUE(end);
  EXPECT_FALSE(*end);
}

TEST_P(SourceCompliance, StopFromAnotherThreadEndsTheRun) {
  const auto source = open();
  auto stopper = std::async(std::launch::async, [&] {
    std::this_thread::sleep_for(std::chrono::milliseconds(30));
    source->request_stop();
  });
  for (;;) {
    auto frame = source->next();
    ASSERT_TRUE(frame);
    if (!*frame) break;
  }
  stopper.get();
  EXPECT_FALSE(*source->next());
}

TEST_P(SourceCompliance, DestroyedMidRunLeavesNothingRunning) {
  const auto source = open();
  ASSERT_TRUE(source->next());
}

}  // namespace relievo::test
