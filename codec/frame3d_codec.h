// SPDX-License-Identifier: Apache-2.0
// One time-stamped, versioned frame of 3D video as bytes (codec/FORMAT.md). The same bytes travel over DDS
// and WebSocket and lie in recordings.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <span>

#include "base/frame3d.h"
#include "base/pattern.h"
#include "base/result.h"
#include "base/rig.h"
#include "base/stream.h"
#include "codec/video_encoder_kind.h"

namespace relievo {

enum class GeometryCodec : std::uint8_t { kDracoMesh = 1, kGrid = 2, kDracoGrid = 3 };
enum class TextureCodec : std::uint8_t { kNone = 0, kJpeg = 1, kWebp = 2, kPng = 3, kH264 = 4 };

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
  int texture_quality = 80;  // 1..100: about the error of a JPEG of that quality
  VideoEncoderKind texture_encoder = VideoEncoderKind::kAuto;  // of H.264
  bool quality = true;  // sigma and interpolation of each vertex, where the surface has them
  int step_bits = 4;    // 0..8; grids: columns are whole steps of 2^-step_bits pixels
  // Grids: estimates from this frame and those before go instead of what was measured (GridEstimator).
  bool estimate = false;
  // Grids: how far off a column may be, 0.006 to 8 pixels; chooses the step. 0: step_bits does.
  float bound_px = 0;
  int slice_lines = 270;  // 8..16384; grid: lines that are coded together, and lost together
  // Of a surface on the grid of stripes and lines every second line goes alone (codec/reduce.h).
  bool halve_lines = false;
  int key_interval = 1;  // 1..1000; grid and H.264: every so many frames decodes alone, those between do not
};

/// What a frame says of itself; read without decoding it.
struct FrameHeader {
  int version = 0;
  bool is_key = false;  // decodes without any frame before it
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

/// Draco alone; see FrameEncoder for grids, and for pictures that build on each other. Fails on a surface
/// outside the limits of the format (the defaults of DecodeLimits; finite numbers; indices within the
/// vertices) or options out of range. An empty surface is a valid frame. Left out are vertices outside
/// `volume`, triangles that use a vertex twice, and vertices of no triangle where there are triangles;
/// texture coordinates are clamped to 0..1. The same frame and options give the same bytes. Any thread.
Result<Bytes> encode_frame(const Frame3D& frame, const EncodeOptions& options);

/// Checks the whole layout (sizes, version, no trailing bytes), not the payloads. Any input.
Result<FrameHeader> read_frame_header(std::span<const std::uint8_t> bytes);

/// Whether the frame says that it can be decoded without any frame before it. Looks at its first bytes alone;
/// false for what is no frame of a known version. Any input.
bool is_key_frame(std::span<const std::uint8_t> bytes);

/// The encoder of one stream: knows its calibration, its last key frame and its last texture. One thread but
/// where said.
class FrameEncoder {
 public:
  FrameEncoder(const Rig& rig, const Pattern& pattern, int line_stride = 1);
  FrameEncoder(FrameEncoder&&) noexcept;
  FrameEncoder& operator=(FrameEncoder&&) noexcept;
  ~FrameEncoder();

  /// Surfaces from now on have every so many of the rig's detection lines, and count those (codec/reduce.h).
  /// Where it changes the next frame is a key frame.
  void set_line_stride(int stride);

  /// As encode_frame(). A surface that does not lie on the grid of stripes and lines (the dense option's,
  /// say) is sent as a Draco mesh, whatever the options say. From the first one with second places on
  /// (GridPoint::line) all grids have room for them; that frame is a key frame. `geometry_done`, where given,
  /// is called between the surface and the texture: for who measures what each takes.
  Result<Bytes> encode(const Frame3D& frame, const EncodeOptions& options,
                       const std::function<void()>& geometry_done = {});

  /// What a log should say, once, of the frames encoded so far: that another encoder than the one asked for
  /// makes the textures from now on, and why. Else empty.
  std::string take_notice();

  /// The next frame will be a key frame. Any thread.
  void request_key_frame();

 private:
  struct State;
  std::unique_ptr<State> state_;
};

/// The decoder of one stream: keeps its last key frame, its last texture and what its calibration costs to
/// work out. One thread.
class FrameDecoder {
 public:
  FrameDecoder();
  FrameDecoder(FrameDecoder&&) noexcept;
  FrameDecoder& operator=(FrameDecoder&&) noexcept;
  ~FrameDecoder();

  /// Any input: hostile bytes give an error, never a crash, a hang or an allocation beyond the limits. Vertex
  /// order is the codec's; `grid` is empty for Draco meshes.
  Result<Frame3D> decode(std::span<const std::uint8_t> bytes, const DecodeLimits& limits = {});

  /// The same into the memory of a frame that nobody needs any more. Where it fails, `out` holds nothing of
  /// meaning.
  Status decode(std::span<const std::uint8_t> bytes, Frame3D& out, const DecodeLimits& limits = {});

  /// Takes in a frame that others may build on and nobody needs to see. Does nothing for one that none builds
  /// on.
  Status remember(std::span<const std::uint8_t> bytes, const DecodeLimits& limits = {});

  /// False for a frame that builds on one which was not decoded here, or which is no frame at all.
  bool can_decode(std::span<const std::uint8_t> bytes) const;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

/// A key frame by itself. Slower than a FrameDecoder where the calibration has lens distortion. Any thread,
/// any input.
Result<Frame3D> decode_frame(std::span<const std::uint8_t> bytes, const DecodeLimits& limits = {});

}  // namespace relievo
