// SPDX-License-Identifier: Apache-2.0
// What the calibration, import and pattern commands share: sizes such as 1024x768, and folders to write to.
#pragma once

#include <optional>
#include <string>

#include "base/result.h"

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

/// Makes the folder where it is missing.
Status make_folder(const std::string& folder);

}  // namespace relievo
