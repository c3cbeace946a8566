// SPDX-License-Identifier: Apache-2.0
// A rig.yaml as calibration builds it, step by step: colour and geometry come from different captures, in
// either order, so one may be there before the other.
#pragma once

#include <filesystem>
#include <optional>

#include "base/result.h"
#include "base/rig.h"

namespace relievo {

struct RigPart {
  std::optional<Rig> whole;  // where all of it is there; then the others are too
  std::optional<Scan> scan;
  std::optional<double> frame_rate;
  std::optional<CameraColours> colours;
};

/// A whole rig.yaml, or one of the keys above alone. Errors name the file and the key.
Result<RigPart> read_rig_part(const std::filesystem::path& file);

/// The text of a rig.yaml: whole with the part's colours, which must be there, or these alone.
std::string to_yaml(const RigPart& part);

}  // namespace relievo
