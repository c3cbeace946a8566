// SPDX-License-Identifier: Apache-2.0
// Proves: a rung that nobody reads costs nothing, one that is slow keeps nobody waiting, and what rungs send
// are valid frames of the same surface.
#include "server/ladder.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <mutex>
#include <optional>
#include <set>
#include <vector>

#include "base/time.h"
#include "codec/texture_codec.h"
#include "tests/support/make_grid.h"
#include "tests/unit/server/fakes.h"

namespace relievo::test {
namespace {

Frame3D frame_with_picture(std::uint64_t number = 1) {
  Frame3D frame = grid_frame({});
  frame.number = number;
  frame.texture = Image8(640, 480, 3);
  std::fill_n(frame.texture.data(), frame.texture.size(), std::uint8_t{90});
  return frame;
}

class LadderTest : public ::testing::Test {
 protected:
  Ladder::Output output(Rung rung, std::atomic<int>& readers, CollectingSink& sink) {
    return {.rung = rung,
            .readers = [&readers] { return readers.load(); },
            .publish = [&sink](const FrameMessage& frame) { return sink.consume(frame); }};
  }
  const EncodeOptions encode_{.geometry = GeometryCodec::kGrid, .step_bits = 6};
  Ladder ladder_{grid_rig({}), grid_pattern({}), encode_, 1e-4};
  std::atomic<int> reduced_readers_{0}, texture_readers_{0};
  CollectingSink reduced_, texture_;

  /// The reduced rung's reader opens `entered` with each frame, and is done with it when `go_on` is open.
  void hold(Gate& entered, Gate& go_on) {
    reduced_.on_frame = [&](const FrameMessage&) -> Status {
      entered.open();
      go_on.wait();
      return {};
    };
  }

  void SetUp() override {
    ladder_.add(output(Rung::kReduced, reduced_readers_, reduced_));
    ladder_.add(output(Rung::kTexture, texture_readers_, texture_));
  }
};

TEST_F(LadderTest, NothingIsMadeWhereNobodyReads) {
  EXPECT_FALSE(ladder_.wanted());
  texture_readers_ = 2;
  EXPECT_TRUE(ladder_.wanted());
  ladder_.take(frame_with_picture(), 5, 1);
  ASSERT_TRUE(eventually([&] { return texture_.frames().size() == 1; }));
  ladder_.end();
  EXPECT_TRUE(reduced_.frames().empty());
  const auto status = ladder_.status();
  ASSERT_EQ(status.size(), 2U);
  EXPECT_EQ(status[0].rung, Rung::kReduced);
  EXPECT_EQ(status[0].frames, 0U);
  EXPECT_EQ(status[1].readers, 2U);
  EXPECT_EQ(status[1].frames, 1U);
  EXPECT_GT(status[1].encode_ms, 0);
}

TEST_F(LadderTest, RungsAreSmallerFramesOfTheSameMoment) {
  reduced_readers_ = texture_readers_ = 1;
  FrameEncoder encoder(grid_rig({}), grid_pattern({}));
  const auto full = encoder.encode(frame_with_picture(), encode_);
  ASSERT_TRUE(full);
  ladder_.take(frame_with_picture(42), 5, 1);
  ASSERT_TRUE(eventually([&] { return texture_.frames().size() == 1; }));
  const FrameMessage reduced = reduced_.frames().at(0), texture = texture_.frames().at(0);
  EXPECT_EQ(reduced.rung, Rung::kReduced);
  EXPECT_EQ(reduced.number, 42U);
  EXPECT_EQ(reduced.capture_time_ns, 5);
  EXPECT_LT(reduced.data->size(), full->size() * 3 / 4);
  EXPECT_LT(texture.data->size(), reduced.data->size());
  const auto surface = decode_frame(*reduced.data);
  const auto picture = decode_frame(*texture.data);
  ASSERT_TRUE(surface && picture);
  EXPECT_EQ(surface->texture.width(), 320);
  EXPECT_GT(surface->surface.triangles.size(), 1000U);
  EXPECT_EQ(picture->texture.height(), 240);
  EXPECT_TRUE(picture->surface.positions.empty());
}

TEST_F(LadderTest, JpegRungsAreTheSameInJpegWhateverTheStreamsTexturesAre) {
  // PNG instead of H.264, which not every build has.
  const EncodeOptions encode{.geometry = GeometryCodec::kGrid, .texture = TextureCodec::kPng, .step_bits = 6};
  Ladder ladder(grid_rig({}), grid_pattern({}), encode, 1e-4);
  std::atomic<int> readers{1};
  CollectingSink full, reduced, texture;
  ladder.add(output(Rung::kReduced, readers, reduced_));
  ladder.add(output(Rung::kFullJpeg, readers, full));
  ladder.add(output(Rung::kReducedJpeg, readers, reduced));
  ladder.add(output(Rung::kTextureJpeg, readers, texture));
  const std::size_t vertices = grid_frame({}).surface.positions.size();
  ladder.take(frame_with_picture(42), 5, 1);
  ASSERT_TRUE(eventually([&] { return texture.frames().size() == 1; }));
  const auto header = [](CollectingSink& sink) {
    const auto read = read_frame_header(*sink.frames().at(0).data);
    EXPECT_TRUE(read);
    return read ? *read : FrameHeader{};
  };
  EXPECT_EQ(header(reduced_).texture, TextureCodec::kPng);
  for (CollectingSink* sink : {&full, &reduced, &texture})
    EXPECT_EQ(header(*sink).texture, TextureCodec::kJpeg);
  EXPECT_EQ(full.frames()[0].rung, Rung::kFullJpeg);
  EXPECT_EQ(header(full).vertices, vertices);
  EXPECT_EQ(header(full).texture_width, 640U);
  EXPECT_EQ(header(reduced).vertices, header(reduced_).vertices);
  EXPECT_EQ(header(reduced).texture_width, 320U);
  EXPECT_EQ(header(texture).vertices, 0U);
  EXPECT_EQ(header(texture).texture_width, 320U);
  const auto picture = decode_frame(*full.frames()[0].data);
  ASSERT_TRUE(picture);
  EXPECT_NEAR(picture->texture.row(240)[960], 90, 2);
}

TEST_F(LadderTest, ASurfaceOffTheGridGoesWhole) {
  reduced_readers_ = 1;
  Frame3D frame = frame_with_picture();
  frame.surface.grid.clear();
  const std::size_t vertices = frame.surface.positions.size();
  ladder_.take(std::move(frame), 5, 1);
  ASSERT_TRUE(eventually([&] { return reduced_.frames().size() == 1; }));
  const auto header = read_frame_header(*reduced_.frames()[0].data);
  ASSERT_TRUE(header);
  EXPECT_EQ(header->geometry, GeometryCodec::kDracoMesh);
  EXPECT_GT(header->vertices, vertices * 9 / 10);
  EXPECT_EQ(header->texture_width, 320U);
}

TEST_F(LadderTest, ASlowRungDropsAndKeepsNobodyWaiting) {
  reduced_readers_ = 1;
  Gate entered, go_on;
  hold(entered, go_on);
  ladder_.take(frame_with_picture(1), 1, 1);
  ASSERT_TRUE(entered.wait());
  for (std::uint64_t n = 2; n <= 6; ++n) ladder_.take(frame_with_picture(n), 1, 1);  // would hang here
  EXPECT_EQ(ladder_.status()[0].drops, 4U);
  EXPECT_EQ(ladder_.status()[1].drops, 0U) << "nobody reads it";
  go_on.open();
  ASSERT_TRUE(eventually([&] { return reduced_.frames().size() == 2; }));
  EXPECT_EQ(reduced_.frames()[1].number, 6U);
  EXPECT_EQ(reduced_.frames()[1].sequence, 1U) << "what was not made is no gap";
}

TEST_F(LadderTest, WhoJoinsGetsAKeyFrame) {
  Ladder ladder(grid_rig({}), grid_pattern({}), {.geometry = GeometryCodec::kGrid, .key_interval = 1000},
                1e-4);
  ladder.add(output(Rung::kReduced, reduced_readers_, reduced_));
  reduced_readers_ = 1;
  const auto next = [&] {
    const std::size_t count = reduced_.frames().size();
    ladder.take(frame_with_picture(), 1, 1);
    EXPECT_TRUE(eventually([&] { return reduced_.frames().size() > count; }));
    return is_key_frame(*reduced_.frames().back().data);
  };
  EXPECT_TRUE(next());
  EXPECT_FALSE(next());
  ladder.request_key_frame();
  EXPECT_TRUE(eventually(next)) << "at most one in a quarter of a second";
  EXPECT_FALSE(next());
}

TEST_F(LadderTest, EndsAtOnceWithFramesWaiting) {
  reduced_readers_ = 1;
  Gate entered, go_on;
  hold(entered, go_on);
  ladder_.take(frame_with_picture(1), 1, 1);
  ASSERT_TRUE(entered.wait());
  ladder_.take(frame_with_picture(2), 1, 1);
  std::thread ending([&] { ladder_.end(); });
  go_on.open();
  ending.join();
  EXPECT_LE(reduced_.frames().size(), 2U);
}

TEST_F(LadderTest, EveryFrameComesBackInItsMemory) {
  reduced_readers_ = 1;
  std::mutex mutex;
  std::vector<const std::uint8_t*> taken, back;
  ladder_.give_back_to([&](Frame3D&& frame) {
    std::lock_guard lock(mutex);
    back.push_back(frame.texture.data());
    EXPECT_GT(frame.surface.positions.size(), 1000U);
  });
  Gate entered, go_on;
  hold(entered, go_on);
  for (std::uint64_t n = 1; n <= 5; ++n) {
    Frame3D frame = frame_with_picture(n);
    if (n == 5) frame.surface.grid.clear();  // goes whole
    taken.push_back(frame.texture.data());
    ladder_.take(std::move(frame), 1, 1);
    if (n == 1) {
      ASSERT_TRUE(entered.wait());
    }
  }
  {
    std::lock_guard lock(mutex);
    EXPECT_EQ(back.size(), 3U) << "those that were dropped";
  }
  go_on.open();
  ASSERT_TRUE(eventually([&] { return reduced_.frames().size() == 2; }));
  ladder_.end();
  std::sort(taken.begin(), taken.end());
  std::sort(back.begin(), back.end());
  EXPECT_EQ(taken, back);
}

TEST(RungOptions, AreNeverFinerThanTheStreams) {
  const EncodeOptions coarse{.texture_quality = 30, .step_bits = 2, .bound_px = 2};
  const EncodeOptions options = rung_options(coarse, Rung::kReduced);
  EXPECT_EQ(options.texture_quality, 30);
  EXPECT_EQ(options.step_bits, 2);
  EXPECT_EQ(options.bound_px, 2);
}

/// Keeps each frame for one more, and counts in how many pieces of memory they lay.
class CountingRungs final : public LowerRungs {
 public:
  bool wanted() override { return true; }
  void take(Frame3D frame, std::int64_t, int) override {
    ++frames;
    memory.insert(frame.texture.data());
    if (kept_) give_back_(std::move(*kept_));
    kept_ = std::move(frame);
  }
  void give_back_to(std::function<void(Frame3D&&)> give_back) override { give_back_ = std::move(give_back); }
  void end() override {
    if (kept_) give_back_(std::move(*kept_));
    kept_.reset();
  }
  std::vector<RungStatus> status() const override { return {}; }

  int frames = 0;
  std::set<const std::uint8_t*> memory;

 private:
  std::function<void(Frame3D&&)> give_back_;
  std::optional<Frame3D> kept_;
};

TEST(PipelineRungs, FramesAreMadeInTheMemoryOfThoseThatRungsHaveDone) {
  const StripedScene scene = striped_scene();
  const Frames frames(scene);
  ScriptedSource source(scene, count_to(frames, 60));
  CollectingSink full;
  CountingRungs rungs;
  PipelineOptions options;
  options.stream = "test";
  options.paced = false;
  options.lossless = true;
  options.encode.geometry = GeometryCodec::kGrid;
  options.rungs = &rungs;
  auto pipeline = Pipeline::create(source, {&full}, options);
  ASSERT_TRUE(pipeline);
  ASSERT_TRUE((*pipeline)->run());
  EXPECT_EQ(rungs.frames, 59);
  // At most: one being made, three in the queue, one encoded, one kept; and as many spare.
  EXPECT_LE(rungs.memory.size(), 10U);
}

TEST(PipelineTap, TheStreamGoesOnBesideARungThatStandsStill) {
  const StripedScene scene = striped_scene();
  const Frames frames(scene);
  ScriptedSource source(scene, count_to(frames, 40));
  CollectingSink full, reduced;
  Gate go_on;
  reduced.on_frame = [&](const FrameMessage&) -> Status {
    go_on.wait();
    return {};
  };
  PipelineOptions options;
  options.stream = "test";
  options.paced = false;
  options.lossless = true;
  options.encode.geometry = GeometryCodec::kGrid;
  Ladder ladder(scene.rig, scene.pattern, options.encode, 1e-4);
  ladder.add({.rung = Rung::kReduced,
              .readers = [] { return 1; },
              .publish = [&](const FrameMessage& frame) { return reduced.consume(frame); }});
  options.rungs = &ladder;
  auto pipeline = Pipeline::create(source, {&full}, options);
  ASSERT_TRUE(pipeline);
  Running running(**pipeline);
  EXPECT_TRUE(eventually([&] { return full.frames().size() == 39; })) << "though the rung never finishes one";
  go_on.open();
  ASSERT_TRUE(running.ended());
  EXPECT_TRUE(running.result());
  const ServerStatus status = full.statuses().back();
  ASSERT_EQ(status.rungs.size(), 1U);
  EXPECT_GT(status.rungs[0].drops, 0U);
  EXPECT_EQ(status.drops_encode + status.drops_publish, 0U);
}

}  // namespace
}  // namespace relievo::test
