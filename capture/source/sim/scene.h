// SPDX-License-Identifier: Apache-2.0
// What stands before the rig: the table of scenes, each made for one set of options.
#pragma once

#include <memory>
#include <string>

#include "base/result.h"
#include "capture/source/sim/shape.h"

namespace relievo::sim {

/// How a scene wants to be filmed.
struct SceneView {
  double distance_m = 1.0;    // where camera and projector aim, and where exposure is right
  double camera_f_px = 1050;  // at 640x480
  double projector_f_px = 1500;
  double baseline_m = 0.2;
};

/// Immutable; any thread.
class Scene {
 public:
  virtual ~Scene() = default;

  virtual SceneView view() const { return {}; }

  /// Everything at one instant. `phase` in [0, 1) is the part of the period of all motion, period_s its
  /// length in seconds: at(0) follows at(1) without a jump.
  virtual Shapes at(double phase, double period_s) const = 0;
};

/// "plane", "object", "face", "walk" or "mesh:FILE". The error lists the names, or says what is wrong with
/// FILE.
Result<std::shared_ptr<const Scene>> make_scene(const std::string& name);

/// Whether there is such a scene; FILE is not looked at.
Status check_scene(const std::string& name);

/// "plane, object, face, walk, mesh:FILE".
std::string scene_names();

// The makers behind the table.
Result<std::shared_ptr<const Scene>> make_plane_scene(const std::string& argument);
Result<std::shared_ptr<const Scene>> make_object_scene(const std::string& argument);
Result<std::shared_ptr<const Scene>> make_face_scene(const std::string& argument);
Result<std::shared_ptr<const Scene>> make_walk_scene(const std::string& argument);
Result<std::shared_ptr<const Scene>> make_mesh_scene(const std::string& argument);

}  // namespace relievo::sim
