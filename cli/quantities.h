// SPDX-License-Identifier: Apache-2.0
// Sizes and durations as people write them.
#pragma once

#include <cstdint>
#include <string>

#include "base/result.h"
#include "cli/checks.h"

namespace relievo {

/// "500MB", "2 GB", "1.5TB", "4096": of 1000 each, and MiB, GiB of 1024. At least a byte.
Result<std::uint64_t> parse_bytes(const std::string& text);

/// "4M", "2.5 Mbit/s", "800k", "4000000": bits a second, of 1000 each. 0.1 to 1000 million.
Result<double> parse_bit_rate(const std::string& text);

/// "90", "90s", "10min", "1.5h", "30d" in seconds. More than 0.
Result<double> parse_duration_s(const std::string& text);

/// For CLI::Option::check.
ValueCheck byte_count();
ValueCheck duration();
ValueCheck bit_rate();

}  // namespace relievo
