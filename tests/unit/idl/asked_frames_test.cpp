// SPDX-License-Identifier: Apache-2.0
// Proves: a frame goes out when all who wait for one have asked, and nobody is waited for without end.
#include "idl/asked_frames.h"

#include <gtest/gtest.h>

namespace relievo {
namespace {

constexpr std::int64_t kPatience_ns = AskedFrames::kPatience_ns;

TEST(AskedFrames, OneForEachWish) {
  AskedFrames asked;
  EXPECT_FALSE(asked.due(0));
  asked.ask(1, 0);
  asked.ask(1, 1);
  EXPECT_TRUE(asked.due(2));
  asked.sent();
  EXPECT_FALSE(asked.due(3));
}

TEST(AskedFrames, WhoComesGetsOneUnasked) {
  AskedFrames asked;
  asked.joined();
  EXPECT_TRUE(asked.due(0));
  asked.sent();
  EXPECT_FALSE(asked.due(1));
}

TEST(AskedFrames, TheSlowestOfThemDecides) {
  AskedFrames asked;
  asked.ask(1, 0);
  asked.ask(2, 0);
  asked.sent();
  asked.ask(1, 10);
  EXPECT_FALSE(asked.due(11)) << "the second one's frame is on its way yet";
  asked.ask(2, 3'000'000'000);
  EXPECT_TRUE(asked.due(3'000'000'000));
}

TEST(AskedFrames, WhoIsGoneIsNotWaitedFor) {
  AskedFrames asked;
  asked.ask(1, 0);
  asked.ask(2, 0);
  asked.sent();
  asked.ask(1, 5);
  EXPECT_FALSE(asked.due(kPatience_ns));
  EXPECT_TRUE(asked.due(kPatience_ns + 1));
}

TEST(AskedFrames, OfAnyNumberOfReadersMemoryIsBounded) {
  AskedFrames asked;
  for (std::uint64_t who = 0; who < 100'000; ++who) asked.ask(who, 0);
  EXPECT_TRUE(asked.due(0));
}

}  // namespace
}  // namespace relievo
