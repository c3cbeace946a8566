// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>

namespace relievo {

/// By whose clock a stream's times are: this machine's, or another's, not known until it was compared.
enum class ServerClock : std::uint8_t { kHere, kElsewhere };

}  // namespace relievo
