// SPDX-License-Identifier: Apache-2.0
// Damaged recordings: whatever is whole is found, wherever the damage lies, and copied to a sound file.
#include "codec/recording_recover.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <set>

#include "codec/mcap_records.h"
#include "tests/support/temp_folder.h"
#include "tests/unit/codec/sample_recording.h"

namespace relievo {
namespace {

using namespace test;

constexpr int kMessages = 23;  // five a chunk: chunks of 5, 5, 5, 5, 3

bool always(std::uint64_t) {
  return true;
}

/// Where chunk `number` begins and how long it is.
std::pair<std::size_t, std::size_t> chunk_extent(const Bytes& file, int number) {
  std::span<const std::uint8_t> rest = std::span(file).subspan(mcap::kMagic.size());
  for (;;) {
    const std::size_t at = file.size() - rest.size();
    const auto record = mcap::take_record(rest);
    if (!record) return {0, 0};
    if (record->op == mcap::Op::kChunk && number-- == 0)
      return {at, mcap::kRecordHeaderBytes + record->content.size()};
  }
}

/// The numbers of the messages that a sound copy of the file holds, each checked against what was written.
std::set<int> recovered_from(const TempFolder& folder, std::span<const std::uint8_t> bytes,
                             RecoveredRecording* report = nullptr) {
  write_file(folder / "bad.mcap", bytes);
  std::filesystem::remove(folder / "copy.mcap");
  const auto done = recover_recording(folder / "bad.mcap", folder / "copy.mcap", always);
  EXPECT_TRUE(done.ok()) << (done ? "" : done.error().message);
  if (!done) return {};
  if (report) *report = *done;
  const auto reader = open(folder / "copy.mcap");
  EXPECT_FALSE(reader->summary().recovered);
  EXPECT_TRUE(reader->summary().damage.empty());
  std::set<int> out;
  const ReadBack back = read_all(*reader);
  EXPECT_TRUE(back.errors.empty());
  EXPECT_EQ(back.messages.size(), done->messages);
  for (const RecordedMessage& m : back.messages) {
    EXPECT_EQ(m.data, payload(static_cast<int>(m.sequence), 40));
    EXPECT_EQ(reader->summary().channels.at(m.channel).topic,
              m.sequence % 4 == 3 ? "relievo/status" : "relievo/frame");
    out.insert(static_cast<int>(m.sequence));
  }
  return out;
}

std::set<int> all_but(int first, int last) {
  std::set<int> out;
  for (int i = 0; i < kMessages; ++i) {
    if (i < first || i > last) out.insert(i);
  }
  return out;
}

class RecordingRecover : public testing::Test {
 protected:
  void SetUp() override {
    write_sample(folder_ / "a.mcap", kMessages);
    whole_ = read_file(folder_ / "a.mcap");
  }
  TempFolder folder_;
  Bytes whole_;
};

TEST_F(RecordingRecover, OfAWholeFileIsEverything) {
  RecoveredRecording report;
  EXPECT_EQ(recovered_from(folder_, whole_, &report), all_but(-1, -1));
  EXPECT_EQ(report.attachments, 2u);
  EXPECT_EQ(report.lost_bytes, 0u);
  EXPECT_TRUE(report.left_out.empty());
  EXPECT_EQ(read_file(folder_ / "bad.mcap"), whole_) << "the damaged file is not touched";
}

/// A recording of other times and numbers whose channels have other ids, and one channel of its own.
Bytes another_recording(const TempFolder& folder, const RecordingSchema& schema = test::schema()) {
  const auto file = folder / "b.mcap";
  {
    auto writer = create(file, {.chunk_ns = 5 * kStep_ns, .chunk_bytes = 1 << 20});
    EXPECT_EQ(*writer->add_channel(schema, channel("relievo/info")), 0);
    EXPECT_EQ(*writer->add_channel(schema, channel("relievo/status")), 1);
    EXPECT_EQ(*writer->add_channel(schema, channel("relievo/frame")), 2);
    EXPECT_TRUE(
        writer->add_attachment({"rig.yaml", "application/yaml", kStart_ns, {'a', ':', ' ', '1'}}).ok());
    EXPECT_TRUE(
        writer->add_attachment({"rig.yaml", "application/yaml", kStart_ns, {'a', ':', ' ', '2'}}).ok());
    for (int i = 100; i < 111; ++i)
      EXPECT_TRUE(writer->write(message(static_cast<std::uint16_t>(i % 4 == 3 ? 1 : 2), i, 40)).ok());
    EXPECT_TRUE(writer->finish().ok());
  }
  Bytes bytes = read_file(file);
  std::filesystem::remove(file);
  return bytes;
}

Bytes joined(const Bytes& a, std::span<const std::uint8_t> b) {
  Bytes out = a;
  out.insert(out.end(), b.begin(), b.end());
  return out;
}

std::set<int> with_another(std::set<int> numbers) {
  for (int i = 100; i < 111; ++i) numbers.insert(i);
  return numbers;
}

TEST_F(RecordingRecover, OfRecordingsOneBehindTheOtherAllAreRead) {
  const Bytes another = another_recording(folder_);
  // In either order, and where the first one was cut short: within its end, its index, and a chunk.
  const std::size_t cut = chunk_extent(whole_, 4).first + 20;
  for (const Bytes& bytes :
       {joined(whole_, another), joined(another, whole_), joined({whole_.begin(), whole_.end() - 4}, another),
        joined({whole_.begin(), whole_.end() - 200}, another)}) {
    RecoveredRecording report;
    EXPECT_EQ(recovered_from(folder_, bytes, &report), with_another(all_but(-1, -1)));
    EXPECT_EQ(report.recordings, 2u);
    EXPECT_EQ(report.attachments, 3u) << "one is in both";
  }
  RecoveredRecording report;
  EXPECT_EQ(recovered_from(
                folder_, joined({whole_.begin(), whole_.begin() + static_cast<std::ptrdiff_t>(cut)}, another),
                &report),
            with_another(all_but(20, 22)));
  EXPECT_EQ(report.recordings, 2u);
  EXPECT_EQ(recovered_from(folder_, joined(joined(whole_, another), std::span(whole_).first(cut)), &report),
            with_another(all_but(-1, -1)));
  EXPECT_EQ(report.recordings, 3u);
}

TEST_F(RecordingRecover, JoinedRecordingsAreReadInOrderOfTimeAndSought) {
  write_file(folder_ / "joined.mcap", joined(another_recording(folder_), whole_));
  const auto reader = open(folder_ / "joined.mcap");
  const RecordingSummary& summary = reader->summary();
  EXPECT_EQ(summary.recordings, 2u);
  EXPECT_FALSE(summary.recovered) << "nothing is missing";
  EXPECT_EQ(summary.lost_bytes, 0u);
  EXPECT_EQ(summary.messages, 34u);
  ASSERT_EQ(summary.channels.size(), 3u);
  EXPECT_EQ(summary.channels[1].topic, "relievo/status");
  EXPECT_EQ(summary.channel_messages, (std::vector<std::uint64_t>{0, 7, 27}));
  EXPECT_EQ(summary.start_ns, kStart_ns);
  EXPECT_EQ(summary.end_ns, kStart_ns + 110 * kStep_ns);
  const ReadBack back = read_all(*reader);
  EXPECT_TRUE(back.errors.empty());
  ASSERT_EQ(back.messages.size(), 34u);
  for (std::size_t i = 1; i < back.messages.size(); ++i)
    EXPECT_LT(back.messages[i - 1].sequence, back.messages[i].sequence);
  EXPECT_EQ(reader->times(2)->size(), 27u);
  ASSERT_TRUE(reader->seek(kStart_ns + 50 * kStep_ns).ok());
  EXPECT_EQ((*reader->next())->sequence, 100u);
  EXPECT_EQ(reader->find_last(kStart_ns + 99 * kStep_ns, [](std::uint16_t c, auto) { return c == 1; }),
            kStart_ns + 19 * kStep_ns);
}

TEST_F(RecordingRecover, WhatIsDefinedOtherwiseBehindIsSaidAndLeftOut) {
  RecordingSchema changed = schema();
  changed.text += " // changed";
  RecoveredRecording report;
  EXPECT_EQ(recovered_from(folder_, joined(whole_, another_recording(folder_, changed)), &report),
            all_but(-1, -1));
  ASSERT_EQ(report.left_out.size(), 1u);
  EXPECT_NE(report.left_out[0].find("test::Frame"), std::string::npos) << report.left_out[0];
  // Nor does what was left out stand for a channel of the same name behind it.
  const Bytes three = joined(joined(whole_, another_recording(folder_, changed)), another_recording(folder_));
  EXPECT_EQ(recovered_from(folder_, three, &report), with_another(all_but(-1, -1)));
  EXPECT_EQ(report.recordings, 3u);
  const auto reader = open(folder_ / "bad.mcap");
  ASSERT_EQ(reader->summary().channels.size(), 3u);
  EXPECT_EQ(reader->summary().channels[2].topic, "relievo/info");
}

TEST_F(RecordingRecover, ABadChunkCostsItselfAlone) {
  for (const std::size_t inside : {60u, 200u}) {
    Bytes bytes = whole_;
    bytes[chunk_extent(whole_, 1).first + inside] ^= 0x40;
    RecoveredRecording report;
    EXPECT_EQ(recovered_from(folder_, bytes, &report), all_but(5, 9));
    EXPECT_EQ(report.left_out.size(), 1u);
  }
}

/// Through its length a chunk seems to reach over others, or out of the file.
TEST_F(RecordingRecover, AWrongLengthLosesNoOtherChunk) {
  for (const std::size_t byte : {1u, 2u, 3u, 5u, 8u}) {
    for (const int change : {0x01, 0x10, 0xff}) {
      Bytes bytes = whole_;
      bytes[chunk_extent(whole_, 1).first + byte] ^= static_cast<std::uint8_t>(change);
      EXPECT_TRUE(std::ranges::includes(recovered_from(folder_, bytes), all_but(5, 9)))
          << byte << " " << change;
    }
  }
}

TEST_F(RecordingRecover, BytesMissingInTheMiddleLoseNoOtherChunk) {
  const auto [at, length] = chunk_extent(whole_, 2);
  Bytes bytes = whole_;
  bytes.erase(bytes.begin() + static_cast<std::ptrdiff_t>(at) + 30,
              bytes.begin() + static_cast<std::ptrdiff_t>(at) + 97);
  RecoveredRecording report;
  EXPECT_EQ(recovered_from(folder_, bytes, &report), all_but(10, 14));
  EXPECT_GT(report.lost_bytes, 0u);
}

TEST_F(RecordingRecover, ForeignBytesInTheMiddleLoseNothing) {
  Bytes bytes = whole_;
  const Bytes foreign(5000, 0);
  bytes.insert(bytes.begin() + static_cast<std::ptrdiff_t>(chunk_extent(whole_, 3).first), foreign.begin(),
               foreign.end());
  RecoveredRecording report;
  EXPECT_EQ(recovered_from(folder_, bytes, &report), all_but(-1, -1));
  EXPECT_EQ(report.lost_bytes, 5000u);
  ASSERT_EQ(report.left_out.size(), 1u);
  EXPECT_NE(report.left_out[0].find("5000 bytes at byte"), std::string::npos) << report.left_out[0];
}

TEST_F(RecordingRecover, ACrashAfterDamageLosesTheLastChunkAndTheDamagedOne) {
  const auto [last, length] = chunk_extent(whole_, 4);
  Bytes bytes(whole_.begin(), whole_.begin() + static_cast<std::ptrdiff_t>(last + length / 2));
  bytes[chunk_extent(whole_, 0).first + 8] ^= 1;  // a length beyond the file
  std::set<int> wanted;
  for (int i = 5; i < 20; ++i) wanted.insert(i);
  EXPECT_EQ(recovered_from(folder_, bytes), wanted);
}

TEST_F(RecordingRecover, AFileThatDoesNotStartAsOneLosesNothing) {
  for (std::size_t damaged = 1; damaged <= mcap::kMagic.size(); ++damaged) {
    Bytes bytes = whole_;
    std::fill_n(bytes.begin(), damaged, std::uint8_t{0});
    RecoveredRecording report;
    EXPECT_EQ(recovered_from(folder_, bytes, &report), all_but(-1, -1)) << damaged;
    EXPECT_EQ(report.lost_bytes, mcap::kMagic.size());
    EXPECT_EQ(report.attachments, 2u);
    // Missing, with what is behind them.
    bytes.erase(bytes.begin(), bytes.begin() + static_cast<std::ptrdiff_t>(2 * damaged));
    EXPECT_EQ(recovered_from(folder_, bytes), all_but(-1, -1)) << damaged;
  }
  const auto opened = RecordingReader::open(folder_ / "bad.mcap");
  ASSERT_FALSE(opened.ok());
  EXPECT_NE(opened.error().message.find("`relievo recover`"), std::string::npos) << opened.error().message;
}

TEST_F(RecordingRecover, AFileThatNeverWasOneIsRefusedAsSuch) {
  write_file(folder_ / "bad.mcap", Bytes(3000, 'x'));
  const auto done = recover_recording(folder_ / "bad.mcap", folder_ / "copy.mcap", always);
  ASSERT_FALSE(done.ok());
  EXPECT_NE(done.error().message.find("is not a recording"), std::string::npos) << done.error().message;
}

/// Any one byte: never more than one chunk is lost, never anything wrong is kept.
TEST_F(RecordingRecover, AnyByteCostsOneChunkAtMost) {
  for (std::size_t at = chunk_extent(whole_, 0).first; at < whole_.size(); ++at) {
    Bytes bytes = whole_;
    bytes[at] ^= at % 2 == 0 ? 0xff : 0x03;
    write_file(folder_ / "bad.mcap", bytes);
    const auto reader = RecordingReader::open(folder_ / "bad.mcap", {.rebuild_index = true});
    ASSERT_TRUE(reader.ok()) << at << ": " << reader.error().message;
    const ReadBack back = read_all(**reader);
    ASSERT_GE(back.messages.size(), 18u) << at;
    for (const RecordedMessage& m : back.messages)
      ASSERT_EQ(m.data, payload(static_cast<int>(m.sequence), 40)) << at;
  }
}

/// Bytes that look like the heads of many large chunks cost no more than reading the file a few times would.
TEST_F(RecordingRecover, AFileMadeToBeSlowIsReadAllTheSame) {
  Bytes heads;
  for (int i = 0; i < 20000; ++i) {
    mcap::append_chunk_header(heads, {.start_time = 1,
                                      .end_time = 2,
                                      .uncompressed_size = 400'000,
                                      .uncompressed_crc = 7,
                                      .compression = "",
                                      .records_size = 400'000});
  }
  Bytes bytes = whole_;
  bytes.insert(bytes.begin() + static_cast<std::ptrdiff_t>(chunk_extent(whole_, 3).first), heads.begin(),
               heads.end());
  EXPECT_TRUE(std::ranges::includes(recovered_from(folder_, bytes), all_but(15, kMessages - 1)));
}

TEST_F(RecordingRecover, WhatAKilledRecoveryLeftIsNotInTheWay) {
  write_file(folder_ / "copy.mcap.part", {});
  EXPECT_TRUE(recover_recording(folder_ / "a.mcap", folder_ / "copy.mcap", always).ok());
}

TEST_F(RecordingRecover, RefusesWhatItCannotDoAndLeavesNoFile) {
  write_file(folder_ / "there.mcap", {});
  const auto over = recover_recording(folder_ / "a.mcap", folder_ / "there.mcap", always);
  ASSERT_FALSE(over.ok());
  EXPECT_NE(over.error().message.find("exists already"), std::string::npos);
  EXPECT_TRUE(read_file(folder_ / "there.mcap").empty());

  write_file(folder_ / "cut.mcap", std::span(whole_).first(chunk_extent(whole_, 0).first + 20));
  const auto nothing = recover_recording(folder_ / "cut.mcap", folder_ / "copy.mcap", always);
  ASSERT_FALSE(nothing.ok());
  EXPECT_NE(nothing.error().message.find("nothing can be recovered"), std::string::npos);

  int calls = 0;
  const auto stopped = recover_recording(folder_ / "a.mcap", folder_ / "copy.mcap",
                                         [&](std::uint64_t) { return ++calls < 3; });
  ASSERT_TRUE(stopped.ok());
  EXPECT_TRUE(stopped->stopped);
  for (const auto& entry : std::filesystem::directory_iterator(folder_.path()))
    EXPECT_EQ(entry.path().filename().string().find("copy"), std::string::npos) << entry.path();
}

}  // namespace
}  // namespace relievo
