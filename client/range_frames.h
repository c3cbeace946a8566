// SPDX-License-Identifier: Apache-2.0
// The frames of a part of a recording, decoded.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>

#include "base/frame3d.h"
#include "base/result.h"
#include "client/recorded_stream.h"
#include "client/time_range.h"
#include "codec/frame3d_codec.h"
#include "idl/cdr.h"

namespace relievo {

struct DecodedFrame {
  Frame3D frame;
  RawSample sample;                    // that it was recorded as,
  std::span<const std::uint8_t> data;  // and in it the bytes that it was decoded from
};

/// Frames that could not be decoded.
struct LeftOut {
  std::uint64_t unreadable = 0;         // their bytes are wrong,
  std::string first_problem;            // in this way
  std::uint64_t without_key_frame = 0;  // what they build on is not there

  std::uint64_t frames() const { return unreadable + without_key_frame; }
  /// False where it cannot be decoded, and is counted here; `out` then holds nothing of meaning.
  bool decode(const Result<FrameView>& frame, FrameDecoder& decoder, Frame3D& out);
  /// Where there are some: how many, and why.
  std::string text() const;
  /// Where no frame could be decoded.
  Error all() const;
  /// At the end, where others could. Fails where bytes are wrong, saying what became of the others:
  /// `written`, "7 frames are in DIR". Logs those that the recording itself lacks something of.
  Status told(const std::string& written) const;
};

/// One thread.
class RangeFrames {
 public:
  /// `recorded` must outlive it; nobody else reads it meanwhile.
  static Result<RangeFrames> open(RecordedStream& recorded, const TimeRange& range);

  /// The next one that can be decoded; nothing at the end of the range. What cannot is counted. Times rise:
  /// where a session's begin anew (a server that was started again, a loop), they go on by when frames were
  /// received.
  Result<std::optional<DecodedFrame>> next();

  const LeftOut& left_out() const { return left_out_; }

 private:
  RangeFrames(RecordedStream& recorded, const TimeRange& range) : recorded_(&recorded), range_(range) {}
  Status read_ahead();
  std::int64_t rising(std::int64_t time_ns, std::int64_t received_ns);

  RecordedStream* recorded_;
  TimeRange range_;
  FrameDecoder decoder_;
  std::optional<RawSample> ahead_;  // the next frame
  LeftOut left_out_;
  // Of the last frame that was given:
  std::optional<std::int64_t> time_ns_;
  std::int64_t received_ns_ = 0;
  std::int64_t later_ns_ = 0;  // that its session's times are put
};

}  // namespace relievo
