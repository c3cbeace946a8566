// SPDX-License-Identifier: Apache-2.0
// Sequences for the scheme one-slide: with s = 1 base b has b (b - 1) codes, fewer than stripes, so codes
// repeat; but runs of codes do not, and a run is what a decoder sees along a scan line.
#pragma once

#include "base/pattern.h"
#include "base/result.h"
#include "capture/pattern/bcsl.h"

namespace relievo {

/// `stripes` stripes on one slide from stripe `first_stripe` of a sequence in which no run of n boundaries
/// comes twice, n being the least for which there are as many runs as stripes are asked for: 2 up to 151
/// stripes of base 6 (150 runs), 3 up to 752. Fails where base is not 3 to 6 or stripes below 2 or beyond
/// what runs of 6 boundaries tell apart.
Result<Pattern> make_repeating_pattern(int base, int first_stripe, int stripes);

/// What `scheme` projects: of one slide make_repeating_pattern(), which has neither slides nor paths to
/// choose, else make_pattern(). Fails as they do.
Result<Pattern> make_scheme_pattern(Scheme scheme, int base, int slides, int first_stripe, int stripes,
                                    CodePath path);

/// The least n for which no run of n boundaries of the pattern's slide 1 comes twice; boundaries() + 1 where
/// even the longest runs are ambiguous (a sequence that is periodic has such runs).
int unique_run(const Pattern& pattern);

}  // namespace relievo
