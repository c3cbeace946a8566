// SPDX-License-Identifier: Apache-2.0
#include "web/gateway/entity_tag.h"

#include <algorithm>

namespace relievo {
namespace {

/// Whether `header`, "*" or tags with commas between, has it. W/"a" is "a" only in a weak comparison.
bool has(std::string_view header, std::string_view etag, bool weakly) {
  if (header == "*") return true;
  for (;;) {
    header.remove_prefix(std::min(header.find_first_not_of(" \t,"), header.size()));
    const bool is_weak = header.starts_with("W/");
    if (is_weak) header.remove_prefix(2);
    const auto end = header.starts_with('"') ? header.find('"', 1) : std::string_view::npos;
    if (end == std::string_view::npos) return false;
    if (header.substr(0, end + 1) == etag && (weakly || !is_weak)) return true;
    header.remove_prefix(end + 1);
  }
}

}  // namespace

std::optional<int> failed_condition(std::string_view if_match, std::string_view if_none_match,
                                    std::string_view etag) {
  if (!if_match.empty() && !has(if_match, etag, false)) return 412;
  if (has(if_none_match, etag, true)) return 304;
  return std::nullopt;
}

}  // namespace relievo
