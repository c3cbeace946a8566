// SPDX-License-Identifier: Apache-2.0
// Disks that are full, and files that are taken away while they are recorded to.
#include <gtest/gtest.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include <csignal>
#include <filesystem>
#include <fstream>

#include "codec/recording.h"
#include "tests/support/small_disk.h"
#include "tests/support/temp_folder.h"
#include "tests/unit/codec/sample_recording.h"

namespace relievo {
namespace {

using namespace test;

/// A limit on the file's size stands in for a full disk: both make write() fail in the middle of a chunk.
TEST(RecordingFault, AFullDiskEndsTheRecordingReadable) {
  test::TempFolder folder;
  for (const rlim_t limit : {3000, 3900, 5000}) {
    const auto file = folder / ("full" + std::to_string(limit) + ".mcap");
    const pid_t child = fork();
    if (child == 0) {
      std::signal(SIGXFSZ, SIG_IGN);
      const rlimit size{limit, limit};
      setrlimit(RLIMIT_FSIZE, &size);
      auto writer = RecordingWriter::create(file, {.chunk_ns = 5 * kStep_ns, .chunk_bytes = 1 << 20});
      if (!writer || !(*writer)->add_channel(schema(), channel("t"))) _exit(2);
      for (int i = 0; i < 200; ++i) {
        const auto status = (*writer)->write(message(0, i, 100));
        if (status.ok()) continue;
        const bool named = status.error().message.find(file.string()) != std::string::npos;
        const bool stays = !(*writer)->write(message(0, i, 100)).ok() && !(*writer)->finish().ok();
        _exit(named && stays ? 0 : 3);
      }
      _exit(4);
    }
    int status = 0;
    ASSERT_EQ(waitpid(child, &status, 0), child);
    ASSERT_TRUE(WIFEXITED(status));
    ASSERT_EQ(WEXITSTATUS(status), 0);
    const auto reader = open(file);
    const ReadBack back = read_all(*reader);
    EXPECT_TRUE(back.errors.empty());
    EXPECT_GE(back.messages.size(), 10u);
    EXPECT_EQ(back.messages.size() % 5, 0u);
    EXPECT_EQ(reader->summary().lost_bytes, 0u) << "cut back to whole records";
    EXPECT_FALSE(reader->summary().recovered) << "there was room for the index";
    EXPECT_LE(std::filesystem::file_size(file), limit);
  }
}

/// Else it would go on for hours, and leave nothing.
TEST(RecordingFault, AFileThatIsRemovedMeanwhileEndsTheRecordingWithAWord) {
  const test::TempFolder folder;
  const auto file = folder / "removed.mcap", moved = folder / "moved.mcap";
  auto writer = RecordingWriter::create(file, {.chunk_ns = 2 * kStep_ns, .chunk_bytes = 1 << 20});
  ASSERT_TRUE(writer);
  ASSERT_TRUE((*writer)->add_channel(schema(), channel("t")));
  int n = 0;
  const auto write = [&](int count) {
    Status status;
    for (int i = 0; i < count && status; ++i) status = (*writer)->write(message(0, n++, 100));
    return status;
  };
  EXPECT_TRUE(write(10));
  std::filesystem::rename(file, moved);
  EXPECT_TRUE(write(10)) << "it has another name";
  std::filesystem::remove(moved);
  const Status removed = write(10);
  ASSERT_FALSE(removed);
  EXPECT_NE(removed.error().message.find("removed while it was being recorded to"), std::string::npos);
  EXPECT_FALSE((*writer)->finish());
}

TEST(RecordingFault, ARenamedFileEndsTheRecordingWhereItsNameIsToStay) {
  const test::TempFolder folder;
  const auto file = folder / "a.mcap";
  auto writer = RecordingWriter::create(file, {.chunk_ns = 0, .keeps_name = true});
  ASSERT_TRUE(writer);
  ASSERT_TRUE((*writer)->add_channel(schema(), channel("t")));
  for (int i = 0; i < 10; ++i) ASSERT_TRUE((*writer)->write(message(0, i, 100)));
  std::filesystem::rename(file, folder / "b.mcap");
  std::ofstream(file) << "somebody else's";
  const Status renamed = (*writer)->write(message(0, 10, 100));
  ASSERT_FALSE(renamed);
  EXPECT_NE(renamed.error().message.find("renamed while it was being recorded to"), std::string::npos);
  EXPECT_EQ(std::filesystem::file_size(file), 15U);
  const auto reader = open(folder / "b.mcap");
  EXPECT_FALSE(reader->summary().recovered) << "what came before is whole";
  EXPECT_GE(read_all(*reader).messages.size(), 9U);
}

TEST(RecordingFault, AFileThatNothingFitsInIsNotLeftBehind) {
  test::TempFolder folder;
  const auto file = folder / "full.mcap";
  const pid_t child = fork();
  if (child == 0) {
    std::signal(SIGXFSZ, SIG_IGN);
    const rlimit size{1500, 1500};
    setrlimit(RLIMIT_FSIZE, &size);
    auto writer = RecordingWriter::create(file, {});
    if (!writer || !(*writer)->add_channel(schema(), channel("t"))) _exit(2);
    if (!(*writer)->write(message(0, 0, 2000)) || !std::filesystem::exists(file)) _exit(3);
    _exit((*writer)->finish() ? 4 : 0);
  }
  int status = 0;
  ASSERT_EQ(waitpid(child, &status, 0), child);
  ASSERT_TRUE(WIFEXITED(status));
  EXPECT_EQ(WEXITSTATUS(status), 0);
  EXPECT_FALSE(std::filesystem::exists(file));
}

/// 0: it ended whole, with its index, and says why.
int record_until_full(const std::filesystem::path& file, std::size_t message_bytes) {
  auto writer = RecordingWriter::create(file, {.chunk_ns = 5 * kStep_ns});
  if (!writer || !(*writer)->add_channel(schema(), channel("t"))) return 2;
  int written = 0;
  while (written < 10000 && (*writer)->write(message(0, written, message_bytes)).ok()) ++written;
  const Status ended = (*writer)->finish();
  if (ended.ok() || ended.error().message.find("no space left") == std::string::npos) return 3;
  const auto reader = RecordingReader::open(file);
  if (!reader || (*reader)->summary().recovered) return 4;
  const ReadBack back = read_all(**reader);
  const auto missing = static_cast<std::size_t>(written) - back.messages.size();
  return back.errors.empty() && back.messages.size() > 20 && missing <= 5 ? 0 : 5;
}

TEST(RecordingFault, ADiskThatFillsUpLeavesRoomForTheIndex) {
  constexpr int kNoSmallDisk = 77;
  for (const std::size_t message_bytes : {90u, 1000u, 7000u}) {
    test::TempFolder folder;
    const pid_t child = fork();
    if (child == 0)
      _exit(mount_small_disk(folder.path(), "size=1m") ? record_until_full(folder / "a.mcap", message_bytes)
                                                       : kNoSmallDisk);
    int status = 0;
    ASSERT_EQ(waitpid(child, &status, 0), child);
    ASSERT_TRUE(WIFEXITED(status));
    if (WEXITSTATUS(status) == kNoSmallDisk) GTEST_SKIP() << "may not mount a small file system here";
    EXPECT_EQ(WEXITSTATUS(status), 0) << message_bytes;
  }
}

TEST(Recording, ReservedRoomIsGivenBack) {
  test::TempFolder folder;
  write_sample(folder / "a.mcap", 200, 3000);
  struct stat info {};
  ASSERT_EQ(::stat((folder / "a.mcap").c_str(), &info), 0);
  EXPECT_LE(info.st_blocks * 512, info.st_size + 64 * 1024);
}

TEST(RecordingFault, NoRoomAtAllLeavesNoFile) {
  test::TempFolder folder;
  const pid_t child = fork();
  if (child == 0) {
    std::signal(SIGXFSZ, SIG_IGN);
    const rlimit size{10, 10};
    setrlimit(RLIMIT_FSIZE, &size);
    _exit(RecordingWriter::create(folder / "a.mcap", {}).ok() ? 1 : 0);
  }
  int status = 0;
  ASSERT_EQ(waitpid(child, &status, 0), child);
  EXPECT_EQ(WEXITSTATUS(status), 0);
  EXPECT_FALSE(std::filesystem::exists(folder / "a.mcap"));
}

}  // namespace
}  // namespace relievo
