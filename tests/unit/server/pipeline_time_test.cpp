// SPDX-License-Identifier: Apache-2.0
// The threaded pipeline: when frames come out of it, of which time they are said to be, and gaps between
// them.
#include "base/time.h"
#include "tests/unit/server/pipeline_fixture.h"

namespace relievo {
namespace {

using namespace test;

TEST_F(PipelineTest, PacedPlaybackKeepsTheTimeStamps) {
  ScriptedSource source(scene_, count_to(frames_, 12));
  PipelineOptions options;
  options.lossless = true;
  const auto pipeline = make(source, {&sink_}, options);
  const std::int64_t begin = utc_now_ns();
  ASSERT_TRUE(pipeline->run());
  const std::int64_t end = utc_now_ns();
  const auto got = sink_.frames();
  ASSERT_EQ(numbers(got), range(1, 12));
  EXPECT_GE(got.front().capture_time_ns, begin);
  EXPECT_LE(got.back().publish_time_ns, end);
  EXPECT_GE(end - begin, 11 * 33'000'000);
  for (std::size_t i = 0; i < got.size(); ++i) {
    EXPECT_GE(got[i].publish_time_ns, got[i].capture_time_ns);
    const auto decoded = read_frame_header(*got[i].data);
    ASSERT_TRUE(decoded);
    EXPECT_EQ(decoded->time_ns, frames_(got[i].number).time_ns);  // the take's own time stays in the frame
    if (i == 0) continue;
    const std::int64_t between = frames_(got[i].number).time_ns - frames_(got[i - 1].number).time_ns;
    // Equal but where this machine was so late that the clock was set back.
    EXPECT_GE(got[i].capture_time_ns - got[i - 1].capture_time_ns, between);
  }
}

// A take of two days, say.
TEST_F(PipelineTest, AGapOfHoursIsNotWaitedFor) {
  constexpr std::int64_t kHour_ns = 3600 * kNanosecondsPerSecond;
  ScriptedSource source(scene_, [&](ScriptedSource&, std::uint64_t n) -> ScriptedSource::Next {
    if (n >= 6) return ScriptedSource::end();
    CapturedFrame frame = frames_(n);
    if (n >= 3) frame.time_ns += kHour_ns;
    return std::optional(std::move(frame));
  });
  PipelineOptions options;
  options.lossless = true;
  const auto pipeline = make(source, {&sink_}, options);
  ::testing::internal::CaptureStderr();
  Running running(*pipeline);
  const bool ended = running.ended();
  pipeline->stop();
  const std::string said = ::testing::internal::GetCapturedStderr();
  ASSERT_TRUE(ended) << said;
  EXPECT_NE(said.find("a gap of 3600 s"), std::string::npos) << said;
  const auto got = sink_.frames();
  ASSERT_EQ(numbers(got), range(1, 6));
  EXPECT_GE(got[2].capture_time_ns - got[1].capture_time_ns, kNanosecondsPerSecond);
  EXPECT_LT(got[2].capture_time_ns - got[1].capture_time_ns, kHour_ns);
  EXPECT_GT(read_frame_header(*got[2].data)->time_ns, kHour_ns);  // the take's own time stays in the frame
}

TEST_F(PipelineTest, ASlowSourceIsNotPlayedInItsOwnPast) {
  // A frame a millisecond by its stamps, one in 40 ms in truth: latency is from when a frame came.
  std::vector<std::int64_t> came;
  ScriptedSource source(scene_, [&](ScriptedSource&, std::uint64_t n) -> ScriptedSource::Next {
    if (n >= 25) return ScriptedSource::end();
    std::this_thread::sleep_for(40ms);
    CapturedFrame frame = frames_(n);
    frame.time_ns = static_cast<std::int64_t>(n) * 1'000'000;
    came.push_back(utc_now_ns());
    return std::optional(std::move(frame));
  });
  const auto pipeline = make(source, {&sink_}, {});
  ASSERT_TRUE(pipeline->run());
  const auto got = sink_.frames();
  ASSERT_FALSE(got.empty());
  // Without setting the clock back the last one would be 24 x 39 ms behind.
  for (const auto& f : got) EXPECT_GE(f.capture_time_ns, came[f.number] - 100'000'000) << f.number;
}

TEST_F(PipelineTest, ALiveSourcesTimesAreItsOwn) {
  const std::int64_t start = utc_now_ns() - 5 * kNanosecondsPerSecond;
  ScriptedSource source(
      scene_,
      [&](ScriptedSource&, std::uint64_t n) -> ScriptedSource::Next {
        if (n >= 5) return ScriptedSource::end();
        CapturedFrame frame = frames_(n);
        frame.time_ns += start;
        return std::optional(std::move(frame));
      },
      true);
  PipelineOptions options;
  options.lossless = true;
  const auto pipeline = make(source, {&sink_}, options);
  ASSERT_TRUE(pipeline->run());
  const auto got = sink_.frames();
  ASSERT_EQ(got.size(), 4U);
  for (const auto& f : got) EXPECT_EQ(f.capture_time_ns, start + frames_(f.number).time_ns);
  EXPECT_GT(pipeline->status().latency_ms, 4000);
}

TEST_F(PipelineTest, ATakeThatStartsAgainHasLostNothing) {
  ScriptedSource source(scene_, [&](ScriptedSource&, std::uint64_t n) -> ScriptedSource::Next {
    if (n >= 9) return ScriptedSource::end();
    CapturedFrame frame = frames_(n % 3);  // the last one shows the slide of the first
    frame.time_ns = frames_(n).time_ns;
    frame.number = 100 + n;
    frame.starts_again = n > 0 && n % 3 == 0;
    return std::optional(std::move(frame));
  });
  const auto pipeline = make(source, {&sink_}, fast_and_lossless());
  ASSERT_TRUE(pipeline->run());
  EXPECT_EQ(pipeline->status().drops_capture, 0U);
}

TEST_F(PipelineTest, ADropInTheTakeIsCountedFromContent) {
  ScriptedSource source(scene_, [&](ScriptedSource&, std::uint64_t n) -> ScriptedSource::Next {
    if (n >= 8) return ScriptedSource::end();
    return std::optional(frames_(n < 4 ? n : n + 1));  // 4 is missing
  });
  const auto pipeline = make(source, {&sink_}, fast_and_lossless());
  ASSERT_TRUE(pipeline->run());
  EXPECT_EQ(pipeline->status().drops_capture, 1U);
  EXPECT_EQ(numbers(sink_.frames()), (std::vector<std::uint64_t>{1, 2, 3, 5, 6, 7, 8}));
}

}  // namespace
}  // namespace relievo
