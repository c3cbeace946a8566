// SPDX-License-Identifier: Apache-2.0
// Reads chunk by chunk with pread; nothing a file says is believed before it is checked against the file's
// size.
#include <algorithm>
#include <limits>
#include <queue>
#include <utility>

#include "codec/byte_io.h"
#include "codec/mcap_message_index.h"
#include "codec/mcap_scan.h"
#include "codec/recording.h"

namespace relievo {
namespace {

constexpr std::uint64_t kMaxLoadedBytes = 2 * mcap::kMaxChunkBytes;  // of chunks that overlap in time
constexpr std::uint64_t kMessageHeadBytes = 2 + 4 + 8 + 8;           // channel, sequence, two times
constexpr std::uint64_t kLeastMessageBytes = mcap::kRecordHeaderBytes + kMessageHeadBytes;

std::int64_t to_ns(std::uint64_t time) {
  return static_cast<std::int64_t>(std::min<std::uint64_t>(time, std::numeric_limits<std::int64_t>::max()));
}

class Reader final : public RecordingReader {
 public:
  explicit Reader(std::unique_ptr<mcap::File> file) : file_(std::move(file)) {}

  Status open(mcap::ReadContents how) {
    auto contents = mcap::read_contents(*file_, how);
    if (!contents) return contents.error();
    contents_ = std::move(*contents);
    summary_ = {};
    ends_by_.clear();
    std::ranges::stable_sort(contents_.chunks, {}, &mcap::ChunkIndex::start_time);
    for (const mcap::ChunkIndex& chunk : contents_.chunks)
      ends_by_.push_back(std::max(chunk.end_time, ends_by_.empty() ? 0 : ends_by_.back()));
    for (const auto& [id, schema] : contents_.schemas)
      summary_.schemas.push_back({schema.name, schema.encoding, schema.data});
    channel_at_.assign(std::size_t{1} << 16, kNoChannel);
    for (const auto& [id, channel] : contents_.channels) {
      channel_at_[id] = static_cast<std::int32_t>(summary_.channels.size());
      const auto schema = contents_.schemas.find(channel.schema_id);
      summary_.channels.push_back({channel.topic, channel.message_encoding,
                                   schema == contents_.schemas.end() ? "" : schema->second.name,
                                   channel.metadata});
    }
    summary_.channel_messages.assign(summary_.channels.size(), 0);
    for (const auto& [id, count] : contents_.statistics.channel_messages)
      if (channel_at_[id] != kNoChannel)
        summary_.channel_messages[static_cast<std::size_t>(channel_at_[id])] = count;
    summary_.messages = contents_.statistics.messages;
    summary_.start_ns = to_ns(contents_.statistics.start_time);
    summary_.end_ns = to_ns(contents_.statistics.end_time);
    summary_.recovered = contents_.recovered;
    for (const mcap::Gap& gap : contents_.gaps) {
      summary_.lost_bytes += gap.length;
      if (gap.offset + gap.length < file_->size())
        summary_.damage.push_back(std::to_string(gap.length) + " bytes at byte " +
                                  std::to_string(gap.offset) + " are no part of a recording");
    }
    return load_attachments();
  }

  const RecordingSummary& summary() const override { return summary_; }

  Result<std::optional<RecordedMessage>> next() override {
    // A chunk may hold the next message if it starts no later than the earliest message at hand.
    while (next_chunk_ < contents_.chunks.size() &&
           (pending_.empty() || contents_.chunks[next_chunk_].start_time <= pending_.top().log_time)) {
      const mcap::ChunkIndex& chunk = contents_.chunks[next_chunk_++];
      if (chunk.end_time < from_ || chunk.offset < from_byte_) continue;
      if (auto status = load(chunk); !status) return status.error();
    }
    if (pending_.empty()) return std::optional<RecordedMessage>();
    const Pending first = pending_.top();
    pending_.pop();
    const auto content = std::span(*first.records).subspan(first.offset, first.size);
    const auto message = mcap::read_message(content);  // was readable when the chunk was loaded
    RecordedMessage result;
    result.channel = static_cast<std::uint16_t>(channel_at_[message->first.channel_id]);
    result.sequence = message->first.sequence;
    result.log_time_ns = to_ns(message->first.log_time);
    result.publish_time_ns = to_ns(message->first.publish_time);
    result.data.assign(message->second.begin(), message->second.end());
    return std::optional(std::move(result));
  }

  Result<bool> read_on() override {
    if (!summary_.recovered) return false;
    auto now = mcap::File::open(file_->name());
    if (!now) return now.error();
    if ((*now)->size() == file_->size()) return false;
    std::uint64_t known = 0;  // where the chunks that it had end
    for (const mcap::ChunkIndex& chunk : contents_.chunks)
      known = std::max(known, chunk.offset + chunk.length);
    file_ = std::move(*now);
    const std::size_t chunks = contents_.chunks.size();
    if (auto status = open(mcap::ReadContents::kByIndex); !status) return status.error();
    from_byte_ = known;
    next_chunk_ = 0;
    return contents_.chunks.size() > chunks;
  }

  Status seek(std::int64_t log_time_ns) override {
    from_ = static_cast<std::uint64_t>(std::max<std::int64_t>(log_time_ns, 0));
    from_byte_ = 0;
    next_chunk_ = 0;
    pending_ = {};
    order_ = 0;
    return {};
  }

  Result<std::vector<std::int64_t>> times(std::uint16_t channel) override {
    std::vector<std::int64_t> out;
    std::uint64_t listed = 0;
    for (const mcap::ChunkIndex& chunk : contents_.chunks) {
      const auto places = mcap::read_message_places(*file_, chunk);
      if (!places) continue;  // next() says so
      listed += places->size();
      if (listed > file_->size() / kLeastMessageBytes)
        return Error{file_->name() + ": its index lists more messages than it can hold; `relievo recover` " +
                     "writes a sound copy"};
      for (const mcap::MessagePlace& place : *places)
        if (channel_at_[place.channel_id] == channel) out.push_back(to_ns(place.log_time));
    }
    std::ranges::sort(out);
    return out;
  }

  std::optional<std::int64_t> find_last(std::int64_t log_time_ns, const Wanted& wanted) override {
    if (log_time_ns < 0) return std::nullopt;
    const auto latest = static_cast<std::uint64_t>(log_time_ns);
    std::optional<std::uint64_t> found;
    for (std::size_t i = contents_.chunks.size(); i-- > 0;) {
      if (found && ends_by_[i] <= *found) break;  // neither this chunk nor any before it reaches further
      const mcap::ChunkIndex& chunk = contents_.chunks[i];
      if (chunk.start_time > latest) continue;
      const auto places = mcap::read_message_places(*file_, chunk);
      if (!places) continue;
      for (auto place = places->rbegin(); place != places->rend(); ++place) {
        if (place->log_time > latest) continue;
        if (found && place->log_time <= *found) break;
        if (is_wanted(*place, wanted)) found = place->log_time;
      }
    }
    return found ? std::optional(to_ns(*found)) : std::nullopt;
  }

 private:
  static constexpr std::int32_t kNoChannel = -1;

  struct Pending {
    std::uint64_t log_time = 0;
    std::uint64_t order = 0;  // as loaded: keeps messages of equal time in the file's order
    std::shared_ptr<const Bytes> records;
    std::size_t offset = 0;
    std::size_t size = 0;
    bool operator>(const Pending& other) const {
      return std::pair(log_time, order) > std::pair(other.log_time, other.order);
    }
  };

  /// All messages of a chunk, or none where it cannot be read.
  Status load(const mcap::ChunkIndex& chunk) {
    const auto unreadable = [&](const std::string& why) {
      return Error{file_->name() + ": the chunk at byte " + std::to_string(chunk.offset) +
                   " cannot be read (" + why + "); its messages are left out"};
    };
    if (loaded_bytes() + chunk.length > kMaxLoadedBytes)
      return Error{file_->name() + ": too many chunks overlap in time at byte " +
                   std::to_string(chunk.offset)};
    auto records = mcap::read_chunk_records(*file_, chunk);
    if (!records) return unreadable(records.error().message);
    const auto shared = std::make_shared<const Bytes>(std::move(*records));
    std::vector<Pending> messages;
    std::span<const std::uint8_t> rest(*shared);
    while (!rest.empty()) {
      const auto record = mcap::take_record(rest);
      if (!record) return unreadable("a record is cut short");
      if (record->op != mcap::Op::kMessage) continue;
      const auto message = mcap::read_message(record->content);
      if (!message || channel_at_[message->first.channel_id] == kNoChannel)
        return unreadable("a message is malformed or of an unknown channel");
      if (message->first.log_time < chunk.start_time || message->first.log_time > chunk.end_time)
        return unreadable(
            "its messages are of other times than the index says: `relievo recover` finds them");
      if (message->first.log_time < from_) continue;
      messages.push_back({message->first.log_time, order_++, shared,
                          static_cast<std::size_t>(record->content.data() - shared->data()),
                          record->content.size()});
    }
    for (Pending& message : messages) pending_.push(std::move(message));
    loaded_.emplace_back(shared);
    return {};
  }

  bool is_wanted(const mcap::MessagePlace& place, const Wanted& wanted) const {
    if (place.offset >= file_->size() || channel_at_[place.channel_id] == kNoChannel) return false;
    const auto head = file_->read(
        place.offset, std::min<std::uint64_t>(kLeastMessageBytes + kHeadBytes, file_->size() - place.offset));
    if (!head || head->size() < kLeastMessageBytes) return false;
    ByteReader reader(*head);
    const auto op = static_cast<mcap::Op>(reader.read<std::uint8_t>());
    const auto length = reader.read<std::uint64_t>();
    const auto message = mcap::read_message(std::span(*head).subspan(reader.position()));
    if (op != mcap::Op::kMessage || length < kMessageHeadBytes || !message ||
        message->first.channel_id != place.channel_id || message->first.log_time != place.log_time)
      return false;
    const auto data = message->second;
    return wanted(static_cast<std::uint16_t>(channel_at_[place.channel_id]),
                  data.first(static_cast<std::size_t>(
                      std::min<std::uint64_t>(data.size(), length - kMessageHeadBytes))));
  }

  std::uint64_t loaded_bytes() {
    std::erase_if(loaded_, [](const auto& records) { return records.expired(); });
    std::uint64_t sum = 0;
    for (const auto& records : loaded_)
      if (const auto held = records.lock()) sum += held->size();
    return sum;
  }

  Status load_attachments() {
    std::uint64_t end = 0;  // they may not overlap, or a small file could ask for any amount of memory
    std::ranges::stable_sort(contents_.attachments, {}, &mcap::AttachmentIndex::offset);
    for (const mcap::AttachmentIndex& index : contents_.attachments) {
      const auto bytes = index.offset < end ? Result<Bytes>(Error{"it overlaps another one"})
                                            : file_->read(index.offset, index.length);
      if (!bytes) {
        summary_.damage.push_back("attachment " + index.name + ": " + bytes.error().message);
        continue;
      }
      end = index.offset + index.length;
      std::span<const std::uint8_t> rest(*bytes);
      const auto record = mcap::take_record(rest);
      const auto attachment = record && record->op == mcap::Op::kAttachment
                                  ? mcap::read_attachment(record->content)
                                  : std::optional<mcap::Attachment>();
      if (!attachment) {
        summary_.damage.push_back("attachment " + index.name + " at byte " + std::to_string(index.offset) +
                                  " is damaged");
        continue;
      }
      summary_.attachments.push_back({attachment->name, attachment->media_type, to_ns(attachment->log_time),
                                      Bytes(attachment->data.begin(), attachment->data.end())});
    }
    return {};
  }

  std::unique_ptr<mcap::File> file_;
  mcap::Contents contents_;
  RecordingSummary summary_;
  std::vector<std::uint64_t> ends_by_;    // the latest message of each chunk and all before it
  std::vector<std::int32_t> channel_at_;  // index into summary_.channels of each id in the file

  std::uint64_t from_ = 0;       // log time that was sought
  std::uint64_t from_byte_ = 0;  // chunks before it were read before the file grew
  std::size_t next_chunk_ = 0;   // of contents_.chunks, in order of their start
  std::uint64_t order_ = 0;
  std::priority_queue<Pending, std::vector<Pending>, std::greater<>> pending_;
  std::vector<std::weak_ptr<const Bytes>> loaded_;
};

}  // namespace

Result<std::unique_ptr<RecordingReader>> RecordingReader::open(const std::filesystem::path& file,
                                                               const Options& options) {
  auto handle = mcap::File::open(file);
  if (!handle) return handle.error();
  auto reader = std::make_unique<Reader>(std::move(*handle));
  using enum mcap::ReadContents;
  if (auto status = reader->open(options.rebuild_index ? kByWalking : kByIndex); !status)
    return status.error();
  return std::unique_ptr<RecordingReader>(std::move(reader));
}

}  // namespace relievo
