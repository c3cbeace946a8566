// SPDX-License-Identifier: Apache-2.0
#include "cli/help.h"

#include <CLI/CLI.hpp>
#include <algorithm>
#include <string>

namespace relievo {
namespace {

/// CLI11 says "INT:INT in [0 - 230]", "TEXT:{ply,glb}" or "UINT:POSITIVE".
std::string value_text(const std::string& type_name) {
  const std::size_t colon = type_name.find(':');
  std::string kind = type_name.substr(0, colon);
  const std::string limits = colon == std::string::npos ? "" : type_name.substr(colon + 1);
  if (limits.starts_with('{') && limits.ends_with('}')) {
    std::string choices = limits.substr(1, limits.size() - 2);
    std::replace(choices.begin(), choices.end(), ',', '|');
    return choices;
  }
  const std::size_t open = limits.find('[');
  const std::size_t dash = limits.find(" - ");
  if (open != std::string::npos && dash != std::string::npos && limits.ends_with(']')) {
    return limits.substr(open + 1, dash - open - 1) + ".." +
           limits.substr(dash + 3, limits.size() - dash - 4);
  }
  if (kind == "INT" || kind == "UINT" || kind == "FLOAT") return "N";
  return kind == "TEXT" ? kind : type_name;  // or a name of our own
}

class HelpFormatter final : public CLI::Formatter {
 public:
  HelpFormatter() {
    label("SUBCOMMAND", "COMMAND");
    column_width(32);
  }

  std::string make_option_opts(const CLI::Option* option) const override {
    if (option->get_type_size() == 0) return {};  // a flag
    std::string text = ' ' + value_text(option->get_type_name());
    if (option->get_expected_max() == CLI::detail::expected_max_vector_size) text += " ...";
    return text;
  }

  std::string make_option_desc(const CLI::Option* option) const override {
    std::string text = option->get_description();
    if (option->get_required() && !option->get_positional()) text += " (required)";
    if (!option->get_default_str().empty()) text += " (default " + option->get_default_str() + ')';
    return text;
  }
};

}  // namespace

std::shared_ptr<CLI::FormatterBase> make_help_formatter() {
  return std::make_shared<HelpFormatter>();
}

}  // namespace relievo
