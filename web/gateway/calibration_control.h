// SPDX-License-Identifier: Apache-2.0
// What the gateway needs of who calibrates the rigs of a server.
#pragma once

#include <memory>
#include <string>

#include "base/result.h"
#include "base/stream.h"

namespace relievo {

struct CalibrationOrder {
  std::string action;  // "start", "take", "automatic", "manual", "calculate", "more", "keep" or "cancel"
  std::string stream;  // to start: whose rig
  std::string kind;    // to start: "colour" or "geometry"
  std::string board;   // to start geometry: as `relievo-server calibrate geometry --board`
};

/// Called on the gateway's thread, so that every function must return at once.
class CalibrationControl {
 public:
  virtual ~CalibrationControl() = default;

  /// JSON (docs/WEB.md) of the calibration that is under way, or of the last one. Who asks watches it: one
  /// that nobody watches is given up.
  virtual std::string report() = 0;
  /// JPEG of "camera" or "coverage"; null: there is none.
  virtual std::shared_ptr<const Bytes> picture(const std::string& name) = 0;
  /// Fails, saying why, where that is not possible now.
  virtual Status order(const CalibrationOrder& order) = 0;
};

}  // namespace relievo
