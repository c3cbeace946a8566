// SPDX-License-Identifier: Apache-2.0
// The Range header of HTTP (RFC 9110, 14). Pure; any input.
#pragma once

#include <cstdint>
#include <optional>
#include <string_view>

namespace relievo {

struct ByteRange {
  std::uint64_t at = 0;
  std::uint64_t length = 0;
  bool operator==(const ByteRange&) const = default;
};

enum class RangeKind { kWhole, kPart, kUnsatisfiable };

/// What `header` asks of `size` bytes. Several ranges, other units and what makes no sense give the whole, as
/// a server may; a range that begins behind the end is unsatisfiable.
RangeKind parse_range(std::string_view header, std::uint64_t size, ByteRange& out);

}  // namespace relievo
