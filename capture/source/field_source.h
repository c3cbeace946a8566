// SPDX-License-Identifier: Apache-2.0
// Where fields come from: a take on disk, the simulator, a camera. One interface, one compliance suite
// (tests/unit/capture/source_compliance_test.cpp) that every source must pass.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>

#include "base/image.h"
#include "base/pattern.h"
#include "base/result.h"
#include "base/rig.h"
#include "capture/source/camera_options.h"

namespace relievo {

/// One camera frame: two exposures one after the other. The first is under a slide, the second under what the
/// pattern's scheme says: the slide's complement, or white; of a white frame both are under white. Owns its
/// pixels.
struct CapturedFrame {
  std::uint64_t number = 0;  // counted by the source from 0; a looping source keeps counting
  std::int64_t time_ns = 0;  // start of the first field, since the source's own start (see SourceInfo::live)
  Scan scan = Scan::kInterlaced;
  FieldOrder field_order = FieldOrder::kTop;
  Image8 picture;     // RGB: the interlaced picture, or the progressive one under the slide
  Image8 complement;  // progressive only: the picture under the complement, or what the scheme has for it
  std::uint64_t lost_before = 0;  // frames that the source knows it lost between the one before and this one
  bool starts_again = false;      // a looped take from its start: the slide may be that of the frame before

  /// The exposure under the slide: every second row of an interlaced picture, or the whole first picture.
  View8 slide_field() const { return scan == Scan::kInterlaced ? field(0) : picture.view(); }
  /// The exposure after it: the other rows of an interlaced picture, or the whole second picture.
  View8 complement_field() const { return scan == Scan::kInterlaced ? field(1) : complement.view(); }

  /// All but the pictures, which stay.
  void take_heading(const CapturedFrame& other) {
    number = other.number;
    time_ns = other.time_ns;
    scan = other.scan;
    field_order = other.field_order;
    lost_before = other.lost_before;
    starts_again = other.starts_again;
  }
  CapturedFrame clone() const {
    CapturedFrame out;
    out.take_heading(*this);
    out.picture = picture.clone();
    out.complement = complement.clone();
    return out;
  }

 private:
  View8 field(int half) const {
    return picture.view().field(field_order == FieldOrder::kTop ? half : 1 - half);
  }
};

struct SourceInfo {
  std::string name;  // as asked for, e.g. "take:bunny"
  Rig rig;
  Pattern pattern;
  bool live = false;                    // true: next() returns at the camera's own pace and times are UTC
  std::optional<std::uint64_t> frames;  // how many there are in one pass, where the source is finite
};

/// What went wrong in a camera since it was opened; 0 of other sources.
struct SourceCounts {
  std::uint64_t lost_frames = 0;       // by the driver's sequence numbers, damaged ones among them
  std::uint64_t damaged_pictures = 0;  // that the driver or the decompressor says are not whole
  std::uint64_t restarts = 0;          // of streaming, after the driver gave up
  std::uint64_t reconnects = 0;        // after the camera was unplugged
};

/// Lives on one thread at a time: construct, next() until it ends, destroy. Only request_stop() may be called
/// from another thread. A source does not pace itself unless it is live; whoever plays it does, by
/// CapturedFrame::time_ns.
class FieldSource {
 public:
  virtual ~FieldSource() = default;

  /// Constant for the source's life.
  virtual const SourceInfo& info() const = 0;

  /// The next frame in order; nothing at the end or once stopped. After an error the source may be asked
  /// again: it goes on behind what it could not read where that is possible, and ends otherwise.
  virtual Result<std::optional<CapturedFrame>> next() = 0;

  /// Makes a waiting next() return soon, and every later one return nothing. Any thread.
  virtual void request_stop() = 0;

  /// Of the frames so far. The same thread as next().
  virtual SourceCounts counts() const { return {}; }
};

struct SourceOptions {
  bool loop = false;     // start again at the end, times and numbers going on; a camera has no end
  CameraOptions camera;  // of "v4l2:DEVICE"
};

/// Opens "sim:SCENE", "take:DIR" or "v4l2:DEVICE". The error says what is wrong with the name or the source
/// and how to mend it.
Result<std::unique_ptr<FieldSource>> open_source(const std::string& uri, const SourceOptions& options);

/// Fails where the name alone tells that open_source() would: of no known kind, or of a simulated source a
/// scene, key or value that there is not. Opens, reads and renders nothing.
Status check_source(const std::string& uri);

}  // namespace relievo
