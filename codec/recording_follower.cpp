// SPDX-License-Identifier: Apache-2.0
#include "codec/recording_follower.h"

#include <algorithm>
#include <utility>

#include "codec/byte_io.h"
#include "codec/mcap_scan.h"

namespace relievo {
namespace {

constexpr std::uint64_t kMaxSmallRecordBytes = 64u << 20;  // schemas, channels, attachments
constexpr std::uint64_t kMostHeaderBytes = 256;            // of a chunk, before its records
constexpr std::uint64_t kIndexHeadBytes = 2 + 4;  // of a message index: channel, bytes of its entries
constexpr std::uint64_t kChunkHeadBytes = mcap::kRecordHeaderBytes + 3 * 8 + 4;  // two times, size, CRC

}  // namespace

Result<RecordingFollower::Found> RecordingFollower::look() {
  const auto file = mcap::File::open(file_);
  if (!file) return finished_ ? Result<Found>(Found::kFinished) : file.error();
  const std::uint64_t size = (*file)->size();
  if (size >= at_ && !(is_there(first_, **file) && is_there(last_, **file))) return Found::kAnother;
  if (finished_) return Found::kFinished;
  const auto damaged = [&] {
    return Error{file_.string() + ": what is being written is damaged at byte " + std::to_string(at_)};
  };
  if (size < at_) return damaged();
  const std::uint64_t before = index_->bytes();
  if (std::exchange(size_, size) == size && at_ == size && chunk_ && chunk_->message_index_length > 0)
    commit();
  if (at_ == 0 && size >= mcap::kMagic.size()) {
    const auto magic = (*file)->read(0, mcap::kMagic.size());
    if (!magic) return magic.error();
    if (!std::ranges::equal(*magic, mcap::kMagic)) return damaged();
    at_ = mcap::kMagic.size();
  }
  while (at_ > 0 && !has_footer_ && size - at_ >= mcap::kRecordHeaderBytes) {
    const auto head = (*file)->read(at_, mcap::kRecordHeaderBytes);
    if (!head) return head.error();
    ByteReader reader(*head);
    const auto op = static_cast<mcap::Op>(reader.read<std::uint8_t>());
    const auto length = reader.read<std::uint64_t>();
    const std::uint64_t content = at_ + mcap::kRecordHeaderBytes;
    if (static_cast<int>(op) == 0 || length > mcap::kMaxChunkBytes) return damaged();
    if (length > size - content) {  // its rest is yet to come, or never does
      if (op != mcap::Op::kMessageIndex) commit();
      break;
    }
    if (const Status taken = take(op, content, length, **file); !taken) return damaged();
    at_ = content + length;
  }
  finished_ = has_footer_ && size - at_ >= mcap::kMagic.size();
  if (finished_) return Found::kFinished;
  return index_->bytes() > before ? Found::kMore : Found::kNothing;
}

bool RecordingFollower::is_there(const ChunkHead& head, const mcap::File& file) {
  const auto now = file.read(head.at, head.bytes.size());
  return now && *now == head.bytes;
}

Status RecordingFollower::take(mcap::Op op, std::uint64_t content, std::uint64_t length,
                               const mcap::File& file) {
  const std::uint64_t end = content + length;
  const auto read = [&](std::uint64_t limit) { return file.read(content, std::min(length, limit)); };
  const auto added = [&](const auto& record) -> Status {
    if (!record) return Error{"malformed"};
    index_->add(*record, end);
    return {};
  };
  if (op != mcap::Op::kMessageIndex) commit();
  behind_data_ = behind_data_ || op == mcap::Op::kDataEnd;
  has_footer_ = op == mcap::Op::kFooter;
  if (behind_data_) return {};  // what it says of the data again
  if (op == mcap::Op::kSchema || op == mcap::Op::kChannel || op == mcap::Op::kAttachment) {
    const auto bytes = length > kMaxSmallRecordBytes ? Result<Bytes>(Error{"too large"}) : read(length);
    if (!bytes) return bytes.error();
    if (op == mcap::Op::kSchema) return added(mcap::read_schema(*bytes));
    if (op == mcap::Op::kChannel) return added(mcap::read_channel(*bytes));
    const auto attachment = mcap::read_attachment(*bytes);
    if (!attachment) return Error{"malformed"};
    index_->add({content - mcap::kRecordHeaderBytes, mcap::kRecordHeaderBytes + length, attachment->log_time,
                 attachment->create_time, attachment->data.size(), attachment->name, attachment->media_type});
  } else if (op == mcap::Op::kChunk) {
    const auto start = read(kMostHeaderBytes);
    if (!start) return start.error();
    const auto header = mcap::read_chunk_header(*start);
    if (!header || header->first.records_size > length) return Error{"malformed"};
    chunk_ = {.start_time = header->first.start_time,
              .end_time = header->first.end_time,
              .offset = content - mcap::kRecordHeaderBytes,
              .length = mcap::kRecordHeaderBytes + length,
              .message_index_offsets = {},
              .message_index_length = 0,
              .compression = header->first.compression,
              .compressed_size = header->first.records_size,
              .uncompressed_size = header->first.uncompressed_size};
    auto head = file.read(chunk_->offset, std::min(kChunkHeadBytes, chunk_->length));
    if (!head) return head.error();
    last_ = {chunk_->offset, *std::move(head)};
    if (first_.bytes.empty()) first_ = last_;
  } else if (op == mcap::Op::kMessageIndex && chunk_) {
    const auto start = read(kIndexHeadBytes);
    if (!start || start->size() < kIndexHeadBytes) return Error{"malformed"};
    ByteReader reader(*start);
    chunk_->message_index_offsets.emplace_back(reader.read<std::uint16_t>(),
                                               content - mcap::kRecordHeaderBytes);
    chunk_->message_index_length += mcap::kRecordHeaderBytes + length;
  }
  return {};
}

void RecordingFollower::commit() {
  if (chunk_) index_->add(*std::exchange(chunk_, {}));
}

}  // namespace relievo
