// SPDX-License-Identifier: Apache-2.0
#include "bench/suites.h"

int main(int argc, char** argv) {
  using namespace relievo::bench;
  return relievo::run_program("relievo-bench", "Measures how fast and how small this machine makes 3D video",
                              {reconstruct_suite(), codec_suite(), texture_suite(), chain_suite(),
                               peer_suite(), rate_suite(), recording_suite()},
                              argc, argv);
}
