// SPDX-License-Identifier: Apache-2.0
// The container of codec/FORMAT.md: a header, a table of sections, the sections.
#include "codec/frame3d_codec.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <string>
#include <utility>

#include "codec/byte_io.h"
#include "codec/draco_mesh.h"
#include "codec/jpeg_texture.h"
#include "codec/vertex_quality.h"

namespace relievo {
namespace {

constexpr std::array<std::uint8_t, 4> kMagic{'R', 'L', 'V', 'F'};
constexpr std::uint8_t kVersion = 1;
constexpr std::uint8_t kKeyFrame = 0x01;
constexpr std::size_t kFixedBytes = 64;
constexpr std::size_t kEntryBytes = 8;
constexpr int kMaxSections = 16;
constexpr std::uint8_t kGeometrySection = 1;
constexpr std::uint8_t kTextureSection = 2;
constexpr std::uint8_t kQualitySection = 4;
constexpr std::uint8_t kQualityCodec = 1;
constexpr std::uint16_t kRequired = 0x0001;
constexpr std::uint64_t kMaxPixelsPerByte = 256;  // of a sequential JPEG: 64 pixels take 2 bits at least
constexpr std::uint64_t kMaxItemsPerByte = 8;
constexpr DecodeLimits kFormatLimits{};

// Where the fields lie.
constexpr std::size_t kTextureBytesAt = kFixedBytes + kEntryBytes + 4;

Status check(const char* name, int value, int low, int high) {
  if (value >= low && value <= high) return {};
  return Error{std::string(name) + " is " + std::to_string(value) + ", allowed are " + std::to_string(low) +
               " to " + std::to_string(high)};
}

Status check_options(const EncodeOptions& options) {
  if (options.geometry != GeometryCodec::kDracoMesh) return Error{"unknown geometry codec"};
  if (options.texture != TextureCodec::kNone && options.texture != TextureCodec::kJpeg)
    return Error{"unknown texture codec"};
  for (const Status& status :
       {check("position_bits", options.position_bits, 8, 20),
        check("texture_coordinate_bits", options.texture_coordinate_bits, 8, 16),
        options.normal_bits == 0 ? Status() : check("normal_bits", options.normal_bits, 4, 16),
        check("draco_speed", options.draco_speed, 0, 9), check("jpeg_quality", options.jpeg_quality, 1, 100)})
    if (!status) return status;
  const Volume& volume = options.volume;
  const bool finite =
      std::isfinite(volume.min[0]) && std::isfinite(volume.min[1]) && std::isfinite(volume.min[2]);
  if (!finite || !std::isfinite(volume.size_m) || volume.size_m < 0)
    return Error{"volume is not finite or its size is negative"};
  return {};
}

Status check_limits(const DecodeLimits& limits, std::uint64_t vertices, std::uint64_t triangles,
                    std::uint64_t pixels) {
  const auto over = [](const char* what, std::uint64_t count, std::uint64_t limit) {
    return Error{"frame has " + std::to_string(count) + " " + what + ", more than the limit of " +
                 std::to_string(limit)};
  };
  if (vertices > limits.vertices) return over("vertices", vertices, limits.vertices);
  if (triangles > limits.triangles) return over("triangles", triangles, limits.triangles);
  if (pixels > limits.texture_pixels) return over("texture pixels", pixels, limits.texture_pixels);
  return {};
}

std::uint64_t pixels_of(const FrameHeader& header) {
  return static_cast<std::uint64_t>(header.texture_width) * header.texture_height;
}

struct Layout {
  FrameHeader header;
  std::span<const std::uint8_t> geometry;
  std::span<const std::uint8_t> texture;
  std::span<const std::uint8_t> quality;  // empty where there is none of a known codec
};

/// The table of sections and the places of those that this version knows; others are stepped over.
Status read_sections(std::span<const std::uint8_t> bytes, std::span<const std::uint8_t> table,
                     std::size_t entry_bytes, std::size_t header_bytes, Layout& layout) {
  bool has_geometry = false;
  bool has_texture = false;
  bool has_quality = false;
  std::uint64_t at = header_bytes;
  for (std::size_t entry = 0; entry < table.size(); entry += entry_bytes) {
    ByteReader reader(table.subspan(entry, kEntryBytes));
    const auto kind = reader.read<std::uint8_t>();
    const auto codec = reader.read<std::uint8_t>();
    const auto flags = reader.read<std::uint16_t>();
    const auto size = reader.read<std::uint32_t>();
    if (size > bytes.size() - at) return Error{"frame is cut short: a section ends behind its end"};
    const auto section = bytes.subspan(static_cast<std::size_t>(at), size);
    at += size;
    if (kind == kGeometrySection && !has_geometry) {
      has_geometry = true;
      layout.header.geometry = static_cast<GeometryCodec>(codec);
      layout.header.geometry_bytes = size;
      layout.geometry = section;
    } else if (kind == kTextureSection && !has_texture) {
      has_texture = true;
      layout.header.texture = static_cast<TextureCodec>(codec);
      layout.header.texture_bytes = size;
      layout.texture = section;
    } else if (kind == kQualitySection && !has_quality) {
      has_quality = true;
      if (codec != kQualityCodec) continue;  // of a later version: the surface does without
      layout.header.quality_bytes = size;
      layout.quality = section;
    } else if (kind == kGeometrySection || kind == kTextureSection || kind == kQualitySection) {
      return Error{"frame has two sections of kind " + std::to_string(kind)};
    } else if ((flags & kRequired) != 0) {
      return Error{"frame needs a section of kind " + std::to_string(kind) +
                   " that this version does not know: update relievo"};
    }
  }
  if (at != bytes.size())
    return Error{"frame has " + std::to_string(bytes.size() - at) + " bytes behind its end"};
  if (!has_geometry) return Error{"frame has no geometry section"};
  if (has_texture && layout.header.texture == TextureCodec::kNone)
    return Error{"frame has a texture section without a codec"};
  return {};
}

/// Counts that contradict each other, or the sizes of their sections (FORMAT.md, "Sizes").
Status check_counts(const FrameHeader& header) {
  if ((header.vertices == 0) != (header.geometry_bytes == 0))
    return Error{"frame declares " + std::to_string(header.vertices) + " vertices in " +
                 std::to_string(header.geometry_bytes) + " bytes"};
  const std::uint64_t items = header.triangles > 0 ? header.triangles : header.vertices;
  if (header.vertices > 3 * static_cast<std::uint64_t>(items) ||
      items > kMaxItemsPerByte * header.geometry_bytes)
    return Error{"frame declares " + std::to_string(header.vertices) + " vertices and " +
                 std::to_string(header.triangles) + " triangles, more than its " +
                 std::to_string(header.geometry_bytes) + " bytes of geometry can hold"};
  const std::uint64_t pixels = pixels_of(header);
  if ((pixels == 0) != (header.texture_bytes == 0) || pixels > kMaxPixelsPerByte * header.texture_bytes)
    return Error{"frame declares a texture of " + std::to_string(header.texture_width) + "x" +
                 std::to_string(header.texture_height) + " in " + std::to_string(header.texture_bytes) +
                 " bytes"};
  return {};
}

Result<Layout> read_layout(std::span<const std::uint8_t> bytes) {
  Layout layout;
  FrameHeader& header = layout.header;
  ByteReader reader(bytes);
  const auto magic = reader.take(kMagic.size());
  if (!reader.ok() || !std::equal(magic.begin(), magic.end(), kMagic.begin()))
    return Error{"not a Relievo frame: it does not start with RLVF"};
  header.version = reader.read<std::uint8_t>();
  if (reader.ok() && header.version != kVersion)
    return Error{"frame is of format version " + std::to_string(header.version) +
                 ", this program knows version 1: update relievo"};
  const auto flags = reader.read<std::uint8_t>();
  const auto header_bytes = reader.read<std::uint16_t>();
  header.number = reader.read<std::uint64_t>();
  header.time_ns = reader.read<std::int64_t>();
  for (float& x : header.volume.min) x = reader.read<float>();
  header.volume.size_m = reader.read<float>();
  header.vertices = reader.read<std::uint32_t>();
  header.triangles = reader.read<std::uint32_t>();
  header.texture_width = reader.read<std::uint32_t>();
  header.texture_height = reader.read<std::uint32_t>();
  const auto sections = reader.read<std::uint8_t>();
  const auto entry_bytes = reader.read<std::uint8_t>();
  const auto table_at = reader.read<std::uint16_t>();
  reader.take(4);  // reserved
  if (!reader.ok() || header_bytes > bytes.size())
    return Error{"frame is cut short: " + std::to_string(bytes.size()) + " bytes"};
  if (flags != kKeyFrame)
    return Error{"frame has flags that this version does not know (" + std::to_string(flags) +
                 "): update relievo"};
  const std::size_t table_bytes = static_cast<std::size_t>(sections) * entry_bytes;
  if (sections > kMaxSections || entry_bytes < kEntryBytes || table_at < kFixedBytes ||
      table_at + table_bytes > header_bytes)
    return Error{"frame has a broken table of sections"};
  if (!std::isfinite(header.volume.size_m) || header.volume.size_m < 0 ||
      !std::isfinite(header.volume.min[0]) || !std::isfinite(header.volume.min[1]) ||
      !std::isfinite(header.volume.min[2]))
    return Error{"frame has a volume that is not finite"};
  if (auto status =
          read_sections(bytes, bytes.subspan(table_at, table_bytes), entry_bytes, header_bytes, layout);
      !status)
    return status.error();
  if (auto status = check_counts(header); !status) return status.error();
  return layout;
}

}  // namespace

Result<Bytes> encode_frame(const Frame3D& frame, const EncodeOptions& options) {
  if (auto status = check_options(options); !status) return status.error();
  const bool has_texture = options.texture != TextureCodec::kNone && !frame.texture.empty();
  const std::uint64_t pixels = has_texture ? static_cast<std::uint64_t>(frame.texture.width()) *
                                                 static_cast<std::uint64_t>(frame.texture.height())
                                           : 0;
  if (auto status =
          check_limits(kFormatLimits, frame.surface.positions.size(), frame.surface.triangles.size(), pixels);
      !status)
    return status.error();
  const auto geometry = encode_draco(frame.surface, options);
  if (!geometry) return geometry.error();

  Bytes quality;
  if (options.quality && !frame.surface.texture_coordinates.empty() &&
      geometry->vertices >= geometry->sent.size())
    quality = encode_vertex_quality(frame.surface, geometry->sent, options.texture_coordinate_bits);

  const int sections = 1 + has_texture + !quality.empty();
  const std::size_t header_bytes = kFixedBytes + static_cast<std::size_t>(sections) * kEntryBytes;
  Bytes out(kMagic.begin(), kMagic.end());
  out.reserve(header_bytes + geometry->bytes.size());
  append(out, kVersion);
  append(out, kKeyFrame);
  append(out, static_cast<std::uint16_t>(header_bytes));
  append(out, frame.number);
  append(out, frame.time_ns);
  for (const float x : geometry->volume.min) append(out, x);
  append(out, geometry->volume.size_m);
  append(out, geometry->vertices);
  append(out, geometry->triangles);
  append(out, static_cast<std::uint32_t>(has_texture ? frame.texture.width() : 0));
  append(out, static_cast<std::uint32_t>(has_texture ? frame.texture.height() : 0));
  append(out, static_cast<std::uint8_t>(sections));
  append(out, static_cast<std::uint8_t>(kEntryBytes));
  append(out, static_cast<std::uint16_t>(kFixedBytes));
  append(out, std::uint32_t{0});
  append(out, kGeometrySection);
  append(out, static_cast<std::uint8_t>(options.geometry));
  append(out, kRequired);
  append(out, static_cast<std::uint32_t>(geometry->bytes.size()));
  if (has_texture) {
    append(out, kTextureSection);
    append(out, static_cast<std::uint8_t>(options.texture));
    append(out, std::uint16_t{0});
    append(out, std::uint32_t{0});
  }
  if (!quality.empty()) {
    append(out, kQualitySection);
    append(out, kQualityCodec);
    append(out, std::uint16_t{0});
    append(out, static_cast<std::uint32_t>(quality.size()));
  }
  append_bytes(out, geometry->bytes);
  if (has_texture) {
    const std::size_t start = out.size();
    if (auto status = append_jpeg(frame.texture.view(), options.jpeg_quality, out); !status)
      return status.error();
    put(out, kTextureBytesAt, static_cast<std::uint32_t>(out.size() - start));
  }
  append_bytes(out, quality);
  return out;
}

Result<FrameHeader> read_frame_header(std::span<const std::uint8_t> bytes) {
  const auto layout = read_layout(bytes);
  if (!layout) return layout.error();
  return layout->header;
}

bool is_key_frame(std::span<const std::uint8_t> bytes) {
  return bytes.size() >= kFixedBytes && std::equal(kMagic.begin(), kMagic.end(), bytes.begin()) &&
         bytes[4] == kVersion && (bytes[5] & kKeyFrame) != 0;
}

Result<Frame3D> decode_frame(std::span<const std::uint8_t> bytes, const DecodeLimits& limits) {
  const auto layout = read_layout(bytes);
  if (!layout) return layout.error();
  const FrameHeader& header = layout->header;
  if (header.geometry != GeometryCodec::kDracoMesh)
    return Error{"frame has geometry of codec " + std::to_string(static_cast<int>(header.geometry)) +
                 " that this version does not know: update relievo"};
  if (header.texture != TextureCodec::kNone && header.texture != TextureCodec::kJpeg)
    return Error{"frame has a texture of codec " + std::to_string(static_cast<int>(header.texture)) +
                 " that this version does not know: update relievo"};
  if (auto status = check_limits(limits, header.vertices, header.triangles, pixels_of(header)); !status)
    return status.error();
  Frame3D frame;
  frame.number = header.number;
  frame.time_ns = header.time_ns;
  if (header.vertices > 0) {
    auto surface = decode_draco(layout->geometry, header.vertices, header.triangles);
    if (!surface) return surface.error();
    frame.surface = std::move(*surface);
    if (!layout->quality.empty())
      if (auto status = decode_vertex_quality(layout->quality, frame.surface); !status) return status.error();
  }
  if (header.texture != TextureCodec::kNone) {
    auto texture = decode_jpeg(layout->texture, header.texture_width, header.texture_height);
    if (!texture) return texture.error();
    frame.texture = std::move(*texture);
  }
  return frame;
}

}  // namespace relievo
