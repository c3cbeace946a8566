// SPDX-License-Identifier: Apache-2.0
// What an MCAP file holds: from its index or, where that is missing, by going through it.
#pragma once

#include <atomic>
#include <cstdint>
#include <filesystem>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "base/result.h"
#include "base/stream.h"
#include "codec/mcap_records.h"

namespace relievo::mcap {

/// A file opened for reading. Any offset and length may be asked for. One thread.
class File {
 public:
  /// `stop`, where there is one, outlives it: once it is set nothing is read any more.
  static Result<std::unique_ptr<File>> open(const std::filesystem::path& path,
                                            const std::atomic<bool>* stop = nullptr);
  ~File();
  File(const File&) = delete;
  File& operator=(const File&) = delete;

  const std::string& name() const { return name_; }
  std::uint64_t size() const { return size_; }  // when it was opened
  /// Fails, before it allocates, where the file does not hold these bytes.
  Result<Bytes> read(std::uint64_t offset, std::uint64_t length) const;
  std::uint64_t bytes_read() const { return bytes_read_; }  // by read() so far

 private:
  File(int handle, std::string name, std::uint64_t size, const std::atomic<bool>* stop)
      : handle_(handle), name_(std::move(name)), size_(size), stop_(stop) {}

  const int handle_;
  const std::string name_;
  const std::uint64_t size_;
  const std::atomic<bool>* const stop_;
  mutable std::uint64_t bytes_read_ = 0;
};

/// Where a record lies.
struct RecordPlace {
  Op op{};
  std::uint64_t offset = 0;
  std::uint64_t length = 0;  // of its content

  std::uint64_t content() const { return offset + kRecordHeaderBytes; }
  std::uint64_t end() const { return content() + length; }
};

/// Of the record at `offset`, which the file's end may cut off. Nothing where the file has no head of one
/// there.
std::optional<RecordPlace> read_record_place(const File& file, std::uint64_t offset);

/// The content of a schema, channel, attachment or footer; fails, before it reads, where it is too large for
/// one.
Result<Bytes> read_small_content(const File& file, const RecordPlace& record);

/// Of a chunk, without message indexes; nothing where its head is wrong.
std::optional<ChunkIndex> read_chunk_place(const File& file, const RecordPlace& chunk);

/// Bytes that are no records.
struct Gap {
  std::uint64_t offset = 0;
  std::uint64_t length = 0;
};

/// Of one recording, which is the whole file but where several were joined.
struct Contents {
  std::map<std::uint16_t, Schema> schemas;    // by id, none 0
  std::map<std::uint16_t, Channel> channels;  // by id
  std::vector<ChunkIndex> chunks;
  std::vector<AttachmentIndex> attachments;
  Statistics statistics;
  bool recovered = false;
  std::vector<Gap> gaps;  // in the file's order

  /// False where there is nothing: it was malformed.
  bool add(const std::optional<Schema>& schema);
  bool add(const std::optional<Channel>& channel);
};

enum class ReadContents {
  kByIndex,    // or, where the index is missing or wrong, by going through the heads of the file's records
  kByWalking,  // through the whole file: finds all that is whole, wherever it lies
};

/// Of each recording in the file: one, or more where others were put behind it (`cat a b`); their places are
/// the file's, their ids their own. Fails where the file is no MCAP file, which kByIndex tells by its first
/// bytes alone, or cannot be read; a file cut short gives what is whole.
Result<std::vector<Contents>> read_contents(const File& file, ReadContents how);

/// A chunk's records, decompressed and checked against its CRC. Errors name no file or place: the caller
/// knows both.
Result<Bytes> read_chunk_records(const File& file, const ChunkIndex& chunk);

}  // namespace relievo::mcap
