// SPDX-License-Identifier: Apache-2.0
// How log lines are written: for people, or for programs that gather them.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>

#include "base/log.h"

namespace relievo {

/// kText: "warning: MESSAGE". kJson:
/// {"time":"2026-01-02T03:04:05.678Z","level":"warning","message":"MESSAGE"}.
enum class LogFormat : std::uint8_t { kText, kJson };

/// Default kText. Any thread.
void set_log_format(LogFormat format);
LogFormat log_format();

/// One line, without its end. `now_ns`: UTC.
std::string log_line(LogFormat format, LogLevel level, std::string_view message, std::int64_t now_ns);

}  // namespace relievo
