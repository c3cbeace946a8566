// SPDX-License-Identifier: Apache-2.0
// Proves: a receiver in trouble goes down the ladder at once, up after a calm time, and does not go to and
// fro at its limit.
#include "base/quality_choice.h"

#include <gtest/gtest.h>

namespace relievo {
namespace {

constexpr std::int64_t kFrame_ns = 33'000'000;

// A stream of 30 frames a second whose frames take `busy_share` of their time and lose `lost_share`.
class Receiver {
 public:
  explicit Receiver(const std::vector<Rung>& rungs = {Rung::kReduced, Rung::kTexture}) {
    choice.offer(rungs);
  }
  /// For so long, by what the rung it is on costs.
  template <typename Seen>
  void run(double for_s, const Seen& seen) {
    const std::int64_t end_ns = now_ns + static_cast<std::int64_t>(for_s * 1e9);
    for (; now_ns < end_ns; now_ns += kFrame_ns) {
      const Rung before = choice.now();
      if (choice.add(now_ns, seen(before)) != before) ++moves;
    }
  }
  QualityChoice choice;
  std::int64_t now_ns = 1'000'000'000;
  int moves = 0;
};

QualityChoice::Seen calm(Rung) {
  return {.arrived = 1, .busy_ns = kFrame_ns / 10};
}
QualityChoice::Seen too_slow(Rung) {
  return {.arrived = 1, .busy_ns = kFrame_ns};
}
QualityChoice::Seen a_fifth_lost(Rung) {
  return {.arrived = 4, .lost = 1};
}

QualityChoice::Seen late(Rung) {
  return {.arrived = 1, .busy_ns = kFrame_ns / 10, .late_ns = 500'000'000};
}

TEST(QualityChoice, StaysWhereAllIsWell) {
  Receiver receiver;
  receiver.run(100, calm);
  EXPECT_EQ(receiver.choice.now(), Rung::kFull);
  EXPECT_EQ(receiver.moves, 0);
}

TEST(QualityChoice, GoesDownAStepAtATimeForLossForSlownessAndForFramesThatComeLate) {
  for (const auto& trouble : {too_slow, a_fifth_lost, late}) {
    Receiver receiver;
    receiver.run(1.2, trouble);
    EXPECT_EQ(receiver.choice.now(), Rung::kReduced);
    receiver.run(1.2, trouble);
    EXPECT_EQ(receiver.choice.now(), Rung::kTexture);
    receiver.run(10, trouble);
    EXPECT_EQ(receiver.choice.now(), Rung::kTexture) << "there is nothing below";
    EXPECT_EQ(receiver.moves, 2);
  }
}

TEST(QualityChoice, ComesBackAfterACalmTime) {
  Receiver receiver;
  receiver.run(1.2, too_slow);
  ASSERT_EQ(receiver.choice.now(), Rung::kReduced);
  receiver.run(4, calm);
  EXPECT_EQ(receiver.choice.now(), Rung::kReduced) << "not sooner than after 5 s";
  receiver.run(4, calm);
  EXPECT_EQ(receiver.choice.now(), Rung::kFull);
}

TEST(QualityChoice, NeitherClimbsNorFallsInBetween) {
  const auto middling = [](Rung) { return QualityChoice::Seen{.arrived = 1, .busy_ns = kFrame_ns * 3 / 4}; };
  Receiver receiver;
  receiver.run(1.2, too_slow);
  receiver.run(100, middling);
  EXPECT_EQ(receiver.choice.now(), Rung::kReduced);
  EXPECT_EQ(receiver.moves, 1);
}

TEST(QualityChoice, WaitsLongerEachTimeItClimbedInVain) {
  const auto only_reduced_fits = [](Rung q) { return q == Rung::kFull ? too_slow(q) : calm(q); };
  Receiver receiver;
  receiver.run(600, only_reduced_fits);
  // 5 s, then 10, 20, 40, 80, 80 ...: without the doubling some 200 moves in ten minutes.
  EXPECT_LE(receiver.moves, 24);
  EXPECT_GE(receiver.moves, 10);
}

TEST(QualityChoice, ForgetsTheWaitingOnceAClimbHasHeld) {
  const auto only_reduced_fits = [](Rung q) { return q == Rung::kFull ? too_slow(q) : calm(q); };
  Receiver receiver;
  receiver.run(120, only_reduced_fits);
  receiver.run(200, calm);
  ASSERT_EQ(receiver.choice.now(), Rung::kFull);
  while (receiver.choice.now() == Rung::kFull) receiver.run(0.1, too_slow);
  receiver.run(8, calm);
  EXPECT_EQ(receiver.choice.now(), Rung::kFull);
}

TEST(QualityChoice, WhereNothingComesThroughItGoesToTheLowestRungAtOnceAndUpAgainStepByStep) {
  Receiver receiver;
  receiver.run(1.2, [](Rung) { return QualityChoice::Seen{.lost = 1}; });
  EXPECT_EQ(receiver.choice.now(), Rung::kTexture);
  receiver.run(7, calm);
  EXPECT_EQ(receiver.choice.now(), Rung::kReduced);
  receiver.run(7, calm);
  EXPECT_EQ(receiver.choice.now(), Rung::kFull);
}

TEST(QualityChoice, AStreamThatStandsStillTellsNothing) {
  Receiver receiver;
  receiver.run(1.2, too_slow);
  ASSERT_EQ(receiver.choice.now(), Rung::kReduced);
  receiver.run(60, [](Rung) { return QualityChoice::Seen{}; });
  EXPECT_EQ(receiver.choice.now(), Rung::kReduced);
}

TEST(QualityChoice, WithoutALadderThereIsNoChoice) {
  Receiver receiver(std::vector<Rung>{});
  receiver.run(10, too_slow);
  EXPECT_EQ(receiver.choice.now(), Rung::kFull);
}

TEST(QualityChoice, LeavesARungThatIsGone) {
  Receiver receiver;
  receiver.run(2.4, too_slow);
  ASSERT_EQ(receiver.choice.now(), Rung::kTexture);
  receiver.choice.offer({Rung::kReduced});
  EXPECT_EQ(receiver.choice.now(), Rung::kReduced);
  receiver.choice.offer({});
  EXPECT_EQ(receiver.choice.now(), Rung::kFull);
}

// After standing still for a moment, a machine gets what waited meanwhile, and then what is new.
TEST(QualityChoice, SomeLateFramesAmongOthersAreNoQueue) {
  Receiver receiver;
  int i = 0;
  receiver.run(60, [&](Rung rung) { return i++ % 10 == 0 ? calm(rung) : late(rung); });
  EXPECT_EQ(receiver.moves, 0);
}

TEST(QualityChoice, AQueueThatIsShortKeepsItFromGoingUp) {
  Receiver receiver;
  receiver.run(1.2, late);
  ASSERT_EQ(receiver.choice.now(), Rung::kReduced);
  const auto waits = [](Rung) { return QualityChoice::Seen{.arrived = 1, .late_ns = 250'000'000}; };
  receiver.run(30, waits);
  EXPECT_EQ(receiver.choice.now(), Rung::kReduced);
  receiver.run(10, calm);
  EXPECT_EQ(receiver.choice.now(), Rung::kFull);
}

}  // namespace
}  // namespace relievo
