// SPDX-License-Identifier: Apache-2.0
#include "codec/frame3d_codec.h"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "codec/draco_mesh.h"
#include "codec/frame_layout.h"
#include "codec/grid_coder.h"
#include "codec/grid_points.h"
#include "codec/jpeg_texture.h"
#include "codec/surface_check.h"
#include "codec/vertex_quality.h"

namespace relievo {
namespace {

constexpr DecodeLimits kFormatLimits{};

Status check(const char* name, int value, int low, int high) {
  if (value >= low && value <= high) return {};
  return Error{std::string(name) + " is " + std::to_string(value) + ", allowed are " + std::to_string(low) +
               " to " + std::to_string(high)};
}

Status check_options(const EncodeOptions& options) {
  if (options.geometry != GeometryCodec::kDracoMesh && options.geometry != GeometryCodec::kGrid)
    return Error{"unknown geometry codec"};
  if (options.texture != TextureCodec::kNone && options.texture != TextureCodec::kJpeg)
    return Error{"unknown texture codec"};
  for (const Status& status :
       {check("position_bits", options.position_bits, 8, 20),
        check("texture_coordinate_bits", options.texture_coordinate_bits, 8, 16),
        options.normal_bits == 0 ? Status() : check("normal_bits", options.normal_bits, 4, 16),
        check("draco_speed", options.draco_speed, 0, 9), check("jpeg_quality", options.jpeg_quality, 1, 100),
        check("step_bits", options.step_bits, 0, 8), check("slice_lines", options.slice_lines, 8, 16384),
        check("key_interval", options.key_interval, 1, 1000)})
    if (!status) return status;
  const Volume& volume = options.volume;
  const bool finite =
      std::isfinite(volume.min[0]) && std::isfinite(volume.min[1]) && std::isfinite(volume.min[2]);
  if (!finite || !std::isfinite(volume.size_m) || volume.size_m < 0)
    return Error{"volume is not finite or its size is negative"};
  return {};
}

Status check_frame(const Frame3D& frame, const EncodeOptions& options) {
  if (auto status = check_options(options); !status) return status;
  const bool has_texture = options.texture != TextureCodec::kNone && !frame.texture.empty();
  const std::uint64_t pixels = has_texture ? static_cast<std::uint64_t>(frame.texture.width()) *
                                                 static_cast<std::uint64_t>(frame.texture.height())
                                           : 0;
  return check_limits(kFormatLimits, frame.surface.positions.size(), frame.surface.triangles.size(), pixels);
}

/// Completes a frame whose header says all of its geometry.
Result<Bytes> with_texture(const Frame3D& frame, const EncodeOptions& options, FrameHeader header,
                           std::span<const std::uint8_t> geometry, std::span<const std::uint8_t> quality) {
  header.number = frame.number;
  header.time_ns = frame.time_ns;
  header.texture = options.texture;
  Bytes texture;
  if (options.texture != TextureCodec::kNone && !frame.texture.empty()) {
    header.texture_width = static_cast<std::uint32_t>(frame.texture.width());
    header.texture_height = static_cast<std::uint32_t>(frame.texture.height());
    if (auto status = append_jpeg(frame.texture.view(), options.jpeg_quality, texture); !status)
      return status.error();
  }
  return write_frame(header, {geometry, texture, quality});
}

/// What a step of the column is in depth, millimetres, at the middle one of some vertices.
float step_mm(const Surface& surface, const GridCalibration& calibration, int step_bits) {
  std::vector<float> depths;
  for (std::size_t i = 0; i < surface.positions.size(); i += 64) depths.push_back(surface.positions[i][2]);
  if (depths.empty()) return 0;
  const auto middle = depths.begin() + static_cast<std::ptrdiff_t>(depths.size() / 2);
  std::nth_element(depths.begin(), middle, depths.end());
  const auto& t = calibration.projector_from_camera_translation;
  const double baseline = std::hypot(t[0], t[1], t[2]);
  const double z = static_cast<double>(*middle);
  return static_cast<float>(1000 * z * z / (calibration.camera.fx() * baseline) / (1 << step_bits));
}

}  // namespace

Result<Bytes> encode_frame(const Frame3D& frame, const EncodeOptions& options) {
  if (auto status = check_frame(frame, options); !status) return status.error();
  if (options.geometry != GeometryCodec::kDracoMesh)
    return Error{"a grid needs its calibration: encode it with a FrameEncoder"};
  const auto geometry = encode_draco(frame.surface, options);
  if (!geometry) return geometry.error();
  Bytes quality;
  if (options.quality && !frame.surface.texture_coordinates.empty() &&
      geometry->vertices >= geometry->sent.size())
    quality = encode_vertex_quality(frame.surface, geometry->sent, options.texture_coordinate_bits);
  FrameHeader header;
  header.is_key = true;
  header.geometry = GeometryCodec::kDracoMesh;
  header.volume = geometry->volume;
  header.vertices = geometry->vertices;
  header.triangles = geometry->triangles;
  return with_texture(frame, options, header, geometry->bytes, quality);
}

struct FrameEncoder::State {
  GridCalibration calibration;
  GridEncoder encoder;
  StripeGrid grid;
  GridKey key;
  int since_key = -1;  // frames; -1: there is none to build on
  std::atomic<bool> key_asked{false};
};

FrameEncoder::FrameEncoder(const Rig& rig, const Pattern& pattern) : state_(std::make_unique<State>()) {
  state_->calibration = grid_calibration(rig, pattern);
}
FrameEncoder::FrameEncoder(FrameEncoder&&) noexcept = default;
FrameEncoder& FrameEncoder::operator=(FrameEncoder&&) noexcept = default;
FrameEncoder::~FrameEncoder() = default;

void FrameEncoder::request_key_frame() {
  state_->key_asked = true;
}

Result<Bytes> FrameEncoder::encode(const Frame3D& frame, const EncodeOptions& options) {
  State& s = *state_;
  EncodeOptions mesh = options;
  mesh.geometry = GeometryCodec::kDracoMesh;
  if (options.geometry == GeometryCodec::kDracoMesh) return encode_frame(frame, mesh);
  if (auto status = check_frame(frame, options); !status) return status.error();
  if (auto status = check_surface(frame.surface); !status) return status.error();
  if (frame.surface.positions.empty() ||
      !to_grid(frame.surface, s.calibration, options.step_bits, options.quality, s.grid)) {
    s.since_key = -1;
    return encode_frame(frame, mesh);
  }
  const bool asked = s.key_asked.exchange(false);
  const bool is_key = asked || s.since_key < 0 || s.since_key + 1 >= options.key_interval ||
                      s.key.grid.step_bits != options.step_bits;
  Bytes geometry = s.encoder.encode(s.grid, s.calibration, is_key ? nullptr : &s.key, {},
                                    step_mm(frame.surface, s.calibration, options.step_bits),
                                    {.slice_lines = options.slice_lines});
  // Nothing may be smaller than FORMAT.md allows.
  const std::uint64_t places =
      static_cast<std::uint64_t>(s.grid.boundaries) * static_cast<std::uint64_t>(s.grid.lines);
  geometry.resize(std::max<std::size_t>(
      {geometry.size(), s.grid.vertices / kMostGridVerticesPerByte + 1, places / kMostPlacesPerByte + 1}));
  FrameHeader header;
  header.is_key = is_key;
  header.geometry = GeometryCodec::kGrid;
  header.vertices = s.grid.vertices;
  header.triangles = s.grid.triangles;
  s.since_key = is_key ? 0 : s.since_key + 1;
  if (is_key && options.key_interval > 1) {
    s.key.id = grid_id(geometry);
    std::swap(s.key.grid, s.grid);
  } else if (is_key) {
    s.since_key = -1;
  }
  if (header.vertices == 0) {  // all too far away: there is nothing to build on either
    geometry.clear();
    s.since_key = -1;
  }
  return with_texture(frame, options, header, geometry, {});
}

Result<FrameHeader> read_frame_header(std::span<const std::uint8_t> bytes) {
  const auto layout = read_frame_layout(bytes);
  if (!layout) return layout.error();
  return layout->header;
}

struct FrameDecoder::State {
  GridDecoder decoder;
  StripeGrid grid;  // of the last delta frame
  GridKey key;
  bool has_key = false;
  std::optional<GridPoints> points;

  /// The grid it decodes to, of which the key is kept.
  Result<const StripeGrid*> decode_grid(std::span<const std::uint8_t> coded, const FrameHeader& header) {
    const auto head = read_grid_head(coded);
    if (!head) return head.error();
    if (head->is_key != header.is_key)
      return Error{"frame and grid do not agree whether this is a key frame"};
    if (head->is_key) has_key = false;
    StripeGrid& to = head->is_key ? key.grid : grid;
    const auto done = decoder.decode(coded, header.vertices, header.triangles, has_key ? &key : nullptr, to);
    if (!done) return done.error();
    if (head->is_key) {
      key.id = grid_id(coded);
      has_key = true;
      if (!points || points->calibration() != head->calibration) points.emplace(head->calibration);
    }
    return &to;
  }
};

FrameDecoder::FrameDecoder() : state_(std::make_unique<State>()) {}
FrameDecoder::FrameDecoder(FrameDecoder&&) noexcept = default;
FrameDecoder& FrameDecoder::operator=(FrameDecoder&&) noexcept = default;
FrameDecoder::~FrameDecoder() = default;

bool FrameDecoder::can_decode(std::span<const std::uint8_t> bytes) const {
  if (is_key_frame(bytes)) return true;
  const auto layout = read_frame_layout(bytes);
  if (!layout || !state_->has_key) return false;
  const auto head = read_grid_head(layout->sections.geometry);
  return head && head->key == state_->key.id;
}

Status FrameDecoder::remember(std::span<const std::uint8_t> bytes, const DecodeLimits& limits) {
  const auto layout = read_frame_layout(bytes);
  if (!layout) return layout.error();
  const FrameHeader& header = layout->header;
  if (!header.is_key || header.geometry != GeometryCodec::kGrid || header.vertices == 0) return {};
  if (auto status = check_limits(limits, header.vertices, header.triangles, 0); !status) return status;
  const auto grid = state_->decode_grid(layout->sections.geometry, header);
  return grid ? Status() : Status(grid.error());
}

Result<Frame3D> FrameDecoder::decode(std::span<const std::uint8_t> bytes, const DecodeLimits& limits) {
  Frame3D frame;
  if (auto status = decode(bytes, frame, limits); !status) return status.error();
  return frame;
}

Status FrameDecoder::decode(std::span<const std::uint8_t> bytes, Frame3D& frame, const DecodeLimits& limits) {
  const auto layout = read_frame_layout(bytes);
  if (!layout) return layout.error();
  const FrameHeader& header = layout->header;
  const FrameSections& sections = layout->sections;
  if (header.geometry != GeometryCodec::kDracoMesh && header.geometry != GeometryCodec::kGrid)
    return Error{"frame has geometry of codec " + std::to_string(static_cast<int>(header.geometry)) +
                 " that this version does not know: update relievo"};
  if (header.texture != TextureCodec::kNone && header.texture != TextureCodec::kJpeg)
    return Error{"frame has a texture of codec " + std::to_string(static_cast<int>(header.texture)) +
                 " that this version does not know: update relievo"};
  if (auto status = check_limits(limits, header.vertices, header.triangles, texture_pixels(header)); !status)
    return status;
  frame.number = header.number;
  frame.time_ns = header.time_ns;
  if (header.vertices == 0) {
    frame.surface = {};
  } else if (header.geometry == GeometryCodec::kGrid) {
    const auto grid = state_->decode_grid(sections.geometry, header);
    if (!grid) return grid.error();
    if (auto status = state_->points->to_surface(**grid, frame.surface); !status) return status;
  } else {
    auto surface = decode_draco(sections.geometry, header.vertices, header.triangles);
    if (!surface) return surface.error();
    frame.surface = std::move(*surface);
    if (!sections.quality.empty())
      if (auto status = decode_vertex_quality(sections.quality, frame.surface); !status) return status;
  }
  if (header.texture == TextureCodec::kNone) {
    frame.texture = {};
  } else {
    auto texture = decode_jpeg(sections.texture, header.texture_width, header.texture_height);
    if (!texture) return texture.error();
    frame.texture = std::move(*texture);
  }
  return {};
}

Result<Frame3D> decode_frame(std::span<const std::uint8_t> bytes, const DecodeLimits& limits) {
  return FrameDecoder().decode(bytes, limits);
}

}  // namespace relievo
