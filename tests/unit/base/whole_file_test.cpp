// SPDX-License-Identifier: Apache-2.0
#include "base/whole_file.h"

#include <gtest/gtest.h>
#include <sys/stat.h>

#include <fstream>
#include <iterator>

#include "tests/support/temp_folder.h"

namespace relievo {
namespace {

using test::TempFolder;

TEST(WholeFile, IsTheNewOneOrTheOldOneAndNothingIsLeftBeside) {
  const TempFolder folder;
  ASSERT_TRUE(write_whole_file(folder / "rig.yaml", "old").ok());
  const auto failed = write_whole_file(folder / "none/rig.yaml", "new");
  ASSERT_FALSE(failed.ok());
  EXPECT_NE(failed.error().message.find("none/rig.yaml"), std::string::npos) << failed.error().message;
  ASSERT_TRUE(write_whole_file(folder / "rig.yaml", "new").ok());
  std::size_t files = 0;
  for (const auto& entry : std::filesystem::directory_iterator(folder.path())) {
    EXPECT_EQ(entry.path().filename(), "rig.yaml");
    ++files;
  }
  EXPECT_EQ(files, 1u);
  std::ifstream in(folder / "rig.yaml");
  EXPECT_EQ(std::string(std::istreambuf_iterator<char>(in), {}), "new");
}

TEST(WholeFile, AFolderInItsPlaceStaysWhatItIs) {
  const TempFolder folder;
  ASSERT_TRUE(std::filesystem::create_directory(folder / "taken"));
  EXPECT_FALSE(write_whole_file(folder / "taken", "text").ok());
  EXPECT_TRUE(std::filesystem::is_directory(folder / "taken"));
  EXPECT_EQ(std::distance(std::filesystem::directory_iterator(folder.path()), {}), 1);
}

TEST(WholeFile, ALinkStaysOneAndWhatItLeadsToIsReplaced) {
  const TempFolder folder;
  ASSERT_TRUE(write_whole_file(folder / "bench.yaml", "old").ok());
  std::filesystem::create_symlink("bench.yaml", folder / "rig.yaml");
  ASSERT_TRUE(write_whole_file(folder / "rig.yaml", "new").ok());
  EXPECT_TRUE(std::filesystem::is_symlink(folder / "rig.yaml"));
  EXPECT_EQ(read_whole_file(folder / "bench.yaml", 10).value(), "new");
}

TEST(WholeFile, ALinkToWhatIsNotThereYetStaysOne) {
  const TempFolder folder;
  std::filesystem::create_symlink("bench.yaml", folder / "link");
  std::filesystem::create_symlink(folder / "link", folder / "rig.yaml");
  std::filesystem::create_symlink(folder / "unplugged" / "rig.yaml", folder / "other.yaml");
  ASSERT_TRUE(write_whole_file(folder / "rig.yaml", "new").ok());
  EXPECT_TRUE(std::filesystem::is_symlink(folder / "rig.yaml"));
  EXPECT_EQ(read_whole_file(folder / "bench.yaml", 10).value(), "new");
  EXPECT_FALSE(write_whole_file(folder / "other.yaml", "new").ok());
  EXPECT_TRUE(std::filesystem::is_symlink(folder / "other.yaml"));
}

TEST(WholeFile, APipeInItsPlaceStaysWhatItIs) {
  const TempFolder folder;
  ASSERT_EQ(::mkfifo((folder / "pipe").c_str(), 0600), 0);
  const auto written = write_whole_file(folder / "pipe", "text");
  ASSERT_FALSE(written.ok());
  EXPECT_NE(written.error().message.find("it is a pipe, not a file"), std::string::npos);
  EXPECT_TRUE(std::filesystem::is_fifo(folder / "pipe"));
}

TEST(WholeFile, IsReadUpToTheSizeItMayHave) {
  const TempFolder folder;
  const std::string text(5000, 'x');  // more than is read at once
  ASSERT_TRUE(write_whole_file(folder / "text", text).ok());
  const auto all = read_whole_file(folder / "text", text.size());
  ASSERT_TRUE(all) << all.error().message;
  EXPECT_EQ(*all, text);
  for (const auto& [file, most] : {std::pair(folder / "text", text.size() - 1),
                                   {std::filesystem::path("/dev/zero"), 100000UL},
                                   {folder / "none", 10UL},
                                   {folder.path(), 10UL}}) {
    const auto read = read_whole_file(file, most);
    ASSERT_FALSE(read) << file;
    EXPECT_NE(read.error().message.find(file.string()), std::string::npos) << read.error().message;
  }
}

// Whoever opens a pipe that nobody writes to waits for ever, and so does who joins its thread.
TEST(WholeFile, WhatIsNoFileIsRefusedWithoutWaiting) {
  const TempFolder folder;
  ASSERT_TRUE(test::make_pipe(folder / "pipe"));
  for (const auto& [file, what] : {std::pair(folder / "pipe", "a pipe"),
                                   {std::filesystem::path("/dev/zero"), "a device"},
                                   {folder.path(), "a folder"}}) {
    const auto read = read_whole_file(file, 10);
    ASSERT_FALSE(read) << file;
    EXPECT_EQ(read.error().message, "cannot read " + file.string() + ": it is " + what + ", not a file");
  }
  EXPECT_EQ(read_whole_file(folder / "none", 10).error().message, (folder / "none").string() + " is missing");
}

}  // namespace
}  // namespace relievo
