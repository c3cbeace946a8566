// SPDX-License-Identifier: Apache-2.0
#include "cli/web_flags.h"

#include <CLI/CLI.hpp>
#include <string_view>

namespace relievo {

std::shared_ptr<WebOptions> add_web_flags(CLI::App& app) {
  auto options = std::make_shared<WebOptions>();
  app.add_option(
         "--tls-cert", options->tls_cert,
         "https with this certificate and those of its authorities, a PEM file; read again when it has "
         "changed")
      ->type_name("FILE");
  app.add_option("--tls-key", options->tls_key, "and with this key, a PEM file without a password")
      ->type_name("FILE");
  auto* tokens =
      app.add_option("--token-file", options->token_file,
                     "Only who has a token of this file may watch: one a line, made with openssl rand "
                     "-hex 24 (default: on this machine alone none is needed, otherwise one is made "
                     "and printed)")
          ->type_name("FILE");
  app.add_flag("--open", options->open, "Anybody who reaches the address may watch")
      ->check([tokens](const std::string& on) {
        return on == "true" && tokens->count() > 0 ? "lets everybody in: leave out --token-file" : "";
      });
  app.add_option("--allow-origin", options->origins,
                 "Pages of this site may watch too, and a proxy may speak for it; may be repeated")
      ->type_name("https://HOST[:PORT]")
      ->check(web_origin());
  app.add_option("--max-clients", options->max_clients, "Viewers at a time (default 64)")
      ->type_name("N")
      ->check(CLI::Range(1, kMostClients));
  app.add_option("--max-per-address", options->max_per_address,
                 "Connections of one address (default 32, and any number from this machine; given, it holds "
                 "for this machine, too)")
      ->type_name("N")
      ->check(CLI::Range(1, kMostClients));
  app.add_option("--max-rate", options->max_rate,
                 "Requests a second of one address (default 200, and any number from this machine; given, it "
                 "holds for this machine, too)")
      ->type_name("N")
      ->check(number(kLeastWebRate, kMostWebRate));
  return options;
}

ValueCheck web_origin() {
  return [](const std::string& origin) -> std::string {
    const bool known = origin.starts_with("http://") || origin.starts_with("https://");
    const std::string_view rest = known ? std::string_view(origin).substr(origin.find("://") + 3) : "";
    if (!rest.empty() && rest.find_first_of("/?#@ *") == std::string_view::npos) return "";
    return "'" + origin + "' is no origin: give scheme, host and port as in https://viewer.example:8443";
  };
}

WebOptions merged(const WebOptions& flags, WebOptions config) {
  for (const auto text : {&WebOptions::tls_cert, &WebOptions::tls_key, &WebOptions::token_file})
    if (!(flags.*text).empty()) config.*text = flags.*text;
  if (flags.open) config.open = flags.open;
  if (!flags.origins.empty()) config.origins = flags.origins;
  for (const auto count : {&WebOptions::max_clients, &WebOptions::max_per_address})
    if (flags.*count) config.*count = flags.*count;
  if (flags.max_rate) config.max_rate = flags.max_rate;
  return config;
}

Status check_web_options(const WebOptions& options) {
  if (options.tls_cert.empty() != options.tls_key.empty())
    return Error{"a certificate needs its key: give --tls-cert FILE and --tls-key FILE together"};
  if (options.open.value_or(false) && !options.token_file.empty())
    return Error{"--open lets everybody watch, --token-file only who has a token: leave one out"};
  return {};
}

}  // namespace relievo
