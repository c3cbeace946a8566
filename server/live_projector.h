// SPDX-License-Identifier: Apache-2.0
// The projector of a live calibration: shows pictures in turn while a camera is watched.
#pragma once

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "base/image.h"
#include "base/result.h"
#include "cli/size_option.h"
#include "cli/stop_signal.h"

namespace CLI {
class App;
class Option;
}  // namespace CLI

namespace relievo {

struct LiveProjector {
  std::string output;  // empty: as `relievo-server project` chooses
  int refreshes = 1;   // that each picture stays
};

/// --project, --projector-output and --refreshes.
struct ProjectorFlags {
  bool project = false;
  LiveProjector projector;

  std::optional<LiveProjector> choice() const { return project ? std::optional(projector) : std::nullopt; }
};
/// Each needs `source`. `flags` must outlive the parsing.
void add_live_projector_options(CLI::App& app, CLI::Option& source, ProjectorFlags& flags);

/// Runs `watch` to its end on a thread of its own and shows what `draw` makes for the output's mode (`size`,
/// where that is not 0) in turn meanwhile; a person who closes the window stops everything. Without a
/// projector, just runs `watch`. Main thread. Fails where the output cannot be opened, before `watch` began,
/// and where either does.
Status project_while(const std::optional<LiveProjector>& projector, Size size,
                     const std::function<Result<std::vector<Image8>>(Size)>& draw,
                     const std::function<Status()>& watch, StopSignal& stop);

}  // namespace relievo
