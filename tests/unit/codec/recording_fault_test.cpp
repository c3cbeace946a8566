// SPDX-License-Identifier: Apache-2.0
// Recordings that are cut short, damaged or lie. Disks that are full: recording_disk_test.cpp.
#include <gtest/gtest.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <csignal>
#include <fstream>
#include <numeric>

#include "codec/byte_io.h"
#include "codec/mcap_records.h"
#include "codec/recording.h"
#include "tests/support/temp_folder.h"
#include "tests/unit/codec/sample_recording.h"

namespace relievo {
namespace {

using namespace test;

TEST(RecordingFault, WhatIsNoRecordingIsRefused) {
  test::TempFolder folder;
  EXPECT_FALSE(RecordingReader::open(folder / "none.mcap").ok());
  EXPECT_FALSE(RecordingReader::open(folder.path()).ok());
  ASSERT_TRUE(test::make_pipe(folder / "pipe"));
  EXPECT_FALSE(RecordingReader::open(folder / "pipe").ok()) << "nobody waits for who writes to it";
  write_file(folder / "text", Bytes{'h', 'e', 'l', 'l', 'o', ' ', 'w', 'o', 'r', 'l', 'd'});
  const auto reader = RecordingReader::open(folder / "text");
  ASSERT_FALSE(reader.ok());
  EXPECT_NE(reader.error().message.find("not a recording"), std::string::npos);
}

/// Every byte a crash can cut at.
TEST(RecordingFault, CutAnywhereGivesEveryWholeChunk) {
  test::TempFolder folder;
  write_sample(folder / "a.mcap", 23);
  const Bytes whole = read_file(folder / "a.mcap");
  std::size_t before = 0;
  for (std::size_t size = 0; size < whole.size(); ++size) {
    write_file(folder / "cut.mcap", std::span(whole).first(size));
    const auto reader = open(folder / "cut.mcap");
    ASSERT_TRUE(reader->summary().recovered) << size;
    ASSERT_LE(reader->summary().lost_bytes, size);
    const ReadBack back = read_all(*reader);
    ASSERT_TRUE(back.errors.empty()) << size << back.errors[0];
    ASSERT_EQ(back.messages.size(), reader->summary().messages);
    ASSERT_TRUE(back.messages.size() % 5 == 0 || back.messages.size() == 23)
        << "a part of a chunk at " << size;
    ASSERT_GE(back.messages.size(), before);
    before = back.messages.size();
    for (std::size_t i = 0; i < back.messages.size(); ++i)
      ASSERT_EQ(back.messages[i].data, payload(static_cast<int>(i), 40));
  }
  EXPECT_EQ(before, 23u) << "a cut within the index loses no message";
}

TEST(RecordingFault, ZerosThatAPowerLossLeftAreNotRecords) {
  test::TempFolder folder;
  write_sample(folder / "a.mcap", 23);
  Bytes bytes = read_file(folder / "a.mcap");
  bytes.erase(bytes.end() - 100, bytes.end());
  bytes.insert(bytes.end(), 4096, 0);
  write_file(folder / "a.mcap", bytes);
  const auto reader = open(folder / "a.mcap");
  EXPECT_TRUE(reader->summary().recovered);
  EXPECT_GT(reader->summary().lost_bytes, 4000u);  // the first few may complete the record that was cut
  EXPECT_EQ(read_all(*reader).messages.size(), 23u);
}

TEST(RecordingFault, AFlippedBitCostsItsChunkAndIsNamed) {
  test::TempFolder folder;
  write_sample(folder / "a.mcap", 23);
  Bytes bytes = read_file(folder / "a.mcap");
  const Bytes wanted = payload(7, 40);  // in the second chunk
  const auto at = std::search(bytes.begin(), bytes.end(), wanted.begin(), wanted.end());
  ASSERT_NE(at, bytes.end());
  *at ^= 0x10;
  write_file(folder / "bad.mcap", bytes);
  const auto reader = open(folder / "bad.mcap");
  EXPECT_FALSE(reader->summary().recovered);
  const ReadBack back = read_all(*reader);
  ASSERT_EQ(back.errors.size(), 1u);
  EXPECT_NE(back.errors[0].find("CRC"), std::string::npos);
  EXPECT_NE(back.errors[0].find("at byte"), std::string::npos);
  ASSERT_EQ(back.messages.size(), 18u);
  EXPECT_EQ(back.messages[4].sequence, 4u);
  EXPECT_EQ(back.messages[5].sequence, 10u);
}

TEST(RecordingFault, ADamagedAttachmentIsLeftOutAndNamed) {
  test::TempFolder folder;
  write_sample(folder / "a.mcap", 6);
  Bytes bytes = read_file(folder / "a.mcap");
  const Bytes wanted = payload(99, 300);
  const auto at = std::search(bytes.begin(), bytes.end(), wanted.begin(), wanted.end());
  *(at + 50) ^= 1;
  write_file(folder / "bad.mcap", bytes);
  const auto reader = open(folder / "bad.mcap");
  EXPECT_EQ(reader->summary().attachments.size(), 1u);
  ASSERT_EQ(reader->summary().damage.size(), 1u);
  EXPECT_NE(reader->summary().damage[0].find("pattern.yaml"), std::string::npos);
  EXPECT_EQ(read_all(*reader).messages.size(), 6u);
}

// It is told on a terminal.
TEST(RecordingFault, ADamagedAttachmentsNameIsTextAlone) {
  test::TempFolder folder;
  write_sample(folder / "a.mcap", 6);
  Bytes bytes = read_file(folder / "a.mcap");
  const std::string name = "pattern.yaml", other = "\x1b[2Jern\a\n\x7f\x01l";
  for (auto at = bytes.begin();;) {
    at = std::search(at, bytes.end(), name.begin(), name.end());
    if (at == bytes.end()) break;
    std::ranges::copy(other, at);
  }
  write_file(folder / "bad.mcap", bytes);
  const auto reader = open(folder / "bad.mcap");
  ASSERT_EQ(reader->summary().damage.size(), 1u);
  EXPECT_NE(reader->summary().damage[0].find("attachment ?[2Jern????l at byte"), std::string::npos)
      << reader->summary().damage[0];
}

/// Whatever the index says, and whether it is believed, is withstood.
void look_around(RecordingReader& reader) {
  static_cast<void>(reader.times(0).ok());
  const auto none = [](std::uint16_t, std::span<const std::uint8_t>) { return false; };
  EXPECT_EQ(reader.find_last(kStart_ns + 8 * kStep_ns, none), std::nullopt);
}

TEST(RecordingFault, EveryFlippedByteIsWithstood) {
  test::TempFolder folder;
  write_sample(folder / "a.mcap", 11, 20);
  const Bytes whole = read_file(folder / "a.mcap");
  std::size_t wrong = 0;
  for (std::size_t at = 0; at < whole.size(); ++at) {
    Bytes bytes = whole;
    bytes[at] ^= at % 2 == 0 ? 0xff : 0x01;
    write_file(folder / "bad.mcap", bytes);
    const auto reader = RecordingReader::open(folder / "bad.mcap");
    if (!reader) continue;
    const ReadBack back = read_all(**reader);
    ASSERT_LT(back.errors.size(), 100u) << at;
    for (const auto& m : back.messages) wrong += m.data != payload(static_cast<int>(m.sequence), 20);
    look_around(**reader);
  }
  EXPECT_EQ(wrong, 0u) << "messages that were changed but not reported";
}

/// The same where no CRC catches it first: what the index says must be checked against the file.
TEST(RecordingFault, AnIndexThatLiesIsWithstood) {
  const test::TempFolder folder;
  write_sample(folder / "a.mcap", 11, 20);
  Bytes whole = read_file(folder / "a.mcap");
  std::fill(whole.end() - 12, whole.end() - 8, std::uint8_t{0});  // the summary's CRC: none
  const Bytes data_end{0x0f, 4, 0, 0, 0, 0, 0, 0, 0};
  const auto summary = std::search(whole.begin(), whole.end(), data_end.begin(), data_end.end());
  ASSERT_NE(summary, whole.end());
  test::Random random(11);
  for (auto at = summary - whole.begin(); at < static_cast<std::ptrdiff_t>(whole.size()); ++at) {
    for (const int value : {0x00, 0xff, 0x80, static_cast<int>(random.below(256))}) {
      Bytes bytes = whole;
      bytes[static_cast<std::size_t>(at)] = static_cast<std::uint8_t>(value);
      write_file(folder / "bad.mcap", bytes);
      const auto reader = RecordingReader::open(folder / "bad.mcap");
      if (!reader) continue;
      ASSERT_LT(read_all(**reader).errors.size(), 100u) << at;
      ASSERT_TRUE((*reader)->seek(kStart_ns + 5 * kStep_ns).ok());
      static_cast<void>((*reader)->next().ok());
      look_around(**reader);
    }
  }
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  EXPECT_LT(usage.ru_maxrss, 500'000) << "kibibytes";
}

/// Where the contents of the records of that kind begin, outside chunks.
std::vector<std::size_t> contents_of(const Bytes& file, mcap::Op op) {
  std::vector<std::size_t> out;
  std::span<const std::uint8_t> rest = std::span(file).subspan(mcap::kMagic.size());
  while (const auto record = mcap::take_record(rest))
    if (record->op == op) out.push_back(static_cast<std::size_t>(record->content.data() - file.data()));
  return out;
}

/// Found by the fuzzer: a chunk whose messages are of other times than is said of it made time run backwards.
TEST(RecordingFault, TimesOfChunksThatLieDoNotMixMessages) {
  const test::TempFolder folder;
  constexpr int kMessages = 23;
  write_sample(folder / "a.mcap", kMessages, 20);
  const Bytes whole = read_file(folder / "a.mcap");
  const std::uint64_t late = kStart_ns + 100 * kStep_ns;
  const auto numbers = [](const ReadBack& back) {
    std::vector<std::uint32_t> out;
    for (const auto& m : back.messages) out.push_back(m.sequence);
    return out;
  };
  std::vector<std::uint32_t> all(kMessages);
  std::iota(all.begin(), all.end(), 0U);

  // What the chunk says itself, where there is no index: its messages know better.
  Bytes bytes = whole;
  put(bytes, contents_of(whole, mcap::Op::kChunk).at(1), late);
  write_file(folder / "chunk.mcap", bytes);
  const auto walked = RecordingReader::open(folder / "chunk.mcap", {.rebuild_index = true});
  ASSERT_TRUE(walked.ok());
  EXPECT_EQ(numbers(read_all(**walked)), all);

  // What the index says: the chunk is left out and named, and found without the index.
  bytes = whole;
  std::fill(bytes.end() - 12, bytes.end() - 8, std::uint8_t{0});  // the summary's CRC: none
  put(bytes, contents_of(whole, mcap::Op::kChunkIndex).at(1), late);
  write_file(folder / "index.mcap", bytes);
  const ReadBack back = read_all(*open(folder / "index.mcap"));
  ASSERT_EQ(back.errors.size(), 1U);
  EXPECT_NE(back.errors[0].find("relievo recover"), std::string::npos) << back.errors[0];
  auto found = numbers(back);
  EXPECT_TRUE(std::ranges::is_sorted(found));
  EXPECT_EQ(found.size(), all.size() - 5);
  const auto rebuilt = RecordingReader::open(folder / "index.mcap", {.rebuild_index = true});
  ASSERT_TRUE(rebuilt.ok());
  EXPECT_EQ(numbers(read_all(**rebuilt)), all);
}

TEST(RecordingFault, AChunkCompressedInAnotherWayIsRefusedInWords) {
  const test::TempFolder folder;
  Bytes bytes(mcap::kMagic.begin(), mcap::kMagic.end());
  mcap::append_header(bytes, "", "another writer");
  mcap::append_chunk_header(bytes, {.start_time = 1,
                                    .end_time = 2,
                                    .uncompressed_size = 100,
                                    .uncompressed_crc = 0,
                                    .compression = "brotli",
                                    .records_size = 8});
  bytes.insert(bytes.end(), 8, 0x28);
  write_file(folder / "a.mcap", bytes);
  const ReadBack back = read_all(*open(folder / "a.mcap"));
  ASSERT_EQ(back.errors.size(), 1u);
  EXPECT_NE(back.errors[0].find("compressed with brotli, which is not supported"), std::string::npos);
}

/// Bytes that this process has read.
std::uint64_t bytes_read() {
  std::ifstream io("/proc/self/io");
  std::string word;
  std::uint64_t bytes = 0;
  io >> word >> bytes;
  EXPECT_EQ(word, "rchar:");
  return bytes;
}

TEST(RecordingFault, OfAFileWithoutItsIndexOnlyTheLastChunkIsReadToOpenIt) {
  test::TempFolder folder;
  auto writer = create(folder / "a.mcap", {.chunk_ns = 5 * kStep_ns});
  ASSERT_TRUE(writer->add_channel(schema(), channel("t")).ok());
  for (int i = 0; i < 203; ++i) ASSERT_TRUE(writer->write(message(0, i, 10'000)).ok());
  const std::uint64_t before = bytes_read();
  const auto reader = open(folder / "a.mcap");
  EXPECT_LT(bytes_read() - before, 150'000u) << "of 2 MB";
  EXPECT_TRUE(reader->summary().recovered);
  EXPECT_EQ(reader->summary().messages, 200u);
  EXPECT_EQ(reader->summary().end_ns, message(0, 199, 1).log_time_ns);
  EXPECT_EQ(reader->summary().lost_bytes, 0u);
  EXPECT_EQ(read_all(*reader).messages.size(), 200u);
}

TEST(Recording, WhatIsWholeOfAFileThatIsWrittenIsARecording) {
  test::TempFolder folder;
  const auto growing = [&] {
    auto writer = create(folder / "a.mcap", {.chunk_ns = 5 * kStep_ns});
    EXPECT_EQ(writer->growing()->bytes(), 0u);
    EXPECT_EQ(writer->growing()->end_at(0), nullptr);
    EXPECT_TRUE(writer->add_channel(schema(), channel("a")).ok());
    EXPECT_TRUE(writer->add_attachment({"rig.yaml", "application/yaml", kStart_ns, {'1'}}).ok());
    for (int i = 0; i < 12; ++i) EXPECT_TRUE(writer->write(message(0, i, 100)).ok());
    EXPECT_TRUE(writer->add_channel(schema(), channel("b")).ok());
    EXPECT_TRUE(writer->add_attachment({"late.yaml", "application/yaml", kStart_ns, {'2'}}).ok());
    for (int i = 12; i < 23; ++i) EXPECT_TRUE(writer->write(message(i % 2 ? 1 : 0, i, 100)).ok());
    EXPECT_TRUE(writer->finish().ok());
    return writer->growing();
  }();
  const Bytes file = read_file(folder / "a.mcap");
  std::vector<std::size_t> counts;
  for (std::size_t bytes = 0; bytes <= file.size(); ++bytes) {
    const auto end = growing->end_at(bytes);
    if (!end) continue;
    Bytes whole(file.begin(), file.begin() + static_cast<std::ptrdiff_t>(bytes));
    whole.insert(whole.end(), end->begin(), end->end());
    write_file(folder / "then.mcap", whole);
    const auto reader = open(folder / "then.mcap");
    EXPECT_FALSE(reader->summary().recovered) << bytes;
    const ReadBack back = read_all(*reader);
    EXPECT_TRUE(back.errors.empty());
    std::vector<std::uint64_t> of_channels(reader->summary().channels.size());
    for (const auto& m : back.messages) ++of_channels.at(m.channel);
    EXPECT_EQ(reader->summary().channel_messages, of_channels);
    EXPECT_EQ(reader->summary().attachments.size(), of_channels.size()) << "those that were there then";
    EXPECT_EQ(reader->summary().end_ns, back.messages.back().log_time_ns);
    counts.push_back(back.messages.size());
  }
  EXPECT_EQ(counts, (std::vector<std::size_t>{5, 10, 15, 20, 23}));
}

TEST(Recording, AFileThatGrowsIsReadOnUntilItIsFinished) {
  test::TempFolder folder;
  auto writer = create(folder / "a.mcap", {.chunk_ns = 5 * kStep_ns});
  ASSERT_TRUE(writer->add_channel(schema(), channel("a")).ok());
  int written = 0;
  const auto write_to = [&](int count) {
    while (written < count) EXPECT_TRUE(writer->write(message(0, written++, 100)).ok());
  };
  write_to(12);
  const auto reader = open(folder / "a.mcap");
  std::vector<std::uint32_t> got, expected;
  const auto read_to_end = [&] {
    for (const auto& m : read_all(*reader).messages) got.push_back(m.sequence);
    return got.size();
  };
  const auto reads_on = [&] {
    const auto more = reader->read_on();
    EXPECT_TRUE(more.ok());
    return more && *more;
  };
  EXPECT_EQ(read_to_end(), 10u);
  EXPECT_FALSE(reads_on());
  EXPECT_EQ(read_to_end(), 10u);
  write_to(17);
  EXPECT_TRUE(reads_on());
  EXPECT_EQ(read_to_end(), 15u);
  ASSERT_TRUE(writer->flush_if_due(kStart_ns).ok()) << "the clock was set back";
  auto earlier = message(0, written++, 100);
  earlier.log_time_ns = kStart_ns;
  ASSERT_TRUE(writer->write(earlier).ok());
  write_to(22);
  EXPECT_TRUE(reads_on());
  EXPECT_EQ(read_to_end(), 18u) << "also what is said to be of before";
  EXPECT_TRUE(reader->summary().recovered);
  write_to(24);
  ASSERT_TRUE(writer->finish().ok());
  EXPECT_TRUE(reads_on());
  EXPECT_EQ(read_to_end(), 24u);
  EXPECT_FALSE(reader->summary().recovered);
  EXPECT_FALSE(reads_on());
  for (std::uint32_t i = 0; i < 24; ++i) expected.push_back(i);
  std::ranges::sort(got);  // a chunk's messages come by their times
  EXPECT_EQ(got, expected) << "each once";
  got.clear();
  ASSERT_TRUE(reader->seek(0).ok());
  EXPECT_EQ(read_to_end(), 24u);
}

TEST(RecordingFault, KillLosesOnlyTheOpenChunk) {
  test::TempFolder folder;
  int ready[2];
  ASSERT_EQ(pipe(ready), 0);
  const pid_t child = fork();
  if (child == 0) {
    auto writer = RecordingWriter::create(folder / "a.mcap", {.chunk_ns = 5 * kStep_ns});
    (*writer)->add_channel(schema(), channel("t")).ok();
    for (int i = 0; i < 23; ++i) (*writer)->write(message(0, i, 100)).ok();
    static_cast<void>(!::write(ready[1], "x", 1));
    pause();
    _exit(0);
  }
  char byte = 0;
  ASSERT_EQ(read(ready[0], &byte, 1), 1);
  kill(child, SIGKILL);
  waitpid(child, nullptr, 0);
  close(ready[0]);
  close(ready[1]);
  const auto reader = open(folder / "a.mcap");
  EXPECT_TRUE(reader->summary().recovered);
  EXPECT_EQ(read_all(*reader).messages.size(), 20u);
}

}  // namespace
}  // namespace relievo
