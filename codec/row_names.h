// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

namespace relievo {

/// "a, b or c": names of a table's rows, for words to users. `Rows` is a contiguous container whose elements
/// have a `name`.
template <class Rows>
std::string names_of(const Rows& rows) {
  std::string names;
  for (const auto& row : rows) {
    if (!names.empty()) names += &row == &rows.back() ? " or " : ", ";
    names += row.name;
  }
  return names;
}

}  // namespace relievo
