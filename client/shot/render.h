// SPDX-License-Identifier: Apache-2.0
// Draws a surface by the processor alone: for reports and tests, on machines without a screen. The modes and
// their colours are the viewer's (docs/viewer.md).
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string_view>

#include "base/frame3d.h"
#include "client/shot/view.h"

namespace relievo {

enum class ShotMode { kTextured, kShaded, kWire, kPoints, kNormals, kDepth, kConfidence };

/// "textured", ...; nothing for another word.
std::optional<ShotMode> shot_mode_named(std::string_view name);
/// "textured, shaded, ..."
std::string_view shot_mode_names();

struct DepthRange {
  float from_m = 0, to_m = 0;  // z in the rig's camera: yellow and violet
};

/// That of the surface's vertices, in whole steps.
DepthRange depth_range_of(const Surface& surface);

using Rgba = std::array<std::uint8_t, 4>;

struct RenderOptions {
  ShotMode mode = ShotMode::kTextured;
  Rgba background{0, 0, 0, 0};
  DepthRange depth;  // of kDepth
  int samples = 2;   // along each side of a pixel, 1 to 4
};

/// RGBA, as large as `view.lens`. Texture coordinates outside the texture take its edge; without a texture,
/// sigmas or triangles what needs them is drawn shaded, grey or as points. Any thread.
Image8 render(const Frame3D& frame, const ShotView& view, const RenderOptions& options);

}  // namespace relievo
