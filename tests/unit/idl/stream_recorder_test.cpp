// SPDX-License-Identifier: Apache-2.0
// Proves: a recording that is asked for begins with what came before, and ends where that is asked for; over
// real DDS on the loopback interface, in real files.
#include "idl/stream_recorder.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <atomic>
#include <filesystem>
#include <fstream>
#include <set>

#include "base/time.h"
#include "codec/recording.h"
#include "idl/cdr.h"
#include "tests/support/key_frames.h"
#include "tests/support/own_domain.h"
#include "tests/support/patience.h"
#include "tests/support/streams.h"
#include "tests/support/temp_folder.h"

namespace relievo {
namespace {

using test::eventually;
using testing::HasSubstr;
using testing::MatchesRegex;

/// A publisher and a recorder of what it publishes.
class RecordedOnRequest : public testing::Test {
 protected:
  void start(StreamRecorder::Options options) {
    options.folder = folder_.path();
    options.stream = "face";
    const DomainOptions domain{test::own_domain(), "lo"};
    auto publisher = Publisher::create(domain, test::example_info("face"));
    ASSERT_TRUE(publisher) << publisher.error().message;
    publisher_ = *std::move(publisher);
    recorder_ = std::make_unique<StreamRecorder>(options);
    Subscriber::Callbacks callbacks = recorder_->callbacks();
    callbacks.raw = [this, add = callbacks.raw](const RawSample& sample) {
      add(sample);
      arrived_ += sample.topic == Topic::kFrame;
    };
    auto subscriber = Subscriber::create(domain, "face", callbacks);
    ASSERT_TRUE(subscriber) << subscriber.error().message;
    subscriber_ = *std::move(subscriber);
    ASSERT_TRUE(eventually([&] { return publisher_->matched_readers() > 0; }));
  }
  ~RecordedOnRequest() override { subscriber_.reset(); }

  void publish(int frames) {
    for (int i = 0; i < frames; ++i) {
      const bool is_key = key_wanted_.exchange(false);
      ASSERT_TRUE(publisher_->publish(test::frame_of_group(sequence_++, is_key ? 1 : key_interval_)));
      ASSERT_TRUE(eventually([&] { return arrived_ == sequence_; }));
    }
  }
  /// Until so many are in the file.
  bool records(std::uint64_t frames) {
    return eventually([&] { return recorder_->state().frames >= frames; });
  }
  bool closes() {
    return eventually([&] { return !recorder_->is_open(recorder_->state().file); });
  }
  /// Of its frames, in order; empty where it is not sound and described.
  std::vector<std::uint64_t> frames_in(const std::string& name) const {
    auto reader = RecordingReader::open(folder_ / name);
    EXPECT_TRUE(reader) << name;
    std::vector<std::uint64_t> out;
    if (!reader) return out;
    const RecordingSummary& summary = (*reader)->summary();
    EXPECT_FALSE(summary.recovered);
    EXPECT_EQ(summary.attachments.size(), 3U);
    bool is_first = true;
    for (;;) {
      const auto message = (*reader)->next();
      EXPECT_TRUE(message);
      if (!message || !*message) return out;
      const std::string& topic = summary.channels[(**message).channel].topic;
      if (std::exchange(is_first, false)) {
        EXPECT_EQ(topic, "relievo/info");
      }
      if (topic != "relievo/frame") continue;
      const auto frame = read_frame_cdr((**message).data);
      EXPECT_TRUE(frame);
      if (frame) out.push_back(frame->sequence);
    }
  }

  const test::TempFolder folder_;
  std::unique_ptr<Publisher> publisher_;
  std::unique_ptr<StreamRecorder> recorder_;
  std::unique_ptr<Subscriber> subscriber_;
  std::uint64_t sequence_ = 0, key_interval_ = 10;
  std::atomic<bool> key_wanted_ = false;
  std::atomic<std::uint64_t> arrived_ = 0;
};

TEST_F(RecordedOnRequest, SaysWhatItsDiskStillTakes) {
  start({});
  EXPECT_TRUE(eventually([&] { return recorder_->state().room_bytes > 0; }));
  ASSERT_TRUE(recorder_->start());
  EXPECT_GT(recorder_->state().room_bytes, 0u);
  std::filesystem::remove_all(folder_.path());
  EXPECT_TRUE(eventually([&] { return recorder_->state().room_bytes == 0; })) << "there is none any more";
}

TEST_F(RecordedOnRequest, BeginsWithWhatCameBefore) {
  start({.pre_roll_s = 3600});
  EXPECT_EQ(recorder_->state().activity, RecordingActivity::kOff);
  publish(45);
  ASSERT_TRUE(recorder_->start());
  EXPECT_FALSE(recorder_->start()) << "twice";
  publish(10);
  ASSERT_TRUE(records(55));
  const RecordingState state = recorder_->state();
  EXPECT_EQ(state.activity, RecordingActivity::kRecording);
  EXPECT_THAT(state.file, MatchesRegex("face-20..-..-..T..-..-..Z\\.mcap"));
  EXPECT_EQ(state.pre_roll_s, 3600);
  EXPECT_GT(state.bytes, 55'000U);
  EXPECT_EQ(state.lost, 0U);
  EXPECT_TRUE(recorder_->is_open(state.file));
  ASSERT_TRUE(recorder_->stop());
  EXPECT_EQ(recorder_->state().activity, RecordingActivity::kOff);
  EXPECT_FALSE(recorder_->stop()) << "twice";
  ASSERT_TRUE(closes());
  const std::vector<std::uint64_t> frames = frames_in(state.file);
  ASSERT_EQ(frames.size(), 55U);
  EXPECT_EQ(frames.front(), 0U);
  EXPECT_EQ(frames.back(), 54U);
}

TEST_F(RecordedOnRequest, WithoutPreRollBeginsWithAFrameThatDecodesAlone) {
  start({});
  publish(45);
  ASSERT_TRUE(recorder_->start());
  publish(3);
  ASSERT_TRUE(records(8));
  ASSERT_TRUE(recorder_->stop());
  ASSERT_TRUE(closes());
  const std::vector<std::uint64_t> frames = frames_in(recorder_->state().file);
  ASSERT_EQ(frames.size(), 8U);
  EXPECT_EQ(frames.front(), 40U);
}

TEST_F(RecordedOnRequest, OneAfterTheOtherEachWithItsPreRoll) {
  start({.pre_roll_s = 3600});
  std::vector<std::string> files;
  for (std::uint64_t i = 1; i <= 3; ++i) {
    publish(20);
    ASSERT_TRUE(recorder_->start());
    ASSERT_TRUE(records(20 * i));
    ASSERT_TRUE(recorder_->stop());
    ASSERT_TRUE(closes());
    files.push_back(recorder_->state().file);
    EXPECT_EQ(frames_in(files.back()).size(), 20 * i);
  }
  EXPECT_NE(files[0], files[1]);
  EXPECT_NE(files[1], files[2]);
}

// As of a server before this one, that was ended and started again within a second.
TEST_F(RecordedOnRequest, AFileThatIsThereAlreadyStays) {
  start({.pre_roll_s = 3600});
  publish(10);
  const std::int64_t now_ns = utc_now_ns();
  for (int s = -1; s < 60; ++s) {
    std::ofstream(folder_ / utc_text(now_ns + s * kNanosecondsPerSecond, "face-%Y-%m-%dT%H-%M-%SZ.mcap"))
        << "another";
  }
  ASSERT_TRUE(recorder_->start());
  ASSERT_TRUE(records(10));
  EXPECT_THAT(recorder_->state().file, MatchesRegex("face-20..-..-..T..-..-..Z-2\\.mcap"));
  EXPECT_TRUE(recorder_->is_open(recorder_->state().file));
  ASSERT_TRUE(recorder_->stop());
  ASSERT_TRUE(closes());
  EXPECT_EQ(frames_in(recorder_->state().file).size(), 10U);
}

TEST_F(RecordedOnRequest, IsSplitAndKeptAsIsSaidOfRecordings) {
  start({.recording = {.segments = {.split_bytes = 40'000, .keep_bytes = 250'000}}});
  ASSERT_TRUE(recorder_->start());
  const std::string first = recorder_->state().file;
  EXPECT_THAT(first, MatchesRegex("face-[0-9TZ-]+_000000.mcap"));
  EXPECT_TRUE(recorder_->is_open(first));
  ASSERT_TRUE(eventually([&] {  // until the first one has made room for others
    publish(10);
    return recorder_->state().file > first && !std::filesystem::exists(folder_ / first);
  }));
  EXPECT_FALSE(recorder_->is_open(first));
  ASSERT_TRUE(recorder_->stop());
  ASSERT_TRUE(closes());
  std::set<std::string> files;
  for (const auto& entry : std::filesystem::directory_iterator(folder_.path()))
    files.insert(entry.path().filename());
  EXPECT_GT(files.size(), 1U);
  EXPECT_EQ(*files.rbegin(), recorder_->state().file);
  std::vector<std::uint64_t> frames;
  for (const std::string& name : files) {
    EXPECT_FALSE(recorder_->is_open(name));
    const auto more = frames_in(name);
    frames.insert(frames.end(), more.begin(), more.end());
  }
  ASSERT_FALSE(frames.empty());
  EXPECT_EQ(frames.back() - frames.front() + 1, frames.size()) << "no frame is missing between the files";
  EXPECT_EQ(recorder_->state().lost, 0U);
}

TEST_F(RecordedOnRequest, AsksForTheKeyFrameThatAFileIsToEndBefore) {
  key_interval_ = 1'000'000;
  start(
      {.recording = {.segments = {.split_bytes = 20'000}}, .key_frame_wanted = [&] { key_wanted_ = true; }});
  publish(1);
  ASSERT_TRUE(recorder_->start());
  const std::string first = recorder_->state().file;
  ASSERT_TRUE(eventually([&] {
    publish(5);
    return recorder_->state().file > first;
  }));
  ASSERT_TRUE(recorder_->stop());
  ASSERT_TRUE(closes());
  EXPECT_EQ(frames_in(first).front(), 0U);
  EXPECT_EQ(frames_in(recorder_->state().file).front(), frames_in(first).back() + 1) << "nothing is lost";
}

TEST_F(RecordedOnRequest, AFolderThatIsGoneIsSaidAndTheNextTryWorks) {
  start({.pre_roll_s = 10});
  publish(10);
  const auto away = folder_.path().string() + "-away";
  std::filesystem::rename(folder_.path(), away);
  ASSERT_TRUE(recorder_->start());
  ASSERT_TRUE(eventually([&] { return recorder_->state().activity == RecordingActivity::kFailed; }));
  EXPECT_THAT(recorder_->state().message, HasSubstr(folder_.path().string()));
  EXPECT_FALSE(recorder_->stop());
  std::filesystem::rename(away, folder_.path());
  ASSERT_TRUE(recorder_->start());
  EXPECT_EQ(recorder_->state().message, "");
  ASSERT_TRUE(records(10));
}

TEST_F(RecordedOnRequest, TheStreamsEndIsInIt) {
  start({.pre_roll_s = 10});
  publish(10);
  ASSERT_TRUE(recorder_->start());
  publish(10);
  recorder_->finish(20);
  EXPECT_FALSE(recorder_->is_open(recorder_->state().file));
  EXPECT_EQ(frames_in(recorder_->state().file).size(), 20U);
}

TEST_F(RecordedOnRequest, WhatIsBeingRecordedIsWholeWhenItIsDestroyed) {
  start({.pre_roll_s = 10});
  publish(30);
  ASSERT_TRUE(recorder_->start());
  const std::string file = recorder_->state().file;
  subscriber_.reset();
  recorder_.reset();
  EXPECT_EQ(frames_in(file).size(), 30U);
}

}  // namespace
}  // namespace relievo
