// SPDX-License-Identifier: Apache-2.0
// The records of an MCAP file (https://mcap.dev/spec), written and read side by side.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "base/stream.h"

namespace relievo::mcap {

constexpr std::array<std::uint8_t, 8> kMagic{0x89, 'M', 'C', 'A', 'P', 0x30, '\r', '\n'};
constexpr std::size_t kRecordHeaderBytes = 9;  // opcode, u64 length
constexpr std::size_t kFooterBytes = kRecordHeaderBytes + 20;
constexpr std::uint64_t kMaxChunkBytes = 1u << 30;  // neither written nor read above

enum class Op : std::uint8_t {
  kHeader = 0x01,
  kFooter = 0x02,
  kSchema = 0x03,
  kChannel = 0x04,
  kMessage = 0x05,
  kChunk = 0x06,
  kMessageIndex = 0x07,
  kChunkIndex = 0x08,
  kAttachment = 0x09,
  kAttachmentIndex = 0x0a,
  kStatistics = 0x0b,
  kSummaryOffset = 0x0e,
  kDataEnd = 0x0f,
};

struct Schema {
  std::uint16_t id = 0;
  std::string name;
  std::string encoding;
  std::string data;
};

struct Channel {
  std::uint16_t id = 0;
  std::uint16_t schema_id = 0;
  std::string topic;
  std::string message_encoding;
  std::vector<std::pair<std::string, std::string>> metadata;
};

/// Without its data, which follows.
struct Message {
  std::uint16_t channel_id = 0;
  std::uint32_t sequence = 0;
  std::uint64_t log_time = 0;
  std::uint64_t publish_time = 0;
};

/// The fields of a chunk before its records.
struct ChunkHeader {
  std::uint64_t start_time = 0;
  std::uint64_t end_time = 0;
  std::uint64_t uncompressed_size = 0;
  std::uint32_t uncompressed_crc = 0;
  std::string compression;
  std::uint64_t records_size = 0;
};

struct MessageIndex {
  std::uint16_t channel_id = 0;
  std::vector<std::pair<std::uint64_t, std::uint64_t>> entries;  // log time, offset in the chunk's records
};

struct ChunkIndex {
  std::uint64_t start_time = 0;
  std::uint64_t end_time = 0;
  std::uint64_t offset = 0;
  std::uint64_t length = 0;
  std::vector<std::pair<std::uint16_t, std::uint64_t>> message_index_offsets;
  std::uint64_t message_index_length = 0;
  std::string compression;
  std::uint64_t compressed_size = 0;
  std::uint64_t uncompressed_size = 0;
};

struct Attachment {
  std::uint64_t log_time = 0;
  std::uint64_t create_time = 0;
  std::string name;
  std::string media_type;
  std::span<const std::uint8_t> data;  // of the caller, or of the record read
};

struct AttachmentIndex {
  std::uint64_t offset = 0;
  std::uint64_t length = 0;
  std::uint64_t log_time = 0;
  std::uint64_t create_time = 0;
  std::uint64_t data_size = 0;
  std::string name;
  std::string media_type;
};

struct Statistics {
  std::uint64_t messages = 0;
  std::uint16_t schemas = 0;
  std::uint32_t channels = 0;
  std::uint32_t attachments = 0;
  std::uint32_t metadata = 0;
  std::uint32_t chunks = 0;
  std::uint64_t start_time = 0;
  std::uint64_t end_time = 0;
  std::vector<std::pair<std::uint16_t, std::uint64_t>> channel_messages;
};

struct Footer {
  std::uint64_t summary_start = 0;
  std::uint64_t summary_offset_start = 0;
  std::uint32_t summary_crc = 0;
};

/// Each appends one whole record.
void append_header(Bytes& out, const std::string& profile, const std::string& library);
void append(Bytes& out, const Schema& schema);
void append(Bytes& out, const Channel& channel);
void append(Bytes& out, const Message& message, std::span<const std::uint8_t> data);
void append(Bytes& out, const MessageIndex& index);
void append(Bytes& out, const ChunkIndex& index);
void append(Bytes& out, const Attachment& attachment);  // with its CRC
void append(Bytes& out, const AttachmentIndex& index);
void append(Bytes& out, const Statistics& statistics);
void append_summary_offset(Bytes& out, Op group, std::uint64_t start, std::uint64_t length);
void append_data_end(Bytes& out, std::uint32_t data_crc);
/// A chunk record up to its records.
void append_chunk_header(Bytes& out, const ChunkHeader& header);
/// A footer record; its CRC covers `summary` (all of both summary sections) and the footer itself.
void append_footer(Bytes& out, std::span<const std::uint8_t> summary, const Footer& footer);

/// Each reads the content of one record (behind opcode and length); nothing where it is malformed.
std::optional<Schema> read_schema(std::span<const std::uint8_t> content);
std::optional<Channel> read_channel(std::span<const std::uint8_t> content);
std::optional<ChunkIndex> read_chunk_index(std::span<const std::uint8_t> content);
std::optional<AttachmentIndex> read_attachment_index(std::span<const std::uint8_t> content);
std::optional<Attachment> read_attachment(std::span<const std::uint8_t> content);  // fails on a wrong CRC
std::optional<Statistics> read_statistics(std::span<const std::uint8_t> content);
std::optional<Footer> read_footer(std::span<const std::uint8_t> content);
/// The header, and how many bytes it takes before the records begin.
std::optional<std::pair<ChunkHeader, std::size_t>> read_chunk_header(std::span<const std::uint8_t> content);
std::optional<std::pair<Message, std::span<const std::uint8_t>>> read_message(
    std::span<const std::uint8_t> content);

struct Record {
  Op op{};
  std::span<const std::uint8_t> content;
};
/// Takes the next record off `bytes`; nothing where it is cut short.
std::optional<Record> take_record(std::span<const std::uint8_t>& bytes);

/// CRC-32 (zlib's) of `bytes` behind what `crc` covers already.
std::uint32_t crc32(std::span<const std::uint8_t> bytes, std::uint32_t crc = 0);

}  // namespace relievo::mcap
