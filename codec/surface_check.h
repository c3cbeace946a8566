// SPDX-License-Identifier: Apache-2.0
// What a surface must be before it is encoded or exported, and what can be derived from it.
#pragma once

#include <vector>

#include "base/frame3d.h"
#include "base/result.h"

namespace relievo {

/// Fails where normals, texture coordinates, sigmas or marks of interpolation are neither none nor one a
/// vertex, where a number is not finite, or where a triangle names a vertex that is not there.
Status check_surface(const Surface& surface);

/// How many there are of each, alone: for who looks at the numbers that it needs anyway.
Status check_counts(const Surface& surface);

/// Unit normals, one a vertex, towards the side from which the triangles run counter-clockwise (the camera):
/// the triangles' mean, weighted by area. A vertex without triangles looks to the camera. The surface must
/// pass check_surface().
std::vector<Vec3f> surface_normals(const Surface& surface);

}  // namespace relievo
