// SPDX-License-Identifier: Apache-2.0
// Proves: a recording that was cut short is given an index with which all that is whole of it is read,
// wherever it was cut; and none where that would leave something out.
#include "codec/cut_recording.h"

#include <gtest/gtest.h>

#include <cstring>

#include "codec/byte_io.h"
#include "codec/mcap_records.h"
#include "tests/support/temp_folder.h"
#include "tests/unit/codec/sample_recording.h"

namespace relievo::test {
namespace {

class Cut : public ::testing::Test {
 protected:
  void SetUp() override {
    write_sample(folder_ / "whole.mcap", 23);
    whole_ = read_file(folder_ / "whole.mcap");
  }
  std::size_t data_bytes() const {
    std::uint64_t summary = 0;
    std::memcpy(&summary, whole_.data() + whole_.size() - 8 - 20, sizeof summary);
    return summary - 13;
  }
  /// Nothing where there is no index of `bytes` as a file.
  std::shared_ptr<const GrowingRecording> index_of(std::span<const std::uint8_t> bytes) {
    write_file(file_, bytes);
    const auto index = index_cut_recording(file_);
    EXPECT_EQ(read_file(file_), Bytes(bytes.begin(), bytes.end())) << "it was written to";
    return index.ok() ? *index : nullptr;
  }
  /// All that is in the file that the index makes of it.
  std::vector<Bytes> read_with(const GrowingRecording& index, std::span<const std::uint8_t> bytes) {
    const auto end = index.end_at(index.bytes());
    Bytes now(bytes.begin(), bytes.begin() + static_cast<std::ptrdiff_t>(index.bytes()));
    now.insert(now.end(), end->begin(), end->end());
    write_file(folder_ / "now.mcap", now);
    const auto reader = open(folder_ / "now.mcap");
    EXPECT_FALSE(reader->summary().recovered) << "it has an index";
    EXPECT_EQ(reader->summary().damage, std::vector<std::string>());
    const ReadBack back = read_all(*reader);
    EXPECT_TRUE(back.errors.empty()) << back.errors.front();
    EXPECT_EQ(reader->summary().messages, back.messages.size());
    std::size_t listed = 0;
    for (std::uint16_t channel = 0; channel < 2; ++channel) listed += reader->times(channel)->size();
    EXPECT_EQ(listed, back.messages.size());
    return all(back, *reader);
  }
  std::vector<Bytes> read_without(std::span<const std::uint8_t> bytes) {
    write_file(folder_ / "now.mcap", bytes);
    const auto reader = open(folder_ / "now.mcap");
    return all(read_all(*reader), *reader);
  }

  TempFolder folder_;
  const std::filesystem::path file_ = folder_ / "cut.mcap";
  Bytes whole_;

 private:
  static std::vector<Bytes> all(const ReadBack& back, const RecordingReader& reader) {
    std::vector<Bytes> out;
    for (const RecordedMessage& message : back.messages) out.push_back(message.data);
    for (const RecordingAttachment& attachment : reader.summary().attachments) out.push_back(attachment.data);
    return out;
  }
};

TEST_F(Cut, WhereverItIsCutAllThatIsWholeIsRead) {
  int with_index = 0;
  for (std::size_t bytes = 0; bytes < whole_.size(); ++bytes) {
    const auto cut = std::span(whole_).first(bytes);
    const auto index = index_of(cut);
    if (!index) {
      EXPECT_TRUE(bytes < 8 || read_without(cut).size() < 3) << "cut at byte " << bytes;
      continue;
    }
    ++with_index;
    EXPECT_LE(index->bytes(), bytes);
    EXPECT_EQ(index->end_at(index->bytes() + 1), nullptr);
    ASSERT_TRUE(read_with(*index, cut) == read_without(cut)) << "cut at byte " << bytes;
  }
  EXPECT_GT(with_index, 1000);
}

/// The data of a recording as other programs write it: what its schemas and channels are stands in the first
/// chunk.
Bytes described_within(std::span<const std::uint8_t> data) {
  Bytes out(data.begin(), data.begin() + 8);
  Bytes described;
  int chunks = 0;
  for (data = data.subspan(8); !data.empty();) {
    const std::span<const std::uint8_t> before = data;
    const auto record = mcap::take_record(data);
    if (!record) break;
    const auto whole = before.first(before.size() - data.size());
    const auto& content = record->content;
    chunks += record->op == mcap::Op::kChunk;
    if (record->op == mcap::Op::kSchema || record->op == mcap::Op::kChannel) {
      described.insert(described.end(), whole.begin(), whole.end());
    } else if (record->op == mcap::Op::kChunk && chunks == 1) {
      auto [header, at] = *mcap::read_chunk_header(content);
      Bytes records = described;
      records.insert(records.end(), content.begin() + static_cast<std::ptrdiff_t>(at), content.end());
      header.records_size = header.uncompressed_size = records.size();
      header.uncompressed_crc = mcap::crc32(records);
      mcap::append_chunk_header(out, header);
      out.insert(out.end(), records.begin(), records.end());
    } else if (record->op == mcap::Op::kMessageIndex && chunks == 1) {
      ByteReader reader(content);
      mcap::MessageIndex index;
      index.channel_id = reader.read<std::uint16_t>();
      reader.read<std::uint32_t>();
      while (reader.position() < content.size()) {
        const auto time = reader.read<std::uint64_t>();
        index.entries.emplace_back(time, reader.read<std::uint64_t>() + described.size());
      }
      mcap::append(out, index);
    } else {
      out.insert(out.end(), whole.begin(), whole.end());
    }
  }
  return out;
}

TEST_F(Cut, WhatSaysInItsFirstChunkWhatItHoldsIsReadLikewise) {
  const Bytes within = described_within(std::span(whole_).first(data_bytes()));
  const auto index = index_of(within);
  ASSERT_TRUE(index);
  EXPECT_TRUE(read_with(*index, within) == read_without(std::span(whole_).first(data_bytes())));
}

TEST_F(Cut, ZerosThatAPowerLossLeftAreNotRecords) {
  Bytes cut(whole_.begin(), whole_.begin() + static_cast<std::ptrdiff_t>(data_bytes() / 2));
  const auto sound = read_without(cut);
  ASSERT_GT(sound.size(), 5U);
  cut.resize(cut.size() + 5000);
  const auto index = index_of(cut);
  ASSERT_TRUE(index);
  EXPECT_TRUE(read_with(*index, cut) == sound);
}

TEST_F(Cut, DamageLeavesNothingOutThatIsSound) {
  const auto data = std::span(whole_).first(data_bytes());
  for (const Bytes& sound : {Bytes(data.begin(), data.end()), described_within(data)})
    for (std::size_t byte = 8; byte < sound.size(); ++byte) {
      Bytes damaged = sound;
      damaged[byte] ^= 0x55;
      const auto index = index_of(damaged);
      if (!index) continue;
      const auto end = index->end_at(index->bytes());
      Bytes now(damaged.begin(), damaged.begin() + static_cast<std::ptrdiff_t>(index->bytes()));
      now.insert(now.end(), end->begin(), end->end());
      EXPECT_TRUE(read_without(now) == read_without(damaged)) << "damaged at byte " << byte;
    }
}

TEST_F(Cut, WhatHasAnIndexOrIsOfSeveralHasNone) {
  EXPECT_FALSE(index_of(whole_));
  Bytes joined = whole_;
  joined.insert(joined.end(), whole_.begin(), whole_.begin() + static_cast<std::ptrdiff_t>(data_bytes()));
  EXPECT_FALSE(index_of(joined));
  EXPECT_FALSE(index_cut_recording(folder_ / "none.mcap").ok());
  write_file(file_, payload(1, 3000));
  EXPECT_FALSE(index_cut_recording(file_).ok());
}

}  // namespace
}  // namespace relievo::test
