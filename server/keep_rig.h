// SPDX-License-Identifier: Apache-2.0
// A stream's rig.yaml, written anew by a calibration.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <string_view>

#include "base/pattern.h"
#include "base/result.h"

namespace relievo {

/// Whether keep_rig() could write this file, as far as that can be said before; if not, how to mend it.
Status can_keep_rig(const std::filesystem::path& file);

/// Writes `text` to `file`, whole or not at all; what was there stays beside it under a name with the time,
/// which is returned (empty: there was nothing). `pattern`, which its stripes are of, is written beside it
/// where none is. On failure the old file is as it was.
Result<std::string> keep_rig(const std::filesystem::path& file, std::string_view text, const Pattern& pattern,
                             std::int64_t utc_ns);

}  // namespace relievo
