// SPDX-License-Identifier: Apache-2.0
// A camera's settings as flags, of every command with a --source.
#pragma once

#include <string>
#include <vector>

#include "base/result.h"
#include "capture/source/camera_options.h"

namespace CLI {
class App;
}

namespace relievo {

constexpr double kLeastRate = 0.1, kMostRate = 1000;  // pictures a second
constexpr int kLeastBuffers = 2, kMostBuffers = 32;
inline const std::vector<std::string> kFieldLayouts{"progressive", "interlaced", "seq-tb", "seq-bt",
                                                    "alternate"};
inline const std::vector<std::string> kFieldOrders{"top", "bottom"};

/// --input, --standard, --format, --size, --rate, --field, --field-order, --odd-pairs, --control, --dmabuf
/// and
/// --buffers, in a group of their own. `camera` must outlive the parsing.
void add_camera_flags(CLI::App& app, CameraOptions& camera);

/// --rig and --pattern, of commands that reconstruct.
void add_rig_flags(CLI::App& app, CameraOptions& camera);

/// A camera whose pictures are to be reconstructed must have its rig.
Status check_rig(const std::string& source, const CameraOptions& camera);

/// `base` with what `flags` set; controls of `flags` are set after those of `base`.
CameraOptions merged(CameraOptions base, const CameraOptions& flags);

}  // namespace relievo
