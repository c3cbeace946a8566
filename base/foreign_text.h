// SPDX-License-Identifier: Apache-2.0
// What others wrote, into files and onto the network, in what is said of it.
#pragma once

#include <cstddef>
#include <string>

namespace relievo {

/// Fit for a terminal: control characters become '?'; what is longer than `most` bytes is cut.
inline std::string foreign_text(std::string text, std::size_t most = 100) {
  if (text.size() > most) text.resize(most);
  for (char& c : text)
    if ((c >= 0 && c < ' ') || c == 0x7f) c = '?';
  return text;
}

}  // namespace relievo
