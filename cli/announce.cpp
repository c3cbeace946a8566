// SPDX-License-Identifier: Apache-2.0
#include "cli/announce.h"

#include <cstdio>

#include "base/log_format.h"
#include "base/time.h"

namespace relievo {

void announce(std::string_view line) {
  const std::string whole = log_line(log_format(), LogLevel::kInfo, line, utc_now_ns()) + '\n';
  std::fwrite(whole.data(), 1, whole.size(), stdout);
  std::fflush(stdout);
}

}  // namespace relievo
