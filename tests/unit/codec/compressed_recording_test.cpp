// SPDX-License-Identifier: Apache-2.0
// Proves: recordings whose chunks another program compressed (zstd, lz4) are read as they were before, also
// where they were cut short or damaged, and that sizes they lie about cost no memory.
#include <gtest/gtest.h>
#include <lz4frame.h>
#include <zstd.h>

#include <algorithm>
#include <string>

#include "codec/byte_io.h"
#include "codec/chunk_compression.h"
#include "codec/mcap_records.h"
#include "codec/mcap_writer_index.h"
#include "codec/recording_recover.h"
#include "tests/support/temp_folder.h"
#include "tests/unit/codec/sample_recording.h"

namespace relievo::test {
namespace {

constexpr int kMessages = 23;

Bytes compress(const std::string& how, std::span<const std::uint8_t> bytes) {
  const bool is_zstd = how == "zstd";
  Bytes out(is_zstd ? ZSTD_compressBound(bytes.size()) : LZ4F_compressFrameBound(bytes.size(), nullptr));
  out.resize(is_zstd ? ZSTD_compress(out.data(), out.size(), bytes.data(), bytes.size(), 3)
                     : LZ4F_compressFrame(out.data(), out.size(), bytes.data(), bytes.size(), nullptr));
  return out;
}

/// The recording with all of its chunks compressed, indexed as it was.
Bytes compressed(const std::string& how, std::span<const std::uint8_t> whole) {
  Bytes out(whole.begin(), whole.begin() + mcap::kMagic.size());
  mcap::WriterIndex index;
  mcap::ChunkIndex chunk;
  const auto end_chunk = [&] {
    if (chunk.length > 0) index.add(chunk);
    chunk = {};
  };
  for (auto rest = whole.subspan(mcap::kMagic.size()); !rest.empty();) {
    const std::size_t at = out.size();
    const auto before = rest;
    const auto record = mcap::take_record(rest);
    const auto& content = record->content;
    if (record->op != mcap::Op::kMessageIndex) end_chunk();
    if (record->op == mcap::Op::kDataEnd) break;
    if (record->op == mcap::Op::kChunk) {
      auto [header, head] = *mcap::read_chunk_header(content);
      const Bytes records = compress(how, content.subspan(head));
      header.compression = how;
      header.records_size = records.size();
      mcap::append_chunk_header(out, header);
      out.insert(out.end(), records.begin(), records.end());
      chunk = {.start_time = header.start_time,
               .end_time = header.end_time,
               .offset = at,
               .length = out.size() - at,
               .message_index_offsets = {},
               .message_index_length = 0,
               .compression = how,
               .compressed_size = records.size(),
               .uncompressed_size = header.uncompressed_size};
      continue;
    }
    out.insert(out.end(), before.begin(), before.end() - static_cast<std::ptrdiff_t>(rest.size()));
    if (record->op == mcap::Op::kSchema) index.add(*mcap::read_schema(content), 0);
    if (record->op == mcap::Op::kChannel) index.add(*mcap::read_channel(content), 0);
    if (record->op == mcap::Op::kMessageIndex) {
      chunk.message_index_offsets.emplace_back(ByteReader(content).read<std::uint16_t>(), at);
      chunk.message_index_length += out.size() - at;
    }
    if (record->op == mcap::Op::kAttachment) {
      const auto attachment = *mcap::read_attachment(content);
      index.add({.offset = at,
                 .length = out.size() - at,
                 .log_time = attachment.log_time,
                 .create_time = attachment.create_time,
                 .data_size = attachment.data.size(),
                 .name = attachment.name,
                 .media_type = attachment.media_type});
    }
  }
  const Bytes end = index.end(out.size(), 0);
  out.insert(out.end(), end.begin(), end.end());
  return out;
}

class Compressed : public ::testing::TestWithParam<const char*> {
 protected:
  void SetUp() override {
    write_sample(folder_ / "whole.mcap", kMessages);
    bytes_ = compressed(GetParam(), read_file(folder_ / "whole.mcap"));
    write_file(file_, bytes_);
  }
  std::unique_ptr<RecordingReader> reader_of(std::span<const std::uint8_t> bytes) {
    write_file(file_, bytes);
    return open(file_);
  }
  std::size_t data_bytes() const {  // up to its summary
    const auto summary = ByteReader(std::span(bytes_).last(8 + 20)).read<std::uint64_t>();
    return static_cast<std::size_t>(summary) - 13;
  }

  TempFolder folder_;
  const std::filesystem::path file_ = folder_ / "compressed.mcap";
  Bytes bytes_;
};

std::vector<Bytes> data_of(const ReadBack& back) {
  std::vector<Bytes> out;
  for (const RecordedMessage& message : back.messages) out.push_back(message.data);
  return out;
}

TEST_P(Compressed, IsReadAsItWasBefore) {
  const auto before = open(folder_ / "whole.mcap");
  const auto now = open(file_);
  EXPECT_FALSE(now->summary().recovered) << "it has an index";
  const ReadBack back = read_all(*now);
  EXPECT_EQ(back.errors, std::vector<std::string>());
  EXPECT_EQ(data_of(back), data_of(read_all(*before)));
  EXPECT_EQ(now->summary().attachments.size(), 2U);
  for (const std::uint16_t channel : {0, 1}) EXPECT_EQ(*now->times(channel), *before->times(channel));
  for (int i = 0; i < kMessages; ++i) {
    const auto third = [&](std::uint16_t channel, std::span<const std::uint8_t> head) {
      return channel == 0 && head.front() % 3 == 0;
    };
    const std::int64_t time_ns = kStart_ns + i * kStep_ns;
    EXPECT_EQ(now->find_last(time_ns, third), before->find_last(time_ns, third)) << i;
  }
  ASSERT_TRUE(now->seek(kStart_ns + 12 * kStep_ns).ok());
  EXPECT_EQ(read_all(*now).messages.size(), static_cast<std::size_t>(kMessages - 12));
}

TEST_P(Compressed, AChunkIsReadOnceToFindWhatIsInIt) {
  const auto reader = open(file_);
  const std::uint64_t before = reader->bytes_read();
  EXPECT_EQ(reader->find_last(kStart_ns + kMessages * kStep_ns, [](auto, auto) { return false; }),
            std::nullopt);
  EXPECT_LE(reader->bytes_read() - before, data_bytes());
}

TEST_P(Compressed, CutShortAllThatIsWholeIsRead) {
  std::size_t before = 0;
  for (std::size_t bytes = mcap::kMagic.size(); bytes <= data_bytes(); bytes += 7) {
    const ReadBack back = read_all(*reader_of(std::span(bytes_).first(bytes)));
    EXPECT_EQ(back.errors, std::vector<std::string>()) << bytes;
    EXPECT_GE(back.messages.size(), before) << bytes;
    before = back.messages.size();
    for (std::size_t i = 0; i < before; ++i)
      ASSERT_EQ(back.messages[i].data, payload(static_cast<int>(i), 40));
  }
  EXPECT_EQ(before, static_cast<std::size_t>(kMessages));
}

TEST_P(Compressed, RecoveredItIsACopyWithoutAndDamageCostsOneChunk) {
  for (std::size_t byte = 8; byte < data_bytes(); byte += 29) {
    Bytes damaged = bytes_;
    damaged[byte] ^= 0x55;
    write_file(file_, damaged);
    const auto copy = folder_ / "copy.mcap";
    std::filesystem::remove(copy);
    const auto done = recover_recording(file_, copy, [](std::uint64_t) { return true; });
    ASSERT_TRUE(done.ok()) << byte << ": " << (done ? "" : done.error().message);
    const auto reader = open(copy);
    const ReadBack back = read_all(*reader);
    EXPECT_EQ(back.errors, std::vector<std::string>());
    EXPECT_GE(back.messages.size(), static_cast<std::size_t>(kMessages - 5)) << byte;
    for (const RecordedMessage& message : back.messages)
      ASSERT_EQ(message.data, payload(static_cast<int>(message.sequence), 40)) << byte;
    EXPECT_FALSE(reader->summary().recovered);
    const Bytes written = read_file(copy);
    const std::string how = GetParam();
    EXPECT_EQ(std::ranges::search(written, how).size(), 0U) << "the copy is compressed";
  }
}

INSTANTIATE_TEST_SUITE_P(Of, Compressed, ::testing::Values("zstd", "lz4"));

TEST(Decompress, SizesThatAreNotTrueAreTold) {
  const Bytes zeros(5 << 20);
  for (const std::string how : {"zstd", "lz4"}) {
    const Bytes bytes = compress(how, zeros);
    ASSERT_LT(bytes.size(), zeros.size() / 50);
    EXPECT_EQ(*mcap::decompress(how, bytes, zeros.size()), zeros);
    for (const std::uint64_t size :
         {std::uint64_t{0}, std::uint64_t{100}, zeros.size() - 1, zeros.size() + 1, std::uint64_t{1} << 62})
      EXPECT_EQ(mcap::decompress(how, bytes, size).error().message, "its sizes disagree") << how << size;
    const auto cut = std::span(bytes).first(bytes.size() / 2);
    EXPECT_EQ(mcap::decompress(how, cut, zeros.size()).error().message, "its sizes disagree") << how;
    EXPECT_EQ(mcap::decompress(how, payload(1, 50), 50).error().message,
              "what is compressed in it is damaged");
    EXPECT_EQ(mcap::decompress(how, compress(how, {}), 0)->size(), 0U) << how;
  }
}

}  // namespace
}  // namespace relievo::test
