// SPDX-License-Identifier: Apache-2.0
#include "base/log.h"

#include <atomic>
#include <cstdio>
#include <string>

#include "base/log_format.h"
#include "base/time.h"

namespace relievo {
namespace {

std::atomic<LogLevel> g_level{LogLevel::kInfo};
std::atomic<LogFormat> g_format{LogFormat::kText};

std::string name_of(LogLevel level) {
  switch (level) {
    case LogLevel::kError:
      return "error";
    case LogLevel::kWarning:
      return "warning";
    case LogLevel::kInfo:
      return "info";
    case LogLevel::kDebug:
      return "debug";
  }
  return "unknown";
}

std::string precise_utc_text(std::int64_t now_ns) {
  char millis[8];
  std::snprintf(millis, sizeof millis, ".%03dZ",
                static_cast<int>(now_ns % kNanosecondsPerSecond / 1'000'000));
  return utc_text(now_ns, "%Y-%m-%dT%H:%M:%S") + millis;
}

std::string quoted(std::string_view text) {
  std::string out = "\"";
  for (const char c : text) {
    if (static_cast<unsigned char>(c) < 0x20) {
      char code[8];
      std::snprintf(code, sizeof code, "\\u%04x", static_cast<unsigned>(c));
      out += code;
      continue;
    }
    if (c == '"' || c == '\\') out += '\\';
    out += c;
  }
  return out + '"';
}

}  // namespace

void set_log_level(LogLevel level) {
  g_level = level;
}
LogLevel log_level() {
  return g_level;
}

void set_log_format(LogFormat format) {
  g_format = format;
}
LogFormat log_format() {
  return g_format;
}

std::string log_line(LogFormat format, LogLevel level, std::string_view message, std::int64_t now_ns) {
  if (format == LogFormat::kText)
    return (level == LogLevel::kInfo ? std::string() : name_of(level) + ": ") + std::string(message);
  return "{\"time\":\"" + precise_utc_text(now_ns) + "\",\"level\":\"" + name_of(level) +
         "\",\"message\":" + quoted(message) + "}";
}

void log(LogLevel level, std::string_view message) {
  if (level > g_level) return;
  const std::string line = log_line(g_format, level, message, utc_now_ns()) + '\n';
  std::fwrite(line.data(), 1, line.size(), stderr);  // one call, so that lines of threads do not mix
}

}  // namespace relievo
