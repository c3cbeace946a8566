// SPDX-License-Identifier: Apache-2.0
// Proves: --decoder auto gives frames as much care as all of them can have, and what it changes to reaches
// readers.
#include "server/pace.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <functional>
#include <map>
#include <utility>

#include "base/time.h"
#include "tests/unit/server/pipeline_fixture.h"

namespace relievo {
namespace {

using namespace test;

constexpr Pace kOrdered{Decoder::kOrdered, 1}, kQuick{Decoder::kQuick, 1}, kHalf{Decoder::kQuick, 2},
    kQuarter{Decoder::kQuick, 4};

/// What a frame takes at each pace.
struct Costs {
  double ordered_ms, quick_ms, half_ms, quarter_ms;

  /// A part is the same for all paces, and the rest goes by lines; `ordered`: times the quick decoder's.
  static Costs of(double fixed_ms, double lines_ms, double ordered) {
    return {fixed_ms + ordered * lines_ms, fixed_ms + lines_ms, fixed_ms + lines_ms / 2,
            fixed_ms + lines_ms / 4};
  }
  double operator()(const Pace& pace) const {
    return pace == kOrdered ? ordered_ms : pace == kQuick ? quick_ms : pace == kHalf ? half_ms : quarter_ms;
  }
  /// The best that every frame can have.
  Pace best(double frame_ms) const {
    return ordered_ms < frame_ms ? kOrdered
           : quick_ms < frame_ms ? kQuick
           : half_ms < frame_ms  ? kHalf
                                 : kQuarter;
  }
};

/// Others on the machine, by the time in seconds: how much longer frames take.
using Load = std::function<double(double)>;

/// A camera in front of a machine that reconstructs as `serve` does: three frames wait, the oldest goes.
class Machine {
 public:
  explicit Machine(double frame_ms, int lines = 540) : control(lines, 1000 / frame_ms), frame_ms_(frame_ms) {}

  /// For so long. Returns how often the pace changed.
  int run(double seconds, const Costs& costs, const Load& load = {}) {
    int changes = 0;
    for (const double end_ms = now_ms_ + 1000 * seconds; now_ms_ < end_ms;) {
      if (waiting_ == 0) {
        now_ms_ = std::max(now_ms_, next_ms_);
        take_in();
      }
      const Pace pace = control.now();
      double ms = costs(pace) * (load ? load(now_ms_ / 1000) : 1);
      if (slow_start && at_pace_ < 2) ms *= at_pace_ == 0 ? 3 : 1.4;
      ++at_pace_;
      --waiting_;
      now_ms_ += ms;
      const std::uint64_t now_dropped = take_in();
      dropped += now_dropped;
      control.add(static_cast<std::int64_t>(now_ms_ * 1e6), ms, now_dropped);
      if (control.now() == pace) continue;
      ++changes;
      at_pace_ = 0;
    }
    return changes;
  }

  /// The pace that it has come to after so long.
  Pace after(double seconds, const Costs& costs, const Load& load = {}) {
    run(seconds, costs, load);
    return control.now();
  }

  PaceControl control;
  std::uint64_t dropped = 0;
  bool slow_start = false;  // the first frames of a pace take longer, as they do

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
  int waiting_ = 0, at_pace_ = 0;
};

/// Frames take between so much less and more, the same in each run.
Load uneven(double share) {
  return [share, state = 1U](double) mutable {
    state = state * 1664525U + 1013904223U;
    return 1 + share * (2 * (state >> 8) / double{1 << 24} - 1);
  };
}

TEST(PaceControl, StaysAsExactAsItCan) {
  for (const double frame_ms : {33.4, 16.7}) {
    Machine machine(frame_ms);
    EXPECT_EQ(machine.run(60, Costs::of(1, .15 * frame_ms, 4), uneven(.3)), 0);
    EXPECT_EQ(machine.control.now(), kOrdered);
    EXPECT_EQ(machine.dropped, 0U);
  }
}

TEST(PaceControl, GoesAsFarDownAsItMustAndStays) {
  for (const auto& [frame_ms, pace] :
       {std::pair{33.4, kQuick}, std::pair{16.7, kHalf}, std::pair{8.4, kQuarter}}) {
    Machine machine(frame_ms);
    EXPECT_EQ(machine.after(12, {86, 23, 12, 6}), pace) << to_string(machine.control.now());
    EXPECT_GT(std::exchange(machine.dropped, 0), 0U);
    EXPECT_EQ(machine.run(300, {86, 23, 12, 6}), 0) << "tries what it knows to take too long";
    EXPECT_EQ(machine.dropped, 0U);
  }
}

// Whatever share of a frame's time is the same for all paces, and however much dearer the ordered decoder is.
TEST(PaceControl, FindsItsPaceSoonAndKeepsIt) {
  for (const double frame_ms : {33.4, 16.7})
    for (const double fixed : {0., .1, .2, .3})
      for (const double ordered : {2.3, 3., 3.7, 4.5})
        for (double quick_ms = .1 * frame_ms; quick_ms < 4 * frame_ms; quick_ms *= 1.13) {
          const Costs costs = Costs::of(fixed * quick_ms, (1 - fixed) * quick_ms, ordered);
          if (costs.quarter_ms > .9 * frame_ms) continue;
          SCOPED_TRACE(testing::Message()
                       << frame_ms << " fixed " << fixed << " ordered " << ordered << " quick " << quick_ms);
          Machine machine(frame_ms);
          machine.slow_start = true;
          machine.run(2, costs, uneven(.2));
          const double first_ms = 3 * costs.ordered_ms;  // in which nothing can be decided
          EXPECT_LE(static_cast<double>(machine.dropped), std::max(0., first_ms / frame_ms - 3) + 10);
          machine.run(3, costs, uneven(.2));
          machine.dropped = 0;
          EXPECT_LE(machine.run(300, costs, uneven(.2)), 2 * 4);
          EXPECT_LE(machine.dropped, 10U);
          const Pace found = machine.control.now(), best = costs.best(frame_ms);
          EXPECT_LE(costs(found), frame_ms) << to_string(found);
          EXPECT_TRUE(found == best || costs(best) > .85 * frame_ms) << to_string(found);
        }
}

TEST(PaceControl, WhereItWentTooLowItIsBackInSeconds) {
  // The first second is busy with other things. Times as of 540 lines with 300 stripes, at 60 Hz: a fourth of
  // the lines takes more than half of what half of them take.
  const auto starting = [](double s) { return s < 1 ? 2. : 1.; };
  Machine machine(16.7);
  machine.slow_start = true;
  EXPECT_EQ(machine.after(1, {92, 25, 13, 7.2}, starting), kQuarter);
  EXPECT_EQ(machine.after(2, {92, 25, 13, 7.2}, starting), kHalf);
  machine.dropped = 0;
  EXPECT_EQ(machine.run(300, {92, 25, 13, 7.2}, starting), 0);
  EXPECT_EQ(machine.dropped, 0U);
}

TEST(PaceControl, FollowsOthersThatComeAndGo) {
  const Costs costs{26, 8, 4.5, 2.5};
  for (const int each_s : {10, 60}) {
    Machine machine(33.4);
    machine.slow_start = true;
    const auto load = [&](double s) { return static_cast<int>(s) / each_s % 2 == 1 ? 2.5 : 1.; };
    for (int i = 0; i < 5; ++i) {
      EXPECT_EQ(machine.after(each_s - .1, costs, load), kOrdered) << i << " of " << each_s;
      EXPECT_EQ(machine.after(each_s, costs, load), kQuick) << i << " of " << each_s;
      machine.run(.1, costs, load);
    }
    EXPECT_LE(machine.dropped, 5 * 10U);
  }
}

TEST(PaceControl, IsBackSoonAlsoWhereItHadBeenTriedInVain) {
  // 20 ms of quick seem to leave time for ordered frames until they are tried.
  Machine machine(83.5);
  EXPECT_EQ(machine.after(600, {95, 20, 11, 6}), kQuick);
  EXPECT_EQ(machine.after(3, {62, 13, 7, 4}), kOrdered);
}

TEST(PaceControl, LeavesEnoughLines) {
  for (const auto& [lines, pace] :
       {std::pair{1080, kQuarter}, std::pair{240, kHalf}, std::pair{144, kQuick}}) {
    Machine machine(1, lines);
    EXPECT_EQ(machine.after(30, {86, 23, 12, 6}), pace) << to_string(machine.control.now());
  }
}

TEST(PaceControl, ComesBackWhenOthersLeaveTheMachineAlone) {
  Machine machine(33.4);
  EXPECT_EQ(machine.after(5, {60, 16, 8, 4}), kQuick);
  EXPECT_EQ(machine.after(20, {24, 6.5, 3.5, 2}), kOrdered);
}

TEST(PaceControl, OneLateFrameChangesNothing) {
  for (const double frame_ms : {33.4, 16.7}) {
    Machine machine(frame_ms);
    machine.run(3, {14, 6, 3, 2});
    machine.run(0.01, {170, 170, 170, 170});
    EXPECT_GE(machine.dropped, 2U);
    EXPECT_EQ(machine.run(10, {14, 6, 3, 2}), 0);
  }
}

TEST(PaceControl, WhatFailsIsTriedLessAndLessOften) {
  // Ordered is taken for quicker than it is: 16 ms by what quick takes.
  const Costs costs{40, 5.4, 3, 2};
  Machine machine(33.4);
  int changes = machine.run(60, costs);
  EXPECT_GT(changes, 3);
  EXPECT_LT(changes, 2 * 5);
  machine.dropped = 0;
  changes = machine.run(1200, costs);
  EXPECT_LE(changes, 2 * 1200 / 240);
  EXPECT_LE(machine.dropped, 2 * 1200 / 240);
}

TEST(DropWatch, LetsAFewPassAndASmallShare) {
  DropWatch watch(3);
  watch.add(3);
  for (int i = 0; i < 100; ++i) watch.add(0);
  for (int i = 0; i < 1000; ++i) watch.add(i % 25 == 0 ? 1 : 0);
  EXPECT_FALSE(watch.too_many());
  for (int i = 0; i < 1000; ++i) watch.add(i % 10 == 0 ? 1 : 0);
  EXPECT_TRUE(watch.too_many());
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
