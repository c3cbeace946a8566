// SPDX-License-Identifier: Apache-2.0
// capture -> reconstruct -> encode -> publish: one thread a stage, bounded queues between them. What else
// may take long, as lower qualities, looks at the rig and disks, has threads of its own that no stage waits
// for.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "base/result.h"
#include "base/stream.h"
#include "capture/reconstruct/reconstructor.h"
#include "capture/source/field_source.h"
#include "codec/frame3d_codec.h"
#include "server/frame_tap.h"
#include "server/rate_control.h"
#include "web/gateway/stage_times.h"

namespace relievo {

/// Where encoded frames go: DDS, the gateway, a counter in a test. Called on the publishing thread, one call
/// at a time.
class FrameSink {
 public:
  virtual ~FrameSink() = default;
  /// A failure ends the pipeline with this error.
  virtual Status consume(const FrameMessage& frame) = 0;
  virtual Status consume(const ServerStatus& status) = 0;
};

/// Makes lower qualities of the frames that were encoded. The caller keeps it.
class LowerRungs {
 public:
  virtual ~LowerRungs() = default;
  /// Whether take() is to be called. This and take() are called on the encoding thread and return at once.
  virtual bool wanted() = 0;
  /// `line_stride`: of the frame's surface, as ReconstructOptions has it.
  virtual void take(Frame3D frame, std::int64_t capture_time_ns, int line_stride) = 0;
  /// Called with each frame that was taken when it is done with, on any thread, until end() has returned; so
  /// that the next ones are made in its memory. Before the first take().
  virtual void give_back_to(std::function<void(Frame3D&&)> give_back) = 0;
  /// No more comes. Returns when all that was begun is done; what was not is not.
  virtual void end() = 0;
  /// What the rungs made of it have done. Any thread.
  virtual std::vector<RungStatus> status() const = 0;
};

struct PipelineOptions {
  std::string stream;
  std::string label{};    // of its lines in the log, where there are several: "left"
  bool paced = true;      // a source that is not live is played at its own time stamps
  bool lossless = false;  // full queues wait instead of dropping the oldest: for tests and offline work
  std::optional<std::uint64_t> frames;  // end after this many camera frames
  ReconstructOptions reconstruct;
  // Decoder and lines are chosen while it runs, so that all of the camera's frames are reconstructed
  // (pace.h).
  bool auto_pace = false;
  EncodeOptions encode;  // volume.size_m 0: fitted to the first frame, grown when a frame leaves it
  // Step of coded positions, of the distance to the nearest part of the scene; overrides position_bits.
  double depth_resolution = 1e-4;
  RateTargets rate;  // what is kept by coarser frames; none: all are as `encode` says
  // False: the rig is a guess, so that surfaces may be missing for long; the status says so.
  bool calibrated = true;
  FrameTap* tap = nullptr;      // must outlive the pipeline; null: nobody looks at single frames
  LowerRungs* rungs = nullptr;  // must outlive the pipeline; null: there is the full quality only
};

/// Between key frames that readers wish for: who joins is to have a picture within 0.2 s.
inline constexpr std::int64_t kWishedKeyInterval_ns = 100'000'000;

class Pipeline {
 public:
  /// `source` and `sinks` must outlive the pipeline. Fails where rig and pattern do not fit.
  static Result<std::unique_ptr<Pipeline>> create(FieldSource& source, std::vector<FrameSink*> sinks,
                                                  const PipelineOptions& options);
  virtual ~Pipeline() = default;

  /// Runs until the source ends, a sink fails, or stop(); then every queue has been emptied into the sinks.
  /// Fails with the sink's error, or the source's where it ended with one. Call once.
  virtual Status run() = 0;

  /// Ends run() soon. Any thread, any number of times.
  virtual void stop() = 0;

  /// Some reader cannot decode what comes: a key frame follows soon. Wishes within 0.1 s of one are met
  /// together. Any thread, any number of times; returns at once.
  virtual void request_key_frame() = 0;

  /// Counts so far. Any thread.
  virtual ServerStatus status() const = 0;
  /// What its stages take, but for what is sent again. Any thread.
  virtual StageTimes stages() const = 0;
};

}  // namespace relievo
