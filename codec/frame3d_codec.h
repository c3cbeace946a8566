// SPDX-License-Identifier: Apache-2.0
// One time-stamped, versioned frame of 3D video as bytes (codec/FORMAT.md). The same bytes travel over DDS
// and WebSocket and lie in recordings.
#pragma once

#include <cstdint>
#include <span>

#include "base/frame3d.h"
#include "base/result.h"
#include "base/stream.h"

namespace relievo {

enum class GeometryCodec : std::uint8_t { kDracoMesh = 1 };
enum class TextureCodec : std::uint8_t { kNone = 0, kJpeg = 1 };

/// Metres, camera frame: the box in which positions are quantised. Fixed for a stream, so that a surface does
/// not shimmer with its own bounding box.
struct Volume {
  Vec3f min{};
  float size_m = 0;  // edge of the cube
};

struct EncodeOptions {
  GeometryCodec geometry = GeometryCodec::kDracoMesh;
  int position_bits = 12;            // 8..20
  int texture_coordinate_bits = 12;  // 8..16
  int normal_bits = 0;               // 4..16; 0: not sent, receivers derive them from the triangles
  int draco_speed = 5;               // 0 smallest .. 9 fastest
  Volume volume;                     // size 0: each frame's own bounding box
  TextureCodec texture = TextureCodec::kJpeg;
  int jpeg_quality = 80;  // 1..100
  bool quality = true;    // sigma and interpolation of each vertex, where the surface has them
};

/// What a frame says of itself; read without decoding it.
struct FrameHeader {
  int version = 0;
  std::uint64_t number = 0;
  std::int64_t time_ns = 0;
  Volume volume;  // positions were quantised in it; size 0 where there are none
  GeometryCodec geometry{};
  TextureCodec texture{};
  std::uint32_t vertices = 0;
  std::uint32_t triangles = 0;
  std::uint32_t texture_width = 0;
  std::uint32_t texture_height = 0;
  std::uint32_t geometry_bytes = 0;
  std::uint32_t texture_bytes = 0;
  std::uint32_t quality_bytes = 0;  // 0: nothing is said of each vertex's sigma
};

/// What a decoder accepts; a frame that declares more is refused before anything is allocated.
struct DecodeLimits {
  std::uint32_t vertices = 4'000'000;
  std::uint32_t triangles = 8'000'000;
  std::uint32_t texture_pixels = 64'000'000;
};

/// Fails on a surface outside the limits of the format (the defaults of DecodeLimits; finite numbers; indices
/// within the vertices) or options out of range. An empty surface is a valid frame. Left out are vertices
/// outside `volume`, triangles that use a vertex twice, and vertices of no triangle where there are
/// triangles; texture coordinates are clamped to 0..1. The same frame and options give the same bytes. Any
/// thread.
Result<Bytes> encode_frame(const Frame3D& frame, const EncodeOptions& options);

/// Checks the whole layout (sizes, version, no trailing bytes), not the payloads. Any input.
Result<FrameHeader> read_frame_header(std::span<const std::uint8_t> bytes);

/// Whether the frame says that it can be decoded without any frame before it. Looks at its first bytes alone;
/// false for what is no frame of a known version. Any input.
bool is_key_frame(std::span<const std::uint8_t> bytes);

/// Any thread. Any input: hostile bytes give an error, never a crash, a hang or an allocation beyond the
/// limits. Vertex order is the codec's; `grid` is empty for Draco.
Result<Frame3D> decode_frame(std::span<const std::uint8_t> bytes, const DecodeLimits& limits = {});

}  // namespace relievo
