// SPDX-License-Identifier: Apache-2.0
#include "codec/mcap_walk.h"

#include <algorithm>
#include <map>
#include <optional>
#include <utility>

#include "codec/byte_io.h"
#include "codec/mcap_message_index.h"

namespace relievo::mcap {
namespace {

constexpr std::uint64_t kWindowBytes = 1u << 20;  // read at once while looking for a record
constexpr std::size_t kMostRecordings = 4096;     // that a file may be joined of

class Walk {
 public:
  Walk(const File& file, ReadChunks which) : file_(file), which_(which), effort_left_(4 * file.size()) {}

  Result<std::vector<Contents>> run() {
    std::uint64_t at = skip_magic();
    while (at < file_.size()) {
      const auto record = ended_ ? std::nullopt : record_at(at);
      loose_messages_ = loose_messages_ || (record && record->op == Op::kMessage);
      if (record && add(*record)) {
        at = record->end();
        if (record->op == Op::kFooter) at = end_at(at);
        continue;
      }
      if (begins_at(at) && done_.size() + 1 < kMostRecordings) {
        finish();
        at += kMagic.size();
        continue;
      }
      const std::uint64_t next = find_next(at + 1);
      contents_.gaps.push_back({at, next - at});
      ended_ = false;
      at = next;
    }
    finish();
    if (done_.size() == 1) done_[0].recovered = done_[0].recovered || !plain_end_;
    const auto has_chunks = [](const Contents& contents) { return !contents.chunks.empty(); };
    if (loose_messages_ && std::ranges::none_of(done_, has_chunks))
      return Error{
          file_.name() +
          ": its messages lie outside of chunks, where they are not read: `mcap compress` of MCAP's own " +
          "tools puts them into some"};
    return std::move(done_);
  }

 private:
  /// Nothing where the file does not hold all of it.
  std::optional<RecordPlace> record_at(std::uint64_t at) const {
    const auto record = read_record_place(file_, at);
    return record && record->end() <= file_.size() ? record : std::nullopt;
  }

  /// The file's first bytes, where they or what follows them is as it should be. Returns where that is.
  std::uint64_t skip_magic() {
    const auto magic = file_.read(0, kMagic.size());
    if (magic && std::ranges::equal(*magic, kMagic)) return kMagic.size();
    const auto header = magic ? record_at(kMagic.size()) : std::nullopt;
    if (!header || header->op != Op::kHeader || !goes_on_at(header->end())) return 0;
    contents_.gaps.push_back({0, kMagic.size()});
    return kMagic.size();
  }

  /// Of a recording whose footer ends at `at`: where it ends itself.
  std::uint64_t end_at(std::uint64_t at) {
    const auto magic = file_.read(at, kMagic.size());
    ended_ = magic && std::equal(kMagic.begin(), kMagic.end(), magic->begin());
    return ended_ ? at + kMagic.size() : at;
  }

  /// Whether a recording begins at `at`: a file's first bytes and a header.
  bool begins_at(std::uint64_t at) const {
    const auto magic = file_.read(at, kMagic.size());
    if (!magic || !std::equal(kMagic.begin(), kMagic.end(), magic->begin())) return false;
    const auto header = record_at(at + kMagic.size());
    return header && header->op == Op::kHeader;
  }

  /// What was read of one recording is all of it.
  void finish() {
    contents_.recovered = !ended_ || !contents_.gaps.empty();
    for (const auto& [id, count] : counts_) contents_.statistics.channel_messages.emplace_back(id, count);
    contents_.statistics.chunks = static_cast<std::uint32_t>(contents_.chunks.size());
    done_.push_back(std::exchange(contents_, {}));
    counts_.clear();
    ended_ = behind_data_ = false;
  }

  /// True where a record or a recording could begin at `at`, or the file ends there.
  bool goes_on_at(std::uint64_t at) const {
    const auto next = record_at(at);
    return at == file_.size() || (next && next->op <= Op::kDataEnd) || begins_at(at);
  }

  /// False where the record, or its length, cannot be.
  bool add(const RecordPlace& record) {
    switch (record.op) {
      case Op::kChunk:
        return add_chunk(record);
      case Op::kAttachment:
        return goes_on_at(record.end()) && (behind_data_ || add_attachment(record));
      case Op::kSchema:
      case Op::kChannel: {
        const auto content = read_small_content(file_, record);
        if (!content) return false;
        const bool read = record.op == Op::kSchema ? contents_.add(read_schema(*content))
                                                   : contents_.add(read_channel(*content));
        return read && goes_on_at(record.end());
      }
      case Op::kFooter: {
        const auto content = read_small_content(file_, record);
        const auto footer = content ? read_footer(*content) : std::nullopt;
        // A footer that points to a summary means that the summary was there, but not as it should be.
        plain_end_ = footer && footer->summary_start == 0;
        return footer.has_value();
      }
      case Op::kMessage:  // in our files, a chunk or an attachment whose first byte was changed
        return false;
      case Op::kMessageIndex: {
        const auto head = file_.read(record.content(), std::min<std::uint64_t>(record.length, 6));
        ByteReader reader(head ? std::span<const std::uint8_t>(*head) : std::span<const std::uint8_t>());
        reader.read<std::uint16_t>();
        const auto entries_bytes = reader.read<std::uint32_t>();
        return reader.ok() && record.length == reader.position() + entries_bytes;
      }
      case Op::kDataEnd:
        behind_data_ = true;
        return true;
      default:
        return goes_on_at(record.end());
    }
  }

  bool add_chunk(const RecordPlace& record) {
    auto chunk = read_chunk_place(file_, record);
    if (!chunk) return false;
    const bool by_index = which_ == ReadChunks::kWhereNeeded && chunk->compression.empty();
    if (const auto places = by_index ? add_index(*chunk) : std::nullopt) {
      for (const MessagePlace& place : *places) count(place.channel_id, place.log_time);
    } else if (const auto records = read_chunk_records(file_, *chunk)) {
      const std::uint64_t before = contents_.statistics.messages;
      count(*records, *chunk);
      // Others' files say within what their channels are.
      ChunkIndex with_index = *chunk;
      const auto of_it = by_index ? add_index(with_index) : std::nullopt;
      if (of_it && of_it->size() == contents_.statistics.messages - before) chunk = std::move(with_index);
    } else if (!goes_on_at(record.end())) {
      return false;  // its length is wrong too, it may reach over others
    }
    contents_.chunks.push_back(std::move(*chunk));
    return true;
  }

  /// The message indexes behind the chunk, and what they say of it, its own bytes unread. Nothing where they
  /// are not all there, or the chunk says otherwise of its times (no CRC is over either), or where a channel
  /// is not known.
  std::optional<std::vector<MessagePlace>> add_index(ChunkIndex& chunk) {
    ChunkIndex with_index = chunk;
    const std::uint64_t begin = chunk.offset + chunk.length;
    std::uint64_t at = begin;
    auto next = record_at(at);
    for (; next && next->op == Op::kMessageIndex; next = record_at(at)) {
      const auto channel = file_.read(next->content(), std::min<std::uint64_t>(next->length, 2));
      if (!channel || channel->size() < 2) return std::nullopt;
      with_index.message_index_offsets.emplace_back(ByteReader(*channel).read<std::uint16_t>(), at);
      at = next->end();
    }
    if (!next || next->op > Op::kDataEnd || at == begin) return std::nullopt;
    with_index.message_index_length = at - begin;
    auto places = read_message_places(file_, with_index);
    if (!places || places->empty() || places->front().log_time != chunk.start_time ||
        places->back().log_time != chunk.end_time ||
        !std::ranges::all_of(*places, [&](const MessagePlace& place) {
          return contents_.channels.contains(place.channel_id);
        }))
      return std::nullopt;
    chunk = std::move(with_index);
    return *std::move(places);
  }

  void count(std::uint16_t channel, std::uint64_t log_time) {
    Statistics& statistics = contents_.statistics;
    statistics.start_time = statistics.messages == 0 ? log_time : std::min(statistics.start_time, log_time);
    statistics.end_time = std::max(statistics.end_time, log_time);
    ++statistics.messages;
    ++counts_[channel];
  }

  bool add_attachment(const RecordPlace& record) {
    // Its data may be large; the name is all that is wanted here.
    const auto start = file_.read(record.content(), std::min<std::uint64_t>(record.length, 4096));
    if (!start) return false;
    ByteReader reader(*start);
    reader.take(16);
    AttachmentIndex index;
    index.offset = record.offset;
    index.length = kRecordHeaderBytes + record.length;
    index.name = reader.read_string();
    if (!reader.ok()) return false;
    contents_.attachments.push_back(std::move(index));
    return true;
  }

  /// The chunk's times become those of its messages: no CRC is over what it says of them itself.
  void count(std::span<const std::uint8_t> records, ChunkIndex& chunk) {
    bool is_first = true;
    while (!records.empty()) {
      const auto record = take_record(records);
      if (!record) return;
      if (record->op == Op::kSchema) contents_.add(read_schema(record->content));
      if (record->op == Op::kChannel) contents_.add(read_channel(record->content));
      if (record->op != Op::kMessage) continue;
      const auto message = read_message(record->content);
      if (!message) return;
      const std::uint64_t time = message->first.log_time;
      chunk.start_time = is_first ? time : std::min(chunk.start_time, time);
      chunk.end_time = is_first ? time : std::max(chunk.end_time, time);
      is_first = false;
      count(message->first.channel_id, time);
    }
  }

  /// The first place from `at` where a chunk or an attachment is whole, or a recording begins; the file's end
  /// where there is none.
  std::uint64_t find_next(std::uint64_t at) {
    while (at < file_.size()) {
      const auto window = file_.read(at, std::min(kWindowBytes, file_.size() - at));
      if (!window) break;
      for (std::size_t i = 0; i < window->size(); ++i) {
        const auto op = static_cast<Op>((*window)[i]);
        if ((op == Op::kChunk || op == Op::kAttachment) && is_whole(at + i)) return at + i;
        if ((*window)[i] == kMagic[0] && begins_at(at + i)) return at + i;
      }
      at += window->size();
    }
    return file_.size();
  }

  /// By its CRC. Bytes made to look like many large records cannot keep us for longer than a few times what
  /// reading the file takes.
  bool is_whole(std::uint64_t at) {
    const auto record = record_at(at);
    if (!record || record->length > std::min(kMaxChunkBytes, effort_left_)) return false;
    if (record->op == Op::kChunk) {
      const auto chunk = read_chunk_place(file_, *record);
      if (!chunk) return false;
      if (chunk->compression.empty() && chunk->compressed_size != chunk->uncompressed_size) return false;
      const std::uint64_t effort = std::max(record->length, chunk->uncompressed_size);
      if (effort > effort_left_) return false;
      effort_left_ -= effort;
      return read_chunk_records(file_, *chunk).ok();
    }
    const auto sizes = file_.read(record->content(), std::min<std::uint64_t>(record->length, 4096));
    if (!sizes) return false;
    ByteReader reader(*sizes);  // times, name, media type, and the data's size, which must fit
    reader.take(16);
    reader.read_string();
    reader.read_string();
    const auto data_size = reader.read<std::uint64_t>();
    if (!reader.ok() || data_size + reader.position() + sizeof(std::uint32_t) != record->length) return false;
    effort_left_ -= record->length;
    const auto content = file_.read(record->content(), record->length);
    return content && read_attachment(*content);
  }

  const File& file_;
  const ReadChunks which_;
  std::vector<Contents> done_;
  Contents contents_;  // of the recording that is read
  std::map<std::uint16_t, std::uint64_t> counts_;
  std::uint64_t effort_left_;  // bytes that may yet be read to tell whether a record is whole
  bool loose_messages_ = false;
  bool behind_data_ = false;
  bool ended_ = false;      // as a whole recording does
  bool plain_end_ = false;  // of the last footer
};

}  // namespace

Result<std::vector<Contents>> walk_records(const File& file, ReadChunks which) {
  return Walk(file, which).run();
}

}  // namespace relievo::mcap
