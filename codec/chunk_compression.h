// SPDX-License-Identifier: Apache-2.0
// The compressions of MCAP's chunks: our own have none, other programs' (and `mcap merge` of ours) often do.
#pragma once

#include <cstdint>
#include <span>
#include <string>

#include "base/result.h"
#include "base/stream.h"

namespace relievo::mcap {

/// A chunk's records, of which it says that they are `size` bytes; `how`: "" for none, "zstd" or "lz4". Takes
/// no more memory than what is there really comes to. Fails where that is another size, or damaged, or `how`
/// is another one.
Result<Bytes> decompress(const std::string& how, std::span<const std::uint8_t> bytes, std::uint64_t size);

}  // namespace relievo::mcap
