// SPDX-License-Identifier: Apache-2.0
// The pipeline where sources or sinks fail, or give what does not fit.
#include <algorithm>

#include "base/time.h"
#include "tests/unit/server/pipeline_fixture.h"

namespace relievo {
namespace {

using namespace test;

TEST_F(PipelineTest, ASinkThatFailsEndsTheRunWithItsError) {
  ScriptedSource source(scene_, count_to(frames_, 1'000'000));
  CollectingSink failing;
  failing.on_frame = [](const FrameMessage& f) -> Status {
    if (f.number >= 3) return Error{"disk full at frame " + std::to_string(f.number)};
    return {};
  };
  const auto pipeline = make(source, {&sink_, &failing}, fast_and_lossless());
  const Status done = pipeline->run();
  ASSERT_FALSE(done);
  EXPECT_EQ(done.error().message, "disk full at frame 3");  // the first, though others followed
  EXPECT_TRUE(source.stopped());
  EXPECT_LT(source.calls, 1000);
  EXPECT_EQ(numbers(failing.frames()), range(1, 3));
  EXPECT_EQ(numbers(sink_.frames()), range(1, 1 + sink_.frames().size()));
  const ServerStatus last = sink_.statuses().back();
  EXPECT_EQ(last.state, StreamState::kEnded);
  EXPECT_EQ(last.message, "disk full at frame 3");
}

TEST_F(PipelineTest, ASinkThatRefusesAStatusEndsTheRun) {
  sink_.on_status = [](const ServerStatus&) -> Status { return Error{"no status, please"}; };
  ScriptedSource source(scene_, [&](ScriptedSource& self, std::uint64_t n) -> ScriptedSource::Next {
    if (n >= 2) return self.block();
    return std::optional(frames_(n));
  });
  const auto pipeline = make(source, {&sink_}, fast_and_lossless());
  const Status done = pipeline->run();
  ASSERT_FALSE(done);
  EXPECT_EQ(done.error().message, "no status, please");
}

TEST_F(PipelineTest, AFrameThatCannotBeReadIsCountedAndTheOthersGoOn) {
  ScriptedSource source(scene_, [&](ScriptedSource&, std::uint64_t n) -> ScriptedSource::Next {
    if (n >= 9) return ScriptedSource::end();
    if (n == 3 || n == 5 || n == 6) return Error{"frame " + std::to_string(n) + " is torn"};
    return std::optional(frames_(n));
  });
  const auto pipeline = make(source, {&sink_}, fast_and_lossless());
  const Status done = pipeline->run();
  EXPECT_TRUE(done) << done.error().message;
  EXPECT_EQ(numbers(sink_.frames()), (std::vector<std::uint64_t>{1, 2, 4, 7, 8}));
  const ServerStatus s = pipeline->status();
  EXPECT_EQ(s.frames_captured, 6U);
  EXPECT_EQ(s.drops_capture, 3U) << "each torn one once, though 4 shows the slide of 2";
  EXPECT_EQ(s.message, "");
}

TEST_F(PipelineTest, AnErrorBeforeTheEndIsTheRuns) {
  ScriptedSource source(scene_, [&](ScriptedSource&, std::uint64_t n) -> ScriptedSource::Next {
    if (n == 4) return Error{"the camera was unplugged"};
    if (n > 4) return ScriptedSource::end();
    return std::optional(frames_(n));
  });
  const auto pipeline = make(source, {&sink_}, fast_and_lossless());
  const Status done = pipeline->run();
  ASSERT_FALSE(done);
  EXPECT_EQ(done.error().message, "the camera was unplugged");
  EXPECT_EQ(numbers(sink_.frames()), range(1, 4));  // what was captured before still went out
  EXPECT_EQ(sink_.statuses().back().state, StreamState::kEnded);
  EXPECT_EQ(sink_.statuses().back().message, "the camera was unplugged");
}

TEST_F(PipelineTest, ASourceOfErrorsIsGivenUp) {
  ScriptedSource source(scene_, [&](ScriptedSource&, std::uint64_t n) -> ScriptedSource::Next {
    return Error{"no signal " + std::to_string(n)};
  });
  const auto pipeline = make(source, {&sink_}, fast_and_lossless());
  const Status done = pipeline->run();
  ASSERT_FALSE(done);
  EXPECT_EQ(done.error().message, "no signal 29");
  EXPECT_EQ(source.calls, 30);
  EXPECT_EQ(pipeline->status().drops_capture, 30U);
}

TEST_F(PipelineTest, StalledIsSaidWhileErrorsLast) {
  Gate stalled;
  sink_.on_status = [&](const ServerStatus& s) -> Status {
    if (s.state == StreamState::kStalled && s.message == "no signal") stalled.open();
    return {};
  };
  ScriptedSource source(scene_, [&](ScriptedSource&, std::uint64_t n) -> ScriptedSource::Next {
    if (n == 2) return Error{"no signal"};
    if (n == 3) {
      EXPECT_TRUE(stalled.wait());
    }
    if (n > 4) return ScriptedSource::end();
    return std::optional(frames_(n));
  });
  const auto pipeline = make(source, {&sink_}, fast_and_lossless());
  EXPECT_TRUE(pipeline->run());
  EXPECT_EQ(sink_.statuses().back().message, "");
}

TEST_F(PipelineTest, ACamerasTroubleIsLoggedWhileItLasts) {
  testing::internal::CaptureStderr();
  std::string while_it_lasts;
  ScriptedSource source(
      scene_,
      [&](ScriptedSource&, std::uint64_t n) -> ScriptedSource::Next {
        if (n == 2 || n == 3) return Error{"it was unplugged"};
        if (n == 4) {
          while_it_lasts = testing::internal::GetCapturedStderr();
          testing::internal::CaptureStderr();
        }
        if (n > 5) return ScriptedSource::end();
        return std::optional(frames_(n));
      },
      true);
  const auto pipeline = make(source, {&sink_}, fast_and_lossless());
  EXPECT_TRUE(pipeline->run());
  const std::string afterwards = testing::internal::GetCapturedStderr();
  EXPECT_EQ(while_it_lasts.find("it was unplugged"), while_it_lasts.rfind("it was unplugged"));
  EXPECT_NE(while_it_lasts.find("it was unplugged"), std::string::npos) << while_it_lasts;
  EXPECT_NE(afterwards.find("scripted gives frames again"), std::string::npos) << afterwards;
  EXPECT_EQ(afterwards.find("it was unplugged"), std::string::npos) << afterwards;
}

TEST_F(PipelineTest, StalledIsSaidWhileTheSourceIsSilent) {
  Gate stalled;
  sink_.on_status = [&](const ServerStatus& s) -> Status {
    if (s.state == StreamState::kStalled && s.message == "The source gives no frames.") stalled.open();
    return {};
  };
  Pipeline* running = nullptr;
  ScriptedSource source(
      scene_,
      [&](ScriptedSource&, std::uint64_t n) -> ScriptedSource::Next {
        if (n == 3) {
          EXPECT_TRUE(stalled.wait());
          EXPECT_EQ(running->status().state, StreamState::kStalled);
        }
        if (n == 4) {
          EXPECT_TRUE(eventually([&] { return running->status().message.empty(); }));
        }
        if (n > 5) return ScriptedSource::end();
        return std::optional(frames_(n));
      },
      true);
  const auto pipeline = make(source, {&sink_}, fast_and_lossless());
  running = pipeline.get();
  EXPECT_TRUE(pipeline->run());
  EXPECT_EQ(numbers(sink_.frames()), range(1, 6));
  EXPECT_EQ(sink_.statuses().back().state, StreamState::kEnded);
  EXPECT_EQ(sink_.statuses().back().message, "");
}

TEST_F(PipelineTest, ASourceThatNeverGivesASurfaceEndsTheRun) {
  ScriptedSource source(scene_, [&](ScriptedSource&, std::uint64_t) -> ScriptedSource::Next {
    return std::optional(frames_(0));  // one frame, looped
  });
  const auto pipeline = make(source, {&sink_}, fast_and_lossless());
  const Status done = pipeline->run();
  ASSERT_FALSE(done);
  EXPECT_EQ(done.error().message,
            "scripted gave no surface in 30 frames: a surface needs two frames under different slides");
  EXPECT_TRUE(sink_.frames().empty());
}

TEST_F(PipelineTest, AFrameOfAnotherSizeEndsTheRun) {
  ScriptedSource source(scene_, [&](ScriptedSource&, std::uint64_t n) -> ScriptedSource::Next {
    CapturedFrame frame = frames_(n);
    if (n == 5) frame.picture = Image8(8, 8, 3);
    return std::optional(std::move(frame));
  });
  const auto pipeline = make(source, {&sink_}, fast_and_lossless());
  const Status done = pipeline->run();
  ASSERT_FALSE(done);
  EXPECT_EQ(done.error().message, "frame 5 is 8x8 but rig.yaml says 160x120");
}

TEST_F(PipelineTest, PatternsThatDoNotFitAreRefusedAtOnce) {
  StripedScene scene = scene_;
  scene.pattern = *make_pattern(3, 3, 0, 16);
  ScriptedSource source(scene, count_to(frames_, 1));
  EXPECT_FALSE(Pipeline::create(source, {&sink_}, {}));
}

}  // namespace
}  // namespace relievo
