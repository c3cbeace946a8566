// SPDX-License-Identifier: Apache-2.0
// --tls-cert, --tls-key, --token-file, --open, --allow-origin, --max-clients, --max-per-address and
// --max-rate: of `relievo web` and of `serve --web`.
#pragma once

#include <memory>

#include "base/result.h"
#include "base/web_options.h"
#include "cli/checks.h"

namespace CLI {
class App;
}

namespace relievo {

constexpr int kMostClients = 100'000;
constexpr double kLeastWebRate = 1, kMostWebRate = 1e6;

/// Filled while parsing.
std::shared_ptr<WebOptions> add_web_flags(CLI::App& app);

/// What is wrong with one of WebOptions::origins, or nothing.
ValueCheck web_origin();

/// Of `flags` what is given, else of `config`.
WebOptions merged(const WebOptions& flags, WebOptions config);

/// Fails where the options contradict themselves.
Status check_web_options(const WebOptions& options);

}  // namespace relievo
