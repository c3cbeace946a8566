// SPDX-License-Identifier: Apache-2.0
// Proves: of what may be a file and a live stream, what is no recording hides no stream, and no stream a
// recording.
#include "client/input.h"

#include <gtest/gtest.h>
#include <CLI/CLI.hpp>

#include <filesystem>
#include <fstream>

#include "tests/support/temp_folder.h"

namespace relievo {
namespace {

namespace fs = std::filesystem;

TEST(Input, RecordingsAreFilesAndNothingElseHidesAStream) {
  const test::TempFolder folder;
  const fs::path before = fs::current_path();
  fs::current_path(folder.path());
  fs::create_directory("face");
  fs::create_directory("face.mcap");
  std::ofstream("recorded") << "\x89MCAP0\r\nand more";
  std::ofstream("notes") << "of somebody";
  std::ofstream("empty") << "";
  std::ofstream("face/a.mcap") << "";
  const auto says = [](const std::string& input) {
    const auto file = is_file(input);
    return !file ? "neither" : *file ? "file" : "stream";
  };
  EXPECT_STREQ(says("face"), "stream");
  EXPECT_STREQ(says("nothing-here"), "stream");
  EXPECT_STREQ(says("recorded"), "file");
  EXPECT_STREQ(says("./recorded"), "file");
  EXPECT_STREQ(says("notes"), "stream") << "what is no recording hides none";
  EXPECT_STREQ(says("empty"), "stream");
  EXPECT_STREQ(says("./notes"), "file");
  EXPECT_STREQ(says("face/a.mcap"), "file");
  EXPECT_STREQ(says("./face"), "file") << "which then is no recording";
  EXPECT_STREQ(says("face.mcap"), "file") << "likewise";
  for (const char* none : {"none.mcap", "face/none", "no stream", ""})
    EXPECT_STREQ(says(none), "neither") << none;
  fs::current_path(before);
}

// It was waited for as if somebody might still call a stream so.
TEST(Input, ARecordingIsNoLiveStreamsName) {
  const test::TempFolder folder;
  const fs::path before = fs::current_path();
  fs::current_path(folder.path());
  std::ofstream("face") << "\x89MCAP0\r\nand more";
  fs::copy_file("face", "face.mcap");
  const auto refused = [](const std::string& name) {
    try {
      check_stream(name);
      return std::string();
    } catch (const CLI::ValidationError& error) {
      return std::string(error.what());
    }
  };
  EXPECT_EQ(refused("face"), "") << "what was recorded of a stream may be called like it";
  EXPECT_EQ(refused("other.mcap"), "");
  EXPECT_NE(refused("face.mcap").find("`relievo play`"), std::string::npos);
  EXPECT_NE(refused("a/b").find("cannot name a stream"), std::string::npos);
  fs::current_path(before);
}

}  // namespace
}  // namespace relievo
