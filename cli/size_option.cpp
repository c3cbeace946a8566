// SPDX-License-Identifier: Apache-2.0
#include "cli/size_option.h"

#include <CLI/CLI.hpp>
#include <charconv>
#include <optional>

namespace relievo {

std::optional<Size> parse_size(const std::string& text) {
  const std::size_t by = text.find_first_of("xX");
  if (by == std::string::npos) return std::nullopt;
  const auto number = [&](std::size_t begin, std::size_t end, int& out) {
    const char* last = text.data() + end;
    const auto [at, failed] = std::from_chars(text.data() + begin, last, out);
    return failed == std::errc{} && at == last && out >= 8 && out <= 16384;
  };
  Size size;
  if (!number(0, by, size.width) || !number(by + 1, text.size(), size.height)) return std::nullopt;
  return size;
}

CLI::Option* add_size_option(CLI::App& app, const std::string& names, Size& size, const std::string& help) {
  return app
      .add_option_function<std::string>(
          names, [&size](const std::string& text) { size = parse_size(text).value_or(Size{}); }, help)
      ->type_name("WxH")
      ->check([](const std::string& text) {
        return parse_size(text) ? std::string() : text + " is no size such as 1024x768";
      });
}

}  // namespace relievo
