// SPDX-License-Identifier: Apache-2.0
#include "idl/recorder.h"

#include <cstdlib>
#include <utility>

#include "base/log.h"
#include "base/time.h"
#include "idl/cdr.h"

namespace relievo {
namespace {

constexpr std::int64_t kAskAgain_ns = kNanosecondsPerSecond;
constexpr std::int64_t kClockStep_ns = kNanosecondsPerSecond;  // below it a clock is not said to be set
constexpr std::int64_t kKeyFrameTime_ns = 10 * kNanosecondsPerSecond;  // in which one that is asked for comes

constexpr const char* kRigAttachment = "rig.yaml";
constexpr const char* kPatternAttachment = "pattern.yaml";

Status attach_yaml(RecordingWriter& writer, const char* name, const std::string& text, std::int64_t time_ns) {
  return writer.add_attachment({name, "application/yaml", time_ns, Bytes(text.begin(), text.end())});
}

std::uint32_t sequence_of(const RawSample& sample) {
  if (sample.topic != Topic::kFrame) return 0;
  const auto frame = read_frame_cdr(sample.cdr);
  return frame ? static_cast<std::uint32_t>(frame->sequence) : 0;
}

}  // namespace

Status DescriptionAttachments::add_to(RecordingWriter& writer, const StreamInfo& info, const Bytes& cdr,
                                      std::int64_t time_ns) {
  // A server that came back with the same calibration does not make the file longer.
  if (const std::string yaml = to_yaml(info.rig); yaml != rig_yaml_) {
    rig_yaml_ = yaml;
    if (auto status = attach_yaml(writer, kRigAttachment, yaml, time_ns); !status) return status;
  }
  if (const std::string yaml = to_yaml(info.pattern); yaml != pattern_yaml_) {
    pattern_yaml_ = yaml;
    if (auto status = attach_yaml(writer, kPatternAttachment, yaml, time_ns); !status) return status;
  }
  if (cdr == cdr_) return {};
  cdr_ = cdr;
  return writer.add_attachment({kInfoAttachment, "application/octet-stream", time_ns, cdr});
}

bool is_description(const RecordingAttachment& attachment) {
  return attachment.name == kRigAttachment || attachment.name == kPatternAttachment ||
         attachment.name == kInfoAttachment;
}

Recorder::Recorder(Options options)
    : options_(std::move(options)), segments_(options_.file, options_.recording.segments) {}

Subscriber::Callbacks Recorder::callbacks() {
  Subscriber::Callbacks callbacks;
  callbacks.raw = [this](const RawSample& sample) {
    std::lock_guard lock(mutex_);
    add(sample);
  };
  callbacks.info = [this](const StreamInfo& info) {
    std::lock_guard lock(mutex_);
    counts_.live = true;
    info_ = info;
    add_attachments();
  };
  callbacks.lost = [this](const std::string&, std::uint64_t count) {
    std::lock_guard lock(mutex_);
    if (!limit_reached_) counts_.lost += count;
  };
  callbacks.gone = [this](const std::string& stream) {
    std::lock_guard lock(mutex_);
    counts_.live = false;
    if (!limit_reached_) log_info("stream '" + stream + "' has gone; recording goes on if it comes back");
  };
  return callbacks;
}

Recorder::Counts Recorder::counts() const {
  std::lock_guard lock(mutex_);
  return counts_;
}

std::vector<std::filesystem::path> Recorder::files() const {
  const std::lock_guard lock(mutex_);
  return files_;
}

std::filesystem::path Recorder::file() const {
  const std::lock_guard lock(file_mutex_);
  return file_;
}

std::shared_ptr<const GrowingRecording> Recorder::growing() const {
  const std::lock_guard lock(file_mutex_);
  return growing_;
}

bool Recorder::is_open() const {
  const std::lock_guard lock(file_mutex_);
  return open_;
}

bool Recorder::done() const {
  std::lock_guard lock(mutex_);
  return limit_reached_ || error_.has_value();
}

Status Recorder::status() const {
  std::lock_guard lock(mutex_);
  return error_ ? Status(*error_) : Status();
}

void Recorder::tick(std::int64_t now_ns) {
  std::lock_guard lock(mutex_);
  if (writer_ && !error_) fail(writer_->flush_if_due(now_ns + log_from_even_ns_));
  if (options_.max_s > 0 && first_frame_ns_ > 0 && seconds(now_ns - first_frame_ns_) >= options_.max_s) {
    limit_reached_ = true;
  }
}

bool Recorder::wants_key_frame(std::int64_t now_ns) {
  const std::lock_guard lock(mutex_);
  if (!full_ns_ || limit_reached_ || error_) return false;
  if (asked_ns_ && now_ns - *asked_ns_ < kAskAgain_ns) return false;
  asked_ns_ = now_ns;
  return true;
}

Status Recorder::finish() {
  std::lock_guard lock(mutex_);
  if (writer_) {
    const Status finished = writer_->finish();
    if (!error_) fail(finished);
    writer_.reset();
    const std::lock_guard file_lock(file_mutex_);
    open_ = false;
  }
  limit_reached_ = true;
  return error_ ? Status(*error_) : Status();
}

void Recorder::add(const RawSample& sample) {
  const bool is_frame = sample.topic == Topic::kFrame;
  if (error_ && is_frame && !limit_reached_) ++counts_.missed;
  if (limit_reached_ || error_) return;
  const std::int64_t now_ns = sample.even_time_ns();
  if (is_frame && options_.max_s > 0 && first_frame_ns_ > 0 &&
      seconds(now_ns - first_frame_ns_) >= options_.max_s) {
    limit_reached_ = true;
    return;
  }
  if (!writer_) {
    fail(open_file(sample));
  } else if (is_frame && segment_ends_before(sample)) {
    fail(next_segment(sample));
  }
  if (!error_) fail(write(sample));
  if (!error_ && is_frame && foxglove_) fail(write_for_viewers(sample));
  if (sample.topic == Topic::kInfo) info_sample_ = sample;
  if (error_) {
    counts_.missed += is_frame;
    return;
  }
  counts_.bytes += sample.cdr.size();
  counts_.live = true;
  if (!is_frame) return;
  if (first_frame_ns_ == 0) first_frame_ns_ = now_ns;
  if (counts_.frames == frames_before_) segment_ns_ = now_ns;
  ++counts_.frames;
  counts_.duration_s = seconds(now_ns - first_frame_ns_);
  limit_reached_ = options_.max_frames > 0 && counts_.frames >= options_.max_frames;
}

void Recorder::add_attachments() {
  // raw comes before info, so there are a writer and a sample.
  if (!writer_ || !info_ || !info_sample_ || error_ || limit_reached_) return;
  fail(attachments_.add_to(*writer_, *info_, info_sample_->cdr, described_ns_));
}

Status Recorder::open_file(const RawSample& first) {
  log_from_even_ns_ = first.receive_time_ns - first.even_time_ns();
  const std::filesystem::path file = options_.recording.segments.split() ? segments_.next() : options_.file;
  now_writes(file, nullptr);  // before it can be found
  auto writer =
      RecordingWriter::create(file, {.sync_ns = static_cast<std::int64_t>(options_.recording.sync_s * 1e9),
                                     .keeps_name = options_.keeps_name,
                                     .make_room = [this] { return make_room(); }});
  if (!writer) return writer.error();
  writer_ = std::move(writer).value();
  now_writes(file, writer_->growing());
  frames_before_ = counts_.frames;
  ++counts_.files;
  files_.push_back(file);
  for (const Topic topic : {Topic::kInfo, Topic::kFrame, Topic::kStatus}) {
    const TopicType& type = topic_type(topic);
    auto channel =
        writer_->add_channel({type.type_name, "omgidl", type.idl},
                             {type.topic_name, "cdr", type.type_name, {{"stream", options_.stream}}});
    if (!channel) return channel.error();
    channels_[static_cast<std::size_t>(topic)] = *channel;
  }
  if (!options_.foxglove) return {};
  auto foxglove = FoxgloveChannels::add_to(*writer_, options_.stream);
  if (!foxglove) return foxglove.error();
  foxglove_ = *std::move(foxglove);
  return {};
}

void Recorder::now_writes(const std::filesystem::path& file,
                          std::shared_ptr<const GrowingRecording> growing) {
  const std::lock_guard lock(file_mutex_);
  file_ = file;
  growing_ = std::move(growing);
  open_ = true;
}

/// UTC as it was when the file was begun, going on evenly whatever the clock is set to: a file is read in the
/// order of its log times, so that what was received later must not seem to be from before.
std::int64_t Recorder::log_time_ns(const RawSample& sample) const {
  return sample.even_time_ns() + log_from_even_ns_;
}

bool Recorder::clock_was_set(const RawSample& sample) const {
  return std::llabs(sample.receive_time_ns - log_time_ns(sample)) >= kClockStep_ns;
}

/// At a frame that decodes without those before. Where none comes although it was asked for, the file goes
/// on: up to what may be kept of all files, since otherwise it would fill the disk.
bool Recorder::segment_ends_before(const RawSample& frame) {
  if (!options_.recording.segments.split() || counts_.frames == frames_before_) return false;
  const std::int64_t now_ns = frame.even_time_ns();
  const std::uint64_t bytes = writer_->size();
  const double duration_s = seconds(now_ns - segment_ns_);
  if (!full_ns_ && !segments_.is_full(bytes, duration_s) && !clock_was_set(frame)) return false;
  if (holds_key_frame(frame.cdr)) return true;
  if (!full_ns_) full_ns_ = now_ns;
  if (now_ns - *full_ns_ < kKeyFrameTime_ns) return false;
  if (!std::exchange(said_waiting_, true))
    log_warning("stream '" + options_.stream + "' sends no frame that decodes alone: the recording's files " +
                "become longer than asked for");
  return segments_.is_all_kept(bytes, duration_s);
}

/// Each file can be read without the others: it begins with the stream's description.
Status Recorder::next_segment(const RawSample& first) {
  if (const Status finished = writer_->finish(); !finished) return finished;
  if (const Status opened = open_file(first); !opened) return opened;
  full_ns_.reset();
  attachments_ = {};
  if (info_sample_) {
    RawSample info = *info_sample_;
    info.receive_time_ns = first.receive_time_ns;
    info.steady_time_ns = first.steady_time_ns;
    if (const Status written = write(info); !written) return written;
  }
  add_attachments();
  if (const Status removed = segments_.remove_old(file()); !removed) log_warning(removed.error().message);
  forget_removed();
  return {};
}

/// Who limits the size of all files has said that old ones may go: also where the disk holds less than that.
bool Recorder::make_room() {
  if (options_.recording.segments.keep_bytes == 0) return false;
  const auto removed = segments_.remove_oldest(file());
  if (!removed) log_warning(removed.error().message);
  if (!removed || removed->empty()) return false;
  if (!std::exchange(said_full_, true))
    log_warning(
        "the disk is full before this recording is as large as it may be: its oldest files are removed, " +
        removed->string() + " first");
  forget_removed();
  return true;
}

void Recorder::forget_removed() {
  std::error_code ignored;
  std::erase_if(files_, [&](const std::filesystem::path& f) { return !std::filesystem::exists(f, ignored); });
}

Status Recorder::write(const RawSample& sample) {
  if (clock_was_set(sample) && !options_.recording.segments.split() && !std::exchange(said_set_, true))
    log_warning("the clock was set while " + file().string() +
                " is recorded: its times go on by what the clock said when it was begun");
  RecordedMessage message;
  message.channel = channels_[static_cast<std::size_t>(sample.topic)];
  message.sequence = sequence_of(sample);
  message.log_time_ns = log_time_ns(sample);
  if (sample.topic == Topic::kInfo) described_ns_ = message.log_time_ns;
  message.publish_time_ns = sample.source_time_ns;
  message.data = sample.cdr;
  return writer_->write(message);
}

/// What cannot be decoded, before the first key frame say, is recorded all the same, but not shown.
Status Recorder::write_for_viewers(const RawSample& frame) {
  const auto view = read_frame_cdr(frame.cdr);
  if (!view) return {};
  const auto decoded = decoder_.decode(view->data);
  if (!decoded) return {};
  return foxglove_->write(*writer_, *decoded, info_ ? &info_->rig.camera : nullptr,
                          {log_time_ns(frame), frame.source_time_ns, view->capture_time_ns});
}

/// What was still in memory is not in the file either.
void Recorder::fail(const Status& status) {
  if (status || error_) return;
  error_ = status.error();
  if (!writer_) return;
  const std::uint64_t frames =
      frames_before_ + writer_->written(channels_[static_cast<std::size_t>(Topic::kFrame)]);
  counts_.missed += counts_.frames - frames;
  counts_.frames = frames;
}

}  // namespace relievo
