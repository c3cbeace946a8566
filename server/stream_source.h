// SPDX-License-Identifier: Apache-2.0
// The source of a served stream, with its rig as far as that is calibrated.
#pragma once

#include <memory>
#include <string>

#include "base/result.h"
#include "capture/calibrate/rig_part.h"
#include "capture/source/field_source.h"
#include "server/config.h"

namespace relievo {

struct StreamSource {
  std::unique_ptr<FieldSource> source;
  std::string uri;
  bool calibrated = true;  // false: the rig is a guess, fit to look at the camera's picture and to calibrate
};

/// What the stream's rig.yaml says; nothing where there is none yet.
Result<RigPart> rig_so_far(const std::string& file);

/// A camera, or a simulated one, has the rig of its file; a simulated one without a file has its own. Where
/// the file is missing or has colours only, and the server has a projector to calibrate with or needs none,
/// the rest is a guess.
Result<StreamSource> open_stream_source(const StreamConfig& config, const ProjectorConfig& projector);

enum class CalibrationKind { kColour, kGeometry };

/// The same camera for a calibration of it; of a simulated one a white sheet, or `board`, before its rig,
/// whose projector shows what is needed.
Result<std::unique_ptr<FieldSource>> open_calibration_source(const StreamConfig& config,
                                                             const ProjectorConfig& projector,
                                                             CalibrationKind kind, const std::string& board);

}  // namespace relievo
