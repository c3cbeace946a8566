// SPDX-License-Identifier: Apache-2.0
#include "codec/draco_stream.h"

#include <draco/compression/config/compression_shared.h>

#include <algorithm>
#include <limits>
#include <string>
#include <string_view>

#include "codec/byte_io.h"

namespace relievo {
namespace {

std::uint32_t read_varint(ByteReader& reader) {
  std::uint64_t value = 0;
  for (int shift = 0; shift < 35; shift += 7) {
    const auto byte = reader.read<std::uint8_t>();
    value |= static_cast<std::uint64_t>(byte & 0x7f) << shift;
    if ((byte & 0x80) == 0) break;
  }
  return value <= std::numeric_limits<std::uint32_t>::max() ? static_cast<std::uint32_t>(value)
                                                            : std::numeric_limits<std::uint32_t>::max();
}

}  // namespace

Result<DracoCounts> allowed_draco_counts(std::span<const std::uint8_t> bytes) {
  ByteReader reader(bytes);
  const auto magic = reader.take(5);
  const auto major = reader.read<std::uint8_t>();
  const auto minor = reader.read<std::uint8_t>();
  const auto type = reader.read<std::uint8_t>();
  const auto method = reader.read<std::uint8_t>();
  const auto flags = reader.read<std::uint16_t>();
  if (!reader.ok() || !std::ranges::equal(magic, std::string_view("DRACO")))
    return Error{"geometry is not a Draco stream"};
  const bool is_mesh = type == draco::TRIANGULAR_MESH && method == draco::MESH_EDGEBREAKER_ENCODING &&
                       major == 2 && minor == 2;
  const bool is_cloud = type == draco::POINT_CLOUD && method == draco::POINT_CLOUD_SEQUENTIAL_ENCODING &&
                        major == 2 && minor == 3;
  if ((!is_mesh && !is_cloud) || flags != 0)
    return Error{"geometry is a Draco stream of a kind that the format does not allow (type " +
                 std::to_string(type) + ", method " + std::to_string(method) + ", version " +
                 std::to_string(major) + "." + std::to_string(minor) + ")"};
  DracoCounts counts;
  if (is_cloud) {
    counts.vertices = reader.read<std::uint32_t>();
  } else {
    const auto traversal = reader.read<std::uint8_t>();
    counts.vertices = read_varint(reader);
    counts.triangles = read_varint(reader);
    const auto more_connectivities = reader.read<std::uint8_t>();
    if (traversal == draco::MESH_EDGEBREAKER_PREDICTIVE_ENCODING || more_connectivities != 0)
      return Error{"geometry is a Draco mesh of a kind that the format does not allow"};
  }
  if (!reader.ok()) return Error{"geometry is cut short"};
  return counts;
}

}  // namespace relievo
