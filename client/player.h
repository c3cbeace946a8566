// SPDX-License-Identifier: Apache-2.0
// Plays a recorded stream at its original pace.
#pragma once

#include <cstdint>
#include <functional>

#include "base/result.h"
#include "cli/stop_signal.h"
#include "client/recorded_stream.h"

namespace relievo {

struct PlayOptions {
  double speed = 1;   // 2: twice as fast
  bool loop = false;  // from the start again at the end, until stopped
};

/// Calls `publish` with each sample when it is due, by the times they were recorded at, until the end or
/// until stopped. An error of `publish` ends it. One thread.
Status play(RecordedStream& recorded, const PlayOptions& options, StopSignal& stop,
            const std::function<Status(const RawSample&)>& publish);

}  // namespace relievo
