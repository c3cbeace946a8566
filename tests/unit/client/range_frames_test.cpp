// SPDX-License-Identifier: Apache-2.0
// Frames of recordings one after the other, and what their files are called.
#include "client/range_frames.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <limits>

#include "codec/frame_names.h"
#include "tests/support/make_recording.h"
#include "tests/support/replace_in.h"
#include "tests/support/temp_folder.h"

namespace relievo {
namespace {

using testing::AllOf;
using testing::Contains;
using testing::ElementsAre;
using testing::Ge;
using testing::HasSubstr;
using testing::IsSupersetOf;
using testing::Lt;
using testing::Not;

constexpr std::int64_t kStart_ns = 1'700'000'000'000'000'000;
constexpr std::int64_t kStep_ns = 100'000'000;

struct Published {
  std::uint64_t sequence, number;
};

std::vector<std::string> names_of(const std::vector<Published>& published, const RangeOptions& options = {}) {
  const test::TempFolder folder;
  test::MadeRecording made(folder / "a.mcap");
  std::int64_t time_ns = kStart_ns;
  for (const auto& [sequence, number] : published) made.add(sequence, number, time_ns += kStep_ns);
  made.finish();
  auto recorded = RecordedStream::open(folder / "a.mcap", "");
  const auto range = find_range(options, *recorded);
  auto frames = RangeFrames::open(*recorded, *range);
  EXPECT_TRUE(frames.ok());
  FrameNames names;
  std::vector<std::string> out;
  for (auto next = frames->next(); next && *next; next = frames->next())
    out.push_back(names.name((*next)->frame));
  EXPECT_EQ(out.size(), range->frames);
  return out;
}

TEST(FrameNames, AFramesFileIsCalledAfterTheCamerasFrame) {
  EXPECT_THAT(names_of({{0, 1}, {1, 2}, {2, 4}}), ElementsAre("000001", "000002", "000004"));
}

TEST(FrameNames, TheFirstOfTwoSurfacesOfACamerasFrameIsTheOneBetween) {
  EXPECT_THAT(names_of({{0, 1}, {1, 2}, {2, 2}, {3, 3}, {5, 4}}),
              ElementsAre("000001", "000002_between", "000002", "000003", "000004"));
  EXPECT_THAT(names_of({{0, 2}, {1, 2}, {2, 3}}, {.frames = ":0"}), ElementsAre("000002_between"))
      << "what follows is behind the range";
}

TEST(FrameNames, NumbersThatStartAgainAreToldApart) {
  EXPECT_THAT(names_of({{0, 1}, {1, 2}, {0, 1}, {1, 2}, {2, 3}, {0, 1}}),
              ElementsAre("000001", "000002", "000001-2", "000002-2", "000003", "000001-3"));
  EXPECT_THAT(names_of({{0, 1}, {1, 1}, {0, 1}, {1, 1}}),
              ElementsAre("000001_between", "000001", "000001_between-2", "000001-2"));
}

/// Changes the bytes of the first frame of that number.
void damage(const std::filesystem::path& file, std::uint64_t number) {
  auto recorded = RecordedStream::open(file, "");
  for (auto sample = recorded->next(); sample && *sample; sample = recorded->next()) {
    if (read_frame_cdr((*sample)->cdr)->number != number) continue;
    std::string frame((*sample)->cdr.begin(), (*sample)->cdr.end());
    const std::string whole = frame;
    frame[frame.size() / 2] ^= 1;
    return test::replace_in(file, whole, frame);
  }
  FAIL();
}

/// Of frames whose cameras' stamps are these.
std::vector<std::int64_t> times_of(const std::vector<std::int64_t>& stamps) {
  const test::TempFolder folder;
  test::MadeRecording made(folder / "a.mcap");
  for (std::size_t i = 0; i < stamps.size(); ++i)
    made.add(i, i, kStart_ns + static_cast<std::int64_t>(i) * kStep_ns, stamps[i]);
  made.finish();
  auto recorded = RecordedStream::open(folder / "a.mcap", "");
  auto frames = RangeFrames::open(*recorded, *find_range({}, *recorded));
  std::vector<std::int64_t> out;
  for (auto next = frames->next(); next && *next; next = frames->next())
    out.push_back((*next)->frame.time_ns);
  return out;
}

// A video or an animation of a recording over a restart: sources that count from their start begin at 0
// again.
TEST(RangeFrames, TimesGoOnWhereTheyBeginAnew) {
  const auto times = times_of({0, 33'000'000, 66'000'000, 0, 33'000'000});
  ASSERT_EQ(times.size(), 5u);
  EXPECT_EQ(times[3] - times[2], kStep_ns);
  EXPECT_EQ(times[4] - times[3], times[1] - times[0]);
}

// Of a damaged clock, or made to do harm.
TEST(RangeFrames, TimesThatCannotBeAreAsNearAsThereIs) {
  constexpr std::int64_t kMost = std::numeric_limits<std::int64_t>::max();
  EXPECT_THAT(times_of({kMost - 5, 7, kMost, 8}), ElementsAre(kMost - 5, kMost, kMost, kMost));
  EXPECT_THAT(times_of({std::numeric_limits<std::int64_t>::min(), 5, kMost}), ElementsAre(0, 5, kMost));
}

TEST(RangeFrames, WhatBuildsOnADamagedKeyFrameIsCounted) {
  const test::TempFolder folder;
  const auto file = folder / "a.mcap";
  test::MadeRecording made(file, 15);  // key frames: 0, 15, 30
  for (std::uint64_t i = 0; i < 40; ++i) made.add(i, i, kStart_ns + static_cast<std::int64_t>(i) * kStep_ns);
  made.finish();
  damage(file, 15);
  auto recorded = RecordedStream::open(file, "");
  auto frames = RangeFrames::open(*recorded, *find_range({}, *recorded));
  std::vector<std::uint64_t> whole;
  for (auto next = frames->next(); next && *next; next = frames->next())
    whole.push_back((*next)->frame.number);
  ASSERT_EQ(recorded->damaged(), 1u) << "a chunk of half a second";
  EXPECT_THAT(whole, Not(Contains(AllOf(Ge(15u), Lt(30u)))));
  EXPECT_THAT(whole, IsSupersetOf({11u, 30u, 39u}));
  EXPECT_GE(frames->left_out().without_key_frame, 9u);
  EXPECT_EQ(frames->left_out().frames(), frames->left_out().without_key_frame);
  EXPECT_THAT(frames->left_out().text(), HasSubstr("frames could not be decoded and were left out: the key"));
}

}  // namespace
}  // namespace relievo
