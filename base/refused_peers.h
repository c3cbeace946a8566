// SPDX-License-Identifier: Apache-2.0
// DDS peers that a secured server or viewer turned away, for /metrics.
#pragma once

#include <cstdint>

namespace relievo {

/// Since the program began.
struct RefusedPeers {
  std::uint64_t handshakes = 0;  // that failed: of another authority, revoked, changed; a peer tries again
  std::uint64_t plain = 0;       // readers without keys of a stream that is published here with some
};

}  // namespace relievo
