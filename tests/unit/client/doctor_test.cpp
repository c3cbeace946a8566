// SPDX-License-Identifier: Apache-2.0
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>

#include "client/doctor/machine.h"
#include "tests/support/temp_folder.h"

namespace relievo {
namespace {

using Grade = Finding::Grade;
using testing::HasSubstr;

/// A folder with what a kernel would say.
struct Machine {
  test::TempFolder root;

  void says(const std::string& file, const std::string& text) const {
    const auto path = root / file;
    std::filesystem::create_directories(path.parent_path());
    std::ofstream(path) << text;
  }
};

TEST(Doctor, ReceiveBuffersBelowWhatOurSocketsAskForAreNamedWithTheSetting) {
  const Machine machine;
  machine.says("proc/sys/net/core/rmem_max", "212992\n");
  const Finding small = check_receive_buffer(machine.root.path());
  EXPECT_EQ(small.grade, Grade::kAdvice);
  EXPECT_THAT(small.found, HasSubstr("213.0 kB"));
  EXPECT_THAT(small.mend, HasSubstr("net.core.rmem_max=8388608"));
  machine.says("proc/sys/net/core/rmem_max", "8388608\n");
  EXPECT_EQ(check_receive_buffer(machine.root.path()).grade, Grade::kGood);
}

// The form of a kernel's own /proc/net/snmp; names and numbers on lines of their own.
std::string snmp(int reassembled, int torn, int came, int full) {
  return "Ip: Forwarding DefaultTTL ReasmReqds ReasmOKs ReasmFails\nIp: 2 64 " + std::to_string(reassembled) +
         " 0 " + std::to_string(torn) + "\nTcp: RtoAlgorithm MaxConn\nTcp: 1 -1\n" +
         "Udp: InDatagrams NoPorts InErrors OutDatagrams RcvbufErrors\nUdp: " + std::to_string(came) +
         " 7 3 80000 " + std::to_string(full) + "\n";
}

TEST(Doctor, LostDatagramsAreCountedByTheirReason) {
  const Machine machine;
  machine.says("proc/net/snmp", snmp(1000, 0, 900'000, 3));
  EXPECT_EQ(check_lost_datagrams(machine.root.path()).grade, Grade::kGood);
  machine.says("proc/net/snmp", snmp(1000, 0, 900'000, 100));
  const Finding full = check_lost_datagrams(machine.root.path());
  EXPECT_EQ(full.grade, Grade::kAdvice);
  EXPECT_THAT(full.found, HasSubstr("100 of 900100"));
  EXPECT_THAT(full.mend, HasSubstr("receive buffer"));
  machine.says("proc/net/snmp", snmp(1000, 40, 900'000, 0));
  const Finding torn = check_lost_datagrams(machine.root.path());
  EXPECT_EQ(torn.grade, Grade::kAdvice);
  EXPECT_THAT(torn.mend, HasSubstr("MTU"));
}

TEST(Doctor, DisksThatAreFullOrSlowAreSaid) {
  EXPECT_EQ(judge_disk(500'000'000'000, 200e6, "/data").grade, Grade::kGood);
  const Finding full = judge_disk(300'000'000, 200e6, "/data");
  EXPECT_EQ(full.grade, Grade::kAdvice);
  EXPECT_THAT(full.found, HasSubstr("2 min"));
  EXPECT_EQ(judge_disk(500'000'000'000, 1e6, "/data").grade, Grade::kTrouble);
}

TEST(Doctor, DiskIsWrittenForTrialAndNothingIsLeftThere) {
  const test::TempFolder folder;
  EXPECT_THAT(check_disk(folder.path()).found, HasSubstr("/s"));
  EXPECT_TRUE(std::filesystem::is_empty(folder.path()));
  const Finding missing = check_disk(folder / "missing");
  EXPECT_EQ(missing.grade, Grade::kTrouble);
  EXPECT_THAT(missing.mend, HasSubstr("--folder"));
}

TEST(Doctor, UnknownInterfaceIsTrouble) {
  const Finding found = check_interface("nosuch0");
  EXPECT_EQ(found.grade, Grade::kTrouble);
  EXPECT_THAT(found.found, HasSubstr("nosuch0"));
  EXPECT_EQ(check_interface("lo").grade, Grade::kAdvice);
}

TEST(Doctor, ProcessorThatIsKeptSlowIsSaid) {
  const Machine machine;
  EXPECT_THAT(check_processor(machine.root.path()).found, HasSubstr("core"));
  machine.says("sys/devices/system/cpu/cpu0/cpufreq/scaling_governor", "powersave\n");
  EXPECT_EQ(check_processor(machine.root.path()).grade, Grade::kAdvice);
}

TEST(Doctor, HugePagesThatAreSwitchedOffAreSaid) {
  const Machine machine;
  EXPECT_EQ(check_huge_pages(machine.root.path()).grade, Grade::kGood);
  EXPECT_THAT(check_huge_pages(machine.root.path()).found, HasSubstr("none"));
  const char* file = "sys/kernel/mm/transparent_hugepage/enabled";
  for (const char* given : {"[always] madvise never\n", "always [madvise] never\n"}) {
    machine.says(file, given);
    EXPECT_EQ(check_huge_pages(machine.root.path()).grade, Grade::kGood) << given;
    EXPECT_THAT(check_huge_pages(machine.root.path()).found, HasSubstr("ask")) << given;
  }
  machine.says(file, "always madvise [never]\n");
  const Finding off = check_huge_pages(machine.root.path());
  EXPECT_EQ(off.grade, Grade::kAdvice);
  EXPECT_THAT(off.mend, HasSubstr("madvise"));
}

TEST(Doctor, WhatKeepsTheClockAndPtpClocksAreSaid) {
  const Finding alone = judge_clock({});
  EXPECT_EQ(alone.grade, Grade::kAdvice);
  EXPECT_THAT(alone.found, HasSubstr("nothing keeps it right"));
  EXPECT_THAT(alone.mend, HasSubstr("chrony"));
  const Finding with_card = judge_clock({.ptp_clocks = {"ptp0 (igb)"}});
  EXPECT_THAT(with_card.found, HasSubstr("PTP clocks: ptp0 (igb)"));
  EXPECT_THAT(with_card.mend, HasSubstr("ptp4l"));
  EXPECT_THAT(judge_clock({.keepers = {"ptp4l"}}).found, HasSubstr("not in step yet; running: ptp4l"));
  const Finding kept = judge_clock({.in_step = true, .error_ms = 0.25, .tai_s = 37, .keepers = {"chronyd"}});
  EXPECT_EQ(kept.grade, Grade::kGood);
  EXPECT_THAT(kept.found, HasSubstr("37 s; running: chronyd"));
}

TEST(Doctor, PtpClocksAndTimeServersAreFound) {
  const Machine machine;
  EXPECT_EQ(check_clock(machine.root.path()).found.find("PTP"), std::string::npos);
  machine.says("sys/class/ptp/ptp0/clock_name", "igb\n");
  machine.says("sys/class/ptp/ptp1/clock_name", "mlx5_ptp\n");
  machine.says("proc/712/comm", "phc2sys\n");
  machine.says("proc/711/comm", "ptp4l\n");
  machine.says("proc/1/comm", "systemd\n");
  EXPECT_THAT(check_clock(machine.root.path()).found,
              HasSubstr("; running: phc2sys ptp4l; PTP clocks: ptp0 (igb) ptp1 (mlx5_ptp)"));
}

TEST(Doctor, CamerasAreListed) {
  const Machine machine;
  std::filesystem::create_directories(machine.root / "dev");
  EXPECT_THAT(check_cameras(machine.root.path()).found, HasSubstr("none"));
  machine.says("dev/video2", "");
  EXPECT_THAT(check_cameras(machine.root.path()).found, HasSubstr("video2"));
}

}  // namespace
}  // namespace relievo
