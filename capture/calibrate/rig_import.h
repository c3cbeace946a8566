// SPDX-License-Identifier: Apache-2.0
// Reads a rig from our rig.yaml and from the result files of two other calibration programs.
#pragma once

#include <filesystem>
#include <string>

#include "base/result.h"
#include "base/rig.h"

namespace relievo {

struct ImportedRig {
  Rig rig;
  std::string format;     // "rig.yaml", "sltk" or "procam-calibration"
  double stereo_rms = 0;  // pixels, as that program reports it; 0 where it does not
};

/// Told apart by their keys: a rig.yaml; sltk's calibration (cam_K, pro_K, R, T); procam-calibration's
/// calibration_result.xml (cam_int, proj_int, ...), which lacks the projector's size. Those two are in
/// millimetres, lack a frame rate and a colour matrix (29.97 and the identity are put there) and are
/// progressive. Where the file says the projector's size it must be the one given, and where it does not that
/// one holds; 0 takes the file's. Errors name the file and the key.
Result<ImportedRig> import_rig(const std::filesystem::path& file, int projector_width, int projector_height);

}  // namespace relievo
