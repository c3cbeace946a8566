// SPDX-License-Identifier: Apache-2.0
// Section kind 4: how exact each vertex is, coded in the order of the vertices' places in the picture, since
// a geometry codec may reorder vertices (codec/FORMAT.md, "Vertex quality codec 1").
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "base/frame3d.h"
#include "base/result.h"
#include "base/stream.h"

namespace relievo {

/// Steps of sigma on the wire: a quarter of an octave from a micrometre up, so that what is read is within 9
/// %.
std::uint8_t sigma_code(float sigma_m);
float sigma_of_code(std::uint8_t code);

/// A texture coordinate, 0..1, as the whole number of `bits` bits that is sent.
std::uint32_t coordinate_step(float coordinate, int bits);

/// Of the vertices `sent` of `surface`, which has texture coordinates. `bits`: of a texture coordinate. Empty
/// where the surface says nothing of its quality.
Bytes encode_vertex_quality(const Surface& surface, std::span<const std::uint32_t> sent, int bits);

/// Fills sigmas_m and interpolated of `surface`, by its texture coordinates. Any bytes; fails, leaving it
/// unchanged, where they are not of this surface.
Status decode_vertex_quality(std::span<const std::uint8_t> bytes, Surface& surface);

}  // namespace relievo
