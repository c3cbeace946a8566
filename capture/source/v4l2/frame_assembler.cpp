// SPDX-License-Identifier: Apache-2.0
#include "capture/source/v4l2/frame_assembler.h"

#include <linux/videodev2.h>

#include <algorithm>
#include <utility>

namespace relievo::v4l2 {

void FrameAssembler::restart() {
  last_sequence_.reset();
  position_ = 0;
  last_done_.reset();
  begun_.reset();
  placed_ = false;
}

bool FrameAssembler::count(std::uint32_t sequence) {
  if (last_sequence_) {
    std::uint32_t step = sequence - *last_sequence_;  // past the wrap too
    const bool shared = step == 0 && format_.layout == FieldLayout::kAlternate;
    if (step == 0 && !shared && sequence != 0) return false;
    // A driver that does not count, or begins again.
    if (!shared && (step == 0 || step > UINT32_MAX / 2)) step = 1;
    position_ += step;
  } else {
    position_ = sequence;  // not 0: even numbers stay even, whichever came first
  }
  last_sequence_ = sequence;
  return true;
}

void FrameAssembler::begin(std::uint64_t index, std::int64_t time_ns) {
  frame_ = {};
  frame_.time_ns = time_ns;
  frame_.scan = format_.scan();
  frame_.field_order = format_.order;
  frame_.picture = Image8(format_.width, format_.frame_height(), 3);
  begun_ = index;
  first_done_ = false;
}

Place FrameAssembler::place(const BufferHeader& header) {
  placed_ = false;
  if (!count(header.sequence)) return {};
  second_ = false;
  switch (format_.layout) {
    case FieldLayout::kInterlaced:
    case FieldLayout::kSequential:
      begin(position_, header.time_ns);
      placed_ = second_ = true;
      return {.picture = &frame_.picture};
    case FieldLayout::kAlternate:
      return place_field(header);
    case FieldLayout::kProgressive:
      break;
  }
  const std::uint64_t at = position_ + (odd_pairs_ ? 1 : 0);
  second_ = at % 2 == 1;
  if (!second_) {
    begin(at / 2, header.time_ns);
  } else if (begun_ != at / 2 || !first_done_) {
    return {};  // its slide was lost
  } else {
    frame_.complement = Image8(format_.width, format_.frame_height(), 3);
  }
  placed_ = true;
  return {.picture = second_ ? &frame_.complement : &frame_.picture};
}

Place FrameAssembler::place_field(const BufferHeader& header) {
  if (header.field != V4L2_FIELD_TOP && header.field != V4L2_FIELD_BOTTOM) return {};
  const bool top = header.field == V4L2_FIELD_TOP;
  second_ = top != (format_.order == FieldOrder::kTop);
  if (!second_) {
    begin(position_, header.time_ns);
  } else {
    // Both fields of a frame have the same number, or the second has the next one.
    const std::uint64_t later = begun_ && first_done_ ? position_ - *begun_ : 2;
    if (later > 1 || (step_ && *step_ != later + 1)) return {};
    step_ = later + 1;
  }
  placed_ = true;
  return {.picture = &frame_.picture, .one_field = true, .first_row = top ? 0 : 1};
}

std::optional<CapturedFrame> FrameAssembler::finish() {
  if (!std::exchange(placed_, false)) return std::nullopt;
  if (!second_) {
    first_done_ = true;
    return std::nullopt;
  }
  std::uint64_t index = *begun_ / step_.value_or(1);
  if (last_done_) index = std::max(index, *last_done_ + 1);
  frame_.lost_before = last_done_ ? index - *last_done_ - 1 : 0;
  frame_.number = next_number_ + frame_.lost_before;
  next_number_ = frame_.number + 1;
  last_done_ = index;
  begun_.reset();
  return std::exchange(frame_, {});
}

}  // namespace relievo::v4l2
