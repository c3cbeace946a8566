// SPDX-License-Identifier: Apache-2.0
// Checks of the machine that streams are sent, received or recorded on. What the kernel says is read below
// `root`: "/", or in tests a folder that looks like it. Any thread.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "client/doctor/finding.h"

namespace relievo {

/// The interface that streams would use: `wanted` by name or address, empty: as the programs choose.
Finding check_interface(const std::string& wanted);
/// Sends a multicast datagram on that interface and waits a second for its coming back.
Finding check_multicast(const std::string& wanted);
/// Room for bursts in a receiving socket: net.core.rmem_max.
Finding check_receive_buffer(const std::filesystem::path& root);
/// Datagrams that came and were thrown away since the start of the machine.
Finding check_lost_datagrams(const std::filesystem::path& root);
/// Free room, and how fast a file gets to the disk: writes 32 MB there, and removes them.
Finding check_disk(const std::filesystem::path& folder);
/// Whether the clock is kept right, so that latencies across machines mean something; by whom, and which PTP
/// clocks there are.
Finding check_clock(const std::filesystem::path& root);
/// Cameras, and whether this user may open them.
Finding check_cameras(const std::filesystem::path& root);
Finding check_processor(const std::filesystem::path& root);
/// Whether large memory lies in huge pages (cli/huge_pages.cpp).
Finding check_huge_pages(const std::filesystem::path& root);

/// What the kernel says of the system's clock, and what was seen beside it.
struct ClockState {
  bool in_step = false;
  double error_ms = 0;
  int tai_s = 0;                        // TAI less UTC; 0: not known
  std::vector<std::string> ptp_clocks;  // "ptp0 (igb)"
  std::vector<std::string> keepers;     // programs that run: "chronyd"
};
/// Of check_clock().
Finding judge_clock(const ClockState& clock);

/// Of check_disk(), apart from the writing: `free` bytes, `rate` in bytes a second.
Finding judge_disk(std::uint64_t free, double rate, const std::filesystem::path& folder);

}  // namespace relievo
