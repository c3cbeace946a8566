// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "base/image.h"

namespace relievo {

/// Makes `image` that large. Where it is already, it keeps its memory, and what is in it.
template <typename T>
void fit_image(int width, int height, int channels, Image<T>& image) {
  if (image.width() != width || image.height() != height || image.channels() != channels)
    image = Image<T>(width, height, channels);
}

}  // namespace relievo
