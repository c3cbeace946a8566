// SPDX-License-Identifier: Apache-2.0
// Writes one stream's samples to a recording as they come: of `relievo record` and of a server that records.
#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "base/recording_options.h"
#include "base/result.h"
#include "codec/foxglove.h"
#include "codec/frame3d_codec.h"
#include "codec/recording.h"
#include "idl/recording_segments.h"
#include "idl/transport.h"

namespace relievo {

/// Name of the attachment that repeats the stream's description, a StreamInfo as CDR: it is in one chunk
/// only, and frames cannot be shown without it.
constexpr const char* kInfoAttachment = "stream_info.cdr";

/// Attaches what describes a stream to a recording: calibration, pattern and the StreamInfo itself; of each
/// only what is not as it was attached last. One thread.
class DescriptionAttachments {
 public:
  /// `cdr`: that `info` was read from.
  Status add_to(RecordingWriter& writer, const StreamInfo& info, const Bytes& cdr, std::int64_t time_ns);

 private:
  std::string rig_yaml_, pattern_yaml_;
  Bytes cdr_;
};

/// Whether an attachment is one of those.
bool is_description(const RecordingAttachment& attachment);

/// Fed by a Subscriber's thread, watched by another: every function may be called from any thread. It writes
/// on the feeding thread; while the disk is slow, samples wait in DDS's own bounded queue, and what that
/// loses is counted.
class Recorder {
 public:
  struct Options {
    std::filesystem::path file;
    std::string stream;
    std::uint64_t max_frames = 0;  // 0: no limit
    double max_s = 0;              // after the first frame; 0: no limit
    bool foxglove = false;         // channels besides that generic viewers show: FoxgloveChannels
    RecordingOptions recording;    // where it splits, `file` names the files: see RecordingSegments
    bool keeps_name = false;       // as RecordingWriter::Options
  };
  struct Counts {
    std::uint64_t frames = 0;  // in the files; while all is well, those on their way there among them
    std::uint64_t lost = 0;    // on the way here
    std::uint64_t missed = 0;  // that could not be written, or came after that
    std::uint64_t bytes = 0;   // of samples
    std::uint64_t files = 0;   // begun, those that `keep` removed among them
    double duration_s = 0;     // first to last frame
    bool live = false;         // the stream is there now
  };

  explicit Recorder(Options options);

  /// What a Subscriber is to call. The recorder must outlive it.
  Subscriber::Callbacks callbacks();

  Counts counts() const;
  /// Those that were begun and are there still: `keep` removes old ones. In order.
  std::vector<std::filesystem::path> files() const;
  /// The file that is being written, or was last; empty before the first sample.
  std::filesystem::path file() const;
  /// What is whole of it; null before the first sample.
  std::shared_ptr<const GrowingRecording> growing() const;
  /// It is not finished. As file() and growing(), this does not wait for the disk.
  bool is_open() const;
  /// The limit of frames or seconds is reached, or writing has failed.
  bool done() const;
  /// Ok, or why writing has failed.
  Status status() const;
  /// To be called about ten times a second: bounds what a crash loses while no samples come. `now_ns`, here
  /// and below: as RawSample::even_time_ns.
  void tick(std::int64_t now_ns);
  /// Whether the stream's server is to be asked for a key frame: a file is full, and ends before the next
  /// one. To be called as often; true once a second.
  bool wants_key_frame(std::int64_t now_ns);
  /// Completes the file. The first error of all there were; ok where nothing was ever received, and then
  /// there is no file.
  Status finish();

 private:
  void add(const RawSample& sample);
  void add_attachments();
  Status open_file(const RawSample& first);
  std::int64_t log_time_ns(const RawSample& sample) const;
  bool clock_was_set(const RawSample& sample) const;
  void now_writes(const std::filesystem::path& file, std::shared_ptr<const GrowingRecording> growing);
  bool segment_ends_before(const RawSample& frame);
  Status next_segment(const RawSample& first);
  Status write(const RawSample& sample);
  Status write_for_viewers(const RawSample& frame);
  bool make_room();
  void forget_removed();
  void fail(const Status& status);

  const Options options_;
  mutable std::mutex mutex_;
  std::uint16_t channels_[3] = {};
  std::optional<FoxgloveChannels> foxglove_;
  FrameDecoder decoder_;  // of what goes there
  const RecordingSegments segments_;
  std::int64_t log_from_even_ns_ = 0;     // to add for a file's log times: see log_time_ns()
  std::int64_t described_ns_ = 0;         // log time of the last description
  bool said_set_ = false;                 // that the clock was
  std::int64_t segment_ns_ = 0;           // when its first frame was received
  std::optional<std::int64_t> full_ns_;   // since when it waits for a key frame to end before
  std::optional<std::int64_t> asked_ns_;  // when one was last asked for
  bool said_waiting_ = false;
  bool said_full_ = false;                    // that the disk is
  std::uint64_t frames_before_ = 0;           // in the files before it
  std::vector<std::filesystem::path> files_;  // as files()
  std::optional<StreamInfo> info_;            // as received last,
  std::optional<RawSample> info_sample_;      // and as it came
  DescriptionAttachments attachments_;        // of the file being written
  std::optional<Error> error_;
  Counts counts_;
  std::int64_t first_frame_ns_ = 0;
  bool limit_reached_ = false;

  mutable std::mutex file_mutex_;                    // of what follows; held for a moment at a time
  std::filesystem::path file_;                       // being written
  std::shared_ptr<const GrowingRecording> growing_;  // of it
  bool open_ = false;

  // Made with the first sample, so that no empty file is left. Last: it may make room as it ends.
  std::unique_ptr<RecordingWriter> writer_;
};

}  // namespace relievo
