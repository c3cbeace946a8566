// SPDX-License-Identifier: Apache-2.0
// Reads a take's rig.yaml and pattern.yaml (OpenCV FileStorage; formats in docs/TAKES.md). Writing:
// base/rig.h, base/pattern.h.
#pragma once

#include <filesystem>

#include "base/pattern.h"
#include "base/result.h"
#include "base/rig.h"

namespace relievo {

/// Errors name the file and the key that is missing, misshapen or out of range (sizes, focal lengths, a
/// rotation that is none, a singular colour matrix).
Result<Rig> read_rig(const std::filesystem::path& file);

/// What read_rig() asks of a rig whatever file it is from: lenses, rotation, baseline and colours that can be
/// worked with. Errors name the key of a rig.yaml.
Status check_rig(const Rig& rig);

/// Errors name the file and what is wrong: a missing key, a palette of the wrong length or with white or
/// black, a digit out of range, a stripe repeating its neighbour's colour on a slide, the first boundary code
/// that repeats.
Result<Pattern> read_pattern(const std::filesystem::path& file);

}  // namespace relievo
