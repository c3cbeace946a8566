// SPDX-License-Identifier: Apache-2.0
// A human head as a cylindrical map: skull profile, features, skin, and what moves when it speaks.
#pragma once

#include <memory>

#include "capture/source/sim/cylinder_map.h"

namespace relievo::sim {

/// What the face does at one instant.
struct Expression {
  float jaw = 0;                 // 0 closed .. 1 wide open
  float round = 0;               // 0 relaxed .. 1 pursed
  float smile = 0;               // 0 .. 1
  float blink = 0;               // 0 open eyes .. 1 shut
  float brow = 0;                // 0 .. 1 raised
  float gaze_x = 0, gaze_y = 0;  // iris offset, -1 .. 1; +x towards the head's +x
};

/// Immutable; any thread.
class HeadSculpt {
 public:
  HeadSculpt();

  /// A new map: the head at rest with mouth, jaw and eyes as in `e`.
  std::shared_ptr<const CylinderMap> at(const Expression& e) const;

 private:
  CylinderMap rest_;  // eyes and the gap of the mouth left out
};

/// Neck and shoulders in a pullover, in the same frame: the head turns on it.
std::shared_ptr<const CylinderMap> make_bust();

}  // namespace relievo::sim
