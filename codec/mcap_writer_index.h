// SPDX-License-Identifier: Apache-2.0
// The index of a recording that is being written.
#pragma once

#include <cstdint>
#include <memory>
#include <mutex>
#include <utility>
#include <vector>

#include "base/growing_recording.h"
#include "codec/mcap_records.h"

namespace relievo::mcap {

/// One thread adds, in the file's order; any thread asks. Nothing here waits for the disk.
class WriterIndex final : public GrowingRecording {
 public:
  /// `end`: where its record ends in the file.
  void add(const Schema& schema, std::uint64_t end);
  void add(const Channel& channel, std::uint64_t end);
  void add(AttachmentIndex attachment);
  void add(ChunkIndex chunk);

  std::uint64_t bytes() const override;
  std::shared_ptr<const Bytes> end_at(std::uint64_t bytes) const override;
  /// Data end, summary, footer and closing magic, behind `bytes` of data with this CRC (0: not known).
  Bytes end(std::uint64_t bytes, std::uint32_t data_crc) const;

 private:
  Bytes build(std::uint64_t bytes, std::uint32_t data_crc) const;

  mutable std::mutex mutex_;
  std::vector<std::pair<Schema, std::uint64_t>> schemas_;  // and where their records end
  std::vector<std::pair<Channel, std::uint64_t>> channels_;
  std::vector<AttachmentIndex> attachments_;
  std::vector<ChunkIndex> chunks_;
  // What end_at() last gave: who reads a file in parts asks for the same again and again.
  mutable std::uint64_t asked_ = 0;
  mutable std::shared_ptr<const Bytes> given_;
};

}  // namespace relievo::mcap
