// SPDX-License-Identifier: Apache-2.0
// Frames as DDS samples. Internal to idl/.
#pragma once

#include <cstdint>
#include <string>

#include "base/result.h"
#include "base/stream.h"

namespace relievo {

/// Serialises and sends on the caller's thread; keeps nothing of the arguments.
Status write_frame(std::int32_t writer, const std::string& stream, const FrameMessage& frame);

/// Readers that a writer is matched with, in all processes.
int matched_readers_of(std::int32_t writer);

}  // namespace relievo
