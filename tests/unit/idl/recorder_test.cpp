// SPDX-License-Identifier: Apache-2.0
// Proves: files that a recording is split into decode alone, and nothing is lost for that; a clock that is
// set meanwhile puts nothing out of its order, and neither ends a recording nor makes it longer.
#include "idl/recorder.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include <fstream>
#include <map>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "idl/cdr.h"
#include "tests/support/key_frames.h"
#include "tests/support/small_disk.h"
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

/// 0: it went on at the cost of its oldest files, and said so once, until nothing of it was left to remove.
int record_on_a_small_disk(const std::filesystem::path& folder) {
  constexpr std::uintmax_t kDisk = 400 << 10;
  std::uint32_t sequence = 0;
  testing::internal::CaptureStderr();
  Recorder recorder({.file = folder / "face.mcap",
                     .stream = "face",
                     .recording = {.segments = {.split_bytes = 50'000, .keep_bytes = 100'000'000}}});
  const auto callbacks = recorder.callbacks();
  const auto record = [&](int frames) {
    for (int i = 0; i < frames; ++i) {
      FrameMessage frame = test::frame_of_group(0, 1);
      frame.sequence = sequence;
      callbacks.raw({Topic::kFrame, "face", sequence * kFrame_ns, sequence * kFrame_ns + kFrame_ns,
                     write_frame_cdr("face", frame)});
      ++sequence;
    }
  };
  record(3000);  // 3 MB
  if (!recorder.status()) return 2;
  const auto files = recorder.files();
  if (files.size() < 3 || recorder.counts().files < 20 || recorder.counts().missed != 0) return 3;
  auto others_take_what_is_left = [&, n = 0]() mutable {
    std::ofstream other(folder / std::to_string(n++), std::ios::binary);
    while (other << std::string(4096, 'x') << std::flush) continue;
  };
  others_take_what_is_left();
  record(100);
  if (!recorder.status()) return 4;  // of which old files are left
  const std::uint32_t last = sequence - 1;
  std::optional<std::uint32_t> before;
  std::uintmax_t bytes = 0;
  for (const auto& file : recorder.files()) {
    if (file == recorder.file()) continue;
    const auto reader = RecordingReader::open(file);
    if (!reader || (*reader)->summary().recovered) return 5;
    bytes += std::filesystem::file_size(file);
    for (auto message = (*reader)->next(); message && *message; message = (*reader)->next()) {
      if (before && (**message).sequence != *before + 1) return 6;
      before = (**message).sequence;
    }
  }
  if (!before || *before > last || bytes > kDisk) return 7;
  for (int i = 0; i < 200 && recorder.status(); ++i) {
    others_take_what_is_left();
    record(10);
  }
  if (recorder.status() || recorder.files().size() != 1) return 8;
  const auto reader = RecordingReader::open(recorder.file());
  if (!reader || (*reader)->summary().recovered || (*reader)->summary().messages == 0) return 9;
  const std::string log = testing::internal::GetCapturedStderr();
  const std::string said = "the disk is full";
  return log.find(said) != std::string::npos && log.find(said) == log.rfind(said) ? 0 : 10;
}

TEST(RecorderFault, OnAFullDiskTheOldestFilesGoWhereTheirSizeIsLimited) {
  constexpr int kNoSmallDisk = 77;
  const test::TempFolder folder;
  const pid_t child = fork();
  if (child == 0)
    _exit(test::mount_small_disk(folder.path(), "size=400k") ? record_on_a_small_disk(folder.path())
                                                             : kNoSmallDisk);
  int status = 0;
  ASSERT_EQ(waitpid(child, &status, 0), child);
  ASSERT_TRUE(WIFEXITED(status));
  if (WEXITSTATUS(status) == kNoSmallDisk) GTEST_SKIP() << "may not mount a small file system here";
  EXPECT_EQ(WEXITSTATUS(status), 0);
}

/// Of a machine whose clock is set.
class RecorderOfASetClock : public testing::Test {
 protected:
  void start(const Recorder::Options& options) {
    recorder_ = std::make_unique<Recorder>(options);
    callbacks_ = recorder_->callbacks();
  }
  void frames(int count) {
    for (int i = 0; i < count; ++i) {
      FrameMessage frame = test::frame_of_group(0, 1);
      frame.sequence = sequence_++;
      callbacks_.raw({Topic::kFrame, "face", 0, steady_ns_ + utc_from_steady_ns_,
                      write_frame_cdr("face", frame), steady_ns_});
      steady_ns_ += kFrame_ns;
      recorder_->tick(steady_ns_);
    }
  }
  /// Log times and sequence numbers of a file's frames, as they are read.
  static std::vector<std::pair<std::int64_t, std::uint32_t>> read(const std::filesystem::path& file) {
    std::vector<std::pair<std::int64_t, std::uint32_t>> out;
    const auto reader = RecordingReader::open(file);
    EXPECT_TRUE(reader) << file;
    while (reader) {
      const auto message = (*reader)->next();
      if (!message || !*message) break;
      out.emplace_back((**message).log_time_ns, (**message).sequence);
    }
    return out;
  }

  static constexpr std::int64_t kHour_ns = 3600 * kNanosecondsPerSecond;
  const test::TempFolder folder_;
  const std::filesystem::path file_ = folder_ / "face.mcap";
  std::unique_ptr<Recorder> recorder_;
  Subscriber::Callbacks callbacks_;
  std::int64_t steady_ns_ = kHour_ns, utc_from_steady_ns_ = 1'700'000'000 * kNanosecondsPerSecond;
  std::uint64_t sequence_ = 0;
  std::map<std::filesystem::path, std::int64_t> begun_ns_;
};

TEST_F(RecorderOfASetClock, AFileGoesOnEvenly) {
  const std::int64_t begun_ns = steady_ns_ + utc_from_steady_ns_;
  start({.file = file_, .stream = "face"});
  for (const std::int64_t set_by_ns : {std::int64_t{0}, kHour_ns, -2 * kHour_ns, -3 * kFrame_ns / 2}) {
    utc_from_steady_ns_ += set_by_ns;
    frames(5);
  }
  EXPECT_TRUE(recorder_->finish());
  EXPECT_DOUBLE_EQ(recorder_->counts().duration_s, 1.9);
  const auto read_back = read(file_);
  ASSERT_EQ(read_back.size(), 20U);
  for (std::uint32_t i = 0; i < 20; ++i) EXPECT_EQ(read_back[i], (std::pair{begun_ns + i * kFrame_ns, i}));
}

TEST_F(RecorderOfASetClock, ItsLimitIsOfTimeThatPassed) {
  start({.file = file_, .stream = "face", .max_s = 2});
  frames(5);
  utc_from_steady_ns_ += kHour_ns;
  frames(5);
  utc_from_steady_ns_ -= 2 * kHour_ns;
  frames(9);
  EXPECT_FALSE(recorder_->done());
  frames(5);
  EXPECT_TRUE(recorder_->done());
  EXPECT_TRUE(recorder_->finish());
  EXPECT_EQ(recorder_->counts().frames, 20U);
}

TEST_F(RecorderOfASetClock, OfSeveralFilesTheNextOneBeginsAndSaysTheTimeAsItIs) {
  start({.file = file_, .stream = "face", .recording = {.segments = {.split_s = 3600}}});
  for (const std::int64_t set_by_ns : {std::int64_t{0}, kHour_ns, -2 * kHour_ns}) {
    utc_from_steady_ns_ += set_by_ns;
    const std::int64_t begun_ns = steady_ns_ + utc_from_steady_ns_;
    frames(5);
    EXPECT_TRUE(recorder_->status());
    const std::filesystem::path now = recorder_->file();
    EXPECT_EQ(recorder_->files().back(), now);
    begun_ns_[now] = begun_ns;
  }
  EXPECT_TRUE(recorder_->finish());
  ASSERT_EQ(begun_ns_.size(), 3U);
  for (const auto& [file, begun_ns] : begun_ns_) {
    const auto read_back = read(file);
    ASSERT_EQ(read_back.size(), 5U) << file;
    EXPECT_EQ(read_back.front().first, begun_ns) << file;
  }
}

}  // namespace
}  // namespace relievo
