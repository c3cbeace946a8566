// SPDX-License-Identifier: Apache-2.0
// A V4L2 camera as a source (docs/CAMERA.md).
#pragma once

#include <memory>
#include <string>

#include "base/result.h"
#include "capture/source/field_source.h"
#include "capture/source/v4l2/io.h"

namespace relievo::v4l2 {

/// Opens `device`, such as /dev/video0, and streams from it; SourceOptions::camera says how. The source is
/// live: times are UTC, of the start of the first exposure by the driver's stamps; numbers count on by its
/// sequence numbers, so that a lost frame leaves a gap. Damaged pictures are left out.
///
/// next() fails once when the camera is unplugged, shows no signal or gives up, and then waits until it works
/// again, as it was set before; numbers go on without a gap. Its rig is the file's, with the scan and
/// rate that the driver states, and its field order where the file states none; without a file, one of the
/// right sizes and nothing else.
Result<std::unique_ptr<FieldSource>> open_camera(const std::string& device, const SourceOptions& options);

/// The same through other system calls, which must outlive the source.
Result<std::unique_ptr<FieldSource>> open_camera(Io& io, const std::string& device,
                                                 const CameraOptions& options);

}  // namespace relievo::v4l2
