// SPDX-License-Identifier: Apache-2.0
// The scene as white light would show it: the two fields added, since complementary colours add up to white
// (paper 5.4).
#pragma once

#include "base/image.h"
#include "base/parallel.h"
#include "capture/camera_response.h"
#include "capture/source/field_source.h"

namespace relievo {

/// RGB, the size of the camera's picture. Of an interlaced frame each row is its own field plus the mean of
/// the other field's rows above and below. Values saturate at 255. `out` is reused where its size fits.
void add_fields(const CapturedFrame& frame, WorkerPool& pool, Image8& out);
/// The same of light: the camera's values for the sum of what its values tell.
void add_fields(const CapturedFrame& frame, const CameraResponse& response, WorkerPool& pool, Image8& out);

/// `to` becomes `from`; its memory is reused where the size fits.
void copy_picture(const Image8& from, Image8& to);

}  // namespace relievo
