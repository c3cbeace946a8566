// SPDX-License-Identifier: Apache-2.0
// Which of the many Eulerian paths of paper 3.1 to project. Every path decodes alike, but boundaries are not
// alike: two primaries differ in one, two or all three channels, and each channel that flips is seen, and
// says where the boundary is (4.1, 4.2). Short paths can do without the boundaries that flip few.
#pragma once

#include <span>
#include <vector>

#include "base/pattern.h"
#include "capture/pattern/bcsl.h"

namespace relievo {

/// A path of at least `stripes` stripes, from vertex 0, over those boundary codes alone that flip two
/// channels a slide and more, all slides together, or as many as leaves enough codes: with six colours on two
/// slides 4 of 6 up to 469 stripes, 3 up to 757. Each code comes once. Always the same path for as many
/// flips. At most graph.arcs() + 1 stripes; `palette` has a primary for each digit. Time and memory as
/// eulerian_path().
std::vector<int> clear_path(const BcslGraph& graph, std::span<const Primary> palette, int stripes);

}  // namespace relievo
