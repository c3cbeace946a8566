// SPDX-License-Identifier: Apache-2.0
// Streams to publish in tests: a plausible description and frames whose bytes follow from their number.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>

#include "base/stream.h"

namespace relievo::test {

StreamInfo example_info(const std::string& stream);

/// `size` bytes that differ in every frame.
FrameMessage example_frame(std::uint64_t sequence, std::size_t size);

}  // namespace relievo::test
