// SPDX-License-Identifier: Apache-2.0
#include "base/pattern.h"

namespace relievo {

std::string to_yaml(const Pattern& pattern) {
  std::string out = "%YAML:1.0\n---\nbase: " + std::to_string(pattern.base) +
                    "\nslides: " + std::to_string(pattern.slides) + "\npalette: [ ";
  for (std::size_t i = 0; i < pattern.palette.size(); ++i) {
    const Primary c = pattern.palette[i];
    out += i ? ", \"" : "\"";
    for (int channel = 0; channel < 3; ++channel) out += (c >> channel) & 1 ? '1' : '0';
    out += '"';
  }
  out += " ]\nsequence: [ ";
  for (std::size_t i = 0; i < pattern.sequence.size(); ++i) {
    out += (i ? ", " : "") + std::to_string(pattern.sequence[i]);
  }
  return out + " ]\n";
}

}  // namespace relievo
