// SPDX-License-Identifier: Apache-2.0
#include "base/time.h"

#include <array>
#include <ctime>

namespace relievo {

std::string utc_text(std::int64_t ns, const char* format) {
  const std::time_t time = std::chrono::floor<std::chrono::seconds>(std::chrono::nanoseconds(ns)).count();
  std::tm utc{};
  gmtime_r(&time, &utc);
  std::array<char, 64> text;
  return {text.data(), std::strftime(text.data(), text.size(), format, &utc)};
}

}  // namespace relievo
