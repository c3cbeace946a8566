// SPDX-License-Identifier: Apache-2.0
// Reading what a gateway's /metrics says.
#pragma once

#include <string>

namespace relievo::test {

/// The value of the line of `text` that begins with `name`, its labels included; -1 where there is none.
inline double metric_in(const std::string& text, const std::string& name) {
  const std::string lines = "\n" + text;
  const auto at = lines.find("\n" + name + " ");
  return at == std::string::npos ? -1 : std::stod(lines.substr(at + name.size() + 2));
}

/// The name of the counter of who was turned away for a reason.
inline std::string refused_for(const std::string& reason) {
  return "relievo_gateway_refused_total{reason=\"" + reason + "\"}";
}

}  // namespace relievo::test
