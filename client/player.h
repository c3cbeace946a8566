// SPDX-License-Identifier: Apache-2.0
// Plays a recorded stream at its original pace.
#pragma once

#include <cstdint>
#include <functional>
#include <limits>
#include <optional>

#include "base/result.h"
#include "cli/stop_signal.h"
#include "client/recorded_stream.h"
#include "client/time_range.h"

namespace relievo {

struct PlayOptions {
  double speed = 1;   // 2: twice as fast
  bool loop = false;  // from the start again at the end, until stopped
  // At the end, goes on with what is written meanwhile, until the file is finished; with `loop` until nothing
  // has come for some seconds, since it may have been left unfinished.
  bool follow = false;
  // Frames are said to be captured now: in the recorded order, their times apart as recorded, at that speed.
  bool restamp = false;
  double longest_pause_s =
      std::numeric_limits<double>::infinity();  // of the recording's; longer ones become this
  // Asked before each sample, and while there is none: true ends it as at the end.
  std::function<bool()> ended = {};
  std::optional<TimeRange> range = {};  // of the samples' times; all of them where there is none
};

/// Calls `publish` with each sample when it is due, by the times they were recorded at, until the end or
/// until stopped. An error of `publish` ends it. Where the range starts between key frames, what it
/// builds on comes first, at once. Before a frame comes the stream's description that holds for it
/// (info_of()), where that is not the one that was published last. One thread.
Status play(RecordedStream& recorded, const PlayOptions& options, StopSignal& stop,
            const std::function<Status(const RawSample&)>& publish);

}  // namespace relievo
