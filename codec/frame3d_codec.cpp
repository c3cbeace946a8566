// SPDX-License-Identifier: Apache-2.0
#include "codec/frame3d_codec.h"

#include <algorithm>
#include <array>
#include <atomic>
#include <cmath>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "codec/draco_grid.h"
#include "codec/draco_mesh.h"
#include "codec/frame_layout.h"
#include "codec/grid_coder.h"
#include "codec/grid_estimator.h"
#include "codec/grid_points.h"
#include "codec/reduce.h"
#include "codec/surface_check.h"
#include "codec/texture_codec.h"
#include "codec/vertex_quality.h"

namespace relievo {
namespace {

constexpr DecodeLimits kFormatLimits{};
constexpr float kLeastBound_px = 1.5F / 256, kLargestBound_px = 8;

bool is_known(GeometryCodec codec) {
  return codec == GeometryCodec::kDracoMesh || codec == GeometryCodec::kGrid ||
         codec == GeometryCodec::kDracoGrid;
}

Status check(const char* name, int value, int low, int high) {
  if (value >= low && value <= high) return {};
  return Error{std::string(name) + " is " + std::to_string(value) + ", allowed are " + std::to_string(low) +
               " to " + std::to_string(high)};
}

Status check_options(const EncodeOptions& options) {
  if (!is_known(options.geometry)) return Error{"unknown geometry codec"};
  if (options.texture != TextureCodec::kNone && !make_texture_encoder(options.texture))
    return Error{"unknown texture codec"};
  for (const Status& status :
       {check("position_bits", options.position_bits, 8, 20),
        check("texture_coordinate_bits", options.texture_coordinate_bits, 8, 16),
        options.normal_bits == 0 ? Status() : check("normal_bits", options.normal_bits, 4, 16),
        check("draco_speed", options.draco_speed, 0, 9),
        check("texture_quality", options.texture_quality, 1, 100),
        check("step_bits", options.step_bits, 0, 8), check("slice_lines", options.slice_lines, 8, 16384),
        check("key_interval", options.key_interval, 1, 1000)})
    if (!status) return status;
  if (!(options.bound_px == 0 ||
        (options.bound_px >= kLeastBound_px && options.bound_px <= kLargestBound_px)))
    return Error{"bound_px is " + std::to_string(options.bound_px) + ", allowed are 0 and 0.006 to 8"};
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

bool sends_texture(const Frame3D& frame, const EncodeOptions& options) {
  return options.texture != TextureCodec::kNone && !frame.texture.empty();
}

/// A frame's sections, and whether each needs none of a frame before.
struct Coded {
  FrameHeader header;  // what it says of the geometry
  bool geometry_is_key = true;
  Bytes geometry, quality;
};

/// Completes a frame; `texture` is of the codec that the options name, and may be null where none is sent.
Result<Bytes> with_texture(const Frame3D& frame, const EncodeOptions& options, TextureEncoder* texture,
                           bool key, double rate_hz, const Coded& coded) {
  FrameHeader header = coded.header;
  header.number = frame.number;
  header.time_ns = frame.time_ns;
  header.texture = options.texture;
  header.is_key = coded.geometry_is_key;
  Bytes section;
  if (sends_texture(frame, options)) {
    header.texture_width = static_cast<std::uint32_t>(frame.texture.width());
    header.texture_height = static_cast<std::uint32_t>(frame.texture.height());
    const auto alone = texture->encode(frame.texture.view(),
                                       {.quality = options.texture_quality,
                                        .key = key,
                                        .encoder = options.texture_encoder,
                                        .rate_hz = rate_hz},
                                       section);
    if (!alone) return alone.error();
    header.is_key = header.is_key && *alone;
  }
  return write_frame(header, {coded.geometry, section, coded.quality});
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

/// Of the largest steps with which a column is at most `bound_px` off: rounding takes half a step, the
/// encoder another one.
int step_bits_within(float bound_px) {
  int bits = 0;
  while (bits < 8 && 1.5F / static_cast<float>(1 << bits) > bound_px) ++bits;
  return bits;
}

Result<Coded> encode_mesh(const Surface& surface, const EncodeOptions& options) {
  auto geometry = encode_draco(surface, options);
  if (!geometry) return geometry.error();
  Coded coded;
  if (options.quality && !surface.texture_coordinates.empty() && geometry->vertices >= geometry->sent.size())
    coded.quality = encode_vertex_quality(surface, geometry->sent, options.texture_coordinate_bits);
  coded.header.geometry = GeometryCodec::kDracoMesh;
  coded.header.volume = geometry->volume;
  coded.header.vertices = geometry->vertices;
  coded.header.triangles = geometry->triangles;
  coded.geometry = std::move(geometry->bytes);
  return coded;
}

}  // namespace

Result<Bytes> encode_frame(const Frame3D& frame, const EncodeOptions& options) {
  if (auto status = check_frame(frame, options); !status) return status.error();
  if (options.geometry != GeometryCodec::kDracoMesh)
    return Error{"a grid needs its calibration: encode it with a FrameEncoder"};
  const auto coded = encode_mesh(frame.surface, options);
  if (!coded) return coded.error();
  return with_texture(frame, options, make_texture_encoder(options.texture).get(), true, 0, *coded);
}

struct FrameEncoder::State {
  GridCalibration calibration;  // of the lines that go
  int rig_step_px = 1;          // of the rig's lines,
  int line_step_px = 1;         // and of the surfaces'
  double rate_hz = 0;           // of the camera
  Surface halved;               // of a mesh
  GridEncoder encoder;
  StripeGrid grid;
  GridEstimator estimator;
  std::vector<std::uint8_t> tolerance;
  GridKey key;
  bool has_key = false;  // a grid to build on
  bool twice = false;    // grids have room for second places
  std::unique_ptr<TextureEncoder> texture;
  TextureCodec texture_codec = TextureCodec::kNone;
  int step_bits = 4;   // of this frame's grid
  int since_key = -1;  // frames; -1: there was none
  std::atomic<bool> key_asked{false};

  /// The surface as a grid, which `grid` already is.
  Coded encode_grid(const Surface& surface, const EncodeOptions& options, bool want_key) {
    Coded coded;
    coded.geometry_is_key = want_key || !has_key;
    coded.geometry =
        encoder.encode(grid, calibration, coded.geometry_is_key ? nullptr : &key, tolerance,
                       step_mm(surface, calibration, grid.step_bits), {.slice_lines = options.slice_lines});
    coded.geometry.resize(std::max(coded.geometry.size(), least_grid_bytes(grid)));
    coded.header.geometry = GeometryCodec::kGrid;
    coded.header.vertices = grid.vertices;
    coded.header.triangles = grid.triangles;
    if (grid.vertices == 0) {  // all too far away: there is nothing to build on either
      coded.geometry.clear();
      coded.geometry_is_key = true;
      has_key = false;
    } else if (coded.geometry_is_key) {
      has_key = options.key_interval > 1;
      if (has_key) key.id = grid_id(coded.geometry);
      std::swap(key.grid, grid);
    }
    return coded;
  }

  /// The same in Draco's clouds.
  Result<Coded> encode_in_draco(const Surface& surface) {
    Coded coded;
    coded.header.geometry = GeometryCodec::kDracoGrid;
    has_key = false;
    if (grid.vertices == 0) return coded;
    auto bytes =
        encode_draco_grid(grid, calibration, tolerance, step_mm(surface, calibration, grid.step_bits));
    if (!bytes) return bytes.error();
    coded.geometry = *std::move(bytes);
    coded.header.vertices = grid.vertices;
    coded.header.triangles = grid.triangles;
    return coded;
  }

  /// Of the surfaces' own lines.
  GridCalibration whole() const {
    GridCalibration out = calibration;
    out.line_step_px = line_step_px;
    return out;
  }

  /// Which lines go, and in which steps: a grid of others than before cannot build on it.
  void choose(const Surface& surface, const EncodeOptions& options) {
    const int step_px = line_step_px * (options.halve_lines ? 2 : 1);
    if (calibration.line_step_px != step_px) has_key = false;
    calibration.line_step_px = step_px;
    step_bits = options.bound_px > 0 ? step_bits_within(options.bound_px) : options.step_bits;
    if (key.grid.step_bits != step_bits) has_key = false;
    // From the first second places on for good: room for them costs next to nothing, a key grid at each
    // change would not.
    twice = twice ||
            (options.geometry != GeometryCodec::kDracoMesh && has_second_places(surface, whole().lines()));
    if (key.grid.twice != (twice && !options.halve_lines)) has_key = false;
  }

  /// All its lines, as they lie in `grid` then; estimated where that is asked for.
  bool fill_grid(const Surface& surface, const EncodeOptions& options) {
    if (options.geometry == GeometryCodec::kDracoMesh || surface.positions.empty() ||
        !to_grid(surface, whole(), {.step_bits = step_bits, .with_quality = options.quality, .twice = twice},
                 grid))
      return false;
    std::vector<std::size_t> copies = copies_of(grid);
    tolerance.clear();
    if (options.estimate) estimator.estimate(surface, grid, tolerance);
    if (options.halve_lines) {
      halve_lines(grid, std::array{&tolerance});
      copies.clear();
    }
    if (options.bound_px > 0) tolerance.assign(grid.columns.size(), 1);
    keep_copies(copies, grid, tolerance);
    return true;
  }

  Result<Coded> encode_geometry(const Surface& surface, const EncodeOptions& options, bool want_key) {
    if (fill_grid(surface, options))
      return options.geometry == GeometryCodec::kDracoGrid ? encode_in_draco(surface)
                                                           : encode_grid(surface, options, want_key);
    has_key = false;
    estimator.forget();
    EncodeOptions mesh = options;
    mesh.geometry = GeometryCodec::kDracoMesh;
    const bool halves = options.halve_lines && halve_lines(surface, whole().lines(), halved);
    return encode_mesh(halves ? halved : surface, mesh);
  }
};

FrameEncoder::FrameEncoder(const Rig& rig, const Pattern& pattern, int line_stride)
    : state_(std::make_unique<State>()) {
  state_->calibration = grid_calibration(rig, pattern);
  state_->rig_step_px = state_->calibration.line_step_px;
  state_->rate_hz = rig.frame_rate;
  set_line_stride(line_stride);
}
FrameEncoder::FrameEncoder(FrameEncoder&&) noexcept = default;
FrameEncoder& FrameEncoder::operator=(FrameEncoder&&) noexcept = default;
FrameEncoder::~FrameEncoder() = default;

void FrameEncoder::set_line_stride(int stride) {
  const int step_px = state_->rig_step_px * stride;
  if (std::exchange(state_->line_step_px, step_px) != step_px) state_->estimator.forget();
}

void FrameEncoder::request_key_frame() {
  state_->key_asked = true;
}

Result<Bytes> FrameEncoder::encode(const Frame3D& frame, const EncodeOptions& options,
                                   const std::function<void()>& geometry_done) {
  State& s = *state_;
  if (auto status = check_frame(frame, options); !status) return status.error();
  // What goes is checked by those who read it: to_grid() and encode_draco().
  if (auto status = check_counts(frame.surface); !status) return status.error();
  const bool asked = s.key_asked.exchange(false);
  const bool other_texture = s.texture_codec != options.texture;
  if (other_texture) s.texture = make_texture_encoder(options.texture);
  s.texture_codec = options.texture;
  const bool had_key = s.has_key;
  s.choose(frame.surface, options);
  // With other lines or steps the texture begins anew too, so that whoever joins finds a whole key frame.
  const bool other_grid = had_key && !s.has_key;
  const bool want_key =
      asked || other_texture || other_grid || s.since_key < 0 || s.since_key + 1 >= options.key_interval;
  const auto coded = s.encode_geometry(frame.surface, options, want_key);
  if (!coded) return coded.error();
  if (geometry_done) geometry_done();
  auto bytes = with_texture(frame, options, s.texture.get(), want_key, s.rate_hz, *coded);
  if (!bytes) {
    s.since_key = -1;  // what receivers would have to build on never reached them
    return bytes;
  }
  s.since_key = is_key_frame(*bytes) ? 0 : s.since_key + 1;
  return bytes;
}

std::string FrameEncoder::take_notice() {
  return state_->texture ? state_->texture->take_notice() : std::string();
}

Result<FrameHeader> read_frame_header(std::span<const std::uint8_t> bytes) {
  const auto layout = read_frame_layout(bytes);
  if (!layout) return layout.error();
  return layout->header;
}

namespace {

/// Of a frame with a grid that is not empty.
bool has_grid(const FrameHeader& header) {
  return header.geometry == GeometryCodec::kGrid && header.vertices > 0;
}

/// A key frame is one whose sections all need none of a frame before.
Status check_key(const FrameLayout& layout) {
  const FrameHeader& header = layout.header;
  bool geometry_is_key = true;
  if (has_grid(header)) {
    const auto head = read_grid_head(layout.sections.geometry);
    if (!head) return head.error();
    geometry_is_key = head->is_key;
  }
  const bool is_key = geometry_is_key && (layout.sections.texture.empty() ||
                                          texture_is_key(header.texture, layout.sections.texture));
  // Writers of before called an empty grid between key frames none.
  if (is_key != header.is_key && (header.is_key || header.vertices > 0))
    return Error{"frame and its sections do not agree whether this is a key frame"};
  return {};
}

}  // namespace

struct FrameDecoder::State {
  GridDecoder decoder;
  StripeGrid grid;  // of the last delta frame
  GridKey key;
  bool has_key = false;
  std::optional<GridPoints> points;
  std::unique_ptr<TextureDecoder> texture;
  TextureCodec texture_codec = TextureCodec::kNone;

  /// The grid it decodes to, of which the key is kept.
  Result<const StripeGrid*> decode_grid(std::span<const std::uint8_t> coded, const FrameHeader& header) {
    const auto head = read_grid_head(coded);
    if (!head) return head.error();
    if (head->is_key) has_key = false;
    StripeGrid& to = head->is_key ? key.grid : grid;
    const auto done = decoder.decode(coded, header.vertices, header.triangles, has_key ? &key : nullptr, to);
    if (!done) return done.error();
    if (head->is_key) {
      use(head->calibration);
      key.id = grid_id(coded);
      has_key = true;
    }
    return &to;
  }

  void use(const GridCalibration& calibration) {
    if (points && points->calibration() == calibration) return;
    points.emplace(calibration);
    has_key = false;  // it has the calibration of before
  }

  Status decode_geometry(const FrameLayout& layout, Surface& out) {
    const FrameHeader& header = layout.header;
    if (header.vertices == 0) {
      out = {};
      return {};
    }
    if (has_grid(header)) {
      const auto to = decode_grid(layout.sections.geometry, header);
      if (!to) return to.error();
      return points->to_surface(**to, out);
    }
    if (header.geometry == GeometryCodec::kDracoGrid) {
      const auto head = decode_draco_grid(layout.sections.geometry, header.vertices, header.triangles, grid);
      if (!head) return head.error();
      use(head->calibration);
      return points->to_surface(grid, out);
    }
    auto surface = decode_draco(layout.sections.geometry, header.vertices, header.triangles);
    if (!surface) return surface.error();
    out = std::move(*surface);
    return layout.sections.quality.empty() ? Status() : decode_vertex_quality(layout.sections.quality, out);
  }

  /// The decoder of that codec, with what it has decoded. Null: it is not known.
  TextureDecoder* texture_decoder(TextureCodec codec) {
    if (!texture || texture_codec != codec) texture = make_texture_decoder(codec);
    texture_codec = codec;
    return texture.get();
  }

  bool can_decode_texture(const FrameLayout& layout) const {
    const auto section = layout.sections.texture;
    if (section.empty() || texture_is_key(layout.header.texture, section)) return true;
    return texture && texture_codec == layout.header.texture && texture->can_decode(section);
  }
};

FrameDecoder::FrameDecoder() : state_(std::make_unique<State>()) {}
FrameDecoder::FrameDecoder(FrameDecoder&&) noexcept = default;
FrameDecoder& FrameDecoder::operator=(FrameDecoder&&) noexcept = default;
FrameDecoder::~FrameDecoder() = default;

bool FrameDecoder::can_decode(std::span<const std::uint8_t> bytes) const {
  if (is_key_frame(bytes)) return true;
  const auto layout = read_frame_layout(bytes);
  if (!layout || !state_->can_decode_texture(*layout)) return false;
  if (!has_grid(layout->header)) return true;
  const auto head = read_grid_head(layout->sections.geometry);
  return head && (head->is_key || (state_->has_key && head->key == state_->key.id));
}

Status FrameDecoder::remember(std::span<const std::uint8_t> bytes, const DecodeLimits& limits) {
  const auto layout = read_frame_layout(bytes);
  if (!layout) return layout.error();
  const FrameHeader& header = layout->header;
  if (auto status = check_limits(limits, header.vertices, header.triangles, texture_pixels(header)); !status)
    return status;
  if (auto status = check_key(*layout); !status) return status;
  if (has_grid(header) && read_grid_head(layout->sections.geometry)->is_key) {
    const auto grid = state_->decode_grid(layout->sections.geometry, header);
    if (!grid) return grid.error();
  }
  if (layout->sections.texture.empty()) return {};
  TextureDecoder* texture = state_->texture_decoder(header.texture);
  return texture == nullptr
             ? Status()
             : texture->remember(layout->sections.texture, header.texture_width, header.texture_height);
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
  if (!is_known(header.geometry))
    return Error{"frame has geometry of codec " + std::to_string(static_cast<int>(header.geometry)) +
                 " that this version does not know: update relievo"};
  // Frames without a texture may come between those that build on each other.
  TextureDecoder* texture =
      header.texture == TextureCodec::kNone ? nullptr : state_->texture_decoder(header.texture);
  if (header.texture != TextureCodec::kNone && texture == nullptr)
    return Error{"frame has a texture of codec " + texture_codec_name(header.texture) +
                 " that this version does not know: update relievo"};
  if (auto status = check_limits(limits, header.vertices, header.triangles, texture_pixels(header)); !status)
    return status;
  if (auto status = check_key(*layout); !status) return status;
  frame.number = header.number;
  frame.time_ns = header.time_ns;
  if (auto status = state_->decode_geometry(*layout, frame.surface); !status) return status;
  if (header.texture == TextureCodec::kNone) {
    frame.texture = {};
    return {};
  }
  return texture->decode(sections.texture, header.texture_width, header.texture_height, frame.texture);
}

Result<Frame3D> decode_frame(std::span<const std::uint8_t> bytes, const DecodeLimits& limits) {
  return FrameDecoder().decode(bytes, limits);
}

}  // namespace relievo
