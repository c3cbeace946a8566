// SPDX-License-Identifier: Apache-2.0
// Proves: --decoder auto gives frames as much care as all of them can have, and what it changes to reaches
// readers.
#include "server/pace.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <map>
#include <utility>

#include "base/time.h"
#include "tests/unit/server/pipeline_fixture.h"

namespace relievo {
namespace {

using namespace test;

constexpr Pace kOrdered{Decoder::kOrdered, 1}, kQuick{Decoder::kQuick, 1}, kHalf{Decoder::kQuick, 2},
    kQuarter{Decoder::kQuick, 4};

/// A camera in front of a machine that reconstructs as `serve` does: three frames wait, the oldest goes.
class Machine {
 public:
  explicit Machine(double frame_ms, int lines = 540) : control(lines), frame_ms_(frame_ms) {}

  /// For so long, with what a frame takes at each pace. Returns how often the pace changed.
  int run(double seconds, double ordered_ms, double quick_ms, double half_ms) {
    int changes = 0;
    for (const double end_ms = now_ms_ + 1000 * seconds; now_ms_ < end_ms;) {
      if (waiting_ == 0) {
        now_ms_ = std::max(now_ms_, next_ms_);
        take_in();
      }
      const Pace pace = control.now();
      const double ms = pace == kOrdered ? ordered_ms
                        : pace == kQuick ? quick_ms
                        : pace == kHalf  ? half_ms
                                         : half_ms / 2;
      --waiting_;
      now_ms_ += ms;
      const std::uint64_t now_dropped = take_in();
      dropped += now_dropped;
      control.add(static_cast<std::int64_t>(now_ms_ * 1e6), ms, now_dropped);
      changes += !(control.now() == pace);
    }
    return changes;
  }

  PaceControl control;
  std::uint64_t dropped = 0;

 private:
  std::uint64_t take_in() {
    std::uint64_t full = 0;
    for (; next_ms_ <= now_ms_; next_ms_ += frame_ms_) {
      if (waiting_ < 3)
        ++waiting_;
      else
        ++full;
    }
    return full;
  }

  const double frame_ms_;
  double now_ms_ = 0, next_ms_ = 0;
  int waiting_ = 0;
};

TEST(PaceControl, StaysAsExactAsItCan) {
  Machine machine(33.4);
  EXPECT_EQ(machine.run(60, 20, 6, 3), 0);
  EXPECT_EQ(machine.control.now(), kOrdered);
  EXPECT_EQ(machine.dropped, 0U);
}

TEST(PaceControl, GoesAsFarDownAsItMustAndStays) {
  for (const auto& [frame_ms, pace] :
       {std::pair{33.4, kQuick}, std::pair{16.7, kHalf}, std::pair{8.4, kQuarter}}) {
    Machine machine(frame_ms);
    machine.run(12, 86, 23, 12);
    EXPECT_EQ(machine.control.now(), pace) << to_string(machine.control.now());
    EXPECT_GT(std::exchange(machine.dropped, 0), 0U);
    EXPECT_EQ(machine.run(300, 86, 23, 12), 0) << "tries what it knows to take too long";
    EXPECT_EQ(machine.dropped, 0U);
  }
}

TEST(PaceControl, LeavesEnoughLines) {
  for (const auto& [lines, pace] :
       {std::pair{1080, kQuarter}, std::pair{240, kHalf}, std::pair{144, kQuick}}) {
    Machine machine(1, lines);
    machine.run(30, 86, 23, 12);
    EXPECT_EQ(machine.control.now(), pace) << to_string(machine.control.now());
    EXPECT_TRUE(machine.control.at_least());
  }
}

TEST(PaceControl, ComesBackWhenOthersLeaveTheMachineAlone) {
  Machine machine(33.4);
  machine.run(5, 60, 16, 8);
  EXPECT_EQ(machine.control.now(), kQuick);
  machine.run(20, 24, 6.5, 3.5);
  EXPECT_EQ(machine.control.now(), kOrdered);
}

TEST(PaceControl, OneLateFrameChangesNothing) {
  Machine machine(33.4);
  machine.run(3, 20, 6, 3);
  machine.run(0.01, 170, 170, 170);
  EXPECT_EQ(machine.dropped, 2U);
  EXPECT_EQ(machine.run(10, 20, 6, 3), 0);
}

TEST(PaceControl, WhatFailsIsTriedLessAndLessOften) {
  // Ordered is taken for quicker than it is: 20 ms by what quick takes.
  Machine machine(33.4);
  int changes = machine.run(60, 40, 5.4, 3);
  EXPECT_GT(changes, 3);
  changes = machine.run(600, 40, 5.4, 3);
  EXPECT_LT(changes, 2 * 600 / 70);
}

TEST_F(PipelineTest, AtAnotherPaceTheStreamGoesOn) {
  // A camera that is too fast for any decoder, until half of the lines come.
  StripedScene tall = scene_;
  tall.rig.camera.height = 480;
  tall.rig.camera.matrix[5] = 239.5;
  const Frames frames(tall);
  FrameDecoder decoder;
  std::map<int, int> frames_of;  // by lines
  std::string undecodable;
  std::atomic<bool> halved = false;
  sink_.on_frame = [&](const FrameMessage& message) -> Status {
    const auto frame = decoder.decode(*message.data);
    if (!frame) {
      undecodable += std::to_string(message.sequence) + ": " + frame.error().message + "\n";
      return {};
    }
    int last = 0;
    for (const GridPoint& point : frame->surface.grid) last = std::max<int>(last, point.line);
    const int lines = last >= 120 ? 240 : 120;
    ++frames_of[lines];
    halved = lines == 120;
    return {};
  };
  Pipeline* running = nullptr;
  const auto end = std::chrono::steady_clock::now() + kPatience;
  ScriptedSource source(
      tall,
      [&](ScriptedSource&, std::uint64_t n) -> ScriptedSource::Next {
        const bool late = std::chrono::steady_clock::now() > end;
        if (late || (halved && running->status().frames_published > 20)) return ScriptedSource::end();
        return std::optional(frames(n));
      },
      true);
  PipelineOptions options;
  options.auto_pace = true;
  options.encode.geometry = GeometryCodec::kGrid;
  options.encode.key_interval = 1000;
  options.encode.texture = TextureCodec::kH264;
  const auto pipeline = make(source, {&sink_}, options);
  running = pipeline.get();
  ASSERT_TRUE(pipeline->run());
  EXPECT_EQ(undecodable, "");
  EXPECT_GT(frames_of[240], 0);
  EXPECT_GT(frames_of[120], 0);
  EXPECT_EQ(pipeline->stages().decoder, "quick");
}

}  // namespace
}  // namespace relievo
