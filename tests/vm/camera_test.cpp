// SPDX-License-Identifier: Apache-2.0
// Boots a virtual machine with the kernel's test cameras, and runs guest_*_test.cpp in it. Needs QEMU, which
// scripts/setup installs; skipped where it is not.
#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "tests/support/process.h"
#include "tests/support/temp_folder.h"

namespace relievo::test {
namespace {

constexpr auto kBootPatience = std::chrono::seconds(900);

// /dev/video0 and 1: a camera, and an output whose pictures it can be given; 2: a multi-planar camera.
const char* const kVividParameters =
    "n_devs=2 node_types=0x101,0x1 multiplanar=1,2 vid_cap_nr=0,2 vid_out_nr=1,3";
const char* const kLoopbackParameters = "devices=1 video_nr=20 exclusive_caps=0";

Finished in_guest(const std::vector<std::string>& command, const std::filesystem::path& shared) {
  std::vector<std::string> all = {RELIEVO_SOURCE_DIR "/tests/support/vm/run",
                                  "--vivid",
                                  kVividParameters,
                                  "--loopback",
                                  kLoopbackParameters,
                                  "--share",
                                  shared.string(),
                                  "--limit",
                                  "850"};
  all.insert(all.end(), command.begin(), command.end());
  return run(all, kBootPatience);
}

void run_guest_tests(const std::string& filter) {
  const TempFolder folder;
  const Finished done =
      in_guest({program("camera_guest_test").string(), "--gtest_filter=" + filter}, folder.path());
  if (done.status == 77) GTEST_SKIP() << done.err;
  EXPECT_EQ(done.status, 0) << done.out << done.err;
  EXPECT_NE(done.out.find("[  PASSED  ]"), std::string::npos) << done.out << done.err;
}

TEST(CameraInGuest, PicturesAreThePatterns) {
  run_guest_tests("Vivid/*:Settings.*");
}

TEST(CameraInGuest, FaultsAreSurvivedAndCounted) {
  run_guest_tests("Faults.*");
}

}  // namespace
}  // namespace relievo::test
