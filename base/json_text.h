// SPDX-License-Identifier: Apache-2.0
// JSON as it is written everywhere: a file's name that is no UTF-8 is written with marks in its place, for it
// must not end the program. `Json` is nlohmann's, in any order of keys; this header does not name it.
#pragma once

#include <string>

namespace relievo {

/// For people and files: indented.
template <class Json>
std::string json_text(const Json& json) {
  return json.dump(2, ' ', false, Json::error_handler_t::replace);
}

/// For the wire: one line.
template <class Json>
std::string json_line(const Json& json) {
  return json.dump(-1, ' ', false, Json::error_handler_t::replace);
}

}  // namespace relievo
