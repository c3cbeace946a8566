// SPDX-License-Identifier: Apache-2.0
// How far a calibration from the page /rig is, as its thread knows it and pages are told.
#pragma once

#include <cstddef>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "base/stream.h"
#include "server/calibration_task.h"

namespace relievo {

enum class CalibrationPhase {
  kOff,       // none is under way; the rest is of the last one
  kPausing,   // the stream lets go of the camera
  kWatching,  // waits for the scene to be taken
  kBusy,      // measures, or calculates
  kSolved,    // there is a result, to be kept or not
};

struct CalibrationState {
  CalibrationPhase phase = CalibrationPhase::kOff;
  std::string stream, kind, board;
  std::string next;     // what the person at the rig is to do
  std::string message;  // what went wrong, or how it ended
  bool failed = false;  // it ended without what was wanted
  std::size_t at_rest = 0, cycle = 0;
  bool armed = false;      // the next rest is taken
  bool automatic = false;  // each is
  bool can_solve = false;
  bool enough = false;
  std::vector<TakenView> views;
  std::vector<std::string> tilts;                 // sides of the board that were farther away in a view
  std::string result;                             // JSON, as CalibrationResult::report; empty: none yet
  std::string file, old;                          // written, and what was there before; empty: none
  std::shared_ptr<const Bytes> camera, coverage;  // JPEG
};

/// JSON (docs/WEB.md).
std::string to_json(const CalibrationState& state);

}  // namespace relievo
