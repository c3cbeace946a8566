// SPDX-License-Identifier: Apache-2.0
// Internal to idl/.
#pragma once

#include <chrono>
#include <string>

#include "base/result.h"
#include "idl/domain.h"

namespace relievo {

/// Long enough for discovery on a local network; the price of starting a stream.
constexpr std::chrono::milliseconds kDiscoveryWait{400};

/// Fails where a stream of that name is live in the domain, having waited for `wait` to hear of one.
Status check_name_is_free(const Domain& domain, const std::string& stream, std::chrono::milliseconds wait);

}  // namespace relievo
