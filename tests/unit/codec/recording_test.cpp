// SPDX-License-Identifier: Apache-2.0
#include "codec/recording.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "base/time.h"
#include "tests/support/temp_folder.h"
#include "tests/unit/codec/sample_recording.h"

namespace relievo {
namespace {

using namespace test;

void expect_equal(const RecordedMessage& a, const RecordedMessage& b) {
  EXPECT_EQ(a.channel, b.channel);
  EXPECT_EQ(a.sequence, b.sequence);
  EXPECT_EQ(a.log_time_ns, b.log_time_ns);
  EXPECT_EQ(a.publish_time_ns, b.publish_time_ns);
  EXPECT_EQ(a.data, b.data);
}

TEST(Recording, EverythingComesBack) {
  test::TempFolder folder;
  write_sample(folder / "a.mcap", 23);
  const auto reader = open(folder / "a.mcap");
  const RecordingSummary& summary = reader->summary();
  EXPECT_FALSE(summary.recovered);
  EXPECT_EQ(summary.lost_bytes, 0u);
  EXPECT_EQ(summary.messages, 23u);
  EXPECT_EQ(summary.start_ns, kStart_ns);
  EXPECT_EQ(summary.end_ns, kStart_ns + 22 * kStep_ns);
  ASSERT_EQ(summary.channels.size(), 2u);
  EXPECT_EQ(summary.channels[1].topic, "relievo/status");
  EXPECT_EQ(summary.channels[1].metadata, channel("").metadata);
  EXPECT_EQ(summary.channels[1].message_encoding, "cdr");
  EXPECT_EQ(summary.channel_messages, (std::vector<std::uint64_t>{18, 5}));
  ASSERT_EQ(summary.schemas.size(), 1u);
  EXPECT_EQ(summary.schemas[0].text, schema().text);
  ASSERT_EQ(summary.attachments.size(), 2u);
  EXPECT_EQ(summary.attachments[0].name, "rig.yaml");
  EXPECT_EQ(summary.attachments[1].data, payload(99, 300));
  EXPECT_EQ(summary.attachments[1].time_ns, kStart_ns);
  const ReadBack back = read_all(*reader);
  EXPECT_TRUE(back.errors.empty());
  ASSERT_EQ(back.messages.size(), 23u);
  for (int i = 0; i < 23; ++i)
    expect_equal(back.messages[static_cast<std::size_t>(i)], message(i % 4 == 3 ? 1 : 0, i, 40));
}

TEST(Recording, AnEmptyOneIsWhole) {
  test::TempFolder folder;
  create(folder / "a.mcap")->finish().ok();
  const auto reader = open(folder / "a.mcap");
  EXPECT_FALSE(reader->summary().recovered);
  EXPECT_TRUE(read_all(*reader).messages.empty());
}

TEST(Recording, MessagesComeInTheOrderOfTheirTimes) {
  test::TempFolder folder;
  {
    auto writer = create(folder / "a.mcap", {.chunk_ns = 3 * kStep_ns, .chunk_bytes = 1 << 20});
    writer->add_channel(schema(), channel("t")).ok();
    for (const int i : {0, 2, 1, 5, 3, 4, 4, 9, 8, 6, 7}) writer->write(message(0, i, 10)).ok();
  }
  std::vector<std::uint32_t> order;
  for (const auto& m : read_all(*open(folder / "a.mcap")).messages) order.push_back(m.sequence);
  EXPECT_EQ(order, (std::vector<std::uint32_t>{0, 1, 2, 3, 4, 4, 5, 6, 7, 8, 9}));
}

TEST(Recording, SeekGoesToAnyMessage) {
  test::TempFolder folder;
  write_sample(folder / "a.mcap", 23);
  const auto reader = open(folder / "a.mcap");
  for (const int i : {20, 0, 7, 22, 13, 14}) {
    for (const std::int64_t earlier : {std::int64_t{0}, kStep_ns / 2}) {
      ASSERT_TRUE(reader->seek(kStart_ns + i * kStep_ns - earlier).ok());
      const auto next = reader->next();
      ASSERT_TRUE(next.ok());
      ASSERT_TRUE(next->has_value());
      EXPECT_EQ((*next)->sequence, static_cast<std::uint32_t>(i));
    }
  }
  ASSERT_TRUE(reader->seek(kStart_ns + 23 * kStep_ns).ok());
  EXPECT_FALSE(reader->next()->has_value());
  ASSERT_TRUE(reader->seek(-5).ok());
  EXPECT_EQ((*reader->next())->sequence, 0u);
}

TEST(Recording, TimesComeFromTheIndexOrTheMessages) {
  test::TempFolder folder;
  write_sample(folder / "a.mcap", 23);
  const Bytes whole = read_file(folder / "a.mcap");
  write_file(folder / "cut.mcap", std::span(whole).first(whole.size() - 8));
  std::vector<std::int64_t> status, frames;
  for (int i = 0; i < 23; ++i) (i % 4 == 3 ? status : frames).push_back(kStart_ns + i * kStep_ns);
  for (const char* name : {"a.mcap", "cut.mcap"}) {
    const auto reader = open(folder / name);
    EXPECT_EQ(*reader->times(0), frames) << name;
    EXPECT_EQ(*reader->times(1), status) << name;
    EXPECT_TRUE(reader->times(7)->empty()) << name;
  }
}

TEST(Recording, TheLastMessageThatIsWantedIsFoundByItsFirstBytes) {
  test::TempFolder folder;
  write_sample(folder / "a.mcap", 43, 600);
  const Bytes whole = read_file(folder / "a.mcap");
  write_file(folder / "cut.mcap", std::span(whole).first(whole.size() - 8));
  const auto time = [](int i) { return kStart_ns + i * kStep_ns; };
  for (const char* name : {"a.mcap", "cut.mcap"}) {
    const auto reader = open(folder / name);
    const auto only = [&](int wanted) {
      return [&, wanted](std::uint16_t channel, std::span<const std::uint8_t> head) {
        EXPECT_EQ(head.size(), RecordingReader::kHeadBytes);
        const Bytes data = payload(wanted, 600);
        return channel == 0 && std::equal(head.begin(), head.end(), data.begin());
      };
    };
    for (const int i : {0, 4, 14, 41})
      for (const int later : {i, i + 1, 42}) EXPECT_EQ(reader->find_last(time(later), only(i)), time(i));
    EXPECT_EQ(reader->find_last(time(14) - 1, only(14)), std::nullopt) << "later than asked for";
    EXPECT_EQ(reader->find_last(time(42), only(7)), std::nullopt) << "on the other channel";
    EXPECT_EQ(reader->find_last(-1, only(0)), std::nullopt);
    const auto any = [](std::uint16_t, std::span<const std::uint8_t>) { return true; };
    EXPECT_EQ(reader->find_last(time(30) + 1, any), time(30));
    EXPECT_EQ(reader->find_last(time(300), any), time(42));
  }
}

/// Chunks need not follow one another in time.
TEST(Recording, TheLastMessageIsFoundAmongChunksThatOverlap) {
  test::TempFolder folder;
  {
    auto writer = create(folder / "a.mcap", {.chunk_ns = 100 * kStep_ns, .chunk_bytes = 60});
    writer->add_channel(schema(), channel("t")).ok();
    for (const int i : {0, 9, 1, 2, 8, 3, 5, 4, 7, 6}) writer->write(message(0, i, 10)).ok();
  }
  const auto reader = open(folder / "a.mcap");
  const auto any = [](std::uint16_t, std::span<const std::uint8_t>) { return true; };
  for (int i = 0; i < 10; ++i)
    EXPECT_EQ(reader->find_last(kStart_ns + i * kStep_ns, any), kStart_ns + i * kStep_ns);
}

constexpr int kRate = 30, kKeyInterval = 15;
constexpr std::size_t kFrameBytes = 2000;

std::int64_t frame_time_ns(int frame) {
  return kStart_ns + frame * kNanosecondsPerSecond / kRate;
}

/// Frames of which every fifteenth begins with a 1: it needs none before it.
void write_frames(const std::filesystem::path& file, int minutes) {
  auto writer = create(file, {.sync_ns = -1});
  ASSERT_TRUE(writer->add_channel(schema(), channel("relievo/frame")).ok());
  for (int i = 0; i < minutes * 60 * kRate; ++i) {
    RecordedMessage m = message(0, i, kFrameBytes);
    m.log_time_ns = frame_time_ns(i);
    m.data[0] = i % kKeyInterval == 0 ? 1 : 0;
    ASSERT_TRUE(writer->write(m).ok());
  }
  ASSERT_TRUE(writer->finish().ok());
}

struct SeekCost {
  std::uint64_t bytes = 0, frames = 0;  // the most of any seek
};

/// Of getting to random times: to the key frame before, and on to the first frame that is not before the
/// time.
SeekCost cost_of_seeks(RecordingReader& reader) {
  SeekCost most;
  Random random(7);
  const int frames = static_cast<int>(reader.summary().messages);
  for (int i = 0; i < 300; ++i) {
    const auto frame = static_cast<int>(random.below(static_cast<std::uint32_t>(frames)));
    const std::uint64_t before = reader.bytes_read();
    const auto key_ns = reader.find_last(
        frame_time_ns(frame), [](std::uint16_t, std::span<const std::uint8_t> head) { return head[0] == 1; });
    EXPECT_EQ(key_ns, frame_time_ns(frame / kKeyInterval * kKeyInterval));
    if (!key_ns) break;
    EXPECT_TRUE(reader.seek(*key_ns).ok());
    std::uint64_t decoded = 0;
    for (std::uint32_t at = ~0U; at != static_cast<std::uint32_t>(frame); ++decoded) {
      const auto next = reader.next();
      EXPECT_TRUE(next.ok() && *next);
      if (!next || !*next) return most;
      at = (*next)->sequence;
      EXPECT_EQ(at, static_cast<std::uint32_t>(frame / kKeyInterval * kKeyInterval) + decoded);
    }
    most.bytes = std::max(most.bytes, reader.bytes_read() - before);
    most.frames = std::max(most.frames, decoded);
  }
  return most;
}

// What a seek takes, whatever else the machine does: how long that is `relievo-bench recording` measures.
TEST(Recording, ASeekReadsTwoSecondsAtMostHoweverLongTheRecordingIs) {
  const TempFolder folder;
  for (const int minutes : {1, 10}) {
    SCOPED_TRACE(minutes);
    const auto file = folder / (std::to_string(minutes) + ".mcap");
    write_frames(file, minutes);
    const auto reader = open(file);
    EXPECT_LT(reader->bytes_read(), std::filesystem::file_size(file) / 100) << "opened by the index alone";
    const SeekCost most = cost_of_seeks(*reader);
    EXPECT_EQ(most.frames, static_cast<std::uint64_t>(kKeyInterval));
    EXPECT_LT(most.bytes, 2 * kRate * kFrameBytes);
  }
}

TEST(Recording, ChunksAreBoundedInTimeAndSize) {
  test::TempFolder folder;
  auto writer = create(folder / "a.mcap", {.chunk_ns = 5 * kStep_ns, .chunk_bytes = 500});
  writer->add_channel(schema(), channel("t")).ok();
  const auto on_disk = [&] { return read_all(*open(folder / "a.mcap")).messages.size(); };
  ASSERT_TRUE(writer->write(message(0, 0, 10)).ok());
  EXPECT_EQ(on_disk(), 0u);
  ASSERT_TRUE(writer->flush_if_due(kStart_ns + 4 * kStep_ns).ok());
  EXPECT_EQ(on_disk(), 0u);
  ASSERT_TRUE(writer->flush_if_due(kStart_ns + 5 * kStep_ns).ok());
  EXPECT_EQ(on_disk(), 1u) << "old enough";
  ASSERT_TRUE(writer->write(message(0, 6, 10)).ok());
  ASSERT_TRUE(writer->write(message(0, 12, 10)).ok());
  EXPECT_EQ(on_disk(), 2u) << "the next message came later than the chunk may be";
  ASSERT_TRUE(writer->write(message(0, 13, 600)).ok());
  EXPECT_EQ(on_disk(), 4u) << "large enough";
}

TEST(Recording, AnExistingFileIsNotTouched) {
  test::TempFolder folder;
  write_file(folder / "a.mcap", Bytes{1, 2, 3});
  const auto writer = RecordingWriter::create(folder / "a.mcap", {});
  ASSERT_FALSE(writer.ok());
  EXPECT_NE(writer.error().message.find("exists already"), std::string::npos);
  EXPECT_EQ(read_file(folder / "a.mcap"), (Bytes{1, 2, 3}));
  EXPECT_FALSE(RecordingWriter::create(folder / "none/a.mcap", {}).ok());
}

TEST(Recording, ALinkToWhatIsNotThereYetIsFollowed) {
  test::TempFolder folder;
  std::filesystem::create_symlink("b.mcap", folder / "link.mcap");
  write_sample(folder / "link.mcap", 5);
  EXPECT_TRUE(std::filesystem::is_symlink(folder / "link.mcap"));
  EXPECT_EQ(open(folder / "b.mcap")->summary().messages, 5u);
  EXPECT_FALSE(RecordingWriter::create(folder / "link.mcap", {}).ok()) << "now it is there";

  std::filesystem::create_symlink("d.mcap", folder / "other.mcap");
  auto writer = create(folder / "other.mcap", {.chunk_ns = 0, .keeps_name = true});
  ASSERT_TRUE(writer->add_channel(schema(), channel("t")).ok());
  ASSERT_TRUE(writer->write(message(0, 0, 10)).ok());
  EXPECT_TRUE(writer->write(message(0, 1, 10)).ok()) << "it was not renamed";
}

TEST(Recording, MisuseIsRefused) {
  test::TempFolder folder;
  auto writer = create(folder / "a.mcap");
  EXPECT_FALSE(writer->write(message(0, 0, 1)).ok()) << "no such channel";
  EXPECT_FALSE(writer->add_channel(schema(), {"t", "cdr", "other", {}}).ok());
  EXPECT_TRUE(writer->add_channel(schema(), channel("t")).ok());
  RecordingSchema other = schema();
  other.text = "else";
  EXPECT_FALSE(writer->add_channel(other, channel("u")).ok());
  RecordedMessage early = message(0, 0, 1);
  early.log_time_ns = -1;
  EXPECT_FALSE(writer->write(early).ok());
  EXPECT_TRUE(writer->finish().ok());
  EXPECT_TRUE(writer->finish().ok());
  EXPECT_FALSE(writer->write(message(0, 0, 1)).ok());
  EXPECT_FALSE(RecordingWriter::create(folder / "b.mcap", {.chunk_bytes = 0}).ok());
}

}  // namespace
}  // namespace relievo
