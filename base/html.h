// SPDX-License-Identifier: Apache-2.0
// Text of others in pages.
#pragma once

#include <string>
#include <string_view>

namespace relievo {

/// As content of an element, or as an attribute's value in double quotes.
std::string html_escaped(std::string_view text);

}  // namespace relievo
