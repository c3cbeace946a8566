// SPDX-License-Identifier: Apache-2.0
// The suites: a new one is a file, a line here and one in main.cpp.
#pragma once

#include "cli/program.h"

namespace relievo::bench {

Command reconstruct_suite();
Command codec_suite();
Command texture_suite();
Command chain_suite();
Command peer_suite();
Command rate_suite();
Command recording_suite();

}  // namespace relievo::bench
