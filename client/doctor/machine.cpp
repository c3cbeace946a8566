// SPDX-License-Identifier: Apache-2.0
#include "client/doctor/machine.h"

#include <fcntl.h>
#include <sys/timex.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <cstdio>
#include <fstream>
#include <string>
#include <thread>

#include "base/whole_file.h"
#include "client/options.h"

namespace relievo {
namespace {

using Grade = Finding::Grade;

constexpr std::uint64_t kMinute = 150'000'000;   // bytes of a stream of 20 Mbit/s
constexpr std::uint64_t kLittle = 10 * kMinute;  // room below which recording soon ends
constexpr double kStreamRate = 2.5e6;            // bytes a second of the same
constexpr std::size_t kPiece = 1 << 20, kPieces = 32;

std::string number_text(double value, const char* format) {
  char text[32];
  std::snprintf(text, sizeof text, format, value);
  return text;
}

/// Bytes a second to the disk itself; an error says why none could be written.
Result<double> write_rate(const std::filesystem::path& folder) {
  std::string name = (folder / ".relievo-doctor-XXXXXX").string();
  const int fd = mkostemp(name.data(), O_CLOEXEC);
  if (fd < 0) return Error{write_failure(errno)};
  unlink(name.c_str());
  const std::string piece(kPiece, 'x');
  const auto start = std::chrono::steady_clock::now();
  int failed = 0;
  for (std::size_t i = 0; i < kPieces && failed == 0; ++i) {
    const ssize_t count = write(fd, piece.data(), piece.size());
    if (count != static_cast<ssize_t>(piece.size())) failed = count < 0 ? errno : ENOSPC;
  }
  if (failed == 0 && fsync(fd) != 0) failed = errno;
  const std::chrono::duration<double> took = std::chrono::steady_clock::now() - start;
  close(fd);
  if (failed != 0) return Error{write_failure(failed)};
  return static_cast<double>(kPiece * kPieces) / std::max(took.count(), 1e-6);
}

}  // namespace

Finding judge_disk(std::uint64_t free, double rate, const std::filesystem::path& folder) {
  const std::string found = bytes_text(free) + " free in " + folder.string() + ", " +
                            std::to_string(free / kMinute) + " min of a stream of 20 Mbit/s; writes " +
                            bytes_text(static_cast<std::uint64_t>(rate)) + "/s";
  if (rate < 2 * kStreamRate)
    return {Grade::kTrouble, "disk", found,
            "record on a faster disk: a recorder that cannot keep up loses frames"};
  if (free < kLittle)
    return {Grade::kAdvice, "disk", found,
            "make room, or let old segments go: record --split-every 10min --keep-size 8GB"};
  return {Grade::kGood, "disk", found, ""};
}

Finding check_disk(const std::filesystem::path& folder) {
  const auto rate = write_rate(folder);
  if (!rate)
    return {Grade::kTrouble, "disk",
            "nothing can be written in " + folder.string() + ": " + rate.error().message,
            "choose a folder to record in by --folder"};
  std::error_code error;
  const auto space = std::filesystem::space(folder, error);
  return judge_disk(error ? 0 : space.available, *rate, folder);
}

Finding check_clock() {
  timex now{};
  const int state = adjtimex(&now);
  std::string ptp;
  std::error_code none;
  for (const auto& entry : std::filesystem::directory_iterator("/dev", none))
    if (const std::string name = entry.path().filename().string(); name.starts_with("ptp")) ptp += " " + name;
  if (!ptp.empty()) ptp = "; PTP clocks:" + ptp;
  if (state == TIME_ERROR || (now.status & STA_UNSYNC) != 0)
    return {Grade::kAdvice, "clock", "nothing keeps it right" + ptp,
            "latencies between machines need clocks in step: apt-get install chrony (or ptp4l and phc2sys of "
            "linuxptp, for microseconds)"};
  return {Grade::kGood, "clock",
          "in step with a time server, off by " +
              number_text(static_cast<double>(now.esterror) / 1e3, "%.1f") +
              " ms or so; TAI is ahead of UTC by " + std::to_string(now.tai) + " s" + ptp,
          ""};
}

Finding check_cameras(const std::filesystem::path& root) {
  std::string open, shut;
  std::error_code none;
  for (const auto& entry : std::filesystem::directory_iterator(root / "dev", none)) {
    const std::string name = entry.path().filename().string();
    if (!name.starts_with("video")) continue;
    (access(entry.path().c_str(), R_OK | W_OK) == 0 ? open : shut) += " " + name;
  }
  if (!shut.empty())
    return {Grade::kTrouble, "cameras", "this user may not open" + shut,
            "sudo usermod -aG video $USER, then log in again"};
  if (open.empty()) return {Grade::kGood, "cameras", "none here (a server needs one; viewers do not)", ""};
  return {Grade::kGood, "cameras", "may be opened:" + open + "; relievo-server devices says more", ""};
}

Finding check_processor(const std::filesystem::path& root) {
  const unsigned cores = std::max(1u, std::thread::hardware_concurrency());
  std::string found = std::to_string(cores) + (cores == 1 ? " core" : " cores");
  std::string governor;
  std::ifstream(root / "sys/devices/system/cpu/cpu0/cpufreq/scaling_governor") >> governor;
  if (governor == "powersave" && !std::filesystem::exists(root / "sys/devices/system/cpu/intel_pstate"))
    return {Grade::kAdvice, "processor", found + ", kept at its lowest speed",
            "cpupower frequency-set -g performance on a machine that reconstructs"};
#if defined(__x86_64__)
  if (!__builtin_cpu_supports("avx2"))
    return {Grade::kAdvice, "processor", found + " without AVX2: reconstruction takes about twice as long",
            ""};
  found += " with AVX2";
#endif
  if (cores < 2) return {Grade::kAdvice, "processor", found, "reconstruction and encoding want a core each"};
  return {Grade::kGood, "processor", found, ""};
}

}  // namespace relievo
