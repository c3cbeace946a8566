// SPDX-License-Identifier: Apache-2.0
// What a command that goes on running has to say on stdout.
#pragma once

#include <string_view>

namespace relievo {

/// A line on stdout at once, for whoever waits for it at a pipe. With --log-json it is in the log's form, as
/// info: a service's stdout and stderr are one journal. -q leaves it, which is a result.
void announce(std::string_view line);

}  // namespace relievo
