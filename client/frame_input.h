// SPDX-License-Identifier: Apache-2.0
// The frames of FILE|STREAM one after the other, for verbs that look at each: those of a part of a recording,
// or what comes of a live stream.
#pragma once

#include <cstdint>
#include <functional>
#include <limits>
#include <memory>
#include <string>

#include "base/frame3d.h"
#include "base/result.h"
#include "base/rig.h"
#include "cli/program.h"
#include "client/range_frames.h"
#include "idl/transport.h"

namespace CLI {
class App;
}

namespace relievo {

struct FrameInput {
  std::shared_ptr<DomainOptions> domain;
  std::shared_ptr<RangeOptions> range;
  std::string input, stream;
  double seconds = 0;  // of a live stream
  double wait_s = 10;  // for one
};

/// The input itself, --stream, --from, --to and --frames of files, --wait of streams: checked and filled
/// while parsing. --seconds is the verb's own option.
std::shared_ptr<FrameInput> add_frame_input(CLI::App& app);

struct FrameVisit {
  std::string verb;  // for the progress bar
  std::string out;   // that is written: not the recording itself
  std::uint64_t most = std::numeric_limits<std::uint64_t>::max();  // frames that are wanted
  // `camera`: the rig's; null where the recording says nothing of it.
  std::function<Status(const Frame3D& frame, const PinholeModel* camera)> frame;
};

/// Until the frames end, one fails or `stop` stops. A live stream's frames are left out where looking at them
/// takes longer than they come. Returns those that could not be decoded. Fails where there are no others.
Result<LeftOut> visit_frames(const FrameInput& input, const FrameVisit& visit, StopSignal& stop);

}  // namespace relievo
