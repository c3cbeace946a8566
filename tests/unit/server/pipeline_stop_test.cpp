// SPDX-License-Identifier: Apache-2.0
// stop() from another thread ends run(), whatever the pipeline is doing: each state would last for minutes or
// for ever.
#include <gtest/gtest.h>

#include "server/pipeline.h"
#include "tests/unit/server/fakes.h"

namespace relievo {
namespace {

using namespace test;

class StopTest : public ::testing::Test {
 protected:
  void expect_stop(ScriptedSource& source, const PipelineOptions& options,
                   const std::function<bool(Pipeline&)>& reached) {
    auto pipeline = Pipeline::create(source, {&sink_}, options);
    ASSERT_TRUE(pipeline) << pipeline.error().message;
    const std::size_t before = sink_.frames().size();
    Running running(**pipeline);
    ASSERT_TRUE(eventually([&] { return reached(**pipeline); }));
    EXPECT_FALSE(running.ended(50ms));
    const auto begin = std::chrono::steady_clock::now();
    (*pipeline)->stop();
    (*pipeline)->stop();
    ASSERT_TRUE(running.ended());
    RecordProperty("stop_ms", static_cast<int>((std::chrono::steady_clock::now() - begin) / 1ms));
    const Status done = running.result();
    EXPECT_TRUE(done) << done.error().message;
    (*pipeline)->stop();  // after the end, too
    ASSERT_FALSE(sink_.statuses().empty());
    EXPECT_EQ(sink_.statuses().back().state, StreamState::kEnded);
    // Nothing that went into the last queue was lost.
    EXPECT_EQ((*pipeline)->status().frames_published, sink_.frames().size() - before);
  }

  const StripedScene scene_ = striped_scene();
  const Frames frames_{scene_};
  CollectingSink sink_;
};

TEST_F(StopTest, WhileWaitingForAFramesTime) {
  ScriptedSource source(scene_, [&](ScriptedSource&, std::uint64_t n) -> ScriptedSource::Next {
    CapturedFrame frame = frames_(n);
    if (n >= 3) frame.time_ns += 3600LL * 1'000'000'000;  // an hour later
    return std::optional(std::move(frame));
  });
  PipelineOptions options;
  expect_stop(source, options, [&](Pipeline&) { return source.calls >= 4 && sink_.frames().size() == 2; });
}

TEST_F(StopTest, WhileTheSourceBlocks) {
  for (const bool lossless : {false, true}) {
    ScriptedSource source(
        scene_,
        [&](ScriptedSource& self, std::uint64_t n) -> ScriptedSource::Next {
          if (n >= 3) return self.block();
          return std::optional(frames_(n));
        },
        true);
    PipelineOptions options;
    options.lossless = lossless;
    expect_stop(source, options, [&](Pipeline&) { return source.blocked.load(); });
  }
}

TEST_F(StopTest, WithFullQueuesThatWait) {
  ScriptedSource source(scene_, count_to(frames_, 1'000'000));
  sink_.on_frame = [](const FrameMessage&) -> Status {
    std::this_thread::sleep_for(20ms);
    return {};
  };
  PipelineOptions options;
  options.paced = false;
  options.lossless = true;
  expect_stop(source, options, [&](Pipeline&) { return sink_.frames().size() >= 10; });
  // Every frame captured was published: the queues were emptied into the sink.
  const ServerStatus last = sink_.statuses().back();
  EXPECT_EQ(last.frames_published, last.frames_captured - 1);
}

TEST_F(StopTest, WithFullQueuesThatDrop) {
  ScriptedSource source(scene_, count_to(frames_, 1'000'000), true);
  sink_.on_frame = [](const FrameMessage&) -> Status {
    std::this_thread::sleep_for(20ms);
    return {};
  };
  expect_stop(source, {}, [&](Pipeline& p) { return p.status().drops_reconstruct > 20; });
}

TEST_F(StopTest, WhileTheSourceFails) {
  // Asked to stop, it stops: that the source was in trouble at the moment is no failure of the run.
  ScriptedSource source(scene_, [&](ScriptedSource& self, std::uint64_t n) -> ScriptedSource::Next {
    if (n < 3) return std::optional(frames_(n));
    if (n > 3) return self.block();
    return Error{"no signal"};
  });
  PipelineOptions options;
  options.paced = false;
  expect_stop(source, options, [&](Pipeline& p) {
    return source.blocked.load() && p.status().state == StreamState::kStalled;
  });
  EXPECT_EQ(sink_.statuses().back().message, "");
}

TEST_F(StopTest, BeforeTheRun) {
  for (const bool paced : {true, false}) {
    ScriptedSource source(scene_, count_to(frames_, 1'000'000));
    PipelineOptions options;
    options.paced = paced;
    auto pipeline = Pipeline::create(source, {&sink_}, options);
    ASSERT_TRUE(pipeline);
    (*pipeline)->stop();
    Running running(**pipeline);
    ASSERT_TRUE(running.ended());
    EXPECT_TRUE(running.result());
    EXPECT_EQ((*pipeline)->status().frames_published, 0U);
  }
}

TEST_F(StopTest, FromManyThreadsWhileStatusIsRead) {
  ScriptedSource source(scene_, count_to(frames_, 1'000'000), true);
  auto pipeline = Pipeline::create(source, {&sink_}, {});
  ASSERT_TRUE(pipeline);
  Running running(**pipeline);
  ASSERT_TRUE(eventually([&] { return sink_.frames().size() >= 3; }));
  std::vector<std::thread> threads;
  for (int t = 0; t < 4; ++t) {
    threads.emplace_back([&] {
      for (int i = 0; i < 50; ++i) static_cast<void>((*pipeline)->status());
      (*pipeline)->stop();
    });
  }
  for (auto& thread : threads) thread.join();
  ASSERT_TRUE(running.ended());
  EXPECT_TRUE(running.result());
}

}  // namespace
}  // namespace relievo
