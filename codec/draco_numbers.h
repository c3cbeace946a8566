// SPDX-License-Identifier: Apache-2.0
// Lists of whole numbers as a Draco point cloud, sequential and lossless: Draco as nothing but an entropy
// coder, which any of its decoders undoes.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "base/result.h"
#include "base/stream.h"

namespace relievo {

/// Lists of equal length, at least one number each: a generic attribute a list, a point for each number of
/// it. Small numbers of either sign take the fewest bits. Deterministic. Any thread.
Result<Bytes> encode_numbers(std::span<const std::vector<std::int32_t>> lists);

/// Any bytes. Fails unless the stream holds exactly `lists.size()` lists of `count` numbers; that is checked
/// before anything as large is allocated. Any thread.
Status decode_numbers(std::span<const std::uint8_t> bytes, std::uint32_t count,
                      std::span<std::vector<std::int32_t>> lists);

}  // namespace relievo
