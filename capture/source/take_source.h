// SPDX-License-Identifier: Apache-2.0
// A take folder as a source (docs/TAKES.md).
#pragma once

#include <memory>
#include <string>

#include "base/result.h"
#include "capture/source/field_source.h"

namespace relievo {

/// Opens the folder `take`. Frames carry the numbers and times of timestamps.csv; looped, numbers go on by
/// the last one + 1 and times by the last one + one frame period, and pictures stay in memory up to 1 GiB. A
/// picture that is missing, torn or of another size is an error for that frame alone; a folder that went
/// away is one error, then the end.
Result<std::unique_ptr<FieldSource>> open_take(const std::string& take, const SourceOptions& options);

}  // namespace relievo
