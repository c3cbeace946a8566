// SPDX-License-Identifier: Apache-2.0
#include "client/range_frames.h"

#include <algorithm>
#include <limits>
#include <utility>

#include "base/counted.h"
#include "base/log.h"
#include "idl/cdr.h"

namespace relievo {
namespace {

/// Of two surfaces published for one camera frame the first is the one between (scheme white-field).
bool is_between(const FrameView& frame, const std::optional<RawSample>& following) {
  const auto next = following ? read_frame_cdr(following->cdr) : Result<FrameView>(Error{});
  return next && next->number == frame.number && next->sequence == frame.sequence + 1;
}

/// Of numbers from 0 on; the largest there is where that is less.
std::int64_t sum(std::int64_t a, std::int64_t b) {
  return a + std::min(b, std::numeric_limits<std::int64_t>::max() - a);
}

}  // namespace

bool LeftOut::decode(const Result<FrameView>& frame, FrameDecoder& decoder, Frame3D& out) {
  if (frame && read_frame_header(frame->data) && !decoder.can_decode(frame->data)) {
    ++without_key_frame;
    return false;
  }
  const Status decoded = frame ? decoder.decode(frame->data, out) : Status(frame.error());
  if (!decoded && unreadable++ == 0) first_problem = decoded.error().message;
  return decoded.ok();
}

std::string LeftOut::text() const {
  const std::string why =
      unreadable > 0 ? first_problem : "the key frame before is damaged, or not in the recording";
  return counted(frames(), "frame") + " could not be decoded and " + (frames() == 1 ? "was" : "were") +
         " left out: " + why;
}

Error LeftOut::all() const {
  return {unreadable > 0 ? text() : "no frame in that range is whole, with the key frame it builds on"};
}

Status LeftOut::told(const std::string& written) const {
  if (unreadable > 0) return Error{text() + "; the other " + written};
  if (frames() > 0) log_warning(text());
  return {};
}

Result<RangeFrames> RangeFrames::open(RecordedStream& recorded, const TimeRange& range) {
  if (auto status = recorded.seek(range.from_ns); !status) return status.error();
  RangeFrames frames(recorded, range);
  if (auto status = frames.read_ahead(); !status) return status.error();
  return frames;
}

Result<std::optional<DecodedFrame>> RangeFrames::next() {
  while (ahead_ && ahead_->receive_time_ns <= range_.to_ns) {
    DecodedFrame out{.frame = {}, .sample = *std::move(ahead_), .data = {}};
    if (auto status = read_ahead(); !status) return status.error();
    const auto view = read_frame_cdr(out.sample.cdr);
    if (out.sample.receive_time_ns < range_.from_ns) {
      if (view) (void)decoder_.remember(view->data);  // those in the range may build on it
      continue;
    }
    if (!left_out_.decode(view, decoder_, out.frame)) continue;
    out.frame.between = is_between(*view, ahead_);
    out.frame.time_ns = rising(out.frame.time_ns, out.sample.receive_time_ns);
    out.data = view->data;
    return std::optional(std::move(out));
  }
  return std::optional<DecodedFrame>();
}

Status RangeFrames::read_ahead() {
  do {
    auto sample = recorded_->next();
    if (!sample) return sample.error();
    ahead_ = *std::move(sample);
  } while (ahead_ && ahead_->topic != Topic::kFrame);
  return {};
}

std::int64_t RangeFrames::rising(std::int64_t time_ns, std::int64_t received_ns) {
  constexpr std::int64_t kLeast_ns = 1'000'000;
  time_ns = std::max<std::int64_t>(time_ns, 0);  // so that no difference of two is too large
  if (time_ns_ && later_ns_ <= *time_ns_ - time_ns)
    later_ns_ = sum(*time_ns_ - time_ns, std::max(received_ns - received_ns_, kLeast_ns));
  received_ns_ = received_ns;
  return *(time_ns_ = sum(time_ns, later_ns_));
}

}  // namespace relievo
