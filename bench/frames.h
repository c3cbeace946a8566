// SPDX-License-Identifier: Apache-2.0
// Camera frames in memory, so that a benchmark measures neither a renderer nor a disk.
#pragma once

#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "base/image.h"
#include "base/result.h"
#include "capture/reconstruct/reconstructor.h"
#include "capture/source/field_source.h"
#include "cli/stop_signal.h"

namespace relievo::bench {

/// The first frames of a source. Played to and fro (0 1 2 1 0 1 ...): slides keep alternating and nothing
/// jumps, however few there are.
class FrameLoop {
 public:
  struct Options {
    bool truth = false;  // keep it where the source has any
  };
  /// Reads `count` frames (two at least), fewer where the source ends or 1 GiB is full. Nothing once stopped.
  static Result<std::optional<FrameLoop>> load(const std::string& uri, int count, StopSignal& stop,
                                               const Options& options);
  static Result<std::optional<FrameLoop>> load(const std::string& uri, int count, StopSignal& stop) {
    return load(uri, count, stop, Options{});
  }

  const SourceInfo& info() const { return info_; }
  std::size_t size() const { return frames_.size(); }
  /// Bytes of a frame's two fields.
  std::size_t frame_bytes() const;
  /// The n-th frame played; number and time as stored.
  const CapturedFrame& at(std::uint64_t n) const;
  /// Depth along the camera's z, metres, 0: none; of the stored frame that the source numbered so. Null where
  /// it is not known.
  const ImageF* truth(std::uint64_t number) const;

  /// A source that plays copies without end, numbers and times going on; not live, so a pipeline paces it.
  /// The loop must outlive it.
  std::unique_ptr<FieldSource> play() const;

 private:
  SourceInfo info_;
  std::vector<CapturedFrame> frames_;
  std::map<std::uint64_t, ImageF> truths_;
};

/// A source's first frames, and their surfaces and textures in order.
struct Reconstructed {
  FrameLoop loop;
  std::vector<Frame3D> frames;
};

/// As FrameLoop::load(). The error says where none could be reconstructed.
Result<std::optional<Reconstructed>> load_reconstructed(const std::string& uri, int count, StopSignal& stop,
                                                        Decoder decoder = ReconstructOptions{}.decoder,
                                                        const FrameLoop::Options& options = {});

}  // namespace relievo::bench
