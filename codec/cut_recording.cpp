// SPDX-License-Identifier: Apache-2.0
#include "codec/cut_recording.h"

#include <algorithm>
#include <map>
#include <optional>
#include <span>
#include <utility>

#include "codec/byte_io.h"
#include "codec/mcap_message_index.h"
#include "codec/mcap_scan.h"
#include "codec/mcap_writer_index.h"

namespace relievo {
namespace {

constexpr std::uint64_t kMostAttachmentBytes = 64u << 20;

std::uint64_t end_of(const mcap::ChunkIndex& chunk) {
  return chunk.offset + chunk.length + chunk.message_index_length;
}

class CutRecording final : public GrowingRecording {
 public:
  CutRecording(std::uint64_t bytes, Bytes end)
      : bytes_(bytes), end_(std::make_shared<const Bytes>(std::move(end))) {}

  std::uint64_t bytes() const override { return bytes_; }
  std::shared_ptr<const Bytes> end_at(std::uint64_t bytes) const override {
    return bytes == bytes_ ? end_ : nullptr;
  }

 private:
  const std::uint64_t bytes_;
  const std::shared_ptr<const Bytes> end_;
};

/// The message indexes of a chunk that was cut off before them, as they would have followed it; `chunk` is
/// told of them.
Result<Bytes> make_message_indexes(const mcap::File& file, mcap::ChunkIndex& chunk) {
  const auto places = mcap::read_message_places(file, chunk);
  if (!places) return places.error();
  const std::uint64_t end = chunk.offset + chunk.length;
  const std::uint64_t records_at = end - chunk.compressed_size;
  std::map<std::uint16_t, mcap::MessageIndex> indexes;
  for (const mcap::MessagePlace& place : *places) {
    mcap::MessageIndex& index = indexes[place.channel_id];
    index.channel_id = place.channel_id;
    index.entries.emplace_back(place.log_time, place.offset - records_at);
  }
  Bytes out;
  for (const auto& [channel, index] : indexes) {
    chunk.message_index_offsets.emplace_back(channel, end + out.size());
    mcap::append(out, index);
  }
  chunk.message_index_length = out.size();
  return out;
}

/// What a walk did not need of it; nothing where its CRC is wrong.
std::optional<mcap::AttachmentIndex> read_whole(const mcap::File& file, mcap::AttachmentIndex index) {
  if (index.length > kMostAttachmentBytes) return std::nullopt;
  const auto bytes = file.read(index.offset, index.length);
  if (!bytes) return std::nullopt;
  const auto attachment = mcap::read_attachment(std::span(*bytes).subspan(mcap::kRecordHeaderBytes));
  if (!attachment) return std::nullopt;
  index.log_time = attachment->log_time;
  index.create_time = attachment->create_time;
  index.data_size = attachment->data.size();
  index.media_type = attachment->media_type;
  return index;
}

}  // namespace

Result<std::shared_ptr<const GrowingRecording>> index_cut_recording(const std::filesystem::path& path,
                                                                    const std::atomic<bool>* stop) {
  const auto file = mcap::File::open(path, stop);
  if (!file) return file.error();
  auto found = mcap::read_contents(**file, mcap::ReadContents::kByIndex);
  if (!found) return found.error();
  if (stop != nullptr && *stop) return Error{"reading " + path.string() + " was stopped"};
  const std::shared_ptr<const GrowingRecording> none;
  mcap::Contents& contents = found->front();
  auto& chunks = contents.chunks;
  if (found->size() > 1 || !contents.recovered || chunks.empty()) return none;
  // Pages read no compressed ones.
  const auto is_compressed = [](const mcap::ChunkIndex& chunk) { return !chunk.compression.empty(); };
  if (std::ranges::any_of(chunks, is_compressed)) return none;
  const auto has_index = [](const mcap::ChunkIndex& chunk) { return chunk.message_index_length > 0; };
  if (!std::all_of(chunks.begin(), chunks.end() - 1, has_index)) return none;

  std::uint64_t bytes = end_of(chunks.back());
  Bytes indexes;
  if (!has_index(chunks.back())) {
    auto made = make_message_indexes(**file, chunks.back());
    if (!made) return none;
    indexes = *std::move(made);
  }
  mcap::WriterIndex index;
  for (const auto& [id, schema] : contents.schemas) index.add(schema, 0);
  for (const auto& [id, channel] : contents.channels) index.add(channel, 0);
  for (const mcap::AttachmentIndex& attachment : contents.attachments) {
    const auto whole = read_whole(**file, attachment);
    if (!whole) return none;
    bytes = std::max(bytes, whole->offset + whole->length);
    index.add(*whole);
  }
  for (mcap::ChunkIndex& chunk : chunks) index.add(std::move(chunk));
  const Bytes end = index.end(bytes + indexes.size(), 0);
  append_bytes(indexes, end);
  return std::shared_ptr<const GrowingRecording>(std::make_shared<CutRecording>(bytes, std::move(indexes)));
}

bool may_hold_chunk(const std::filesystem::path& path) {
  const auto file = mcap::File::open(path);
  if (!file) return true;
  const std::uint64_t size = (*file)->size();
  const auto magic = (*file)->read(0, std::min<std::uint64_t>(size, mcap::kMagic.size()));
  if (!magic || !std::equal(magic->begin(), magic->end(), mcap::kMagic.begin())) return true;
  for (std::uint64_t at = mcap::kMagic.size(); at <= size && size - at >= mcap::kRecordHeaderBytes;) {
    const auto record = mcap::read_record_place(**file, at);
    if (!record || record->length > mcap::kMaxChunkBytes) return true;
    if (record->end() > size) return false;
    if (record->op == mcap::Op::kChunk) return true;
    at = record->end();
  }
  return false;
}

}  // namespace relievo
