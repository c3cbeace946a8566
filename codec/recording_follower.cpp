// SPDX-License-Identifier: Apache-2.0
#include "codec/recording_follower.h"

#include <algorithm>
#include <utility>

#include "codec/byte_io.h"
#include "codec/mcap_scan.h"

namespace relievo {
namespace {

constexpr std::uint64_t kLeastIndexBytes = 2 + 4;  // of a message index: channel, bytes of its entries
constexpr std::uint64_t kChunkHeadBytes = mcap::kRecordHeaderBytes + 3 * 8 + 4;  // two times, size, CRC

}  // namespace

Result<RecordingFollower::Found> RecordingFollower::look() {
  const auto file = mcap::File::open(file_, stop_);
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
    const auto record = mcap::read_record_place(**file, at_);
    if (!record || record->length > mcap::kMaxChunkBytes) return damaged();
    if (record->end() > size) {  // its rest is yet to come, or never does
      if (record->op != mcap::Op::kMessageIndex) commit();
      break;
    }
    if (const Status taken = take(*record, **file); !taken) return damaged();
    at_ = record->end();
  }
  finished_ = has_footer_ && size - at_ >= mcap::kMagic.size();
  if (finished_) return Found::kFinished;
  return index_->bytes() > before ? Found::kMore : Found::kNothing;
}

bool RecordingFollower::is_there(const ChunkHead& head, const mcap::File& file) {
  const auto now = file.read(head.at, head.bytes.size());
  return now && *now == head.bytes;
}

Status RecordingFollower::take(const mcap::RecordPlace& record, const mcap::File& file) {
  const mcap::Op op = record.op;
  const auto added = [&](const auto& read) -> Status {
    if (!read) return Error{"malformed"};
    index_->add(*read, record.end());
    return {};
  };
  if (op != mcap::Op::kMessageIndex) commit();
  behind_data_ = behind_data_ || op == mcap::Op::kDataEnd;
  has_footer_ = op == mcap::Op::kFooter;
  if (behind_data_) return {};  // what it says of the data again
  if (op == mcap::Op::kSchema || op == mcap::Op::kChannel || op == mcap::Op::kAttachment) {
    const auto bytes = mcap::read_small_content(file, record);
    if (!bytes) return bytes.error();
    if (op == mcap::Op::kSchema) return added(mcap::read_schema(*bytes));
    if (op == mcap::Op::kChannel) return added(mcap::read_channel(*bytes));
    const auto attachment = mcap::read_attachment(*bytes);
    if (!attachment) return Error{"malformed"};
    index_->add({record.offset, record.end() - record.offset, attachment->log_time, attachment->create_time,
                 attachment->data.size(), attachment->name, attachment->media_type});
  } else if (op == mcap::Op::kChunk) {
    chunk_ = mcap::read_chunk_place(file, record);
    if (!chunk_) return Error{"malformed"};
    auto head = file.read(chunk_->offset, std::min(kChunkHeadBytes, chunk_->length));
    if (!head) return head.error();
    last_ = {chunk_->offset, *std::move(head)};
    if (first_.bytes.empty()) first_ = last_;
  } else if (op == mcap::Op::kMessageIndex && chunk_) {
    const auto channel = file.read(record.content(), sizeof(std::uint16_t));
    if (!channel || record.length < kLeastIndexBytes) return Error{"malformed"};
    chunk_->message_index_offsets.emplace_back(ByteReader(*channel).read<std::uint16_t>(), record.offset);
    chunk_->message_index_length += record.end() - record.offset;
  }
  return {};
}

void RecordingFollower::commit() {
  if (chunk_) index_->add(*std::exchange(chunk_, {}));
}

}  // namespace relievo
