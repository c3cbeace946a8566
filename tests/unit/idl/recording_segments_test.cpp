// SPDX-License-Identifier: Apache-2.0
#include "idl/recording_segments.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <chrono>
#include <fstream>

#include "tests/support/temp_folder.h"

namespace relievo {
namespace {

namespace fs = std::filesystem;
using testing::ElementsAre;

class Segments : public testing::Test {
 protected:
  fs::path make(const std::string& name, std::size_t bytes, int hours_ago = 0) {
    const fs::path file = folder_ / name;
    std::ofstream(file) << std::string(bytes, 'x');
    fs::last_write_time(file, fs::file_time_type::clock::now() - std::chrono::hours(hours_ago));
    return file;
  }
  std::vector<std::string> there() const {
    std::vector<std::string> out;
    for (const auto& entry : fs::directory_iterator(folder_.path())) out.push_back(entry.path().filename());
    std::ranges::sort(out);
    return out;
  }
  test::TempFolder folder_;
};

TEST_F(Segments, AreNumberedAfterTheLastThatIsThere) {
  const RecordingSegments segments(folder_ / "face.mcap", {.split_s = 1});
  EXPECT_EQ(segments.next(), folder_ / "face_000000.mcap");
  make("face_000000.mcap", 1);
  make("face_000009.mcap", 1);
  make("face_2.mcap", 1);
  make("face_000123.txt", 1);
  make("faces_000456.mcap", 1);
  make("face_000x11.mcap", 1);
  EXPECT_EQ(segments.next(), folder_ / "face_000010.mcap");
  make("face_999999.mcap", 1);
  EXPECT_EQ(segments.next(), folder_ / "face_1000000.mcap");
  make("face_1000000.mcap", 1);
  EXPECT_EQ(segments.next(), folder_ / "face_1000001.mcap") << "by number, not by name";
}

TEST_F(Segments, EndBySizeOrTimeWhicheverComesFirst) {
  const RecordingSegments both(folder_ / "a.mcap", {.split_bytes = 100, .split_s = 10});
  EXPECT_FALSE(both.is_full(99, 9.9));
  EXPECT_TRUE(both.is_full(100, 0));
  EXPECT_TRUE(both.is_full(0, 10));
  EXPECT_FALSE(RecordingSegments(folder_ / "a.mcap", {.split_bytes = 100}).is_full(5, 1e9));
  EXPECT_FALSE(RecordingSegments(folder_ / "a.mcap", {.split_s = 10}).is_full(1u << 30, 1));
}

TEST_F(Segments, OldestGoWhileAllAreTooLarge) {
  for (int i = 0; i < 5; ++i) make("a_00000" + std::to_string(i) + ".mcap", 100);
  make("a_1.mcap", 5000);
  make("b_000000.mcap", 5000);
  const RecordingSegments segments(folder_ / "a.mcap", {.split_bytes = 100, .keep_bytes = 250});
  EXPECT_TRUE(segments.remove_old(folder_ / "a_000004.mcap").ok());
  EXPECT_THAT(there(), ElementsAre("a_000003.mcap", "a_000004.mcap", "a_1.mcap", "b_000000.mcap"));
}

TEST_F(Segments, OldestGoWhereTheyEndedLongAgo) {
  make("a_000000.mcap", 10, 50);
  make("a_000001.mcap", 10, 30);
  make("a_000002.mcap", 10, 20);
  const auto open = make("a_000003.mcap", 10, 90);
  const RecordingSegments segments(folder_ / "a.mcap", {.split_s = 10, .keep_s = 25 * 3600.0});
  EXPECT_TRUE(segments.remove_old(open).ok());
  EXPECT_THAT(there(), ElementsAre("a_000002.mcap", "a_000003.mcap"));
}

TEST_F(Segments, NothingGoesUnlessAskedAndTheOpenOneNever) {
  make("a_000000.mcap", 1000, 1000);
  const auto open = make("a_000001.mcap", 1000, 1000);
  EXPECT_TRUE(RecordingSegments(folder_ / "a.mcap", {.split_s = 1}).remove_old(open).ok());
  EXPECT_EQ(there().size(), 2u);
  EXPECT_TRUE(RecordingSegments(folder_ / "a.mcap", {.split_s = 1, .keep_bytes = 1, .keep_s = 1})
                  .remove_old(open)
                  .ok());
  EXPECT_THAT(there(), ElementsAre("a_000001.mcap"));
}

TEST_F(Segments, WhatCannotBeRemovedIsNamed) {
  fs::create_directory(folder_ / "a_000000.mcap");
  std::ofstream(folder_ / "a_000000.mcap/in_the_way") << "x";
  make("a_000001.mcap", 100);
  const RecordingSegments segments(folder_ / "a.mcap", {.split_bytes = 10, .keep_bytes = 10});
  const Status removed = segments.remove_old(folder_ / "a_000002.mcap");
  ASSERT_FALSE(removed.ok());
  EXPECT_NE(removed.error().message.find("a_000000.mcap"), std::string::npos);
  EXPECT_THAT(there(), ElementsAre("a_000000.mcap")) << "the others go all the same";
}

TEST_F(Segments, AnUnusedNameIsBesideTheUsedOnes) {
  EXPECT_EQ(unused_name(folder_ / "face.mcap"), folder_ / "face.mcap");
  make("face.mcap", 1);
  EXPECT_EQ(unused_name(folder_ / "face.mcap"), folder_ / "face-2.mcap");
  make("face-2.mcap", 1);
  EXPECT_EQ(unused_name(folder_ / "face.mcap"), folder_ / "face-3.mcap");
}

}  // namespace
}  // namespace relievo
