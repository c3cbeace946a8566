// SPDX-License-Identifier: Apache-2.0
// in_own_domain COMMAND [ARGUMENT...]: runs a test that is no C++ program with the number of a DDS domain of
// its own in RELIEVO_TEST_DOMAIN.
#include <unistd.h>

#include <cstdio>
#include <cstdlib>
#include <string>

#include "tests/support/own_domain.h"

int main(int argc, char** argv) {
  if (argc < 2) return 2;
  setenv("RELIEVO_TEST_DOMAIN", std::to_string(relievo::test::own_domain()).c_str(), 1);
  execvp(argv[1], argv + 1);
  std::perror(argv[1]);
  return 1;
}
