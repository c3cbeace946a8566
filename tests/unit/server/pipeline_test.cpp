// SPDX-License-Identifier: Apache-2.0
// The threaded pipeline: what comes out of it, when, and what it drops.
#include <algorithm>
#include <set>

#include "base/time.h"
#include "capture/upright.h"
#include "tests/support/hung_up.h"
#include "tests/unit/server/pipeline_fixture.h"

namespace relievo {
namespace {

using namespace test;

TEST_F(PipelineTest, LosslessEqualsTheSerialLoopByteForByte) {
  constexpr std::uint64_t kFrames = 24;
  PipelineOptions options = fast_and_lossless();
  options.encode.volume = {{-1, -1, 0}, 2};
  options.encode.draco_speed = 7;

  std::vector<Bytes> serial;
  auto reconstructor = Reconstructor::create(scene_.rig, scene_.pattern, {});
  for (std::uint64_t n = 0; n < kFrames; ++n) {
    auto frame = reconstructor->add(frames_(n));
    ASSERT_TRUE(frame);
    if (!*frame) continue;
    auto bytes = encode_frame(**frame, options.encode);
    ASSERT_TRUE(bytes) << bytes.error().message;
    serial.push_back(*std::move(bytes));
  }
  ASSERT_EQ(serial.size(), kFrames - 1);

  for (const int threads : {1, 3}) {
    options.reconstruct.threads = threads;
    ScriptedSource source(scene_, count_to(frames_, kFrames));
    CollectingSink first;
    CollectingSink second;
    const auto pipeline = make(source, {&first, &second}, options);
    const Status done = pipeline->run();
    EXPECT_TRUE(done) << done.error().message;
    for (const CollectingSink* sink : {&first, &second}) {
      const auto got = sink->frames();
      ASSERT_EQ(numbers(got), range(1, kFrames));
      expect_no_gaps(got);
      for (std::size_t i = 0; i < got.size(); ++i) EXPECT_EQ(*got[i].data, serial[i]) << i;
    }
    EXPECT_EQ(first.frames()[0].data, second.frames()[0].data);  // shared, not copied
    const ServerStatus last = first.statuses().back();
    EXPECT_EQ(last.state, StreamState::kEnded);
    EXPECT_EQ(last.message, "");
    EXPECT_EQ(last.stream, "test");
    EXPECT_EQ(last.frames_captured, kFrames);
    EXPECT_EQ(last.frames_published, kFrames - 1);
    EXPECT_EQ(last.drops_capture + last.drops_reconstruct + last.drops_encode + last.drops_publish, 0U);
    EXPECT_GT(last.reconstruct_ms, 0);
    EXPECT_GT(last.encode_ms, 0);
  }
}

class HalfLines : public testing::TestWithParam<Scan> {};

TEST_P(HalfLines, ReachReadersWhereTheirRowsAre) {
  const StripedScene scene = striped_scene(GetParam());
  const int step_px = GetParam() == Scan::kInterlaced ? 4 : 2;
  const Frames frames(scene);
  ScriptedSource source(scene, count_to(frames, 4));
  CollectingSink sink;
  PipelineOptions options = fast_and_lossless();
  options.reconstruct.line_stride = 2;
  options.encode.geometry = GeometryCodec::kGrid;
  ASSERT_TRUE(make(source, {&sink}, options)->run());
  FrameDecoder decoder;
  ASSERT_EQ(sink.frames().size(), 3U);
  for (const FrameMessage& message : sink.frames()) {
    const auto frame = decoder.decode(*message.data);
    ASSERT_TRUE(frame) << frame.error().message;
    const Surface& surface = frame->surface;
    EXPECT_GT(static_cast<int>(surface.grid.size()), 120 / step_px * 12);
    for (std::size_t v = 0; v < surface.grid.size(); ++v) {
      const Vec3f& p = surface.positions[v];
      ASSERT_LT(surface.grid[v].line, 120 / step_px);
      EXPECT_NEAR(scene.rig.camera.fy() * p[1] / p[2] + scene.rig.camera.cy(), step_px * surface.grid[v].line,
                  0.01);
    }
  }
}

INSTANTIATE_TEST_SUITE_P(, HalfLines, testing::Values(Scan::kInterlaced, Scan::kProgressive),
                         [](const auto& test) { return std::string(to_string(test.param)); });

/// Vertices in triangles, which are those that a mesh carries.
std::size_t in_triangles(const Surface& surface) {
  std::set<std::uint32_t> used;
  for (const Triangle& triangle : surface.triangles) used.insert(triangle.begin(), triangle.end());
  return used.size();
}

TEST_F(PipelineTest, AProjectorUpsideDownGivesTheSameStream) {
  StripedScene over = scene_;  // whose pictures are the same
  over.rig = hung_up(scene_.rig);
  over.pattern = reversed(scene_.pattern);
  ScriptedSource upright(scene_, count_to(frames_, 4)), hung(over, count_to(frames_, 4));
  CollectingSink as_ever, turned;
  ASSERT_TRUE(make(upright, {&as_ever}, fast_and_lossless())->run());
  ASSERT_TRUE(make(hung, {&turned}, fast_and_lossless())->run());
  ASSERT_EQ(turned.frames().size(), 3U);
  for (std::size_t i = 0; i < 3; ++i) EXPECT_EQ(*turned.frames()[i].data, *as_ever.frames()[i].data);
}

TEST_F(PipelineTest, TheVolumeGrowsSoThatNoVertexIsLost) {
  StripedScene far = scene_;
  far.depth_m = 1.6;
  const Frames far_frames(far);
  ScriptedSource source(scene_, [&](ScriptedSource&, std::uint64_t n) -> ScriptedSource::Next {
    if (n >= 8) return ScriptedSource::end();
    return std::optional(n < 4 ? frames_(n) : far_frames(n));
  });
  const auto pipeline = make(source, {&sink_}, fast_and_lossless());
  ASSERT_TRUE(pipeline->run());
  const auto got = sink_.frames();
  ASSERT_EQ(got.size(), 7U);
  auto reconstructor = Reconstructor::create(scene_.rig, scene_.pattern, {});
  std::vector<std::size_t> vertices;
  for (std::uint64_t n = 0; n < 8; ++n) {
    auto frame = reconstructor->add(n < 4 ? frames_(n) : far_frames(n));
    ASSERT_TRUE(frame);
    if (*frame) vertices.push_back(in_triangles((*frame)->surface));
  }
  for (std::size_t i = 0; i < got.size(); ++i) {
    const auto decoded = decode_frame(*got[i].data);
    ASSERT_TRUE(decoded) << decoded.error().message;
    EXPECT_EQ(decoded->surface.positions.size(), vertices[i]) << i;
    const double expected = got[i].number < 4 ? 1.0 : 1.6;
    if (got[i].number == 4) continue;  // the wall jumps between this frame's slides
    for (const Vec3f& p : decoded->surface.positions)
      ASSERT_NEAR(p[2], expected + scene_.slope * p[0], 0.01 * expected) << i;
  }
}

TEST_F(PipelineTest, SomethingFarAwayDoesNotCoarsenWhatIsNear) {
  // The lower half of the picture shows a wall at 12 m: the upper half's positions are coded as finely as if
  // it were not there.
  StripedScene far = scene_;
  far.depth_m = 12;
  const Frames far_frames(far);
  const auto both = [&](std::uint64_t n) {
    CapturedFrame frame = frames_(n);
    const CapturedFrame lower = far_frames(n);
    for (int y = 60; y < frame.picture.height(); ++y)
      std::copy_n(lower.picture.row(y), lower.picture.stride(), frame.picture.row(y));
    return frame;
  };
  ScriptedSource source(scene_, [&](ScriptedSource&, std::uint64_t n) -> ScriptedSource::Next {
    if (n >= 3) return ScriptedSource::end();
    return std::optional(both(n));
  });
  PipelineOptions options = fast_and_lossless();
  options.depth_resolution = 1e-4;
  const auto pipeline = make(source, {&sink_}, options);
  ASSERT_TRUE(pipeline->run());
  ASSERT_EQ(sink_.frames().size(), 2U);
  auto reconstructor = Reconstructor::create(scene_.rig, scene_.pattern, {});
  for (std::uint64_t n = 0; n < 3; ++n) {
    auto exact = reconstructor->add(both(n));
    ASSERT_TRUE(exact);
    if (!*exact) continue;
    const auto decoded = decode_frame(*sink_.frames()[n - 1].data);
    ASSERT_TRUE(decoded);
    std::size_t near = 0;
    for (const Vec3f& p : decoded->surface.positions) {
      if (p[2] > 2) continue;
      ++near;
      float closest = 1;
      for (const Vec3f& q : (*exact)->surface.positions)
        closest = std::min(closest, std::hypot(p[0] - q[0], p[1] - q[1], p[2] - q[2]));
      ASSERT_LT(closest, 1e-4 * p[2]);  // half a step along each axis
    }
    EXPECT_GT(near, 200U);
  }
}

TEST_F(PipelineTest, ASlowSinkCostsTheOldestFramesBeforePublishing) {
  // Frame 1 waits in the sink and three more in the queue; each further one must throw the oldest out.
  Gate entered, release;
  hold_frame_1(entered, release);
  Pipeline* running = nullptr;
  ScriptedSource source(
      scene_,
      [&](ScriptedSource&, std::uint64_t n) -> ScriptedSource::Next {
        if (n == 2) {
          EXPECT_TRUE(entered.wait());
        }
        if (n > 2 && n < 6) {  // the queues are not full yet: each frame is to wait in the last one
          EXPECT_TRUE(eventually(at_rest)) << n;
        }
        if (n >= 6) {
          EXPECT_TRUE(eventually([&] { return running->status().drops_publish >= n - 5; })) << n;
        }
        if (n == 15) {
          release.open();
          return ScriptedSource::end();
        }
        return std::optional(frames_(n));
      },
      true);
  PipelineOptions options;
  const auto pipeline = make(source, {&sink_}, options);
  running = pipeline.get();
  ASSERT_TRUE(pipeline->run());
  const auto got = sink_.frames();
  EXPECT_EQ(numbers(got), (std::vector<std::uint64_t>{1, 12, 13, 14}));
  expect_no_gaps(got);  // sequence counts what is published
  const ServerStatus s = pipeline->status();
  EXPECT_EQ(s.frames_captured, 15U);
  EXPECT_EQ(s.frames_published, 4U);
  EXPECT_EQ(s.drops_publish, 10U);
  EXPECT_EQ(s.drops_encode, 0U);
  EXPECT_EQ(s.drops_reconstruct, 0U);
  EXPECT_EQ(s.drops_capture, 0U);
}

// Readers see no gap where a frame was dropped before it had a number: what they get must decode.
TEST_F(PipelineTest, WhatBuildsOnADroppedFrameIsDroppedToo) {
  Gate entered, release;
  hold_frame_1(entered, release);
  Pipeline* running = nullptr;
  ScriptedSource source(
      scene_,
      [&](ScriptedSource&, std::uint64_t n) -> ScriptedSource::Next {
        if (n == 2) {
          EXPECT_TRUE(entered.wait());
        }
        if (n > 2 && n < 6) {
          EXPECT_TRUE(eventually(at_rest)) << n;
        }
        if (n == 6) {  // frame 5 was encoded before anybody knew that it throws out frame 2
          EXPECT_TRUE(eventually([&] { return running->status().drops_publish > 0; }));
          release.open();
          EXPECT_TRUE(eventually([&] { return running->stages().waiting_publish == 0; }));
        }
        if (n == 9) return ScriptedSource::end();
        return std::optional(frames_(n));
      },
      true);
  const auto pipeline = make(source, {&sink_}, keys_are_rare());
  running = pipeline.get();
  ASSERT_TRUE(pipeline->run());
  const auto got = sink_.frames();
  EXPECT_EQ(numbers(got), (std::vector<std::uint64_t>{1, 6, 7, 8}));
  expect_no_gaps(got);
  EXPECT_EQ(pipeline->status().drops_publish, 4U);
  expect_all_decode(got);
}

TEST_F(PipelineTest, AStreamBeginsWithAFrameThatDecodes) {
  // The publisher begins late: the stream's first frames, its key frame among them, are gone by then.
  Gate release;
  sink_.on_status = [&](const ServerStatus&) -> Status {
    release.wait();
    return {};
  };
  Pipeline* running = nullptr;
  ScriptedSource source(
      scene_,
      [&](ScriptedSource&, std::uint64_t n) -> ScriptedSource::Next {
        EXPECT_TRUE(eventually(at_rest)) << n;
        if (running->status().drops_publish > 0) release.open();
        if (n == 12) return ScriptedSource::end();
        return std::optional(frames_(n));
      },
      true);
  const auto pipeline = make(source, {&sink_}, keys_are_rare());
  running = pipeline.get();
  ASSERT_TRUE(pipeline->run());
  const auto got = sink_.frames();
  ASSERT_GT(got.size(), 3U);
  expect_no_gaps(got);
  expect_all_decode(got);
}

TEST_F(PipelineTest, ACameraFasterThanTheMachineCostsFramesBeforeReconstruction) {
  constexpr std::uint64_t kLeast = 400;
  Pipeline* running = nullptr;
  const auto end = std::chrono::steady_clock::now() + kPatience;
  std::uint64_t given = 0;
  ScriptedSource source(
      scene_,
      [&](ScriptedSource&, std::uint64_t n) -> ScriptedSource::Next {
        const bool late = std::chrono::steady_clock::now() > end;
        if (n >= kLeast && (late || running->status().drops_reconstruct > 0)) return ScriptedSource::end();
        given = n + 1;
        return std::optional(frames_(n));
      },
      true);
  const auto pipeline = make(source, {&sink_}, {});
  running = pipeline.get();
  ASSERT_TRUE(pipeline->run());
  const ServerStatus s = pipeline->status();
  const auto got = sink_.frames();
  EXPECT_EQ(s.frames_captured, given);
  EXPECT_EQ(s.frames_published, got.size());
  EXPECT_GT(s.drops_reconstruct, 0U);
  EXPECT_EQ(s.drops_capture, 0U);  // the same slide twice, but because the server dropped what lay between
  EXPECT_LT(got.size() + s.drops_reconstruct + s.drops_encode + s.drops_publish, given);
  ASSERT_FALSE(got.empty());
  EXPECT_GE(got.back().number, given - 3);  // the newest ones stay
  EXPECT_TRUE(std::is_sorted(got.begin(), got.end(), [](const FrameMessage& a, const FrameMessage& b) {
    return a.number < b.number;
  }));
}

// A slide of now and one from before the wall jumped make few points. The paper's decoder knows nothing else
// of the past.
TEST_F(PipelineTest, WhereFramesAreDroppedASurfaceIsStillOfTwoInARow) {
  constexpr std::uint64_t kJump = 16, kDrops = 200, kSurfaces = 30;
  StripedScene far = scene_;
  far.depth_m = 1.6;
  const Frames far_frames(far);
  Pipeline* running = nullptr;
  const auto end = std::chrono::steady_clock::now() + kPatience;
  ScriptedSource source(
      scene_,
      [&](ScriptedSource&, std::uint64_t n) -> ScriptedSource::Next {
        const bool late = std::chrono::steady_clock::now() > end;
        const ServerStatus s = running->status();
        if (late || (s.drops_reconstruct > kDrops && s.frames_published > kSurfaces))
          return ScriptedSource::end();
        std::this_thread::sleep_for(
            std::chrono::microseconds(200));  // many times faster than the machine all the same
        return std::optional(n / kJump % 2 == 0 ? frames_(n) : far_frames(n));
      },
      true);
  PipelineOptions options;
  options.reconstruct.decoder = Decoder::kPaper;
  options.encode.key_interval = 1;
  const auto pipeline = make(source, {&sink_}, options);
  running = pipeline.get();
  ASSERT_TRUE(pipeline->run());
  EXPECT_GT(pipeline->status().drops_reconstruct, kDrops);
  const auto got = sink_.frames();
  EXPECT_GT(got.size(), kSurfaces);
  for (const FrameMessage& message : got) {
    if (message.number % kJump == 0) continue;  // the wall jumps between its own two frames
    const auto frame = decode_frame(*message.data);
    ASSERT_TRUE(frame) << frame.error().message;
    EXPECT_GT(frame->surface.positions.size(), 60U * 13) << message.number;
  }
}

TEST_F(PipelineTest, EndsAfterAsManyFramesAsAsked) {
  PipelineOptions options = fast_and_lossless();
  options.frames = 5;
  ScriptedSource source(scene_, [&](ScriptedSource&, std::uint64_t n) -> ScriptedSource::Next {
    if (n == 2) return Error{"torn"};  // is none of the five
    return std::optional(frames_(n));
  });
  const auto pipeline = make(source, {&sink_}, options);
  EXPECT_TRUE(pipeline->run());
  EXPECT_EQ(source.calls, 6);
  EXPECT_EQ(pipeline->status().frames_captured, 5U);
  EXPECT_EQ(sink_.frames().back().number, 5U);
}

TEST_F(PipelineTest, StatusGoesOutWhileNothingComes) {
  std::atomic<int> statuses{0};
  sink_.on_status = [&](const ServerStatus&) -> Status {
    ++statuses;
    return {};
  };
  ScriptedSource source(scene_, [&](ScriptedSource& self, std::uint64_t n) -> ScriptedSource::Next {
    if (n >= 3) return self.block();
    return std::optional(frames_(n));
  });
  const auto pipeline = make(source, {&sink_}, fast_and_lossless());
  Running running(*pipeline);
  ASSERT_TRUE(eventually([&] { return source.blocked.load(); }));
  const int before = statuses;
  EXPECT_TRUE(eventually([&] { return statuses >= before + 2; }));  // one a second
  pipeline->stop();
  ASSERT_TRUE(running.ended());
  EXPECT_TRUE(running.result());
  EXPECT_EQ(sink_.statuses().back().frames_published, 2U);
}

}  // namespace
}  // namespace relievo
