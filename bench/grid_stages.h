// SPDX-License-Identifier: Apache-2.0
// Where the time of the stripe grid's codec goes.
#pragma once

#include <vector>

#include "base/frame3d.h"
#include "base/pattern.h"
#include "base/result.h"
#include "base/rig.h"
#include "bench/report.h"
#include "codec/grid_coder.h"
#include "codec/grid_points.h"

namespace relievo::bench {

/// Key grids at 1/16 px on one core, each stage with the memory of the run before.
class GridStages {
 public:
  GridStages(const Rig& rig, const Pattern& pattern);

  Status measure(const Surface& surface);

  /// Nanoseconds a vertex.
  std::vector<Figure> figures() const;

 private:
  GridCalibration calibration_;
  GridEncoder encoder_;
  GridDecoder decoder_;
  GridPoints points_;
  StripeGrid sent_, received_;
  Surface surface_;
  std::vector<double> gather_ns_, code_ns_, decode_ns_, surface_ns_;
};

}  // namespace relievo::bench
