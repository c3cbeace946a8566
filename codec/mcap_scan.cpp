// SPDX-License-Identifier: Apache-2.0
#include "codec/mcap_scan.h"

#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <map>
#include <optional>
#include <system_error>
#include <utility>

#include "base/whole_file.h"
#include "codec/byte_io.h"
#include "codec/chunk_compression.h"
#include "codec/mcap_walk.h"

namespace relievo::mcap {
namespace {

constexpr std::uint64_t kMaxSummaryBytes = 256u << 20;
constexpr std::uint64_t kMaxSmallRecordBytes = 64u << 20;
constexpr std::uint64_t kMostHeaderBytes = 256;  // of a chunk, before its records

/// From the summary at the file's end; nothing where there is none or any byte of it is wrong.
std::optional<Contents> read_index(const File& file) {
  if (file.size() < 2 * kMagic.size() + kFooterBytes) return std::nullopt;
  const std::uint64_t footer_at = file.size() - kMagic.size() - kFooterBytes;
  const auto end = file.read(footer_at, kFooterBytes + kMagic.size());
  if (!end || !std::equal(kMagic.begin(), kMagic.end(), end->end() - kMagic.size())) return std::nullopt;
  std::span<const std::uint8_t> end_bytes(*end);
  const auto footer_record = take_record(end_bytes);
  if (!footer_record || footer_record->op != Op::kFooter) return std::nullopt;
  const auto footer = read_footer(footer_record->content);
  if (!footer || footer->summary_start == 0 || footer->summary_start > footer_at ||
      footer_at - footer->summary_start > kMaxSummaryBytes)
    return std::nullopt;
  const auto summary = file.read(footer->summary_start, footer_at - footer->summary_start);
  if (!summary) return std::nullopt;
  const auto footer_covered = std::span(*end).first(kFooterBytes - sizeof(footer->summary_crc));
  if (footer->summary_crc != 0 && crc32(footer_covered, crc32(*summary)) != footer->summary_crc)
    return std::nullopt;

  Contents contents;
  bool has_statistics = false;
  std::span<const std::uint8_t> rest(*summary);
  while (!rest.empty()) {
    const auto record = take_record(rest);
    if (!record) return std::nullopt;
    bool ok = true;
    if (record->op == Op::kSchema) {
      ok = contents.add(read_schema(record->content));
    } else if (record->op == Op::kChannel) {
      ok = contents.add(read_channel(record->content));
    } else if (record->op == Op::kChunkIndex) {
      auto index = read_chunk_index(record->content);
      ok = index.has_value();
      if (ok) contents.chunks.push_back(std::move(*index));
    } else if (record->op == Op::kAttachmentIndex) {
      auto index = read_attachment_index(record->content);
      ok = index.has_value();
      if (ok) contents.attachments.push_back(std::move(*index));
    } else if (record->op == Op::kStatistics) {
      auto statistics = read_statistics(record->content);
      ok = has_statistics = statistics.has_value();
      if (ok) contents.statistics = std::move(*statistics);
    }
    if (!ok) return std::nullopt;
  }
  // Without these a reader could not tell what the file holds: go through it.
  const Statistics& statistics = contents.statistics;
  const auto is_known = [&](const auto& of) { return contents.channels.contains(of.first); };
  if (!has_statistics || statistics.chunks != contents.chunks.size()) return std::nullopt;
  if (statistics.messages > 0 && (contents.chunks.empty() || statistics.channel_messages.empty()))
    return std::nullopt;
  if (!std::ranges::all_of(statistics.channel_messages, is_known)) return std::nullopt;
  return contents;
}

/// Of a file whose first bytes are wrong: it may never have been a recording.
Result<std::vector<Contents>> walk_damaged_start(const File& file) {
  auto found = walk_records(file, ReadChunks::kAll);
  if (found && std::ranges::all_of(*found, [](const Contents& c) { return c.chunks.empty(); }))
    return Error{file.name() + " is not a recording: it does not start as an MCAP file does, nor is a part " +
                 "of one in it"};
  return found;
}

}  // namespace

std::optional<RecordPlace> read_record_place(const File& file, std::uint64_t offset) {
  const auto head = file.read(offset, kRecordHeaderBytes);
  if (!head) return std::nullopt;
  ByteReader reader(*head);
  RecordPlace place{.op = static_cast<Op>(reader.read<std::uint8_t>()), .offset = offset};
  place.length = reader.read<std::uint64_t>();
  if (static_cast<int>(place.op) == 0) return std::nullopt;  // zeros that a power loss left
  if (place.end() < place.content()) return std::nullopt;
  return place;
}

Result<Bytes> read_small_content(const File& file, const RecordPlace& record) {
  if (record.length > kMaxSmallRecordBytes) return Error{"too large"};
  return file.read(record.content(), record.length);
}

std::optional<ChunkIndex> read_chunk_place(const File& file, const RecordPlace& chunk) {
  const auto start = file.read(chunk.content(), std::min(chunk.length, kMostHeaderBytes));
  if (!start) return std::nullopt;
  const auto header = read_chunk_header(*start);
  if (!header || header->first.records_size > chunk.length ||
      header->second > chunk.length - header->first.records_size)
    return std::nullopt;
  return ChunkIndex{.start_time = header->first.start_time,
                    .end_time = header->first.end_time,
                    .offset = chunk.offset,
                    .length = kRecordHeaderBytes + chunk.length,
                    .message_index_offsets = {},
                    .message_index_length = 0,
                    .compression = header->first.compression,
                    .compressed_size = header->first.records_size,
                    .uncompressed_size = header->first.uncompressed_size};
}

/// The first one of an id counts; the specification has all of an id equal.
bool Contents::add(const std::optional<Schema>& schema) {
  if (schema && schema->id != 0) schemas.try_emplace(schema->id, *schema);
  return schema.has_value();
}

bool Contents::add(const std::optional<Channel>& channel) {
  if (channel) channels.try_emplace(channel->id, *channel);
  return channel.has_value();
}

Result<std::unique_ptr<File>> File::open(const std::filesystem::path& path, const std::atomic<bool>* stop) {
  const auto handle = open_file_to_read(path);
  if (!handle) return handle.error();
  struct stat info {};
  if (::fstat(*handle, &info) != 0) {
    ::close(*handle);
    return Error{"cannot read " + path.string() + ": " + std::generic_category().message(errno)};
  }
  return std::unique_ptr<File>(
      new File(*handle, path.string(), static_cast<std::uint64_t>(info.st_size), stop));
}

File::~File() {
  ::close(handle_);
}

Result<Bytes> File::read(std::uint64_t offset, std::uint64_t length) const {
  if (offset > size_ || length > size_ - offset)
    return Error{"bytes " + std::to_string(offset) + " to " + std::to_string(offset) + " + " +
                 std::to_string(length) + " are behind the end of the file"};
  if (stop_ != nullptr && *stop_) return Error{"reading " + name_ + " was stopped"};
  Bytes bytes(static_cast<std::size_t>(length));
  std::size_t done = 0;
  while (done < bytes.size()) {
    const ssize_t got =
        ::pread(handle_, bytes.data() + done, bytes.size() - done, static_cast<off_t>(offset + done));
    if (got < 0 && errno == EINTR) continue;
    if (got < 0) return Error{"cannot read " + name_ + ": " + std::generic_category().message(errno)};
    if (got == 0) return Error{name_ + " became shorter while it was read"};
    done += static_cast<std::size_t>(got);
  }
  bytes_read_ += length;
  return bytes;
}

Result<std::vector<Contents>> read_contents(const File& file, ReadContents how) {
  const std::uint64_t start_bytes = std::min<std::uint64_t>(file.size(), kMagic.size());
  const auto magic = file.read(0, start_bytes);
  if (!magic) return magic.error();
  if (!std::equal(magic->begin(), magic->end(), kMagic.begin())) {
    if (how == ReadContents::kByWalking) return walk_damaged_start(file);
    return Error{file.name() + " is not a recording: it does not start as an MCAP file does; where it was " +
                 "one, `relievo recover` may find what is whole"};
  }
  if (file.size() < kMagic.size()) {
    Contents nothing;
    nothing.recovered = true;
    if (file.size() > 0) nothing.gaps.push_back({0, file.size()});
    return std::vector{std::move(nothing)};
  }
  if (how == ReadContents::kByIndex) {
    if (auto contents = read_index(file)) return std::vector{std::move(*contents)};
  }
  return walk_records(file, how == ReadContents::kByIndex ? ReadChunks::kWhereNeeded : ReadChunks::kAll);
}

Result<Bytes> read_chunk_records(const File& file, const ChunkIndex& chunk) {
  if (chunk.length > kMaxChunkBytes)
    return Error{"its " + std::to_string(chunk.length) + " bytes are more than the limit of " +
                 std::to_string(kMaxChunkBytes)};
  auto bytes = file.read(chunk.offset, chunk.length);
  if (!bytes) return bytes.error();
  std::span<const std::uint8_t> rest(*bytes);
  const auto record = take_record(rest);
  if (!record || record->op != Op::kChunk || !rest.empty()) return Error{"no chunk is there"};
  const auto header = read_chunk_header(record->content);
  if (!header || header->first.records_size > record->content.size() - header->second)
    return Error{"its header is malformed"};
  const std::uint64_t size = header->first.uncompressed_size;
  if (size > kMaxChunkBytes)
    return Error{"its records of " + std::to_string(size) + " bytes are more than the limit of " +
                 std::to_string(kMaxChunkBytes)};
  auto records = decompress(
      header->first.compression,
      record->content.subspan(header->second, static_cast<std::size_t>(header->first.records_size)), size);
  if (!records) return records;
  if (header->first.uncompressed_crc != 0 && header->first.uncompressed_crc != crc32(*records))
    return Error{"its CRC is wrong"};
  return records;
}

}  // namespace relievo::mcap
