// SPDX-License-Identifier: Apache-2.0
// Which colour was projected on each of 8 pictures of a white sheet.
#pragma once

#include <vector>

#include "base/image.h"
#include "base/pattern.h"
#include "base/result.h"

namespace relievo {

/// The primary of each picture (RGB, of one size): each of the 8 once. Black and white are the darkest and
/// the brightest; a channel of another counts as lit where it is over half way between theirs. Fails where
/// the pictures do not show each colour once.
Result<std::vector<Primary>> tell_colours(const std::vector<Image8>& pictures);

/// What to project for them: black, red, green and blue, each before its complement; whole pictures, RGB.
std::vector<Image8> draw_sheet_colours(int width, int height);

}  // namespace relievo
