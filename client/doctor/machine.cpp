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
#include <set>
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

Finding judge_clock(const ClockState& clock) {
  const auto list = [](const char* what, const std::vector<std::string>& names) {
    std::string all;
    for (const std::string& name : names) all += " " + name;
    return names.empty() ? all : std::string("; ") + what + all;
  };
  const std::string seen = list("running:", clock.keepers) + list("PTP clocks:", clock.ptp_clocks);
  const bool has_ptp = !clock.ptp_clocks.empty();
  if (!clock.in_step)
    return {Grade::kAdvice, "clock",
            (clock.keepers.empty() ? "nothing keeps it right" : "it is not in step yet") + seen,
            has_ptp ? "latencies between machines need clocks in step: apt-get install linuxptp, then ptp4l "
                      "and phc2sys "
                      "keep it within microseconds (or chrony)"
                    : "latencies between machines need clocks in step: apt-get install chrony"};
  return {Grade::kGood, "clock",
          "in step, off by " + number_text(clock.error_ms, "%.1f") + " ms or so; TAI is ahead of UTC by " +
              std::to_string(clock.tai_s) + " s" + seen,
          ""};
}

Finding check_clock(const std::filesystem::path& root) {
  timex now{};
  const int state = adjtimex(&now);
  ClockState clock{.in_step = state >= 0 && state != TIME_ERROR && (now.status & STA_UNSYNC) == 0,
                   .error_ms = static_cast<double>(now.esterror) / 1e3,
                   .tai_s = now.tai};
  std::error_code none;
  const auto first_line = [](const std::filesystem::path& file) {
    std::string line;
    std::ifstream in(file);
    std::getline(in, line);
    return line;
  };
  for (const auto& entry : std::filesystem::directory_iterator(root / "sys/class/ptp", none)) {
    const std::string name = first_line(entry.path() / "clock_name");
    clock.ptp_clocks.push_back(entry.path().filename().string() + (name.empty() ? "" : " (" + name + ")"));
  }
  std::set<std::string> keepers;
  for (const auto& entry : std::filesystem::directory_iterator(root / "proc", none)) {
    const std::string program = first_line(entry.path() / "comm");
    for (const char* known :
         {"ptp4l", "phc2sys", "chronyd", "ntpd", "systemd-timesyn"})  // as the kernel cuts it
      if (program == known) keepers.insert(program);
  }
  clock.keepers = {keepers.begin(), keepers.end()};
  std::ranges::sort(clock.ptp_clocks);
  return judge_clock(clock);
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

Finding check_huge_pages(const std::filesystem::path& root) {
  // As "always [madvise] never": the one in brackets holds.
  std::ifstream file(root / "sys/kernel/mm/transparent_hugepage/enabled");
  std::string word;
  while (file >> word)
    if (word.starts_with('[')) break;
  if (word == "[always]" || word == "[madvise]")
    return {Grade::kGood, "huge pages", "given to programs that ask for them, as these do", ""};
  constexpr const char* kCost =
      "reconstruction of large pictures takes up to a quarter longer in a virtual machine";
  if (word == "[never]")
    return {Grade::kAdvice, "huge pages", std::string("switched off: ") + kCost,
            "echo madvise | sudo tee /sys/kernel/mm/transparent_hugepage/enabled"};
  return {Grade::kGood, "huge pages", "this kernel has none to give", ""};
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
