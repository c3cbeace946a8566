// SPDX-License-Identifier: Apache-2.0
// If-Match and If-None-Match (RFC 9110, 13.1). Pure; any input.
#pragma once

#include <optional>
#include <string_view>

namespace relievo {

/// What is said instead of sending what has this strong `etag`, with its quotes: 412 where it is not the one
/// that `if_match` wants, 304 where `if_none_match` has it, else nothing. Both are values of headers, empty
/// where there is none.
std::optional<int> failed_condition(std::string_view if_match, std::string_view if_none_match,
                                    std::string_view etag);

}  // namespace relievo
