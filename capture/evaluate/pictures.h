// SPDX-License-Identifier: Apache-2.0
// Pictures of what each stage made of a frame, and of where and how much it is wrong. Camera pixels, RGB;
// scales have a legend below the picture. Pure.
#pragma once

#include "base/frame3d.h"
#include "base/image.h"
#include "base/pattern.h"
#include "base/rig.h"
#include "capture/evaluate/judge.h"
#include "capture/source/field_source.h"

namespace relievo {

/// The exposure under the slide, or under its complement; the missing lines of an interlaced one repeated.
Image8 draw_field(const CapturedFrame& frame, bool complement);

/// The decoder's difference image of a frame in light: grey is none, each channel lighter or darker with its
/// sign.
Image8 draw_difference(const CapturedFrame& frame, const Rig& rig);

/// Boundaries that are vertices, in the colours projected on their two sides, over the dimmed frame. `slide`
/// is what the frame shows, from 0.
Image8 draw_boundaries(const CapturedFrame& frame, const Surface& surface, const Pattern& pattern, int slide);

/// Depth in colours from near (red) to far (blue), with a legend in metres.
Image8 draw_depth(const Surface& surface, const Rig& rig);

/// Normals as colours: x right is red, y up green, towards the camera blue.
Image8 draw_normals(const Surface& surface, const Rig& rig);

/// Standard deviation of the depth, logarithmic, with a legend.
Image8 draw_sigma(const Surface& surface, const Rig& rig);

/// Signed error of each right vertex over the dimmed frame: blue too near, red too far, white none, up to
/// `range` (of depth) at both ends; wrong ones in magenta. With a legend.
Image8 draw_errors(const CapturedFrame& frame, const Judgement& judgement, float range);

/// Visible boundaries found in green and missed in red, wrong vertices in magenta, over the dimmed frame.
Image8 draw_completeness(const CapturedFrame& frame, const Judgement& judgement);

}  // namespace relievo
