// SPDX-License-Identifier: Apache-2.0
// Makes frames of buffers: two fields or two pictures each, by the driver's sequence numbers. Pure: neither
// reads a clock nor a device.
#pragma once

#include <cstdint>
#include <optional>

#include "base/rig.h"
#include "capture/source/field_source.h"
#include "capture/source/v4l2/capture_format.h"

namespace relievo::v4l2 {

/// What a buffer's header says.
struct BufferHeader {
  std::uint32_t sequence = 0;
  std::uint32_t field = 0;   // V4L2's; matters where fields alternate
  std::int64_t time_ns = 0;  // UTC, start of the buffer's first exposure
};

/// Where a buffer's picture belongs.
struct Place {
  Image8* picture = nullptr;
  bool one_field = false;  // every second row, from `first_row`
  int first_row = 0;
};

/// A buffer that is damaged is simply not placed. One thread.
class FrameAssembler {
 public:
  /// odd_pairs: see CameraOptions.
  FrameAssembler(const CaptureFormat& format, bool odd_pairs) : format_(format), odd_pairs_(odd_pairs) {}

  /// Where the picture of this buffer goes, which the caller then writes there and says so by finish().
  /// Buffers come in the driver's order; one that is left out is lost.
  Place place(const BufferHeader& header);
  /// The frame that the picture placed last completes. CapturedFrame::lost_before counts the frames between
  /// it and the one before that never were complete.
  std::optional<CapturedFrame> finish();

  /// The next buffer is the first of a stream: nothing is lost between it and the one before.
  void restart();

 private:
  /// False where it is the buffer before once more.
  bool count(std::uint32_t sequence);
  void begin(std::uint64_t index, std::int64_t time_ns);
  Place place_field(const BufferHeader& header);

  const CaptureFormat format_;
  const bool odd_pairs_;
  std::uint64_t next_number_ = 0;
  std::optional<std::uint64_t> step_;  // sequence numbers a frame where fields alternate: 1 or 2

  // Since the stream began.
  std::optional<std::uint32_t> last_sequence_;
  std::uint64_t position_ = 0;              // the sequence number, never wrapping
  std::optional<std::uint64_t> last_done_;  // index of the frame that was complete last

  CapturedFrame frame_;                 // under way
  std::optional<std::uint64_t> begun_;  // its index; where fields alternate its first field's position
  bool first_done_ = false;             // its first half is written
  bool placed_ = false;                 // a picture is placed and not finished,
  bool second_ = false;                 // and is the frame's last
};

}  // namespace relievo::v4l2
