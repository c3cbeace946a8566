// SPDX-License-Identifier: Apache-2.0
// Writes a take folder (docs/TAKES.md).
#pragma once

#include <atomic>
#include <cstdint>
#include <filesystem>
#include <functional>

#include "base/image.h"
#include "base/result.h"
#include "capture/source/field_source.h"
#include "capture/source/sim/sim_source.h"

namespace relievo {

struct TakeOptions {
  std::uint64_t frames = 0;                                  // at most; 0: until the source ends
  std::function<void(std::uint64_t written)> progress = {};  // after each frame
  // A frame that cannot be written ends the take, which has those before it; where something is in its place
  // it is NAME-2 and so on. Both are errors that say so.
  bool keep_written = false;
  const std::atomic<bool>* stop = nullptr;  // once true, nothing is left behind and an error returned
};

/// Fails where write_take() would at once: something is there, or no folder can be made there. Leaves
/// nothing.
Status check_take_target(const std::filesystem::path& take);

/// Writes the frames of `source` into the new folder `take`, times from its first frame on. The folder
/// appears when it is complete: until then a sibling ".NAME.partial-PID" holds it, which is removed on every
/// failure but that of keep_written. A folder that is there already and is not empty is refused.
Status write_take(const std::filesystem::path& take, FieldSource& source, const TakeOptions& options);

/// The same, with the truth where the source has any.
Status write_take(const std::filesystem::path& take, SimSource& source, const TakeOptions& options);

}  // namespace relievo
