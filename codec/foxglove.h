// SPDX-License-Identifier: Apache-2.0
// Frames as messages that generic viewers of recordings show: foxglove.CompressedImage, CameraCalibration,
// FrameTransform and SceneUpdate (https://docs.foxglove.dev/docs/sdk/schemas), as CDR with their OMG IDL.
#pragma once

#include <cstdint>
#include <string>

#include "base/frame3d.h"
#include "base/result.h"
#include "base/rig.h"
#include "codec/recording.h"

namespace relievo {

/// More channels of a recording: "relievo/image", "relievo/calibration" of the camera that took it (a viewer
/// pairs topics by what is before the last slash), "relievo/scene", and "relievo/transform" between the two
/// coordinate frames: that of the surface is x right, y forward, z up, since viewers stand a GLB up so and
/// look from there; that of the image is the camera's (x right, y down, z forward), as its calibration needs.
/// One thread.
class FoxgloveChannels {
 public:
  /// Adds them; `stream` names the surface's coordinate frame ("STREAM/camera": the image's) and, in their
  /// metadata, the stream.
  static Result<FoxgloveChannels> add_to(RecordingWriter& writer, const std::string& stream);

  struct Times {
    std::int64_t log_ns = 0;
    std::int64_t publish_ns = 0;
    std::int64_t capture_ns = 0;  // what the messages say of themselves
  };
  /// The texture as a JPEG, where there is one, and the surface as a GLB (as write_glb() has it), which takes
  /// the place of the one before. With the image comes all that places it, so that it does wherever a viewer
  /// seeks to. `camera`: null where it is not known, and then there is no calibration. Nothing is kept of the
  /// arguments.
  Status write(RecordingWriter& writer, const Frame3D& frame, const PinholeModel* camera,
               const Times& times) const;

 private:
  FoxgloveChannels() = default;

  std::string stream_;
  std::uint16_t image_ = 0;
  std::uint16_t calibration_ = 0;
  std::uint16_t transform_ = 0;
  std::uint16_t scene_ = 0;
};

}  // namespace relievo
