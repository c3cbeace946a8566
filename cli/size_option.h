// SPDX-License-Identifier: Apache-2.0
// Sizes such as 1024x768 on the command line.
#pragma once

#include <optional>
#include <string>

namespace CLI {
class App;
class Option;
}  // namespace CLI

namespace relievo {

struct Size {
  int width = 0;
  int height = 0;
};

/// "WIDTHxHEIGHT", each 8 to 16384.
std::optional<Size> parse_size(const std::string& text);

/// Adds an option whose value is WIDTHxHEIGHT, each 8 to 16384; wrong values are usage errors.
CLI::Option* add_size_option(CLI::App& app, const std::string& names, Size& size, const std::string& help);

}  // namespace relievo
