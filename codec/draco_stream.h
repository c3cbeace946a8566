// SPDX-License-Identifier: Apache-2.0
// What a Draco stream says of itself, read before Draco's own decoder sees it.
#pragma once

#include <cstdint>
#include <span>

#include "base/result.h"

namespace relievo {

struct DracoCounts {
  std::uint32_t vertices = 0;
  std::uint32_t triangles = 0;  // 0: a point cloud
};

/// What a stream says of its size (Draco bitstream 2.2 for meshes, 2.3 for point clouds). Fails on whatever
/// codec/FORMAT.md does not allow, so that Draco's code for older and other streams is out of reach. Any
/// bytes.
Result<DracoCounts> allowed_draco_counts(std::span<const std::uint8_t> bytes);

}  // namespace relievo
