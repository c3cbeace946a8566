// SPDX-License-Identifier: Apache-2.0
// Log lines on stderr: for mains, pipelines and network threads. Stages and codecs return errors instead.
#pragma once

#include <string_view>

namespace relievo {

/// error: something asked for did not happen. warning: it happened, but not as wanted. info: milestones of a
/// run. debug: what a developer needs.
enum class LogLevel { kError, kWarning, kInfo, kDebug };

/// Lines above this level are not written. Default kInfo. Any thread.
void set_log_level(LogLevel level);
LogLevel log_level();

/// One line, written whole. Any thread.
void log(LogLevel level, std::string_view message);

inline void log_error(std::string_view message) {
  log(LogLevel::kError, message);
}
inline void log_warning(std::string_view message) {
  log(LogLevel::kWarning, message);
}
inline void log_info(std::string_view message) {
  log(LogLevel::kInfo, message);
}
inline void log_debug(std::string_view message) {
  log(LogLevel::kDebug, message);
}

}  // namespace relievo
