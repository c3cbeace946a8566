// SPDX-License-Identifier: Apache-2.0
// Proves: which frames of a take were lost is told by its stamps' steps, whatever clock they are of.
#include <gtest/gtest.h>

#include <cstdint>
#include <vector>

#include "capture/evaluate/frame_places.h"

namespace relievo {
namespace {

using Places = std::vector<std::uint64_t>;

Places places(const std::vector<double>& times_s, double period_s) {
  FramePlaces numbered(1e9 * period_s);
  Places out;
  for (const double time_s : times_s) out.push_back(numbered.next(static_cast<std::int64_t>(1e9 * time_s)));
  return out;
}

std::vector<double> periods_s(const std::vector<double>& times_s, double frame_rate) {
  std::vector<TakeStamp> stamps;
  for (const double time_s : times_s)
    stamps.push_back({stamps.size(), static_cast<std::int64_t>(1e9 * time_s)});
  std::vector<double> out = likely_periods_ns(stamps, frame_rate);
  for (double& period : out) period /= 1e9;
  return out;
}

TEST(FramePlaces, BeginWithTheFirstStampAndCountTheLost) {
  for (const double start_s : {0., 0.5, -100., 1.7e9})
    EXPECT_EQ(places({start_s, start_s + 1, start_s + 2, start_s + 4, start_s + 5}, 1),
              (Places{0, 1, 2, 4, 5}))
        << start_s;
}

TEST(FramePlaces, AStampThatIsLateIsOfThatFrameAlone) {
  EXPECT_EQ(places({0.5, 1.3, 2.7, 3.3, 4.7, 5.3}, 1), (Places{0, 1, 2, 3, 4, 5}));
  EXPECT_EQ(places({0, 1, 2.7, 3, 4}, 1), (Places{0, 1, 3, 3, 4})) << "and what it was taken for";
}

TEST(FramePlaces, WhatClocksDifferByDoesNotAddUp) {
  std::vector<double> times_s;
  for (int i = 0; i < 5000; ++i) times_s.push_back(1.03 * i);
  EXPECT_EQ(places(times_s, 1).back(), 4999U);
}

TEST(FramePeriod, IsWhatIsUsualInTheTake) {
  EXPECT_EQ(periods_s({0, 1, 2, 4, 5}, 1), (std::vector<double>{1}));
  EXPECT_EQ(periods_s({0, 1.25, 2.5}, 1), (std::vector<double>{1.25})) << "at about the rig's frame rate";
  EXPECT_EQ(periods_s({7, 9, 11, 13}, 1), (std::vector<double>{1, 2})) << "every second one lost, or not";
  EXPECT_EQ(periods_s({0, 0.001, 0.002}, 1), (std::vector<double>{0.001}));
  EXPECT_EQ(periods_s({0, 1, 2, 3600.5, 3601.5}, 1), (std::vector<double>{1})) << "a gap aside";
  EXPECT_EQ(periods_s({0.2, 0.8, 2.2, 2.8, 4.2}, 1).front(), 1) << "of stamps that come early and late";
  EXPECT_EQ(periods_s({5}, 4), (std::vector<double>{0.25}));
  EXPECT_NEAR(periods_s({0, 0.033, 0.067, 0.1, 0.133, 0.167, 0.2}, 30).front(), 1 / 30., 1e-9)
      << "of stamps in whole milliseconds";
}

}  // namespace
}  // namespace relievo
