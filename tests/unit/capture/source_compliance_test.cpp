// SPDX-License-Identifier: Apache-2.0
// What every source must keep (capture/source/field_source.h), whatever it reads from.
#include <gtest/gtest.h>

#include <chrono>
#include <cmath>
#include <future>
#include <thread>

#include "capture/source/field_source.h"
#include "small_take.h"

namespace relievo {
namespace {

struct Case {
  const char* name;
  bool loop;
  /// Returns the source's uri; may write files into the folder.
  std::string (*prepare)(const std::filesystem::path& folder);
};

std::string small_take(const std::filesystem::path& folder, Scan scan) {
  test::write_small_take(folder, scan, 5);
  return "take:" + folder.string();
}

class SourceCompliance : public testing::TestWithParam<Case> {
 protected:
  void SetUp() override { uri_ = GetParam().prepare(folder_.path()); }

  std::unique_ptr<FieldSource> open() const {
    auto source = open_source(uri_, {.loop = GetParam().loop});
    EXPECT_TRUE(source) << source.error().message;
    return source ? *std::move(source) : nullptr;
  }

  test::TempFolder folder_;
  std::string uri_;
};

constexpr int kMany = 23;  // more than two passes of every case here

TEST_P(SourceCompliance, FramesFitTheRigAndComeInOrder) {
  const auto source = open();
  ASSERT_TRUE(source);
  const SourceInfo& info = source->info();
  EXPECT_EQ(info.name, uri_);
  EXPECT_GE(info.pattern.stripes(), 2);
  ASSERT_TRUE(info.frames || info.live);
  const int expected = GetParam().loop ? kMany : static_cast<int>(*info.frames);
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
      EXPECT_NEAR(periods, std::round(periods), 0.01);
    } else {
      EXPECT_EQ(f.number, 0u);
    }
    last_number = f.number;
    last_ns = f.time_ns;
  }
  if (!GetParam().loop) {
    for (int again = 0; again < 3; ++again) {
      auto end = source->next();
      ASSERT_TRUE(end);
      EXPECT_FALSE(*end) << "the end must stay the end";
    }
  }
}

TEST_P(SourceCompliance, TheSameSourceGivesTheSameBytes) {
  const auto one = open(), two = open();
  for (int i = 0; i < 6; ++i) {
    auto a = one->next(), b = two->next();
    ASSERT_TRUE(a && b);
    ASSERT_EQ(a->has_value(), b->has_value());
    if (!*a) break;
    EXPECT_EQ((*a)->time_ns, (*b)->time_ns);
    const auto same = [](const Image8& x, const Image8& y) {
      return x.size() == y.size() && std::equal(x.data(), x.data() + x.size(), y.data());
    };
    EXPECT_TRUE(same((*a)->picture, (*b)->picture)) << i;
    EXPECT_TRUE(same((*a)->complement, (*b)->complement)) << i;
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

const std::string kSmall = ",stripes=20";

const Case kCases[] = {
    {"TakeInterlaced", false, [](const auto& folder) { return small_take(folder, Scan::kInterlaced); }},
    {"TakeInterlacedLoop", true, [](const auto& folder) { return small_take(folder, Scan::kInterlaced); }},
    {"TakeProgressive", false, [](const auto& folder) { return small_take(folder, Scan::kProgressive); }},
    {"TakeProgressiveLoop", true, [](const auto& folder) { return small_take(folder, Scan::kProgressive); }},
    {"SimInterlaced", false, [](const auto&) { return "sim:face,width=64,height=48,frames=7" + kSmall; }},
    {"SimInterlacedLoop", true,
     [](const auto&) { return "sim:object,width=64,height=48,period=8" + kSmall; }},
    {"SimProgressive", false,
     [](const auto&) { return "sim:walk,width=64,height=48,scan=progressive,frames=6,drop=3" + kSmall; }},
    {"SimProgressiveLoop", true,
     [](const auto&) { return "sim:plane,width=64,height=48,scan=progressive,period=6,drop=4" + kSmall; }},
    {"Board", false, [](const auto&) { return "sim:board,width=64,height=48,frames=7" + kSmall; }},
    {"BoardProgressiveLoop", true,
     [](const auto&) { return "sim:board,width=64,height=48,scan=progressive,drop=5" + kSmall; }},
    {"Sheet", false, [](const auto&) { return "sim:sheet,width=64,height=48,frames=9" + kSmall; }},
};

INSTANTIATE_TEST_SUITE_P(Sources, SourceCompliance, testing::ValuesIn(kCases),
                         [](const auto& test) { return std::string(test.param.name); });

}  // namespace
}  // namespace relievo
