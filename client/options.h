// SPDX-License-Identifier: Apache-2.0
// Options and words that several verbs share.
#pragma once

#include <cstdint>
#include <memory>
#include <string>

#include "idl/transport.h"

namespace CLI {
class App;
}

namespace relievo {

/// --domain, --interface and --keys, filled while parsing.
std::shared_ptr<DomainOptions> add_domain_options(CLI::App& app);

/// "12.3 MB"; "2 min 5 s", "26 h 5 min".
std::string bytes_text(std::uint64_t bytes);
std::string duration_text(double s);

}  // namespace relievo
