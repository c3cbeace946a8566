// SPDX-License-Identifier: Apache-2.0
// The file grows by whole records only: what a crash cuts off is at most the chunk being written.
#include <fcntl.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <limits>
#include <map>
#include <system_error>

#include "base/whole_file.h"
#include "codec/byte_io.h"
#include "codec/mcap_records.h"
#include "codec/mcap_writer_index.h"
#include "codec/recording.h"

namespace relievo {
namespace {

constexpr std::uint64_t kEmptyIndexBytes = (9 + 4) + (9 + 50) + 5 * (9 + 17) + mcap::kFooterBytes +
                                           8;  // data end, statistics, offsets, footer, magic
constexpr std::uint64_t kStatisticsOfChannel = 2 + 8;

class Writer final : public RecordingWriter {
 public:
  Writer(int file, std::filesystem::path path, const Options& options)
      : file_(file), path_(std::move(path)), options_(options) {}
  ~Writer() override {
    static_cast<void>(finish().ok());
    if (file_ >= 0) ::close(file_);
  }

  Status start() {
    Bytes bytes(mcap::kMagic.begin(), mcap::kMagic.end());
    mcap::append_header(bytes, options_.profile, "relievo " RELIEVO_VERSION);
    return write_with_room({bytes});
  }

  Result<std::uint16_t> add_channel(const RecordingSchema& schema, const RecordingChannel& channel) override {
    if (auto status = check_open(); !status) return status.error();
    if (schema.name != channel.schema)
      return Error{"channel " + channel.topic + " names schema " + channel.schema + ", not " + schema.name};
    if (written_.size() >= std::numeric_limits<std::uint16_t>::max())
      return Error{"a recording cannot hold more than 65535 channels"};
    Bytes records;
    const auto known = std::ranges::find(schemas_, schema.name, &mcap::Schema::name);
    const bool is_new = known == schemas_.end();
    if (!is_new && (known->data != schema.text || known->encoding != schema.encoding))
      return Error{"the recording holds another schema of the name " + schema.name};
    const auto schema_id = is_new ? static_cast<std::uint16_t>(schemas_.size() + 1) : known->id;
    const mcap::Schema new_schema{schema_id, schema.name, schema.encoding, schema.text};
    if (is_new) mcap::append(records, new_schema);
    const auto id = static_cast<std::uint16_t>(written_.size());
    const mcap::Channel new_channel{id, schema_id, channel.topic, channel.message_encoding, channel.metadata};
    mcap::append(records, new_channel);
    index_bytes_ += records.size() + kStatisticsOfChannel;
    if (auto status = write_or_close({records}); !status) return status.error();
    if (is_new) {
      schemas_.push_back(new_schema);
      index_->add(new_schema, offset_);
    }
    index_->add(new_channel, offset_);
    written_.push_back(0);
    return id;
  }

  Status add_attachment(const RecordingAttachment& attachment) override {
    if (auto status = check_open(); !status) return status;
    const auto time = static_cast<std::uint64_t>(std::max<std::int64_t>(attachment.time_ns, 0));
    Bytes record;
    mcap::append(record,
                 mcap::Attachment{time, time, attachment.name, attachment.media_type, attachment.data});
    const mcap::AttachmentIndex index{
        offset_, record.size(), time, time, attachment.data.size(), attachment.name, attachment.media_type};
    index_grows_by(index);
    if (auto status = write_or_close({record}); !status) return status;
    index_->add(index);
    return {};
  }

  Status write(const RecordedMessage& message) override {
    if (auto status = check_open(); !status) return status;
    if (message.channel >= written_.size())
      return Error{"no channel " + std::to_string(message.channel) + " in the recording"};
    if (message.log_time_ns < 0 || message.publish_time_ns < 0)
      return Error{"a recording cannot hold times before 1970"};
    if (message.data.size() > mcap::kMaxChunkBytes / 2)
      return Error{"a message of " + std::to_string(message.data.size()) + " bytes is too large to record"};
    if (auto status = flush_if_due(message.log_time_ns); !status) return status;
    const auto log_time = static_cast<std::uint64_t>(message.log_time_ns);
    if (chunk_.empty()) {
      chunk_opened_ns_ = message.log_time_ns;
      chunk_header_ = {};
      chunk_header_.start_time = chunk_header_.end_time = log_time;
    }
    chunk_header_.start_time = std::min(chunk_header_.start_time, log_time);
    chunk_header_.end_time = std::max(chunk_header_.end_time, log_time);
    chunk_index_[message.channel].emplace_back(log_time, chunk_.size());
    mcap::append(
        chunk_,
        {message.channel, message.sequence, log_time, static_cast<std::uint64_t>(message.publish_time_ns)},
        message.data);
    if (chunk_.size() >= options_.chunk_bytes) return flush();
    return {};
  }

  Status flush_if_due(std::int64_t now_ns) override {
    if (auto status = check_open(); !status) return status;
    // The clock may have been set back: never wait for it.
    const bool due = now_ns - chunk_opened_ns_ >= options_.chunk_ns || now_ns < chunk_opened_ns_;
    return !chunk_.empty() && due ? flush() : Status();
  }

  std::uint64_t size() const override { return offset_ + chunk_.size(); }

  std::uint64_t written(std::uint16_t channel) const override {
    return channel < written_.size() ? written_[channel] : 0;
  }

  std::shared_ptr<const GrowingRecording> growing() const override { return index_; }

  Status finish() override {
    if (!failure_.empty()) return Error{failure_};
    if (file_ < 0) return {};
    if (!chunk_.empty())
      if (auto status = flush(); !status) return status;
    Status status = write_index();
    while (!status && made_room()) status = write_index();
    return status ? close_file() : fail(status.error());
  }

 private:
  using Parts = std::initializer_list<std::span<const std::uint8_t>>;

  Status check_open() const {
    if (!failure_.empty()) return Error{failure_};
    if (file_ < 0) return Error{path_.string() + ": the recording is finished"};
    return {};
  }

  Status write_all(std::span<const std::uint8_t> bytes) {
    while (!bytes.empty()) {
      const ssize_t written = ::write(file_, bytes.data(), bytes.size());
      if (written < 0 && errno == EINTR) continue;
      if (written <= 0) return cannot_write(written < 0 ? errno : ENOSPC);
      bytes = bytes.subspan(static_cast<std::size_t>(written));
    }
    return {};
  }

  /// Room on the disk for so many bytes and for the index behind them: whenever the disk is full, the index
  /// still fits. Where that cannot be asked for (NFS, FAT), what a failed write gives back has to do.
  Status reserve(std::uint64_t bytes) {
    const std::uint64_t length = bytes + index_bytes_;
    rlimit limit{};
    const bool limited = ::getrlimit(RLIMIT_FSIZE, &limit) == 0 && limit.rlim_cur != RLIM_INFINITY;
    int failure = limited && offset_ + length > limit.rlim_cur ? EFBIG : 0;
    if (failure == 0 && can_reserve_ &&
        ::fallocate(file_, FALLOC_FL_KEEP_SIZE, static_cast<off_t>(offset_), static_cast<off_t>(length)) !=
            0) {
      const bool full = errno == ENOSPC || errno == EDQUOT || errno == EFBIG;
      failure = full ? errno : 0;
      can_reserve_ = full;
    }
    return failure == 0 ? Status() : cannot_write(failure);
  }

  Status cannot_write(int failure) {
    is_full_ = failure == ENOSPC || failure == EDQUOT;
    return Error{"cannot write " + path_.string() + ": " + write_failure(failure)};
  }
  /// After a failure: whether it is worth trying again.
  bool made_room() const { return is_full_ && options_.make_room && options_.make_room(); }

  /// The index will be that much longer.
  template <typename Record>
  void index_grows_by(const Record& record) {
    Bytes bytes;
    mcap::append(bytes, record);
    index_bytes_ += bytes.size();
  }

  /// All parts or, after a failure, none: the file is cut back to where it was.
  Status write_whole(Parts parts) {
    std::uint32_t crc = crc_;
    std::uint64_t size = 0;
    for (const auto part : parts) {
      if (auto status = write_all(part); !status) {
        if (::ftruncate(file_, static_cast<off_t>(offset_)) == 0)
          static_cast<void>(::lseek(file_, static_cast<off_t>(offset_), SEEK_SET));
        return status;
      }
      crc = mcap::crc32(part, crc);
      size += part.size();
    }
    crc_ = crc;
    offset_ += size;
    return {};
  }

  /// A file without a name takes all that is written, and gives none of it back.
  Status check_name() const {
    struct stat of_file {};
    if (::fstat(file_, &of_file) != 0) return {};
    const bool removed = of_file.st_nlink == 0;
    if (!removed && (!options_.keeps_name || is_named(of_file))) return {};
    return Error{"cannot write " + path_.string() + ": it was " + (removed ? "removed" : "renamed") +
                 " while it was being recorded to"};
  }
  /// Also where the file system does not say.
  bool is_named(const struct stat& of_file) const {
    struct stat named {};
    if (::lstat(path_.c_str(), &named) != 0) return errno != ENOENT && errno != ENOTDIR;
    return named.st_dev == of_file.st_dev && named.st_ino == of_file.st_ino;
  }

  /// The first failure ends the recording: with its index where that still fits, else as it is, which readers
  /// recover. A file that no message has come to is removed.
  Status fail(const Error& error) {
    failure_ = error.message;
    chunk_.clear();
    static_cast<void>(write_index().ok());
    struct stat of_file {};
    const bool is_empty =
        std::all_of(written_.begin(), written_.end(), [](auto count) { return count == 0; });
    if (is_empty && ::fstat(file_, &of_file) == 0 && is_named(of_file)) ::unlink(path_.c_str());
    static_cast<void>(close_file().ok());
    return error;
  }
  Status write_or_close(Parts parts) {
    if (auto status = check_name(); !status) return fail(status.error());
    if (auto status = write_with_room(parts); !status) return fail(status.error());
    return {};
  }
  Status write_with_room(Parts parts) {
    std::uint64_t bytes = 0;
    for (const auto part : parts) bytes += part.size();
    for (;;) {
      Status status = reserve(bytes);
      if (status) status = write_whole(parts);
      if (status || !made_room()) return status;
    }
  }

  Status flush() {
    chunk_header_.uncompressed_size = chunk_.size();
    chunk_header_.records_size = chunk_.size();
    chunk_header_.uncompressed_crc = mcap::crc32(chunk_);
    Bytes head;
    mcap::append_chunk_header(head, chunk_header_);
    mcap::ChunkIndex index{.start_time = chunk_header_.start_time,
                           .end_time = chunk_header_.end_time,
                           .offset = offset_,
                           .length = head.size() + chunk_.size(),
                           .message_index_offsets = {},
                           .message_index_length = 0,
                           .compression = "",
                           .compressed_size = chunk_.size(),
                           .uncompressed_size = chunk_.size()};
    Bytes tail;
    for (auto& [channel, entries] : chunk_index_) {
      index.message_index_offsets.emplace_back(channel, offset_ + index.length + tail.size());
      mcap::append(tail, mcap::MessageIndex{channel, entries});
    }
    index.message_index_length = tail.size();
    index_grows_by(index);
    if (auto status = write_or_close({head, chunk_, tail}); !status) return status;
    if (auto status = sync(); !status) return status;
    for (const auto& [channel, entries] : chunk_index_) written_[channel] += entries.size();
    index_->add(std::move(index));
    chunk_.clear();
    chunk_index_.clear();
    return {};
  }

  Status sync() {
    const std::int64_t now_ns = static_cast<std::int64_t>(chunk_header_.end_time);
    const bool due = now_ns - synced_ns_ >= options_.sync_ns || now_ns < synced_ns_;  // as in flush_if_due()
    if (options_.sync_ns < 0 || !due) return {};
    synced_ns_ = now_ns;
    if (::fdatasync(file_) == 0 || errno == EINVAL || errno == EROFS) return {};
    return fail({"cannot write " + path_.string() + ": " + write_failure(errno)});
  }

  Status write_index() { return write_whole({index_->end(offset_, crc_)}); }

  Status close_file() {
    static_cast<void>(::ftruncate(file_, static_cast<off_t>(offset_)));  // gives back what was reserved
    const bool synced = ::fsync(file_) == 0 || errno == EINVAL || errno == EROFS;
    const int sync_error = errno;
    const bool closed = ::close(std::exchange(file_, -1)) == 0;
    if (synced && closed) return {};
    failure_ = "cannot write " + path_.string() + ": " + write_failure(synced ? errno : sync_error);
    return Error{failure_};
  }

  int file_ = -1;  // -1: closed
  const std::filesystem::path path_;
  const Options options_;
  std::string failure_;  // the first one; empty while all is well
  std::uint64_t offset_ = 0;
  std::uint32_t crc_ = 0;  // of everything before offset_
  bool can_reserve_ = true;
  bool is_full_ = false;                          // the disk, when something could not be written last
  std::uint64_t index_bytes_ = kEmptyIndexBytes;  // what write_index() will take, or a little more
  std::int64_t synced_ns_ = 0;                    // the end of the last chunk that is on the disk for sure

  std::vector<mcap::Schema> schemas_;
  std::vector<std::uint64_t> written_;  // messages of each channel
  const std::shared_ptr<mcap::WriterIndex> index_ = std::make_shared<mcap::WriterIndex>();

  Bytes chunk_;  // records of the open chunk
  mcap::ChunkHeader chunk_header_;
  std::int64_t chunk_opened_ns_ = 0;  // log time of its first message
  std::map<std::uint16_t, std::vector<std::pair<std::uint64_t, std::uint64_t>>> chunk_index_;
};

/// So that a power loss does not take the new name with it. Not all file systems can; no reason to fail.
void sync_folder(const std::filesystem::path& file) {
  const std::filesystem::path folder = file.has_parent_path() ? file.parent_path() : ".";
  const int handle = ::open(folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
  if (handle < 0) return;
  static_cast<void>(::fsync(handle));
  ::close(handle);
}

}  // namespace

Result<std::unique_ptr<RecordingWriter>> RecordingWriter::create(const std::filesystem::path& file,
                                                                 const Options& options) {
  if (options.chunk_bytes == 0 || options.chunk_bytes > mcap::kMaxChunkBytes / 2 || options.chunk_ns < 0)
    return Error{"chunk_bytes must be 1 to 536870912 and chunk_ns not negative"};
  const auto leads = where_to_write(file);
  const std::filesystem::path& path = leads ? *leads : file;  // the latter fails below
  const auto open_new = [&] { return ::open(path.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0644); };
  int handle = open_new();
  while (handle < 0 && (errno == ENOSPC || errno == EDQUOT) && options.make_room && options.make_room())
    handle = open_new();
  if (handle < 0) {
    if (errno == EEXIST)
      return Error{"cannot record to " + file.string() +
                   ": it exists already; give another name or remove it"};
    return Error{"cannot record to " + file.string() + ": " + write_failure(errno)};
  }
  auto writer = std::make_unique<Writer>(handle, path, options);
  if (auto status = writer->start(); !status) {
    ::unlink(path.c_str());
    return status.error();
  }
  sync_folder(path);
  return std::unique_ptr<RecordingWriter>(std::move(writer));
}

}  // namespace relievo
