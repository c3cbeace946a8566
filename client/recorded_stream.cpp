// SPDX-License-Identifier: Apache-2.0
#include "client/recorded_stream.h"

#include <algorithm>
#include <iterator>
#include <set>
#include <utility>

#include "base/counted.h"
#include "base/foreign_text.h"
#include "base/log.h"
#include "codec/frame3d_codec.h"
#include "idl/cdr.h"
#include "idl/recorder.h"

namespace relievo {
namespace {

// How far into a file a description is looked for: it is received with the first frames.
constexpr int kInfoWithinSamples = 1000;
constexpr std::size_t kMostTopics = 5;  // that are named of another program's file
constexpr std::size_t kMostSaid = 20;   // damaged parts: a long file can have tens of thousands

std::optional<Topic> topic_of(const RecordingChannel& channel) {
  if (channel.message_encoding != "cdr") return std::nullopt;
  for (const Topic topic : {Topic::kInfo, Topic::kFrame, Topic::kStatus}) {
    if (channel.topic == topic_type(topic).topic_name) return topic;
  }
  return std::nullopt;
}

std::string stream_of(const RecordingChannel& channel) {
  for (const auto& [key, value] : channel.metadata) {
    if (key == "stream" && valid_stream_name(value)) return value;
  }
  return {};
}

std::string joined(const std::set<std::string>& names) {
  std::string text;
  for (const auto& name : names) text += (text.empty() ? "" : ", ") + name;
  return text;
}

/// Of a file without a stream: what it is instead.
std::string what_else(const RecordingSummary& summary) {
  if (summary.channels.empty())
    return summary.recovered ? ": it was cut short before anything was recorded" : ": it is empty";
  const bool of_ros = std::ranges::any_of(
      summary.schemas, [](const auto& schema) { return schema.encoding.starts_with("ros2"); });
  std::set<std::string> topics;
  for (const RecordingChannel& channel : summary.channels) {
    topics.insert(foreign_text(channel.topic));
  }
  const std::size_t more = topics.size() > kMostTopics ? topics.size() - kMostTopics : 0;
  while (topics.size() > kMostTopics) topics.erase(std::prev(topics.end()));
  return ", but " + joined(topics) + (more > 0 ? " and " + counted(more, "more topic") : "") +
         (of_ros
              ? ": it is a bag of ROS 2, for `ros2 bag play -s mcap`; a stream is in the recording that it "
                "was made of"
              : ", of another program");
}

}  // namespace

bool needed_later(const RawSample& sample) {
  if (sample.topic != Topic::kFrame) return sample.topic == Topic::kInfo;
  if (holds_key_frame(sample.cdr)) return true;
  const auto view = read_frame_cdr(sample.cdr);
  const auto header = view ? read_frame_header(view->data) : Result<FrameHeader>(view.error());
  return header && header->texture == TextureCodec::kH264;
}

namespace {

/// The last one up to then, by this time of its sample; the first one before all of them.
const RecordedInfo* last_info(std::span<const RecordedInfo> infos, std::int64_t RawSample::*time,
                              std::int64_t time_ns) {
  if (infos.empty()) return nullptr;
  for (std::size_t i = infos.size(); i-- > 1;)
    if (infos[i].sample.*time <= time_ns) return &infos[i];
  return &infos[0];
}

}  // namespace

const RecordedInfo* info_of(const RawSample& frame, std::span<const RecordedInfo> infos) {
  return last_info(infos, &RawSample::source_time_ns, frame.source_time_ns);
}

const RecordedInfo* info_at(std::int64_t time_ns, std::span<const RecordedInfo> infos) {
  return last_info(infos, &RawSample::receive_time_ns, time_ns);
}

Result<RecordedStream> RecordedStream::open(const std::filesystem::path& file, const std::string& stream) {
  auto reader = RecordingReader::open(file);
  if (!reader) return reader.error();
  RecordedStream recorded;
  recorded.file_ = file;
  recorded.reader_ = std::move(reader).value();
  const RecordingSummary& summary = recorded.reader_->summary();

  if (summary.recordings > 1)
    log_warning(
        file.string() + " is " + std::to_string(summary.recordings) +
        " recordings, one behind the other: all are read here; `relievo recover` makes one of them that " +
        "other readers read, too");

  std::set<std::string> streams;
  for (const RecordingChannel& channel : summary.channels) {
    if (topic_of(channel) && !stream_of(channel).empty()) streams.insert(stream_of(channel));
  }
  if (streams.empty()) return Error{file.string() + " holds no 3D video stream" + what_else(summary)};
  if (stream.empty() && streams.size() > 1) {
    return Error{file.string() + " holds several streams: choose one with --stream (" + joined(streams) +
                 ")"};
  }
  recorded.stream_ = stream.empty() ? *streams.begin() : stream;
  if (streams.count(recorded.stream_) == 0) {
    return Error{file.string() + " holds no stream '" + stream + "', only " + joined(streams)};
  }
  recorded.read_channels();
  return recorded;
}

void RecordedStream::read_channels() {
  topics_.clear();
  for (const RecordingChannel& channel : summary().channels) {
    topics_.push_back(stream_of(channel) == stream_ ? topic_of(channel) : std::nullopt);
  }
}

Result<bool> RecordedStream::read_on() {
  auto more = reader_->read_on();
  if (more) read_channels();
  return more;
}

void RecordedStream::warn_if_cut() const {
  if (summary().recovered)
    log_warning(file_.string() +
                " is being written, or was cut short or damaged: this is of what is whole in it");
}

std::uint64_t RecordedStream::frames() const {
  std::uint64_t count = 0;
  for (std::size_t i = 0; i < topics_.size() && i < summary().channel_messages.size(); ++i) {
    if (topics_[i] == Topic::kFrame) count += summary().channel_messages[i];
  }
  return count;
}

void RecordedStream::tell_of_damage(const std::string& what) {
  if (said_.size() > kMostSaid || !said_.insert(what).second) return;
  if (said_.size() <= kMostSaid)
    log_warning("skipped a damaged part of the recording: " + what);
  else
    log_warning("more damaged parts are not told of one by one");
}

Result<std::optional<RawSample>> RecordedStream::next() {
  for (;;) {
    auto message = reader_->next();
    if (!message) {
      ++damaged_;
      tell_of_damage(message.error().message);
      continue;
    }
    if (!*message) return std::optional<RawSample>();
    RecordedMessage& m = **message;
    if (m.channel >= topics_.size() || !topics_[m.channel]) continue;
    return std::optional(
        RawSample{*topics_[m.channel], stream_, m.publish_time_ns, m.log_time_ns, std::move(m.data)});
  }
}

Status RecordedStream::rewind() {
  return reader_->seek(summary().start_ns);
}

Status RecordedStream::check_output(const std::filesystem::path& out) const {
  std::error_code missing;
  if (!std::filesystem::equivalent(out, file_, missing)) return {};
  return Error{out.string() + " is the recording itself: give another name"};
}

Result<std::vector<std::int64_t>> RecordedStream::frame_times() {
  return times_of(Topic::kFrame);
}

Result<std::vector<std::int64_t>> RecordedStream::times_of(Topic topic) {
  std::vector<std::int64_t> out;
  for (std::size_t i = 0; i < topics_.size(); ++i) {
    if (topics_[i] != topic) continue;
    auto times = reader_->times(static_cast<std::uint16_t>(i));
    if (!times) return times.error();
    out.insert(out.end(), times->begin(), times->end());
  }
  std::ranges::sort(out);
  return out;
}

Status RecordedStream::seek(std::int64_t time_ns) {
  static_assert(RecordingReader::kHeadBytes >= kFrameStartBytes);
  const auto key_ns =
      reader_->find_last(time_ns, [&](std::uint16_t channel, std::span<const std::uint8_t> head) {
        return topics_[channel] == Topic::kFrame && holds_key_frame(head);
      });
  return reader_->seek(key_ns.value_or(time_ns));
}

std::vector<RawSample> RecordedStream::attached_infos() const {
  std::vector<RawSample> out;
  for (const RecordingAttachment& attachment : summary().attachments) {
    if (attachment.name != kInfoAttachment) continue;
    const auto read = read_info_cdr(attachment.data);
    if (read && read->stream == stream_)
      out.push_back({Topic::kInfo, stream_, attachment.time_ns, attachment.time_ns, attachment.data});
  }
  return out;
}

Result<std::optional<RawSample>> RecordedStream::find_info() {
  if (auto attached = attached_infos(); !attached.empty()) return std::optional(std::move(attached.front()));
  std::optional<RawSample> info;
  const std::uint64_t damaged = damaged_;
  for (int i = 0; i < kInfoWithinSamples && !info; ++i) {
    auto sample = next();
    if (!sample) return sample.error();
    if (!*sample) break;
    if ((*sample)->topic == Topic::kInfo) info = std::move(*sample);
  }
  damaged_ = damaged;  // they are met again
  if (auto status = rewind(); !status) return status.error();
  return info;
}

/// Those among the messages, found by their times; and where some of them are damaged, those attached.
Result<std::vector<RawSample>> RecordedStream::info_samples() {
  const auto times = times_of(Topic::kInfo);
  if (!times) return times.error();
  std::vector<RawSample> out;
  const std::uint64_t damaged = damaged_;
  for (std::size_t i = 0; i < times->size(); ++i) {
    if (i > 0 && (*times)[i] == (*times)[i - 1]) continue;
    if (auto status = reader_->seek((*times)[i]); !status) return status.error();
    for (;;) {
      auto sample = next();
      if (!sample) return sample.error();
      if (!*sample || (*sample)->receive_time_ns > (*times)[i]) break;
      if ((*sample)->topic == Topic::kInfo) out.push_back(**std::move(sample));
    }
  }
  damaged_ = damaged;  // they are met again
  if (times->empty() || out.size() < times->size())
    std::ranges::move(attached_infos(), std::back_inserter(out));
  std::ranges::stable_sort(out, {}, &RawSample::receive_time_ns);
  return out;
}

Result<std::vector<RecordedInfo>> RecordedStream::read_infos() {
  auto samples = info_samples();
  if (!samples) return samples.error();
  if (auto status = rewind(); !status) return status.error();
  std::vector<RecordedInfo> out;
  for (RawSample& sample : *samples) {
    if (!out.empty() && out.back().sample.cdr == sample.cdr) continue;
    if (auto info = read_info_cdr(sample.cdr)) out.push_back({std::move(sample), *std::move(info)});
  }
  return out;
}

}  // namespace relievo
