// SPDX-License-Identifier: Apache-2.0
#include "base/pattern.h"

#include <array>
#include <utility>

namespace relievo {
namespace {

constexpr std::array<std::pair<Scheme, std::string_view>, 4> kSchemes = {
    {{Scheme::kComplementary, "complementary"},
     {Scheme::kWhiteField, "white-field"},
     {Scheme::kWhiteFrame, "white-frame"},
     {Scheme::kOneSlide, "one-slide"}}};

}  // namespace

std::string_view to_string(Scheme scheme) {
  for (const auto& [value, name] : kSchemes)
    if (value == scheme) return name;
  return {};
}

std::optional<Scheme> scheme_named(std::string_view name) {
  for (const auto& [value, known] : kSchemes)
    if (known == name) return value;
  return std::nullopt;
}

std::string scheme_names() {
  std::string out;
  for (std::size_t i = 0; i < kSchemes.size(); ++i) {
    if (i > 0) out += i + 1 < kSchemes.size() ? ", " : " or ";
    out += kSchemes[i].second;
  }
  return out;
}

std::string to_yaml(const Pattern& pattern) {
  std::string out =
      "%YAML:1.0\n---\nbase: " + std::to_string(pattern.base) +
      (pattern.scheme == Scheme::kComplementary ? ""
                                                : "\nscheme: " + std::string(to_string(pattern.scheme))) +
      "\nslides: " + std::to_string(pattern.slides) + "\npalette: [ ";
  for (std::size_t i = 0; i < pattern.palette.size(); ++i) {
    const Primary c = pattern.palette[i];
    out += i ? ", \"" : "\"";
    for (int channel = 0; channel < 3; ++channel) out += (c >> channel) & 1 ? '1' : '0';
    out += '"';
  }
  out += " ]\nsequence: [ ";
  for (std::size_t i = 0; i < pattern.sequence.size(); ++i) {
    out += (i ? ", " : "") + std::to_string(pattern.sequence[i]);
  }
  return out + " ]\n";
}

}  // namespace relievo
