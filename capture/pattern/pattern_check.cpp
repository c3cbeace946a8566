// SPDX-License-Identifier: Apache-2.0
#include "capture/pattern/pattern_check.h"

#include <limits>
#include <string>
#include <unordered_map>

namespace relievo {
namespace {

std::string text(int value) {
  return std::to_string(value);
}

Status check_palette(const Pattern& pattern) {
  if (static_cast<int>(pattern.palette.size()) != pattern.base) {
    return Error{"palette has " + text(static_cast<int>(pattern.palette.size())) + " colours, base " +
                 text(pattern.base) + " needs " + text(pattern.base)};
  }
  int seen[8] = {-1, -1, -1, -1, -1, -1, -1, -1};
  for (int i = 0; i < pattern.base; ++i) {
    const Primary colour = pattern.palette[static_cast<std::size_t>(i)];
    if (colour > 7) return Error{"palette colour " + text(i) + " is no RGB primary"};
    if (colour == 0 || colour == 7) {
      return Error{"palette colour " + text(i) + " is " + (colour ? "white" : "black") +
                   ", which cannot be told from an unlit or unpatterned surface"};
    }
    if (seen[colour] >= 0) {
      return Error{"palette colour " + text(i) + " repeats colour " + text(seen[colour])};
    }
    seen[colour] = i;
  }
  return {};
}

/// The digits of a stripe on all slides, slide 1's first.
std::string digits(const Pattern& pattern, int stripe) {
  std::string out;
  for (int slide = 0; slide < pattern.slides; ++slide) out += text(pattern.digit(stripe, slide));
  return out;
}

}  // namespace

Status check_pattern(const Pattern& pattern) {
  if (pattern.base < 3 || pattern.base > 6) {
    return Error{"base is " + text(pattern.base) +
                 ", must be 3 to 6 (a zero crossing tells six primaries apart)"};
  }
  if (pattern.slides < 1) return Error{"slides is " + text(pattern.slides) + ", must be 1 or more"};
  const bool repeats = pattern.scheme == Scheme::kOneSlide;
  if (repeats && pattern.slides != 1) {
    return Error{"scheme one-slide has slides: 1, not " + text(pattern.slides)};
  }
  int vertices = 1;
  for (int s = 0; s < pattern.slides; ++s) {
    if (vertices > std::numeric_limits<int>::max() / pattern.base) {
      return Error{"slides is " + text(pattern.slides) + ", too many for base " + text(pattern.base)};
    }
    vertices *= pattern.base;
  }
  if (const Status palette = check_palette(pattern); !palette) return palette;
  if (pattern.stripes() < 2) {
    return Error{"sequence has " + text(pattern.stripes()) + " stripes, must have 2 or more"};
  }

  std::unordered_map<std::uint64_t, int> boundary_of_code;
  for (int i = 0; i < pattern.stripes(); ++i) {
    const int vertex = pattern.sequence[static_cast<std::size_t>(i)];
    if (vertex < 0 || vertex >= vertices) {
      return Error{"sequence stripe " + text(i) + " is " + text(vertex) + ", must be 0 to " +
                   text(vertices - 1)};
    }
    if (i == 0) continue;
    for (int slide = 0; slide < pattern.slides; ++slide) {
      if (pattern.digit(i - 1, slide) == pattern.digit(i, slide)) {
        return Error{"sequence stripes " + text(i - 1) + " and " + text(i) + " share colour " +
                     text(pattern.digit(i, slide)) + " on slide " + text(slide + 1) +
                     ", so no boundary is seen between them"};
      }
    }
    const int before = pattern.sequence[static_cast<std::size_t>(i - 1)];
    const std::uint64_t code = static_cast<std::uint64_t>(before) * static_cast<std::uint64_t>(vertices) +
                               static_cast<std::uint64_t>(vertex);
    const auto [found, fresh] = boundary_of_code.emplace(code, i - 1);
    if (!fresh && !repeats) {
      return Error{"boundary " + text(i - 1) + " repeats the code " + digits(pattern, i - 1) + "|" +
                   digits(pattern, i) + " of boundary " + text(found->second)};
    }
  }
  return {};
}

}  // namespace relievo
