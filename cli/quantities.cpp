// SPDX-License-Identifier: Apache-2.0
#include "cli/quantities.h"

#include <cctype>
#include <charconv>
#include <cmath>
#include <optional>
#include <span>

namespace relievo {
namespace {

struct Unit {
  const char* name;  // lower case
  double value;
};

constexpr Unit kBytes[] = {{"", 1},      {"b", 1},      {"kb", 1e3},      {"mb", 1e6},     {"gb", 1e9},
                           {"tb", 1e12}, {"kib", 1024}, {"mib", 1 << 20}, {"gib", 1 << 30}};
constexpr Unit kBitRates[] = {{"", 1},         {"k", 1e3},      {"m", 1e6},     {"g", 1e9},
                              {"kbit/s", 1e3}, {"mbit/s", 1e6}, {"gbit/s", 1e9}};
constexpr Unit kSeconds[] = {{"", 1}, {"s", 1}, {"min", 60}, {"h", 3600}, {"d", 86400}};

/// A positive number and one of the units, a space between them or none.
std::optional<double> quantity(const std::string& text, std::span<const Unit> units) {
  double number = 0;
  const auto [end, failed] = std::from_chars(text.data(), text.data() + text.size(), number);
  if (failed != std::errc() || !std::isfinite(number) || number <= 0) return std::nullopt;
  std::string unit;
  for (const char* c = end; c != text.data() + text.size(); ++c) {
    if (*c != ' ' || !unit.empty()) unit += static_cast<char>(std::tolower(static_cast<unsigned char>(*c)));
  }
  for (const Unit& known : units) {
    if (unit == known.name) return number * known.value;
  }
  return std::nullopt;
}

template <typename Parse>
ValueCheck check_of(Parse parse) {
  return [parse](const std::string& text) {
    const auto value = parse(text);
    return value ? std::string() : value.error().message;
  };
}

}  // namespace

Result<std::uint64_t> parse_bytes(const std::string& text) {
  const auto bytes = quantity(text, kBytes);
  if (!bytes || *bytes < 1 || *bytes > 9e18) return Error{"'" + text + "' is no size such as 500MB or 2GB"};
  return static_cast<std::uint64_t>(std::llround(*bytes));
}

Result<double> parse_duration_s(const std::string& text) {
  const auto s = quantity(text, kSeconds);
  if (!s || *s > 1e10) return Error{"'" + text + "' is no duration such as 90s, 10min, 2h or 30d"};
  return *s;
}

Result<double> parse_bit_rate(const std::string& text) {
  const auto bits = quantity(text, kBitRates);
  if (!bits || *bits < 1e5 || *bits > 1e9)
    return Error{"'" + text + "' is no bit rate such as 800k or 4M, from 100k to 1G"};
  return *bits;
}

ValueCheck bit_rate() {
  return check_of(parse_bit_rate);
}

ValueCheck byte_count() {
  return check_of(parse_bytes);
}

ValueCheck duration() {
  return check_of(parse_duration_s);
}

}  // namespace relievo
