// SPDX-License-Identifier: Apache-2.0
// A (b,s)-BCSL stripe pattern as projected (paper section 3), as in a take's pattern.yaml. Plain data.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace relievo {

/// A projected primary: bit 0 red, bit 1 green, bit 2 blue. Its complement is value ^ 7.
using Primary = std::uint8_t;

/// What the fields of a frame show, and in which order (paper 5.1 and 5.5; docs/SCHEMES.md). Rates are of
/// NTSC.
enum class Scheme {
  kComplementary,  // a slide, then its complement: texture and geometry at 30 Hz
  kWhiteField,     // a slide, then white: texture at 30 Hz, geometry at 60 Hz
  kWhiteFrame,     // as complementary, but after each slide once a whole white frame: texture at 10 Hz,
                   // geometry at 20 Hz
  kOneSlide,       // one slide and its complement, codes repeat: both at 30 Hz, each frame by itself
};

/// "complementary", "white-field", "white-frame" or "one-slide".
std::string_view to_string(Scheme scheme);
/// The scheme of that name, or nothing.
std::optional<Scheme> scheme_named(std::string_view name);
/// "complementary, white-field, white-frame or one-slide": for messages and help.
std::string scheme_names();

struct Pattern {
  int base = 6;                  // b, number of colours
  int slides = 2;                // s, slides projected in turn
  std::vector<Primary> palette;  // `base` entries: the colour of each base-b digit
  std::vector<int> sequence;  // one vertex a stripe, left to right: `slides` base-b digits, slide 1's first
  Scheme scheme = Scheme::kComplementary;

  int stripes() const { return static_cast<int>(sequence.size()); }
  int boundaries() const { return stripes() - 1; }

  /// Base-b digit of a stripe under slide 0..slides-1, the first slide's being the most significant.
  int digit(int stripe, int slide) const {
    int value = sequence[static_cast<std::size_t>(stripe)];
    for (int s = slides - 1; s > slide; --s) value /= base;
    return value % base;
  }
  Primary colour(int stripe, int slide) const {
    return palette[static_cast<std::size_t>(digit(stripe, slide))];
  }

  /// Projector column, in pixels with the first pixel's centre at 0, of boundary i between stripes i and i+1.
  double boundary_column_px(int boundary, int projector_width) const {
    return (boundary + 1.0) * projector_width / stripes() - 0.5;
  }
};

/// The text of a pattern.yaml (OpenCV FileStorage).
std::string to_yaml(const Pattern& pattern);

}  // namespace relievo
