// SPDX-License-Identifier: Apache-2.0
// A buffer's bytes, by the format that was settled, into the rows of a frame.
#pragma once

#include "base/result.h"
#include "capture/source/v4l2/buffer_stream.h"
#include "capture/source/v4l2/capture_format.h"
#include "capture/source/v4l2/frame_assembler.h"

namespace relievo::v4l2 {

/// Converts to RGB where `place` says. Fails where the buffer holds less than a picture, or a damaged one;
/// the rows may be written in part then.
Status write_picture(const Filled& filled, const CaptureFormat& format, const Place& place);

}  // namespace relievo::v4l2
