// SPDX-License-Identifier: Apache-2.0
// A server from start to stop: gateway, streams, and what a new configuration changes.
#pragma once

#include <functional>

#include "base/result.h"
#include "cli/stop_signal.h"
#include "server/config.h"

namespace relievo {

/// The configuration as it is to be now; fails where something in it is wrong.
using ReadAgain = std::function<Result<ServeConfig>()>;

/// Until all streams have ended, or stopped. `again`, where there is one, is called at SIGHUP: streams whose
/// configuration did not change go on untouched.
Status serve(const ServeConfig& config, const ReadAgain& again, StopSignal& stop);

}  // namespace relievo
