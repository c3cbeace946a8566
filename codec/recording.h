// SPDX-License-Identifier: Apache-2.0
// Recordings: MCAP files (https://mcap.dev/spec) of any message bytes with their schema, chunked, indexed,
// with CRCs. Knows nothing of DDS: a message is a topic, times and bytes (here CDR with its 4-byte
// encapsulation header).
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "base/growing_recording.h"
#include "base/result.h"
#include "base/stream.h"

namespace relievo {

struct RecordingSchema {
  std::string name;      // the message type's name, e.g. "relievo::Frame"
  std::string encoding;  // "omgidl"
  std::string text;      // self-contained
};

struct RecordingChannel {
  std::string topic;                                          // e.g. "relievo/frame"
  std::string message_encoding;                               // "cdr"
  std::string schema;                                         // a RecordingSchema's name
  std::vector<std::pair<std::string, std::string>> metadata;  // e.g. {"stream", "face"}
};

struct RecordingAttachment {
  std::string name;        // "rig.yaml"
  std::string media_type;  // "application/yaml"
  std::int64_t time_ns = 0;
  Bytes data;
};

struct RecordedMessage {
  std::uint16_t channel = 0;  // id: from add_channel, or an index into RecordingSummary::channels
  std::uint32_t sequence = 0;
  std::int64_t log_time_ns = 0;      // when the recorder received it
  std::int64_t publish_time_ns = 0;  // when it was published
  Bytes data;
};

/// Writes one file. Chunks are closed at most `chunk_ns` after their first message or at `chunk_bytes`, so a
/// crash loses at most that much; and put on the disk (fdatasync) as `sync_ns` says, so a power loss loses at
/// most that much more. write() may therefore wait for the disk: call it from a thread of its own. One
/// thread.
class RecordingWriter {
 public:
  struct Options {
    std::int64_t chunk_ns = 500'000'000;
    std::size_t chunk_bytes = 4u << 20;
    std::int64_t sync_ns = 0;  // of the messages' times; 0: each chunk; below 0: only the finished file
    bool keeps_name = false;   // where the file is renamed it fails, as where it is removed
    std::string profile;       // of MCAP, for readers that go by one: "ros2"
    // Called in any of the calls below where the disk is full: true where something was removed, and it is
    // tried again. Null: nothing can be.
    std::function<bool()> make_room = nullptr;
  };
  /// Fails, saying why, where the file exists or cannot be made, also where a link leads; changes no file.
  static Result<std::unique_ptr<RecordingWriter>> create(const std::filesystem::path& file,
                                                         const Options& options);
  virtual ~RecordingWriter() = default;  // finishes the file as finish() does, errors lost

  /// Schemas of one name are written once and must be equal.
  virtual Result<std::uint16_t> add_channel(const RecordingSchema& schema,
                                            const RecordingChannel& channel) = 0;
  virtual Status add_attachment(const RecordingAttachment& attachment) = 0;
  /// After a failed write (a full disk) the file is closed with what was written before, and its index, for
  /// which there is always room where the file system can reserve it; every later call fails. The same where
  /// the file was removed meanwhile.
  virtual Status write(const RecordedMessage& message) = 0;
  /// Closes the open chunk where it is older than chunk_ns: call while no messages come.
  virtual Status flush_if_due(std::int64_t now_ns) = 0;
  /// Bytes so far, those of the open chunk among them.
  virtual std::uint64_t size() const = 0;
  /// How many of a channel's messages are in the file, whatever comes: those of the open chunk are not.
  virtual std::uint64_t written(std::uint16_t channel) const = 0;
  /// Never null; what it says stays right when the file is finished, and the writer gone.
  virtual std::shared_ptr<const GrowingRecording> growing() const = 0;
  /// Writes the index and closes.
  virtual Status finish() = 0;
};

struct RecordingSummary {
  std::vector<RecordingSchema> schemas;
  std::vector<RecordingChannel> channels;       // index = RecordedMessage::channel when reading
  std::vector<std::uint64_t> channel_messages;  // count of each channel
  std::vector<RecordingAttachment> attachments;
  std::int64_t start_ns = 0;  // log times of the first and last message
  std::int64_t end_ns = 0;
  std::uint64_t messages = 0;
  std::vector<std::string> damage;  // a line for each part left out because its bytes are wrong
  bool recovered = false;           // its index was rebuilt from what is whole
  std::size_t recordings = 1;       // that the file was joined of, one behind the other: all of them are read
  std::vector<std::int64_t> starts_ns;  // log time of the first message of each of them that has one
  std::uint64_t lost_bytes = 0;         // that are no records: at its end where it was cut short
};

/// Reads a file, whole, cut short or damaged (never changing it). One thread.
class RecordingReader {
 public:
  struct Options {
    bool rebuild_index = false;  // even where there is one: finds what a damaged file's index does not
  };
  static Result<std::unique_ptr<RecordingReader>> open(const std::filesystem::path& file,
                                                       const Options& options);
  static Result<std::unique_ptr<RecordingReader>> open(const std::filesystem::path& file) {
    return open(file, Options{});
  }
  virtual ~RecordingReader() = default;

  virtual const RecordingSummary& summary() const = 0;
  /// The next message in log-time order; nothing at the end. Fails on a chunk whose CRC is wrong, naming its
  /// place; the call after that goes on behind it.
  virtual Result<std::optional<RecordedMessage>> next() = 0;
  /// When next() came to the end of a file without an index: looks for what was written since, with which it
  /// then goes on. False where there is nothing new; once summary() says that there is an index, the file is
  /// finished and nothing will come.
  virtual Result<bool> read_on() = 0;
  /// The next next() returns the first message at or after this log time.
  virtual Status seek(std::int64_t log_time_ns) = 0;

  /// The log times of a channel's messages, in order: through the index, so that no message is read. Messages
  /// of damaged chunks are among them where an index names them.
  virtual Result<std::vector<std::int64_t>> times(std::uint16_t channel) = 0;

  /// Says of a message by its first bytes, kHeadBytes of them or all there are, whether it is the one.
  using Wanted = std::function<bool(std::uint16_t channel, std::span<const std::uint8_t> head)>;
  static constexpr std::size_t kHeadBytes = 256;
  /// The log time of the last message at or before this one that is wanted; nothing where there is none.
  /// Reads the heads of messages alone, from there backwards, and checks no CRC: that is for next().
  virtual std::optional<std::int64_t> find_last(std::int64_t log_time_ns, const Wanted& wanted) = 0;

  /// From the file so far, by all of these.
  virtual std::uint64_t bytes_read() const = 0;
};

}  // namespace relievo
