// SPDX-License-Identifier: Apache-2.0
#include "cli/progress.h"

#include <sys/ioctl.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <utility>

#include "base/log.h"
#include "base/time.h"

namespace relievo {
namespace {

constexpr std::int64_t kFirstDraw_ns = kNanosecondsPerSecond;
constexpr std::int64_t kDrawEvery_ns = kNanosecondsPerSecond / 10;
constexpr std::uint64_t kBarWidth = 24;

std::string duration_text(double s) {
  char text[32];
  const auto whole = static_cast<long long>(std::llround(std::min(s, 1e9)));
  if (whole < 120) {
    std::snprintf(text, sizeof text, "%lld s", whole);
  } else if (whole < 7200) {
    std::snprintf(text, sizeof text, "%lld min", whole / 60);
  } else {
    std::snprintf(text, sizeof text, "%lld h", whole / 3600);
  }
  return text;
}

std::size_t terminal_width() {
  winsize size{};
  if (ioctl(STDERR_FILENO, TIOCGWINSZ, &size) != 0 || size.ws_col == 0) return 80;
  return size.ws_col;
}

}  // namespace

std::string progress_line(const std::string& label, const std::string& unit, std::uint64_t done,
                          std::uint64_t total, double elapsed_s, const std::string& note) {
  const double rate = elapsed_s > 0 ? static_cast<double>(done) / elapsed_s : 0;
  char number[48];
  std::string line = label + "  ";
  if (total > 0) {
    const auto filled = std::min(kBarWidth, done * kBarWidth / total);
    line += '[' + std::string(filled, '#') + std::string(kBarWidth - filled, ' ') + "] ";
    line += std::to_string(done) + '/' + std::to_string(total) + ' ' + unit;
  } else {
    line += std::to_string(done) + ' ' + unit;
  }
  std::snprintf(number, sizeof number, "  %.1f/s", rate);
  line += number;
  if (total > 0 && rate > 0) {
    line += "  " + duration_text(static_cast<double>(total - std::min(done, total)) / rate) + " left";
  } else {
    line += "  " + duration_text(elapsed_s);
  }
  if (!note.empty()) line += "  " + note;
  return line;
}

Progress::Progress(std::string label, std::string unit, std::uint64_t total)
    : label_(std::move(label)),
      unit_(std::move(unit)),
      total_(total),
      start_ns_(steady_now_ns()),
      enabled_(isatty(STDERR_FILENO) == 1 && log_level() > LogLevel::kError) {}

Progress::~Progress() {
  finish();
}

void Progress::update(std::uint64_t done, const std::string& note) {
  if (!enabled_) return;
  const std::int64_t now = steady_now_ns();
  if (now - start_ns_ < kFirstDraw_ns || now - drawn_ns_ < kDrawEvery_ns) return;
  drawn_ns_ = now;
  std::string line = progress_line(label_, unit_, done, total_, seconds(now - start_ns_), note);
  line.resize(std::min(line.size(), terminal_width() - 1));
  // The cursor stays at the line's start, so that a log line overwrites the bar instead of following it.
  line = "\r\x1b[K" + line + '\r';
  std::fwrite(line.data(), 1, line.size(), stderr);
}

void Progress::finish() {
  if (drawn_ns_ != 0) std::fputs("\r\x1b[K", stderr);
  drawn_ns_ = 0;
  enabled_ = false;
}

}  // namespace relievo
