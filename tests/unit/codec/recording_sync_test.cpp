// SPDX-License-Identifier: Apache-2.0
// When a recording is put on the disk, as the system is told: these stand before the C library's functions.
#include <gtest/gtest.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <vector>

#include "tests/support/temp_folder.h"
#include "tests/unit/codec/sample_recording.h"

namespace {

int data_syncs = 0;   // of what is written so far
int whole_syncs = 0;  // with the file's size and name
int data_syncs_that_work = 1 << 30;

}  // namespace

extern "C" int fdatasync(int file) {
  if (++data_syncs > data_syncs_that_work) {
    errno = EIO;
    return -1;
  }
  return static_cast<int>(::syscall(SYS_fdatasync, file));
}
extern "C" int fsync(int file) {
  ++whole_syncs;
  return static_cast<int>(::syscall(SYS_fsync, file));
}

namespace relievo {
namespace {

using namespace test;

/// How often data was synced by the time each of 20 chunks had been written, in messages a chunk's time
/// apart.
std::vector<int> syncs_by_chunk(std::int64_t sync_ns) {
  const TempFolder folder;
  auto writer = create(folder / "a.mcap", {.chunk_ns = kStep_ns, .sync_ns = sync_ns});
  EXPECT_TRUE(writer->add_channel(schema(), channel("t")).ok());
  data_syncs = 0;
  std::vector<int> out;
  for (int i = 0; i <= 20; ++i) {
    EXPECT_TRUE(writer->write(message(0, i, 100)).ok());
    if (i > 0) out.push_back(data_syncs);  // the message before is a chunk now
  }
  whole_syncs = 0;
  EXPECT_TRUE(writer->finish().ok());
  EXPECT_GE(whole_syncs, 1) << "a finished file is on the disk, whatever the policy";
  EXPECT_EQ(read_all(*open(folder / "a.mcap")).messages.size(), 21U);
  return out;
}

TEST(RecordingSync, EachChunkIsOnTheDiskBeforeTheNextBegins) {
  std::vector<int> each(20);
  for (int i = 0; i < 20; ++i) each[static_cast<std::size_t>(i)] = i + 1;
  EXPECT_EQ(syncs_by_chunk(0), each);
}

TEST(RecordingSync, EverySoOftenWhereThatIsAskedFor) {
  const std::vector<int> syncs = syncs_by_chunk(5 * kStep_ns);
  EXPECT_EQ(syncs.back(), 4);
  for (std::size_t i = 5; i < syncs.size(); ++i) EXPECT_EQ(syncs[i] - syncs[i - 5], 1) << i;
}

TEST(RecordingSync, NeverBeforeTheEndWhereTheSystemIsTrusted) {
  EXPECT_EQ(syncs_by_chunk(-1), std::vector<int>(20, 0));
}

/// A disk that fails: what it took is there, and the recorder hears of it.
TEST(RecordingSync, ADiskThatFailsIsAnErrorThatNamesTheFile) {
  const TempFolder folder;
  auto writer = create(folder / "a.mcap", {.chunk_ns = kStep_ns});
  ASSERT_TRUE(writer->add_channel(schema(), channel("t")).ok());
  data_syncs = 0;
  data_syncs_that_work = 10;
  int written = 0;
  Status status;
  while (written < 100 && (status = writer->write(message(0, written, 100))).ok()) ++written;
  data_syncs_that_work = 1 << 30;
  ASSERT_FALSE(status.ok());
  EXPECT_NE(status.error().message.find("a.mcap"), std::string::npos) << status.error().message;
  EXPECT_FALSE(writer->write(message(0, 101, 100)).ok());
  EXPECT_FALSE(writer->finish().ok());
  const ReadBack back = read_all(*open(folder / "a.mcap"));
  EXPECT_TRUE(back.errors.empty());
  EXPECT_GE(back.messages.size(), 10U);
}

}  // namespace
}  // namespace relievo
