// SPDX-License-Identifier: Apache-2.0
#include "client/options.h"

#include <CLI/CLI.hpp>
#include <cstdio>

namespace relievo {

std::shared_ptr<DomainOptions> add_domain_options(CLI::App& app) {
  auto options = std::make_shared<DomainOptions>();
  app.add_option("--domain", options->domain, "DDS domain")->check(CLI::Range(0, 230))->capture_default_str();
  app.add_option("--interface", options->interface,
                 "Network interface, by name or address (default: the first that "
                 "reaches others; lo for this machine alone)")
      ->type_name("NAME");
  app.add_option("--keys", options->keys,
                 "Folder of the keys for secured streams; none for plain ones (default: $RELIEVO_KEYS, "
                 "~/.config/relievo/keys or /etc/relievo/keys, where there are some)")
      ->type_name("DIR");
  return options;
}

std::string bytes_text(std::uint64_t bytes) {
  char text[32];
  const auto value = static_cast<double>(bytes);
  if (bytes < 1000) {
    std::snprintf(text, sizeof text, "%.0f B", value);
  } else if (bytes < 1'000'000) {
    std::snprintf(text, sizeof text, "%.1f kB", value / 1e3);
  } else if (bytes < 1'000'000'000) {
    std::snprintf(text, sizeof text, "%.1f MB", value / 1e6);
  } else {
    std::snprintf(text, sizeof text, "%.2f GB", value / 1e9);
  }
  return text;
}

std::string duration_text(double s) {
  char text[48];
  if (s < 60) {
    std::snprintf(text, sizeof text, "%.2f s", s);
  } else {
    const auto whole = static_cast<long long>(s);
    if (whole < 3600)
      std::snprintf(text, sizeof text, "%lld min %lld s", whole / 60, whole % 60);
    else
      std::snprintf(text, sizeof text, "%lld h %lld min", whole / 3600, whole / 60 % 60);
  }
  return text;
}

}  // namespace relievo
