// SPDX-License-Identifier: Apache-2.0
// What makes a pattern decodable (paper section 3.1): a path without a repeated arc in the graph of colour
// assignments.
#pragma once

#include "base/pattern.h"
#include "base/result.h"

namespace relievo {

/// Ok where the pattern can be decoded: base 3..6 distinct primaries (neither black nor white), one or more
/// slides whose base^slides digits fit an int, two or more stripes, no two neighbours of one colour on any
/// slide, and no boundary code (sequence[i], sequence[i + 1]) twice; under the scheme one-slide there is one
/// slide and codes may repeat. The error names the first offender, e.g.
/// "boundary 17 repeats the code 20|01 of boundary 3".
Status check_pattern(const Pattern& pattern);

}  // namespace relievo
