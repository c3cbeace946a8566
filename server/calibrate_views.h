// SPDX-License-Identifier: Apache-2.0
// A folder of views of a board, each a folder of pictures, measured.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "base/pattern.h"
#include "base/result.h"
#include "base/rig.h"
#include "capture/calibrate/measure_view.h"
#include "capture/calibrate/rig_part.h"
#include "cli/size_option.h"
#include "cli/stop_signal.h"

namespace relievo {

/// What was projected on the board.
struct ViewCode {
  std::optional<Pattern> stripes;  // none: Gray code
  Size projector;
  CameraColours colours;
  FieldOrder field_order = FieldOrder::kTop;  // of views that are an interlaced camera's frames
};

struct MeasuredViews {
  std::vector<MeasuredView> views;
  PinholeModel camera;     // its size
  bool of_fields = false;  // some are an interlaced camera's frames
};

/// What the rig.yaml that --update names says so far; where there is none, the error says how to begin one.
Result<RigPart> rig_to_update(const std::string& file);

/// `pattern`: "gray", or the file of the stripes' pattern; empty: FOLDER/pattern.yaml where it is there, Gray
/// code otherwise.
Result<std::optional<Pattern>> stripes_of(const std::string& folder, const std::string& pattern);

/// Views in the order of their names; a view that cannot be used says why, in its `refused` and as a warning.
/// Fails where none can be read at all.
Result<MeasuredViews> measure_views(const std::string& folder, const ViewCode& code, const Board& board,
                                    int threads, StopSignal& stop);

}  // namespace relievo
