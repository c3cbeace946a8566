// SPDX-License-Identifier: Apache-2.0
// What Cyclone DDS says goes where all goes that is logged. Internal to idl/.
#pragma once

#include <cstdint>

namespace relievo {

/// From now on; any thread, any number of times. Cyclone's warnings are warnings when they come for the first
/// time, and later ones of their kind are for developers: a peer without the right keys tries for ever.
void take_over_dds_log();

/// Of those, how many say that DDS Security turned a peer away.
std::uint64_t refused_handshakes();

}  // namespace relievo
