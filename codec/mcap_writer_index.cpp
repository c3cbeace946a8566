// SPDX-License-Identifier: Apache-2.0
#include "codec/mcap_writer_index.h"

#include <algorithm>
#include <map>

#include "codec/byte_io.h"

namespace relievo::mcap {
namespace {

constexpr std::uint64_t kEmptyMessageIndexBytes = kRecordHeaderBytes + 2 + 4;  // channel, length of entries
constexpr std::uint64_t kMessageIndexEntryBytes = 8 + 8;

/// Where what belongs to a chunk ends.
std::uint64_t end_of(const ChunkIndex& chunk) {
  return chunk.offset + chunk.length + chunk.message_index_length;
}

/// By how long its message indexes are, one behind the other.
void count_messages(const ChunkIndex& chunk, std::map<std::uint16_t, std::uint64_t>& counts) {
  std::uint64_t end = end_of(chunk);
  for (auto index = chunk.message_index_offsets.rbegin(); index != chunk.message_index_offsets.rend();
       ++index) {
    counts[index->first] += (end - index->second - kEmptyMessageIndexBytes) / kMessageIndexEntryBytes;
    end = index->second;
  }
}

}  // namespace

void WriterIndex::add(const Schema& schema, std::uint64_t end) {
  const std::lock_guard lock(mutex_);
  schemas_.emplace_back(schema, end);
}

void WriterIndex::add(const Channel& channel, std::uint64_t end) {
  const std::lock_guard lock(mutex_);
  channels_.emplace_back(channel, end);
}

void WriterIndex::add(AttachmentIndex attachment) {
  const std::lock_guard lock(mutex_);
  attachments_.push_back(std::move(attachment));
}

void WriterIndex::add(ChunkIndex chunk) {
  const std::lock_guard lock(mutex_);
  chunks_.push_back(std::move(chunk));
}

std::uint64_t WriterIndex::bytes() const {
  const std::lock_guard lock(mutex_);
  return chunks_.empty() ? 0 : end_of(chunks_.back());
}

std::shared_ptr<const Bytes> WriterIndex::end_at(std::uint64_t bytes) const {
  const std::lock_guard lock(mutex_);
  if (given_ && asked_ == bytes) return given_;
  const auto chunk = std::ranges::lower_bound(chunks_, bytes, {}, end_of);
  if (chunk == chunks_.end() || end_of(*chunk) != bytes) return nullptr;
  given_ = std::make_shared<const Bytes>(build(bytes, 0));
  asked_ = bytes;
  return given_;
}

Bytes WriterIndex::end(std::uint64_t bytes, std::uint32_t data_crc) const {
  const std::lock_guard lock(mutex_);
  return build(bytes, data_crc);
}

/// With the mutex held.
Bytes WriterIndex::build(std::uint64_t bytes, std::uint32_t data_crc) const {
  Bytes out;
  append_data_end(out, data_crc);
  const std::uint64_t summary_start = bytes + out.size();
  Statistics statistics;
  std::map<std::uint16_t, std::uint64_t> counts;
  Bytes summary;
  Bytes offsets;
  /// Each writes those of its records that end within `bytes`, and says how many they are.
  const auto group = [&](Op op, const auto& records, const auto& end_of_record, const auto& write) {
    const std::size_t start = summary.size();
    std::uint32_t count = 0;
    for (const auto& record : records) {
      if (end_of_record(record) > bytes) continue;
      write(record);
      ++count;
    }
    if (summary.size() > start)
      append_summary_offset(offsets, op, summary_start + start, summary.size() - start);
    return count;
  };
  const auto at_second = [](const auto& record) { return record.second; };
  statistics.schemas = static_cast<std::uint16_t>(
      group(Op::kSchema, schemas_, at_second, [&](const auto& schema) { append(summary, schema.first); }));
  statistics.channels = group(Op::kChannel, channels_, at_second, [&](const auto& channel) {
    append(summary, channel.first);
    counts[channel.first.id] = 0;
  });
  for (const ChunkIndex& chunk : chunks_) {
    if (end_of(chunk) > bytes) break;
    count_messages(chunk, counts);
    statistics.start_time =
        statistics.chunks == 0 ? chunk.start_time : std::min(statistics.start_time, chunk.start_time);
    statistics.end_time = std::max(statistics.end_time, chunk.end_time);
    ++statistics.chunks;
  }
  const auto attachment_end = [](const AttachmentIndex& a) { return a.offset + a.length; };
  statistics.attachments = static_cast<std::uint32_t>(std::ranges::count_if(
      attachments_, [&](const AttachmentIndex& a) { return attachment_end(a) <= bytes; }));
  for (const auto& [channel, count] : counts) {
    statistics.channel_messages.emplace_back(channel, count);
    statistics.messages += count;
  }
  const auto write = [&](const auto& record) { append(summary, record); };
  group(
      Op::kStatistics, std::span(&statistics, 1), [](const Statistics&) { return std::uint64_t{0}; }, write);
  group(Op::kChunkIndex, chunks_, end_of, write);
  group(Op::kAttachmentIndex, attachments_, attachment_end, write);
  const std::uint64_t offsets_start = summary_start + summary.size();
  append_bytes(summary, offsets);
  append_bytes(out, summary);
  append_footer(out, summary, {.summary_start = summary_start, .summary_offset_start = offsets_start});
  append_bytes(out, kMagic);
  return out;
}

}  // namespace relievo::mcap
