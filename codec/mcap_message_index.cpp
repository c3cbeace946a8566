// SPDX-License-Identifier: Apache-2.0
#include "codec/mcap_message_index.h"

#include <algorithm>
#include <optional>
#include <span>
#include <utility>

#include "codec/byte_io.h"

namespace relievo::mcap {
namespace {

constexpr std::uint64_t kMostHeaderBytes = 256;       // of a chunk, before its records
constexpr std::uint64_t kMostIndexBytes = 64u << 20;  // of one chunk
constexpr std::uint64_t kIndexHeadBytes = 2 + 4;      // of a message index: channel, bytes of its entries
constexpr std::uint64_t kEntryBytes = 8 + 8;          // log time, offset

/// Where the chunk's records begin in the file.
Result<std::uint64_t> records_at(const File& file, const ChunkIndex& chunk) {
  const auto start = file.read(chunk.offset, std::min(chunk.length, kRecordHeaderBytes + kMostHeaderBytes));
  if (!start) return start.error();
  if (start->size() <= kRecordHeaderBytes || static_cast<Op>(start->front()) != Op::kChunk)
    return Error{"no chunk is there"};
  const auto header = read_chunk_header(std::span(*start).subspan(kRecordHeaderBytes));
  if (!header) return Error{"its header cannot be read"};
  return chunk.offset + kRecordHeaderBytes + header->second;
}

bool add_entries(std::span<const std::uint8_t> content, const ChunkIndex& chunk, std::uint64_t base,
                 std::vector<MessagePlace>& out) {
  ByteReader reader(content);
  const auto channel = reader.read<std::uint16_t>();
  const auto bytes = reader.read<std::uint32_t>();
  if (!reader.ok() || bytes % kEntryBytes != 0 || content.size() != kIndexHeadBytes + bytes) return false;
  for (std::uint32_t i = 0; i < bytes / kEntryBytes; ++i) {
    const auto log_time = reader.read<std::uint64_t>();
    const auto offset = reader.read<std::uint64_t>();
    if (offset >= chunk.uncompressed_size) return false;
    out.push_back({log_time, channel, base + offset});
  }
  return true;
}

std::optional<std::vector<MessagePlace>> from_indexes(const File& file, const ChunkIndex& chunk) {
  if (chunk.message_index_length == 0 || chunk.message_index_length > kMostIndexBytes ||
      !chunk.compression.empty())  // there the index cannot be checked against what there is
    return std::nullopt;
  const auto base = records_at(file, chunk);
  const auto bytes = file.read(chunk.offset + chunk.length, chunk.message_index_length);
  if (!base || !bytes || chunk.uncompressed_size > chunk.length) return std::nullopt;
  std::vector<MessagePlace> out;
  std::span<const std::uint8_t> rest(*bytes);
  while (!rest.empty()) {
    const auto record = take_record(rest);
    if (!record || record->op != Op::kMessageIndex || !add_entries(record->content, chunk, *base, out))
      return std::nullopt;
  }
  return out;
}

Result<std::vector<MessagePlace>> from_chunk(const File& file, const ChunkIndex& chunk) {
  const auto base = chunk.compression.empty() ? records_at(file, chunk) : Result<std::uint64_t>(0U);
  if (!base) return base.error();
  const auto records = read_chunk_records(file, chunk);
  if (!records) return records.error();
  return message_places(*records, *base);
}

}  // namespace

Result<std::vector<MessagePlace>> read_message_places(const File& file, const ChunkIndex& chunk) {
  auto indexed = from_indexes(file, chunk);
  if (!indexed) return from_chunk(file, chunk);
  std::ranges::stable_sort(*indexed, {}, &MessagePlace::log_time);
  return *std::move(indexed);
}

Result<std::vector<MessagePlace>> message_places(std::span<const std::uint8_t> records, std::uint64_t base) {
  std::vector<MessagePlace> out;
  for (auto rest = records; !rest.empty();) {
    const std::uint64_t offset = records.size() - rest.size();
    const auto record = take_record(rest);
    if (!record) return Error{"a record is cut short"};
    if (record->op != Op::kMessage) continue;
    const auto message = read_message(record->content);
    if (!message) return Error{"a message is malformed"};
    out.push_back({message->first.log_time, message->first.channel_id, base + offset});
  }
  std::ranges::stable_sort(out, {}, &MessagePlace::log_time);
  return out;
}

}  // namespace relievo::mcap
