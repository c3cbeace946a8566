// SPDX-License-Identifier: Apache-2.0
// Numbers and what they count, in words.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>

namespace relievo {

/// "1 frame", "3 frames".
inline std::string counted(std::uint64_t number, std::string_view what) {
  return std::to_string(number) + ' ' + std::string(what) + (number == 1 ? "" : "s");
}

/// What of them is said: "is" of one, "are" of others.
inline const char* is_or_are(std::uint64_t number) {
  return number == 1 ? "is" : "are";
}

}  // namespace relievo
