// SPDX-License-Identifier: Apache-2.0
// The guest's tests begin with all their code in memory: fetched only when it is first run, from the host's
// disk, it would come late on a busy host while the camera's clock runs on.
#include <gtest/gtest.h>
#include <sys/mman.h>

#include <cstdio>

int main(int argc, char** argv) {
  testing::InitGoogleTest(&argc, argv);
  if (mlockall(MCL_CURRENT | MCL_FUTURE) != 0) std::perror("mlockall");
  return RUN_ALL_TESTS();
}
