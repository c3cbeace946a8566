// SPDX-License-Identifier: Apache-2.0
// Frames as messages that generic viewers of recordings show: foxglove.CompressedImage and
// foxglove.SceneUpdate (https://docs.foxglove.dev/docs/sdk/schemas), as CDR with their OMG IDL.
#pragma once

#include <cstdint>
#include <string>

#include "base/frame3d.h"
#include "base/result.h"
#include "codec/recording.h"

namespace relievo {

/// Two more channels of a recording: "relievo/image" and "relievo/scene". One thread.
class FoxgloveChannels {
 public:
  /// Adds them; `stream` names the coordinate frame and, in their metadata, the stream.
  static Result<FoxgloveChannels> add_to(RecordingWriter& writer, const std::string& stream);

  struct Times {
    std::int64_t log_ns = 0;
    std::int64_t publish_ns = 0;
    std::int64_t capture_ns = 0;  // what the messages say of themselves
  };
  /// The texture as a JPEG, where there is one, and the surface as a GLB (as write_glb() has it), which takes
  /// the place of the one before. Nothing is kept of the arguments.
  Status write(RecordingWriter& writer, const Frame3D& frame, const Times& times) const;

 private:
  FoxgloveChannels() = default;

  std::string stream_;
  std::uint16_t image_ = 0;
  std::uint16_t scene_ = 0;
};

}  // namespace relievo
