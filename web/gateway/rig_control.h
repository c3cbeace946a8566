// SPDX-License-Identifier: Apache-2.0
// What the gateway needs of who sees a stream's camera and drives its projector.
#pragma once

#include <array>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "base/projector_state.h"
#include "base/result.h"
#include "base/stream.h"

namespace relievo {

/// Pictures of a camera's frame that can be asked for.
struct RigPicture {
  std::string_view name;  // of /api/rig/STREAM/NAME.jpg
  std::string_view shows;
};
inline constexpr std::array<RigPicture, 7> kRigPictures{{
    {"camera", "the exposure under the slide, as the camera gave it"},
    {"complement", "the exposure after it"},
    {"exposure", "the first, with clipped pixels in red and dark ones in blue"},
    {"difference", "the difference of both: what stripes are read from"},
    {"boundaries", "decoded boundaries, in the colours projected on both sides"},
    {"coverage", "green where stripes are decoded, red where their light arrives and they are not"},
    {"order", "magenta where neighbouring boundaries do not fit together"},
}};

/// What is known of one frame of a stream's camera.
struct RigView {
  std::string report;                                  // JSON (docs/WEB.md)
  std::map<std::string, Bytes, std::less<>> pictures;  // JPEG, by name: those that were asked for lately
};

/// Called on the gateway's thread, so that every function must return at once.
class RigControl {
 public:
  virtual ~RigControl() = default;

  /// There is such a stream.
  virtual bool has(const std::string& stream) const = 0;
  /// Asks for a look at the stream's next frame, with these pictures of it, and gives the last look, if that
  /// is fresh; null: none is ready yet. Nothing: no such stream.
  virtual std::optional<std::shared_ptr<const RigView>> look(const std::string& stream,
                                                             const std::vector<std::string>& pictures) = 0;

  virtual ProjectorState projector() const = 0;
  /// The stream's pattern, or one picture ("white", "slide1", ...) all the time, instead of what is shown
  /// now. Fails, saying why, where there is no such stream or picture, or no projector that may be driven.
  virtual Status project(const std::string& stream, const std::string& shows) = 0;
  /// Fails where nothing is shown.
  virtual Status stop_projecting() = 0;
};

}  // namespace relievo
