// SPDX-License-Identifier: Apache-2.0
// What the simulator's rays meet. Shapes are posed in the camera frame for one instant and never change
// afterwards: any thread may ask.
#pragma once

#include <limits>
#include <memory>
#include <vector>

#include "capture/source/sim/vec.h"

namespace relievo::sim {

/// Where a ray from the camera's centre meets a shape. `patch` is for the shape that sets it.
struct Hit {
  float depth = std::numeric_limits<float>::infinity();  // along z: the point is direction * depth
  unsigned patch = 0;
  float patch_u = 0, patch_v = 0;
};

struct Material {
  Vec3 normal;      // unit, towards the camera
  Vec3 albedo;      // 0..1
  float gloss = 0;  // strength of the mirror lobe, in the projector's colour
};

struct Sphere {
  Vec3 centre;
  float radius = std::numeric_limits<float>::infinity();
};

class Shape {
 public:
  virtual ~Shape() = default;

  /// Where the ray (0, 0, 0) + t * direction, direction.z == 1, meets the shape nearer than hit.depth: sets
  /// `hit` and returns true.
  virtual bool hit(Vec3 direction, Hit& hit) const = 0;

  /// The surface at a hit of this shape.
  virtual Material material(Vec3 direction, const Hit& hit) const = 0;

  /// True where the shape lies between a point and a light. `from` may be on the shape itself.
  virtual bool blocks(Vec3 from, Vec3 light) const = 0;

  /// Encloses the shape.
  virtual Sphere bound() const { return {}; }
};

using Shapes = std::vector<std::shared_ptr<const Shape>>;

/// A colour with smooth mottling that sticks to the shape: albedo * (1 +- mottle), features of `grain_m`.
struct Paint {
  Vec3 albedo{0.6f, 0.6f, 0.6f};
  float mottle = 0;
  float grain_m = 0.02f;
  float gloss = 0;

  Vec3 at(Vec3 local) const;
};

/// Smooth noise in [-1, 1], period 256 in each coordinate; the same on every machine.
float smooth_noise(float x, float y);

/// The plane through `point` with unit `normal` towards the camera.
std::shared_ptr<const Shape> make_plane(Vec3 point, Vec3 normal, const Paint& paint);
/// An axis-aligned ellipsoid of these half axes, then posed.
std::shared_ptr<const Shape> make_ellipsoid(const Pose& pose, Vec3 half, const Paint& paint);
/// An axis-aligned box of these half sizes, then posed.
std::shared_ptr<const Shape> make_box(const Pose& pose, Vec3 half, const Paint& paint);
/// A ball swept from a to b, camera frame.
std::shared_ptr<const Shape> make_capsule(Vec3 a, Vec3 b, float radius, const Paint& paint);

}  // namespace relievo::sim
