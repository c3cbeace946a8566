// SPDX-License-Identifier: Apache-2.0
// What clients that decode a stream say of themselves, as its server hears it. Plain data.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "base/histogram.h"

namespace relievo {

/// Since the client began.
struct ClientReport {
  std::string client;  // machine and process, for a person: not unique, and a hostile one says what it likes
  std::uint64_t id = 0;       // chosen by the client at random
  Histogram decode;           // what decoding a frame took
  Histogram decoded_after;    // from its capture until it was decoded
  std::uint64_t lost = 0;     // frames lost on the way to it,
  std::uint64_t skipped = 0;  // and that build on one of those, or do not decode
};

struct ClientReports {
  std::vector<ClientReport> clients;  // that were heard of lately, by id
  Histogram decode, decoded_after;    // of all clients, also those gone, since the server began to listen
};

}  // namespace relievo
