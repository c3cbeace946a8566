// SPDX-License-Identifier: Apache-2.0
// What is particular to a calibration of colours, or of geometry, on the page /rig: what it takes of a scene
// at rest, what is missing, and what it makes of it. No clock, no thread; one thread at a time.
#pragma once

#include <cstddef>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "base/image.h"
#include "base/result.h"
#include "capture/calibrate/rig_part.h"
#include "capture/calibrate/still_collector.h"
#include "capture/source/field_source.h"
#include "server/stream_source.h"

namespace relievo {

/// What became of a scene at rest.
struct TakenView {
  std::string name;
  bool used = false;
  std::string says;  // what it shows, or why it is not used and how to mend that
};

struct CalibrationResult {
  std::string rig;     // the text of the rig.yaml
  std::string report;  // JSON: calibration_report.h
};

class CalibrationTask {
 public:
  virtual ~CalibrationTask() = default;

  /// What the projector must show: ProjectorDriver::Order::shows.
  virtual std::string projector_shows() const = 0;
  /// Frames that differ from each other while nothing moves.
  virtual std::size_t cycle() const = 0;
  /// For the person at the rig, in one or two sentences.
  virtual std::string next() const = 0;

  virtual TakenView take(const StillCollector& collector) = 0;
  /// solve() may succeed.
  virtual bool can_solve() const = 0;
  /// More would hardly be better.
  virtual bool enough() const = 0;
  virtual Result<CalibrationResult> solve() = 0;
  /// RGB: what was seen, and where something is missing; nothing where that is not told by a picture.
  virtual std::optional<Image8> coverage() const { return std::nullopt; }
  /// As Coverage::tilts().
  virtual std::vector<std::string> tilts() const { return {}; }
};

/// "chessboard:9x7:25mm": as `calibrate geometry --board`. `before`: what the rig.yaml said so far. Fails
/// where the board is no board, or the source does not say what is projected.
Result<std::unique_ptr<CalibrationTask>> make_calibration_task(CalibrationKind kind, const std::string& board,
                                                               const SourceInfo& info, const RigPart& before);

}  // namespace relievo
