// SPDX-License-Identifier: Apache-2.0
// Planes and spheres through measured points, some of which are of something else. Camera frame, metres.
// Pure.
#pragma once

#include <array>
#include <optional>
#include <span>
#include <string_view>

#include "base/frame3d.h"

namespace relievo {

enum class ShapeKind { kPlane, kSphere };

/// "plane", "sphere"; nothing for another word.
std::optional<ShapeKind> shape_kind_named(std::string_view name);

struct Shape {
  ShapeKind kind = ShapeKind::kPlane;
  std::array<double, 3> at{};  // plane: its unit normal, towards the camera; sphere: its centre
  double size_m = 0;           // plane: how far the camera is from it; sphere: its radius

  /// How far the point is before the plane, or outside the sphere.
  double height_m(const Vec3f& point) const;
  /// The normal there: by how much the height changes as the point moves.
  std::array<double, 3> normal_at(const Vec3f& point) const;
};

/// The one that most points lie on (least median of squares over samples, then Tukey's biweight: what is more
/// than 4.7 robust deviations off counts as nothing). Equal points give equal shapes. Nothing of fewer than
/// four points, or of such as determine none.
std::optional<Shape> fit_shape(ShapeKind kind, std::span<const Vec3f> points);

}  // namespace relievo
