// SPDX-License-Identifier: Apache-2.0
#include "codec/recording_recover.h"

#include <algorithm>
#include <system_error>
#include <utility>

#include "base/whole_file.h"
#include "codec/recording.h"

namespace relievo {
namespace {

namespace fs = std::filesystem;

/// A new file under a name of its own until it is complete.
class PartFile {
 public:
  explicit PartFile(fs::path whole) : whole_(std::move(whole)), part_(unfinished_name(whole_)) {}
  PartFile(const PartFile&) = delete;
  PartFile& operator=(const PartFile&) = delete;
  ~PartFile() {
    std::error_code ignored;
    if (made_) fs::remove(part_, ignored);
  }

  Result<std::unique_ptr<RecordingWriter>> create() {
    std::error_code ignored;
    if (fs::exists(whole_, ignored)) {
      return Error{whole_.string() + " exists already: name another file, or remove it"};
    }
    auto writer = RecordingWriter::create(part_, {});
    made_ = writer.ok();
    if (!writer) return failed(writer.error());
    return writer;
  }
  Error failed(const Error& error) const { return told_of(whole_, error, part_); }
  Status complete() {
    std::error_code error;
    fs::rename(part_, whole_, error);
    if (error) return Error{"cannot make " + whole_.string() + ": " + error.message()};
    made_ = false;
    return {};
  }

 private:
  const fs::path whole_, part_;
  bool made_ = false;
};

Status copy_description(const RecordingSummary& from, RecordingWriter& to) {
  for (const RecordingChannel& channel : from.channels) {
    const auto schema = std::ranges::find(from.schemas, channel.schema, &RecordingSchema::name);
    const auto added = to.add_channel(schema == from.schemas.end() ? RecordingSchema{} : *schema, channel);
    if (!added) return added.error();
  }
  for (const RecordingAttachment& attachment : from.attachments) {
    if (const Status added = to.add_attachment(attachment); !added) return added;
  }
  return {};
}

}  // namespace

Result<RecoveredRecording> recover_recording(const fs::path& damaged, const fs::path& copy,
                                             const RecoverProgress& progress) {
  auto reader = RecordingReader::open(damaged, {.rebuild_index = true});
  if (!reader) return reader.error();
  const RecordingSummary& from = (*reader)->summary();
  if (from.messages == 0)
    return Error{damaged.string() + " holds no whole message: nothing can be recovered"};
  const auto target = where_to_write(copy);
  if (!target) return target.error();
  PartFile part(*target);
  auto writer = part.create();
  if (!writer) return writer.error();
  if (const Status copied = copy_description(from, **writer); !copied) return part.failed(copied.error());

  RecoveredRecording out{
      .attachments = from.attachments.size(), .lost_bytes = from.lost_bytes, .recordings = from.recordings};
  out.left_out = from.damage;
  for (;;) {
    auto message = (*reader)->next();
    if (!message) {
      out.left_out.push_back(message.error().message);
      continue;
    }
    if (!*message) break;
    if (const Status written = (*writer)->write(**message); !written) return part.failed(written.error());
    ++out.messages;
    out.stopped = !progress(out.messages);
    if (out.stopped) return out;
  }
  if (const Status finished = (*writer)->finish(); !finished) return part.failed(finished.error());
  if (const Status complete = part.complete(); !complete) return complete.error();
  return out;
}

}  // namespace relievo
