// SPDX-License-Identifier: Apache-2.0
// An index of a recording that was cut short, so that it can be read as if it were whole. The file stays as
// it is.
#pragma once

#include <atomic>
#include <filesystem>
#include <memory>

#include "base/growing_recording.h"
#include "base/result.h"

namespace relievo {

/// Of a file without an index of its own, by the heads of its records: of several GB some seconds. Null where
/// such an index would leave out what is in the file: one that was joined of several, or damaged in its
/// middle. Fails where it is no recording, or cannot be read; soon after `stop` is set, where there is one.
Result<std::shared_ptr<const GrowingRecording>> index_cut_recording(const std::filesystem::path& file,
                                                                    const std::atomic<bool>* stop = nullptr);

/// Whether there is anything to read in a file without an end, by the heads of its records up to the first
/// chunk. True where it is no recording or damaged before that: what there is then takes more to find out.
bool may_hold_chunk(const std::filesystem::path& file);

}  // namespace relievo
