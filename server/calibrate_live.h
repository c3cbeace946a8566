// SPDX-License-Identifier: Apache-2.0
// Takes a calibration's captures from a live source, into the folders that the calibration then reads, and
// projects what they need. Where it projects, call it from the main thread.
#pragma once

#include <optional>
#include <string>

#include "base/result.h"
#include "capture/calibrate/board.h"
#include "capture/source/camera_options.h"
#include "capture/source/field_source.h"
#include "cli/stop_signal.h"
#include "server/live_projector.h"

namespace relievo {

struct LiveOptions {
  std::string source;  // as for serve --source
  CameraOptions
      camera;  // of a source that is one; for views without rig, with the pattern and the projector's size
  std::string folder;  // made where it is missing; views in it are kept
  int views = 8;       // to take
  int threads = 2;
  CameraColours colours;                   // as far as they are known
  std::optional<LiveProjector> projector;  // none: somebody else projects
};

/// Takes a view, FOLDER/view_NN, each time that the board is held still at a new pose under the stripes along
/// columns and rows, and logs what it sees and what is missing. Ends with enough views, with the source, or
/// stopped; says what was left. FOLDER/pattern.yaml is written first, FOLDER/coverage.png with each view.
/// Fails where no view was taken.
Result<SourceInfo> take_board_views(const LiveOptions& options, const Board& board, StopSignal& stop);

/// Takes FOLDER/RGB.png of each of the 8 primaries on a white sheet at rest.
Status take_colour_captures(const LiveOptions& options, StopSignal& stop);

}  // namespace relievo
