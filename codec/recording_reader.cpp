// SPDX-License-Identifier: Apache-2.0
// Reads chunk by chunk with pread; nothing a file says is believed before it is checked against the file's
// size.
#include <algorithm>
#include <iterator>
#include <limits>
#include <map>
#include <queue>
#include <set>
#include <tuple>
#include <utility>

#include "base/foreign_text.h"
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
    summary_ = {};
    summary_.recordings = contents->size();
    chunks_.clear();
    channel_at_.clear();
    known_channels_.clear();
    known_schemas_.clear();
    std::vector<mcap::AttachmentIndex> attachments;
    for (mcap::Contents& recording : *contents) {
      add(recording);
      std::ranges::move(recording.attachments, std::back_inserter(attachments));
    }
    std::ranges::stable_sort(chunks_, {}, &Chunk::start_time);
    ends_by_.clear();
    for (const Chunk& chunk : chunks_)
      ends_by_.push_back(std::max(chunk.end_time, ends_by_.empty() ? 0 : ends_by_.back()));
    return load_attachments(std::move(attachments));
  }

  const RecordingSummary& summary() const override { return summary_; }

  Result<std::optional<RecordedMessage>> next() override {
    // A chunk may hold the next message if it starts no later than the earliest message at hand.
    while (next_chunk_ < chunks_.size() &&
           (pending_.empty() || chunks_[next_chunk_].start_time <= pending_.top().log_time)) {
      const Chunk& chunk = chunks_[next_chunk_++];
      if (chunk.end_time < from_ || chunk.offset < from_byte_) continue;
      if (auto status = load(chunk); !status) return status.error();
    }
    if (pending_.empty()) return std::optional<RecordedMessage>();
    const Pending first = pending_.top();
    pending_.pop();
    const auto content = std::span(*first.records).subspan(first.offset, first.size);
    const auto message = mcap::read_message(content);  // was readable when the chunk was loaded
    RecordedMessage result;
    result.channel = first.channel;
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
    for (const Chunk& chunk : chunks_) known = std::max(known, chunk.offset + chunk.length);
    read_before_ += file_->bytes_read();
    file_ = std::move(*now);
    const std::size_t chunks = chunks_.size();
    if (auto status = open(mcap::ReadContents::kByIndex); !status) return status.error();
    from_byte_ = known;
    next_chunk_ = 0;
    return chunks_.size() > chunks;
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
    for (const Chunk& chunk : chunks_) {
      const auto places = mcap::read_message_places(*file_, chunk);
      if (!places) continue;  // next() says so
      if (chunk.compression.empty()) listed += places->size();
      if (listed > file_->size() / kLeastMessageBytes)
        return Error{file_->name() + ": its index lists more messages than it can hold; `relievo recover` " +
                     "writes a sound copy"};
      for (const mcap::MessagePlace& place : *places)
        if (channel_of(chunk, place.channel_id) == channel) out.push_back(to_ns(place.log_time));
    }
    std::ranges::sort(out);
    return out;
  }

  std::optional<std::int64_t> find_last(std::int64_t log_time_ns, const Wanted& wanted) override {
    if (log_time_ns < 0) return std::nullopt;
    const auto latest = static_cast<std::uint64_t>(log_time_ns);
    std::optional<std::uint64_t> found;
    for (std::size_t i = chunks_.size(); i-- > 0;) {
      if (found && ends_by_[i] <= *found) break;  // neither this chunk nor any before it reaches further
      const Chunk& chunk = chunks_[i];
      if (chunk.start_time > latest) continue;
      const bool plain = chunk.compression.empty();  // else places are in its records, not in the file
      const auto records = plain ? Result<Bytes>(Bytes()) : mcap::read_chunk_records(*file_, chunk);
      if (!records) continue;
      const auto places =
          plain ? mcap::read_message_places(*file_, chunk) : mcap::message_places(*records, 0);
      if (!places) continue;
      for (auto place = places->rbegin(); place != places->rend(); ++place) {
        if (place->log_time > latest) continue;
        if (found && place->log_time <= *found) break;
        if (is_wanted(chunk, *place, *records, wanted)) found = place->log_time;
      }
    }
    return found ? std::optional(to_ns(*found)) : std::nullopt;
  }

  std::uint64_t bytes_read() const override { return read_before_ + file_->bytes_read(); }

 private:
  static constexpr std::int32_t kNoChannel = -1, kLeftOut = -2;

  struct Chunk : mcap::ChunkIndex {
    std::size_t recording = 0;  // of those that the file was joined of
  };
  /// Index into summary_.channels; kNoChannel where its recording has none with this id.
  std::int32_t channel_of(const Chunk& chunk, std::uint16_t id) const {
    const auto& ids = channel_at_[chunk.recording];
    const auto at = ids.find(id);
    return at == ids.end() ? kNoChannel : at->second;
  }

  /// A recording's contents to all that were before it.
  void add(mcap::Contents& recording) {
    const std::size_t number = channel_at_.size();
    for (mcap::ChunkIndex& chunk : recording.chunks) chunks_.push_back({std::move(chunk), number});
    add_channels(recording);
    const mcap::Statistics& statistics = recording.statistics;
    for (const auto& [id, count] : statistics.channel_messages) {
      const auto at = channel_at_[number].find(id);
      if (at != channel_at_[number].end() && at->second >= 0)
        summary_.channel_messages[static_cast<std::size_t>(at->second)] += count;
    }
    if (statistics.messages > 0) {
      const bool is_first = summary_.messages == 0;
      summary_.start_ns =
          is_first ? to_ns(statistics.start_time) : std::min(summary_.start_ns, to_ns(statistics.start_time));
      summary_.end_ns = std::max(summary_.end_ns, to_ns(statistics.end_time));
      summary_.messages += statistics.messages;
      summary_.starts_ns.push_back(to_ns(statistics.start_time));
    }
    summary_.recovered = summary_.recovered || recording.recovered;
    for (const mcap::Gap& gap : recording.gaps) {
      summary_.lost_bytes += gap.length;
      if (gap.offset + gap.length < file_->size())
        summary_.damage.push_back(std::to_string(gap.length) + " bytes at byte " +
                                  std::to_string(gap.offset) + " are no part of a recording");
    }
  }

  /// Channels of a second recording that are as one of the first are the same; what has another schema by the
  /// name of one that is there is left out.
  void add_channels(const mcap::Contents& recording) {
    std::map<std::uint16_t, std::int32_t>& ids = channel_at_.emplace_back();
    const bool is_first = channel_at_.size() == 1;
    std::set<std::uint16_t> differ;
    for (const auto& [id, schema] : recording.schemas) {
      const RecordingSchema mine{schema.name, schema.encoding, schema.data};
      const auto [same, is_new] = known_schemas_.try_emplace(mine.name, mine.encoding, mine.text);
      if (is_first || is_new) summary_.schemas.push_back(mine);
      if (is_first || same->second == std::pair(mine.encoding, mine.text)) continue;
      differ.insert(id);
      summary_.damage.push_back("recording " + std::to_string(channel_at_.size()) +
                                " of the file has another " + foreign_text(mine.name) +
                                " than those before it: its messages of that kind are left out");
    }
    for (const auto& [id, channel] : recording.channels) {
      const auto schema = recording.schemas.find(channel.schema_id);
      RecordingChannel mine{channel.topic, channel.message_encoding,
                            schema == recording.schemas.end() ? "" : schema->second.name, channel.metadata};
      const auto next = static_cast<std::int32_t>(summary_.channels.size());
      if (differ.contains(channel.schema_id) || next > std::numeric_limits<std::uint16_t>::max()) {
        ids[id] = kLeftOut;
        continue;
      }
      const auto [same, is_new] =
          known_channels_.try_emplace({mine.topic, mine.message_encoding, mine.schema, mine.metadata}, next);
      if (is_first || is_new) {
        ids[id] = next;
        summary_.channels.push_back(std::move(mine));
        summary_.channel_messages.push_back(0);
      } else {
        ids[id] = same->second;
      }
    }
  }

  struct Pending {
    std::uint64_t log_time = 0;
    std::uint64_t order = 0;  // as loaded: keeps messages of equal time in the file's order
    std::uint16_t channel = 0;
    std::shared_ptr<const Bytes> records;
    std::size_t offset = 0;
    std::size_t size = 0;
    bool operator>(const Pending& other) const {
      return std::pair(log_time, order) > std::pair(other.log_time, other.order);
    }
  };

  /// All messages of a chunk, or none where it cannot be read.
  Status load(const Chunk& chunk) {
    const auto unreadable = [&](const std::string& why) {
      return Error{file_->name() + ": the chunk at byte " + std::to_string(chunk.offset) +
                   " cannot be read (" + why + "); its messages are left out"};
    };
    if (loaded_bytes() + std::max(chunk.length, chunk.uncompressed_size) > kMaxLoadedBytes)
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
      const std::int32_t channel = message ? channel_of(chunk, message->first.channel_id) : kNoChannel;
      if (channel == kNoChannel) return unreadable("a message is malformed or of an unknown channel");
      if (message->first.log_time < chunk.start_time || message->first.log_time > chunk.end_time)
        return unreadable(
            "its messages are of other times than the index says: `relievo recover` finds them");
      if (message->first.log_time < from_ || channel == kLeftOut) continue;
      messages.push_back({message->first.log_time, order_++, static_cast<std::uint16_t>(channel), shared,
                          static_cast<std::size_t>(record->content.data() - shared->data()),
                          record->content.size()});
    }
    for (Pending& message : messages) pending_.push(std::move(message));
    loaded_.emplace_back(shared);
    return {};
  }

  /// Its first bytes.
  Result<Bytes> head_of(const Chunk& chunk, const mcap::MessagePlace& place, const Bytes& records) const {
    const std::uint64_t size = chunk.compression.empty() ? file_->size() : records.size();
    if (place.offset >= size) return Error{"it is behind the end"};
    const std::uint64_t bytes = std::min<std::uint64_t>(kLeastMessageBytes + kHeadBytes, size - place.offset);
    if (chunk.compression.empty()) return file_->read(place.offset, bytes);
    const auto head =
        std::span(records).subspan(static_cast<std::size_t>(place.offset), static_cast<std::size_t>(bytes));
    return Bytes(head.begin(), head.end());
  }

  /// `records`: of a compressed chunk.
  bool is_wanted(const Chunk& chunk, const mcap::MessagePlace& place, const Bytes& records,
                 const Wanted& wanted) const {
    const std::int32_t channel = channel_of(chunk, place.channel_id);
    if (channel < 0) return false;
    const auto head = head_of(chunk, place, records);
    if (!head || head->size() < kLeastMessageBytes) return false;
    ByteReader reader(*head);
    const auto op = static_cast<mcap::Op>(reader.read<std::uint8_t>());
    const auto length = reader.read<std::uint64_t>();
    const auto message = mcap::read_message(std::span(*head).subspan(reader.position()));
    if (op != mcap::Op::kMessage || length < kMessageHeadBytes || !message ||
        message->first.channel_id != place.channel_id || message->first.log_time != place.log_time)
      return false;
    const auto data = message->second;
    return wanted(static_cast<std::uint16_t>(channel),
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

  /// One that a second recording has, too, counts once.
  Status load_attachments(std::vector<mcap::AttachmentIndex> attachments) {
    std::uint64_t end = 0;  // they may not overlap, or a small file could ask for any amount of memory
    std::set<std::tuple<std::string, std::size_t, std::uint32_t>> known;
    std::ranges::stable_sort(attachments, {}, &mcap::AttachmentIndex::offset);
    for (const mcap::AttachmentIndex& index : attachments) {
      const auto bytes = index.offset < end ? Result<Bytes>(Error{"it overlaps another one"})
                                            : file_->read(index.offset, index.length);
      if (!bytes) {
        summary_.damage.push_back("attachment " + foreign_text(index.name) + ": " + bytes.error().message);
        continue;
      }
      end = index.offset + index.length;
      std::span<const std::uint8_t> rest(*bytes);
      const auto record = mcap::take_record(rest);
      const auto attachment = record && record->op == mcap::Op::kAttachment
                                  ? mcap::read_attachment(record->content)
                                  : std::optional<mcap::Attachment>();
      if (!attachment) {
        summary_.damage.push_back("attachment " + foreign_text(index.name) + " at byte " +
                                  std::to_string(index.offset) + " is damaged");
        continue;
      }
      if (summary_.recordings > 1 &&
          !known.emplace(attachment->name, attachment->data.size(), mcap::crc32(attachment->data)).second)
        continue;
      summary_.attachments.push_back({attachment->name, attachment->media_type, to_ns(attachment->log_time),
                                      Bytes(attachment->data.begin(), attachment->data.end())});
    }
    return {};
  }

  std::unique_ptr<mcap::File> file_;
  std::uint64_t read_before_ = 0;  // of the file as it was, which grew
  RecordingSummary summary_;
  std::vector<Chunk> chunks_;           // in order of their start
  std::vector<std::uint64_t> ends_by_;  // the latest message of each chunk and all before it
  // Of each recording: index into summary_.channels of each id, or kLeftOut.
  std::vector<std::map<std::uint16_t, std::int32_t>> channel_at_;
  std::map<std::string, std::pair<std::string, std::string>> known_schemas_;  // encoding and text, by name
  std::map<
      std::tuple<std::string, std::string, std::string, std::vector<std::pair<std::string, std::string>>>,
      std::int32_t>
      known_channels_;  // by all that is said of them

  std::uint64_t from_ = 0;       // log time that was sought
  std::uint64_t from_byte_ = 0;  // chunks before it were read before the file grew
  std::size_t next_chunk_ = 0;   // of chunks_
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
