// SPDX-License-Identifier: Apache-2.0
#include "web/gateway/byte_range.h"

#include <algorithm>
#include <charconv>

#include "web/gateway/request_target.h"

namespace relievo {
namespace {

/// Digits alone; nothing where there are none, or too many for any file.
std::optional<std::uint64_t> number(std::string_view text) {
  std::uint64_t value = 0;
  const char* end = text.data() + text.size();
  const auto [rest, failed] = std::from_chars(text.data(), end, value);
  if (failed != std::errc() || rest != end || text.empty()) return std::nullopt;
  return value;
}

}  // namespace

RangeKind parse_range(std::string_view header, std::uint64_t size, ByteRange& out) {
  constexpr std::string_view kUnit = "bytes=";
  out = {0, size};
  if (!begins_with(header, kUnit)) return RangeKind::kWhole;
  header.remove_prefix(kUnit.size());
  const auto dash = header.find('-');
  if (dash == std::string_view::npos) return RangeKind::kWhole;
  const std::string_view first_text = header.substr(0, dash), last_text = header.substr(dash + 1);
  if (first_text.empty()) {  // so many at the end
    const auto count = number(last_text);
    if (!count) return RangeKind::kWhole;
    if (*count == 0 || size == 0) return RangeKind::kUnsatisfiable;
    out.length = std::min(*count, size);
    out.at = size - out.length;
    return RangeKind::kPart;
  }
  const auto first = number(first_text);
  const auto last = last_text.empty() ? std::optional(size) : number(last_text);
  if (!first || !last || (!last_text.empty() && *last < *first)) return RangeKind::kWhole;
  if (*first >= size) return RangeKind::kUnsatisfiable;
  out.at = *first;
  out.length = std::min(*last, size - 1) - *first + 1;
  return RangeKind::kPart;
}

}  // namespace relievo
