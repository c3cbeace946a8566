// SPDX-License-Identifier: Apache-2.0
// Checks of option values, for CLI::Option::check: CLI11's own accept numbers that overflow, and NaN, and
// print limits of 300 digits.
#pragma once

#include <cstdint>
#include <functional>
#include <limits>
#include <string>
#include <vector>

namespace relievo {

/// Returns what is wrong with a value, or nothing.
using ValueCheck = std::function<std::string(const std::string&)>;

ValueCheck whole_number(std::uint64_t least, std::uint64_t most = std::numeric_limits<std::uint64_t>::max());
/// A finite number, `least` and `most` included.
ValueCheck number(double least, double most = std::numeric_limits<double>::infinity());
/// One of these words.
ValueCheck one_of(std::vector<std::string> words);
/// The name of a folder, not one that ends as a file's: results in a folder a.png would be a surprise.
ValueCheck folder_name();
/// The name of a file in PNG.
ValueCheck png_name();
/// HOST:PORT; "none" too where `optional`.
ValueCheck listen_address(bool optional = false);

}  // namespace relievo
