// SPDX-License-Identifier: Apache-2.0
// Whether a PNG is whole, before a decoder sees it.
#pragma once

#include <cstdint>
#include <span>

#include "base/result.h"

namespace relievo {

struct PngHeader {
  std::uint32_t width = 0, height = 0;
  int bits = 0, colour_type = 0;
};

/// Walks the chunks of a whole file and verifies their checksums. The error goes on behind the file's name.
Result<PngHeader> check_png(std::span<const std::uint8_t> file);

}  // namespace relievo
