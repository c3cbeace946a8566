// SPDX-License-Identifier: Apache-2.0
#include "codec/mcap_records.h"

#include <zlib.h>

#include <algorithm>

#include "codec/byte_io.h"

namespace relievo::mcap {
namespace {

/// Opcode now, length when the scope ends.
class RecordScope {
 public:
  RecordScope(Bytes& out, Op op) : out_(out) {
    relievo::append(out_, static_cast<std::uint8_t>(op));
    length_at_ = out_.size();
    relievo::append(out_, std::uint64_t{0});
  }
  ~RecordScope() { put(out_, length_at_, static_cast<std::uint64_t>(out_.size() - length_at_ - 8)); }
  RecordScope(const RecordScope&) = delete;
  RecordScope& operator=(const RecordScope&) = delete;

 private:
  Bytes& out_;
  std::size_t length_at_ = 0;
};

template <Scalar... T>
void append_all(Bytes& out, T... values) {
  (relievo::append(out, values), ...);
}

template <Scalar K, Scalar V>
void append_map(Bytes& out, const std::vector<std::pair<K, V>>& map) {
  relievo::append(out, static_cast<std::uint32_t>(map.size() * (sizeof(K) + sizeof(V))));
  for (const auto& [key, value] : map) append_all(out, key, value);
}

template <Scalar K, Scalar V>
std::vector<std::pair<K, V>> read_map(ByteReader& reader) {
  ByteReader entries(reader.take(reader.read<std::uint32_t>()));
  std::vector<std::pair<K, V>> map;
  while (entries.remaining() >= sizeof(K) + sizeof(V)) {
    const K key = entries.read<K>();
    map.emplace_back(key, entries.read<V>());
  }
  return map;
}

template <typename T>
std::optional<T> if_ok(const ByteReader& reader, T&& value) {
  if (!reader.ok()) return std::nullopt;
  return std::forward<T>(value);
}

}  // namespace

void append_header(Bytes& out, const std::string& profile, const std::string& library) {
  const RecordScope record(out, Op::kHeader);
  append_string(out, profile);
  append_string(out, library);
}

void append(Bytes& out, const Schema& schema) {
  const RecordScope record(out, Op::kSchema);
  append_all(out, schema.id);
  append_string(out, schema.name);
  append_string(out, schema.encoding);
  append_string(out, schema.data);
}

void append(Bytes& out, const Channel& channel) {
  const RecordScope record(out, Op::kChannel);
  append_all(out, channel.id, channel.schema_id);
  append_string(out, channel.topic);
  append_string(out, channel.message_encoding);
  Bytes map;
  for (const auto& [key, value] : channel.metadata) {
    append_string(map, key);
    append_string(map, value);
  }
  append_all(out, static_cast<std::uint32_t>(map.size()));
  append_bytes(out, map);
}

void append(Bytes& out, const Message& message, std::span<const std::uint8_t> data) {
  const RecordScope record(out, Op::kMessage);
  append_all(out, message.channel_id, message.sequence, message.log_time, message.publish_time);
  append_bytes(out, data);
}

void append(Bytes& out, const MessageIndex& index) {
  const RecordScope record(out, Op::kMessageIndex);
  append_all(out, index.channel_id);
  append_map(out, index.entries);
}

void append(Bytes& out, const ChunkIndex& index) {
  const RecordScope record(out, Op::kChunkIndex);
  append_all(out, index.start_time, index.end_time, index.offset, index.length);
  append_map(out, index.message_index_offsets);
  append_all(out, index.message_index_length);
  append_string(out, index.compression);
  append_all(out, index.compressed_size, index.uncompressed_size);
}

void append(Bytes& out, const Attachment& attachment) {
  const RecordScope record(out, Op::kAttachment);
  const std::size_t start = out.size();
  append_all(out, attachment.log_time, attachment.create_time);
  append_string(out, attachment.name);
  append_string(out, attachment.media_type);
  append_all(out, static_cast<std::uint64_t>(attachment.data.size()));
  append_bytes(out, attachment.data);
  append_all(out, crc32(std::span(out).subspan(start)));
}

void append(Bytes& out, const AttachmentIndex& index) {
  const RecordScope record(out, Op::kAttachmentIndex);
  append_all(out, index.offset, index.length, index.log_time, index.create_time, index.data_size);
  append_string(out, index.name);
  append_string(out, index.media_type);
}

void append(Bytes& out, const Statistics& statistics) {
  const RecordScope record(out, Op::kStatistics);
  append_all(out, statistics.messages, statistics.schemas, statistics.channels, statistics.attachments,
             statistics.metadata, statistics.chunks, statistics.start_time, statistics.end_time);
  append_map(out, statistics.channel_messages);
}

void append_summary_offset(Bytes& out, Op group, std::uint64_t start, std::uint64_t length) {
  const RecordScope record(out, Op::kSummaryOffset);
  append_all(out, static_cast<std::uint8_t>(group), start, length);
}

void append_data_end(Bytes& out, std::uint32_t data_crc) {
  const RecordScope record(out, Op::kDataEnd);
  append_all(out, data_crc);
}

void append_chunk_header(Bytes& out, const ChunkHeader& header) {
  append_all(out, static_cast<std::uint8_t>(Op::kChunk));
  const std::uint64_t fields = 8 + 8 + 8 + 4 + 4 + header.compression.size() + 8;
  append_all(out, fields + header.records_size, header.start_time, header.end_time, header.uncompressed_size,
             header.uncompressed_crc);
  append_string(out, header.compression);
  append_all(out, header.records_size);
}

void append_footer(Bytes& out, std::span<const std::uint8_t> summary, const Footer& footer) {
  const std::size_t start = out.size();
  const RecordScope record(out, Op::kFooter);
  append_all(out, footer.summary_start, footer.summary_offset_start);
  // The CRC covers the record's own length, which the scope has not written yet.
  put(out, start + 1, static_cast<std::uint64_t>(kFooterBytes - kRecordHeaderBytes));
  append_all(out, crc32(std::span(out).subspan(start), crc32(summary)));
}

std::optional<Schema> read_schema(std::span<const std::uint8_t> content) {
  ByteReader reader(content);
  Schema schema;
  schema.id = reader.read<std::uint16_t>();
  schema.name = reader.read_string();
  schema.encoding = reader.read_string();
  schema.data = reader.read_string();
  return if_ok(reader, std::move(schema));
}

std::optional<Channel> read_channel(std::span<const std::uint8_t> content) {
  ByteReader reader(content);
  Channel channel;
  channel.id = reader.read<std::uint16_t>();
  channel.schema_id = reader.read<std::uint16_t>();
  channel.topic = reader.read_string();
  channel.message_encoding = reader.read_string();
  ByteReader map(reader.take(reader.read<std::uint32_t>()));
  while (map.ok() && map.remaining() > 0) {
    std::string key = map.read_string();
    std::string value = map.read_string();
    if (map.ok()) channel.metadata.emplace_back(std::move(key), std::move(value));
  }
  if (!map.ok()) return std::nullopt;
  return if_ok(reader, std::move(channel));
}

std::optional<ChunkIndex> read_chunk_index(std::span<const std::uint8_t> content) {
  ByteReader reader(content);
  ChunkIndex index;
  index.start_time = reader.read<std::uint64_t>();
  index.end_time = reader.read<std::uint64_t>();
  index.offset = reader.read<std::uint64_t>();
  index.length = reader.read<std::uint64_t>();
  index.message_index_offsets = read_map<std::uint16_t, std::uint64_t>(reader);
  index.message_index_length = reader.read<std::uint64_t>();
  index.compression = reader.read_string();
  index.compressed_size = reader.read<std::uint64_t>();
  index.uncompressed_size = reader.read<std::uint64_t>();
  return if_ok(reader, std::move(index));
}

std::optional<AttachmentIndex> read_attachment_index(std::span<const std::uint8_t> content) {
  ByteReader reader(content);
  AttachmentIndex index;
  index.offset = reader.read<std::uint64_t>();
  index.length = reader.read<std::uint64_t>();
  index.log_time = reader.read<std::uint64_t>();
  index.create_time = reader.read<std::uint64_t>();
  index.data_size = reader.read<std::uint64_t>();
  index.name = reader.read_string();
  index.media_type = reader.read_string();
  return if_ok(reader, std::move(index));
}

std::optional<Attachment> read_attachment(std::span<const std::uint8_t> content) {
  ByteReader reader(content);
  Attachment attachment;
  attachment.log_time = reader.read<std::uint64_t>();
  attachment.create_time = reader.read<std::uint64_t>();
  attachment.name = reader.read_string();
  attachment.media_type = reader.read_string();
  attachment.data = reader.take(reader.read<std::uint64_t>());
  const std::size_t covered = reader.position();
  const auto crc = reader.read<std::uint32_t>();
  if (!reader.ok() || (crc != 0 && crc != crc32(content.first(covered)))) return std::nullopt;
  return attachment;
}

std::optional<Statistics> read_statistics(std::span<const std::uint8_t> content) {
  ByteReader reader(content);
  Statistics statistics;
  statistics.messages = reader.read<std::uint64_t>();
  statistics.schemas = reader.read<std::uint16_t>();
  statistics.channels = reader.read<std::uint32_t>();
  statistics.attachments = reader.read<std::uint32_t>();
  statistics.metadata = reader.read<std::uint32_t>();
  statistics.chunks = reader.read<std::uint32_t>();
  statistics.start_time = reader.read<std::uint64_t>();
  statistics.end_time = reader.read<std::uint64_t>();
  statistics.channel_messages = read_map<std::uint16_t, std::uint64_t>(reader);
  return if_ok(reader, std::move(statistics));
}

std::optional<Footer> read_footer(std::span<const std::uint8_t> content) {
  ByteReader reader(content);
  Footer footer;
  footer.summary_start = reader.read<std::uint64_t>();
  footer.summary_offset_start = reader.read<std::uint64_t>();
  footer.summary_crc = reader.read<std::uint32_t>();
  return if_ok(reader, std::move(footer));
}

std::optional<std::pair<ChunkHeader, std::size_t>> read_chunk_header(std::span<const std::uint8_t> content) {
  ByteReader reader(content);
  ChunkHeader header;
  header.start_time = reader.read<std::uint64_t>();
  header.end_time = reader.read<std::uint64_t>();
  header.uncompressed_size = reader.read<std::uint64_t>();
  header.uncompressed_crc = reader.read<std::uint32_t>();
  header.compression = reader.read_string();
  header.records_size = reader.read<std::uint64_t>();
  return if_ok(reader, std::pair(std::move(header), reader.position()));
}

std::optional<std::pair<Message, std::span<const std::uint8_t>>> read_message(
    std::span<const std::uint8_t> content) {
  ByteReader reader(content);
  Message message;
  message.channel_id = reader.read<std::uint16_t>();
  message.sequence = reader.read<std::uint32_t>();
  message.log_time = reader.read<std::uint64_t>();
  message.publish_time = reader.read<std::uint64_t>();
  return if_ok(reader, std::pair(message, content.subspan(reader.position())));
}

std::optional<Record> take_record(std::span<const std::uint8_t>& bytes) {
  ByteReader reader(bytes);
  Record record;
  record.op = static_cast<Op>(reader.read<std::uint8_t>());
  record.content = reader.take(reader.read<std::uint64_t>());
  if (!reader.ok()) return std::nullopt;
  bytes = bytes.subspan(reader.position());
  return record;
}

std::uint32_t crc32(std::span<const std::uint8_t> bytes, std::uint32_t crc) {
  return static_cast<std::uint32_t>(::crc32_z(crc, bytes.data(), bytes.size()));
}

}  // namespace relievo::mcap
