// SPDX-License-Identifier: Apache-2.0
// Proves: files that a recording is split into decode alone, and nothing is lost for that.
#include "idl/recorder.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "idl/cdr.h"
#include "tests/support/key_frames.h"
#include "tests/support/temp_folder.h"

namespace relievo {
namespace {

using testing::ElementsAre;

constexpr std::int64_t kFrame_ns = kNanosecondsPerSecond / 10;

/// A recorder of ten frames a second, of a kilobyte each, as they come by a clock of the test's own.
class RecorderInFiles : public testing::Test {
 protected:
  void start(const SegmentOptions& segments) {
    recorder_ = std::make_unique<Recorder>(Recorder::Options{
        .file = folder_ / "face.mcap", .stream = "face", .recording = {.segments = segments}});
    callbacks_ = recorder_->callbacks();
  }
  void frames(int count, bool first_is_key = false) {
    for (int i = 0; i < count; ++i) {
      FrameMessage frame = test::frame_of_group(first_is_key && i == 0 ? 0 : 1, 2);
      frame.sequence = ++sequence_;
      add(Topic::kFrame, write_frame_cdr("face", frame));
      now_ns_ += kFrame_ns;
    }
  }
  void add(Topic topic, const Bytes& cdr) { callbacks_.raw({topic, "face", now_ns_, now_ns_, cdr}); }
  bool wants_key_frame() { return recorder_->wants_key_frame(now_ns_); }
  /// How many frames are in each file; each must begin with one that decodes alone unless it is `exempt`.
  std::vector<int> finished(const std::string& exempt = {}) {
    EXPECT_TRUE(recorder_->finish());
    EXPECT_EQ(recorder_->counts().frames, sequence_) << "nothing is lost";
    std::vector<int> out;
    for (const auto& file : recorder_->files()) {
      auto reader = RecordingReader::open(file);
      EXPECT_TRUE(reader) << file;
      int count = 0;
      while (reader) {
        const auto message = (*reader)->next();
        EXPECT_TRUE(message) << file;
        if (!message || !*message) break;
        if ((*reader)->summary().channels[(**message).channel].topic != "relievo/frame") continue;
        if (count++ == 0 && file.filename() != exempt) {
          EXPECT_TRUE(holds_key_frame((**message).data)) << file;
        }
      }
      out.push_back(count);
    }
    return out;
  }

  const test::TempFolder folder_;
  std::unique_ptr<Recorder> recorder_;
  Subscriber::Callbacks callbacks_;
  std::int64_t now_ns_ = utc_now_ns();
  std::uint64_t sequence_ = 0;
};

TEST_F(RecorderInFiles, AFullOneWaitsForTheKeyFrameThatItAsksFor) {
  start({.split_s = 2});
  frames(20, true);
  EXPECT_FALSE(wants_key_frame()) << "none is due";
  frames(1);
  EXPECT_TRUE(wants_key_frame());
  EXPECT_FALSE(wants_key_frame()) << "it was asked for a moment ago";
  frames(10);
  EXPECT_TRUE(wants_key_frame()) << "it may have been lost";
  frames(300);  // of a publisher that does not listen
  EXPECT_TRUE(wants_key_frame());
  frames(5, true);
  EXPECT_FALSE(wants_key_frame());
  EXPECT_THAT(finished(), ElementsAre(331, 5));
}

TEST_F(RecorderInFiles, BySizeLikewise) {
  start({.split_bytes = 20'000});
  frames(100, true);
  EXPECT_TRUE(wants_key_frame());
  frames(5, true);
  EXPECT_THAT(finished(), ElementsAre(100, 5));
}

TEST_F(RecorderInFiles, WithoutKeyFramesAFileEndsWhereItIsAllThatMayBeKept) {
  start({.split_s = 1, .keep_bytes = 50'000});
  frames(105, true);  // above that soon, but less than ten seconds after it was full
  frames(20);
  recorder_->tick(now_ns_);
  const std::vector<int> files = finished("face_000001.mcap");
  EXPECT_GE(recorder_->counts().files, 2U);
  EXPECT_EQ(files.back(), 125 - 110) << "the one before it has gone";
}

TEST_F(RecorderInFiles, ASegmentsTimeCountsFromItsFirstFrame) {
  start({.split_s = 1});
  add(Topic::kStatus, Bytes(20));
  now_ns_ += 5 * kNanosecondsPerSecond;
  EXPECT_FALSE(wants_key_frame());
  for (int i = 0; i < 3; ++i) frames(5, true);
  EXPECT_THAT(finished(), ElementsAre(10, 5));
}

}  // namespace
}  // namespace relievo
