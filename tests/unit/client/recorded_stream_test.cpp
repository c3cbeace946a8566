// SPDX-License-Identifier: Apache-2.0
// Parts of recordings: real frames, of which only some decode without others.
#include "client/recorded_stream.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <chrono>
#include <set>
#include <sstream>
#include <thread>

#include "base/time.h"
#include "client/player.h"
#include "client/ros/bag.h"
#include "client/time_range.h"
#include "codec/frame3d_codec.h"
#include "idl/cdr.h"
#include "tests/support/make_recording.h"
#include "tests/support/temp_folder.h"

namespace relievo {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;

constexpr std::int64_t kStart_ns = 1'700'000'000'000'000'000;
constexpr std::int64_t kStep_ns = 100'000'000;
constexpr int kFrames = 40;
constexpr int kKeyInterval = 15;  // key frames: 0, 15, 30

std::int64_t time_of(int frame) {
  return kStart_ns + frame * kStep_ns;
}

/// Frame i at time_of(i).
void write_recording(const std::filesystem::path& file) {
  test::MadeRecording recording(file, kKeyInterval);
  for (int i = 0; i < kFrames; ++i) {
    const auto number = static_cast<std::uint64_t>(i);
    ASSERT_EQ(recording.add(number, number, time_of(i)), i % kKeyInterval == 0);
  }
  recording.finish();
}

class RecordedStreamTest : public testing::Test {
 protected:
  void SetUp() override {
    write_recording(file_);
    auto opened = RecordedStream::open(file_, "");
    ASSERT_TRUE(opened.ok()) << opened.error().message;
    stream_.emplace(std::move(*opened));
  }
  std::uint64_t next_number() {
    const auto sample = stream_->next();
    return sample.ok() && *sample ? read_frame_cdr((*sample)->cdr)->number : 9999;
  }
  Result<TimeRange> range(const RangeOptions& options) { return find_range(options, *stream_); }

  const test::TempFolder folder_;
  const std::filesystem::path file_ = folder_ / "a.mcap";
  std::optional<RecordedStream> stream_;
};

TEST_F(RecordedStreamTest, WhatIsNoneOfOursIsToldByWhatItHolds) {
  auto bag = RosBag::create(folder_ / "bag.mcap", "my-face", std::nullopt);
  ASSERT_TRUE(bag.ok()) << bag.error().message;
  Frame3D frame;
  frame.surface.positions.resize(3);
  ASSERT_TRUE(bag->add(frame));
  ASSERT_TRUE(bag->finish());
  auto opened = RecordedStream::open(folder_ / "bag.mcap", "");
  ASSERT_FALSE(opened.ok());
  EXPECT_THAT(opened.error().message, HasSubstr("holds no 3D video stream, but "));
  EXPECT_THAT(opened.error().message, HasSubstr("/my_face/points"));
  EXPECT_THAT(opened.error().message, HasSubstr("a bag of ROS 2"));

  auto writer = RecordingWriter::create(folder_ / "other.mcap", {});
  ASSERT_TRUE(writer.ok());
  for (int i = 0; i < 7; ++i)
    ASSERT_TRUE(
        (*writer)->add_channel({"T", "jsonschema", "{}"}, {"t\x1b" + std::to_string(i), "json", "T", {}}));
  ASSERT_TRUE((*writer)->finish());
  opened = RecordedStream::open(folder_ / "other.mcap", "");
  ASSERT_FALSE(opened.ok());
  EXPECT_THAT(opened.error().message,
              HasSubstr("t?0, t?1, t?2, t?3, t?4 and 2 more topics, of another program"));
}

TEST_F(RecordedStreamTest, SeeksToTheKeyFrameThatATimeNeeds) {
  const std::pair<std::int64_t, std::uint64_t> cases[] = {
      {time_of(0), 0},       {time_of(14), 0},  {time_of(15) - 1, 0}, {time_of(15), 15},
      {time_of(29) + 5, 15}, {time_of(39), 30}, {time_of(1000), 30},  {kStart_ns - 1, 0}};
  for (const auto& [time_ns, expected] : cases) {
    ASSERT_TRUE(stream_->seek(time_ns).ok());
    EXPECT_EQ(next_number(), expected) << time_ns - kStart_ns;
    EXPECT_EQ(next_number(), expected + 1);
  }
}

TEST_F(RecordedStreamTest, FrameTimesAreThoseOfAllFrames) {
  const auto times = stream_->frame_times();
  ASSERT_TRUE(times.ok());
  ASSERT_EQ(times->size(), kFrames);
  EXPECT_EQ(times->front(), time_of(0));
  EXPECT_EQ(times->back(), time_of(kFrames - 1));
}

TEST_F(RecordedStreamTest, RangesAreTimesOrPositionsOrBoth) {
  EXPECT_EQ(range({})->frames, kFrames);
  EXPECT_EQ(range({.from = "1.2", .to = "1.5"})->frames, 4u);
  EXPECT_EQ(range({.from = "1.200000001"})->frames, 27u) << "a nanosecond later";
  EXPECT_EQ(range({.from = "2023-11-14T22:13:21.25Z"})->from_ns, kStart_ns + 1'250'000'000);
  EXPECT_EQ(range({.to = "2023-11-14T22:13:21"})->frames, 11u);
  EXPECT_EQ(range({.frames = "20:29"})->frames, 10u);
  EXPECT_EQ(range({.frames = "20:29"})->from_ns, time_of(20));
  EXPECT_EQ(range({.frames = "39"})->frames, 1u);
  EXPECT_EQ(range({.frames = ":3"})->frames, 4u);
  EXPECT_EQ(range({.frames = "35:1000"})->frames, 5u);
  EXPECT_EQ(range({.from = "2.5", .frames = "20:29"})->frames, 5u);
  for (const RangeOptions& none :
       {RangeOptions{.from = "4"}, RangeOptions{.from = "2", .to = "1"}, RangeOptions{.frames = "40:"},
        RangeOptions{.from = "3", .frames = ":9"}}) {
    const auto refused = range(none);
    ASSERT_FALSE(refused.ok());
    EXPECT_THAT(refused.error().message, HasSubstr("40 frames in 3.90 s"));
  }
}

TEST(RecordedRange, OfARecordingWithoutFramesThereIsNone) {
  const test::TempFolder folder;
  test::MadeRecording(folder / "empty.mcap").finish();
  auto stream = RecordedStream::open(folder / "empty.mcap", "");
  ASSERT_TRUE(stream.ok()) << stream.error().message;
  for (const RangeOptions& range : {RangeOptions{}, RangeOptions{.from = "1"}})
    EXPECT_EQ(find_range(range, *stream).error().message, "the recording holds no frame");
}

TEST(RecordedTime, WhatIsNoTimeIsRefused) {
  for (const char* text :
       {"", "-1", "1e3", "1:2", "nan", "12345678901", "1.0000000001", "2026-01-02", "2026-13-02T00:00:00Z",
        "2026-01-02T03:04:99Z", "2026-01-02T03:04:05Zulu", "1969-01-01T00:00:00Z", "2026-02-31T00:00:00Z",
        "2262-04-12T00:00:00Z", "9999-01-01T00:00:00Z"})
    EXPECT_FALSE(parse_recorded_time_ns(text, 0).ok()) << text;
  EXPECT_EQ(*parse_recorded_time_ns("12.5", 7), 12'500'000'007);
}

TEST_F(RecordedStreamTest, PlayingFromBetweenKeyFramesSendsTheOneBefore) {
  const auto part = range({.frames = "33:36"});
  ASSERT_TRUE(part.ok());
  StopSignal stop;
  std::vector<std::uint64_t> played;
  FrameDecoder decoder;
  const Status done = play(*stream_, {.speed = 100, .range = *part}, stop, [&](const RawSample& sample) {
    const auto frame = read_frame_cdr(sample.cdr);
    played.push_back(frame->number);
    EXPECT_TRUE(decoder.decode(frame->data).ok());
    return Status();
  });
  EXPECT_TRUE(done.ok());
  EXPECT_THAT(played, ElementsAre(30, 33, 34, 35, 36));
}

/// A pause, of a stream that was gone meanwhile say, is as long as it was unless it is to be shortened.
TEST_F(RecordedStreamTest, PausesAreOfTheirLength) {
  const std::filesystem::path file = folder_ / "pause.mcap";
  test::MadeRecording recording(file, 1);
  recording.add(0, 0, kStart_ns);
  recording.add(1, 1, kStart_ns + 40 * kNanosecondsPerSecond);
  recording.finish();
  const auto step_s = [&](const PlayOptions& options) {
    auto stream = RecordedStream::open(file, "");
    std::vector<std::int64_t> captured_ns, played_ns;
    StopSignal stop;
    EXPECT_TRUE(play(*stream, options, stop, [&](const RawSample& sample) {
      captured_ns.push_back(read_frame_cdr(sample.cdr)->capture_time_ns);
      played_ns.push_back(steady_now_ns());
      return Status();
    }));
    EXPECT_EQ(played_ns.size(), 2U);
    EXPECT_NEAR(seconds(played_ns.back() - played_ns.front()),
                seconds(captured_ns.back() - captured_ns.front()), 0.3)
        << "the times written are those it is played at";
    return seconds(captured_ns.back() - captured_ns.front());
  };
  EXPECT_NEAR(step_s({.speed = 40, .restamp = true}), 1, 1e-6);
  EXPECT_NEAR(step_s({.speed = 40, .restamp = true, .longest_pause_s = 20}), 0.5, 1e-6);
}

// Proves: a file that became shorter while it is played in a loop does not fill the log.
TEST_F(RecordedStreamTest, WhatIsDamagedIsSaidOnceHoweverOftenItIsPlayed) {
  std::filesystem::resize_file(file_, 100);
  testing::internal::CaptureStderr();
  const std::int64_t begin_ns = steady_now_ns();
  {
    StopSignal stop;
    std::thread later([&] {
      std::this_thread::sleep_for(std::chrono::milliseconds(2500));
      stop.request();
    });
    EXPECT_TRUE(play(*stream_, {.loop = true}, stop, [](const RawSample&) { return Status(); }).ok());
    later.join();
  }
  const std::string said = testing::internal::GetCapturedStderr();
  EXPECT_GE(steady_now_ns() - begin_ns, 2'000'000'000);
  std::set<std::string> lines;
  std::istringstream in(said);
  for (std::string line; std::getline(in, line);) EXPECT_TRUE(lines.insert(line).second) << line;
  EXPECT_FALSE(lines.empty());
  const std::uint64_t parts = lines.size();
  EXPECT_LE(stream_->damaged(), 4 * parts) << "a pass a second";
}

// Proves: nor does a long one, of which very many parts are damaged.
TEST_F(RecordedStreamTest, OfManyDamagedPartsTheFirstAreSaidOneByOne) {
  constexpr int kParts = 60;  // each a chunk
  {
    test::MadeRecording recording(folder_ / "long.mcap");
    for (int i = 0; i < kParts; ++i)
      recording.add(static_cast<std::uint64_t>(i), static_cast<std::uint64_t>(i),
                    kStart_ns + i * kNanosecondsPerSecond);
    recording.finish();
  }
  auto stream = RecordedStream::open(folder_ / "long.mcap", "");
  ASSERT_TRUE(stream.ok());
  std::filesystem::resize_file(folder_ / "long.mcap", 100);
  testing::internal::CaptureStderr();
  for (auto sample = stream->next(); sample.ok() && *sample;) sample = stream->next();
  const std::string said = testing::internal::GetCapturedStderr();
  EXPECT_EQ(stream->damaged(), static_cast<std::uint64_t>(kParts));
  EXPECT_EQ(std::ranges::count(said, '\n'), 21) << said;
  EXPECT_THAT(said, HasSubstr("more damaged parts are not told of one by one"));
}

}  // namespace
}  // namespace relievo
