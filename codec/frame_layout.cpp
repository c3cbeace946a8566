// SPDX-License-Identifier: Apache-2.0
#include "codec/frame_layout.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <string>

#include "codec/byte_io.h"
#include "codec/grid_coder.h"
#include "codec/texture_codec.h"

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
constexpr std::uint64_t kMaxItemsPerByte = 8;

/// The table of sections and the places of those that this version knows; others are stepped over.
Status read_sections(std::span<const std::uint8_t> bytes, std::span<const std::uint8_t> table,
                     std::size_t entry_bytes, std::size_t header_bytes, FrameLayout& layout) {
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
      layout.sections.geometry = section;
    } else if (kind == kTextureSection && !has_texture) {
      has_texture = true;
      layout.header.texture = static_cast<TextureCodec>(codec);
      layout.header.texture_bytes = size;
      layout.sections.texture = section;
    } else if (kind == kQualitySection && !has_quality) {
      has_quality = true;
      if (codec != kQualityCodec) continue;  // of a later version: the surface does without
      layout.header.quality_bytes = size;
      layout.sections.quality = section;
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
  const bool is_grid =
      header.geometry == GeometryCodec::kGrid || header.geometry == GeometryCodec::kDracoGrid;
  const std::uint64_t vertices = header.vertices;
  const std::uint64_t items = header.triangles > 0 ? header.triangles : vertices;
  const bool too_many =
      is_grid ? header.triangles > 2 * vertices || vertices > kMostGridVerticesPerByte * header.geometry_bytes
              : vertices > 3 * items || items > kMaxItemsPerByte * header.geometry_bytes;
  if (too_many)
    return Error{"frame declares " + std::to_string(header.vertices) + " vertices and " +
                 std::to_string(header.triangles) + " triangles, more than its " +
                 std::to_string(header.geometry_bytes) + " bytes of geometry can hold"};
  const std::uint64_t pixels = texture_pixels(header);
  if ((pixels == 0) != (header.texture_bytes == 0) ||
      pixels > most_texture_pixels_per_byte(header.texture) * header.texture_bytes)
    return Error{"frame declares a texture of " + std::to_string(header.texture_width) + "x" +
                 std::to_string(header.texture_height) + " in " + std::to_string(header.texture_bytes) +
                 " bytes"};
  return {};
}

}  // namespace

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

std::uint64_t texture_pixels(const FrameHeader& header) {
  return static_cast<std::uint64_t>(header.texture_width) * header.texture_height;
}

Result<FrameLayout> read_frame_layout(std::span<const std::uint8_t> bytes) {
  FrameLayout layout;
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
  header.is_key = (flags & kKeyFrame) != 0;
  if ((flags & ~kKeyFrame) != 0)
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
  if (!header.is_key && header.geometry != GeometryCodec::kGrid && header.texture != TextureCodec::kH264)
    return Error{"frame has flags that this version does not know (0): update relievo"};
  if (auto status = check_counts(header); !status) return status.error();
  return layout;
}

bool is_key_frame(std::span<const std::uint8_t> bytes) {
  return bytes.size() >= kFixedBytes && std::equal(kMagic.begin(), kMagic.end(), bytes.begin()) &&
         bytes[4] == kVersion && (bytes[5] & kKeyFrame) != 0;
}

BuildsOn what_it_builds_on(std::span<const std::uint8_t> bytes) {
  if (is_key_frame(bytes)) return BuildsOn::kNothing;
  const auto layout = read_frame_layout(bytes);
  if (!layout) return BuildsOn::kNothing;
  const auto texture = layout->sections.texture;
  const bool is_chained = !texture.empty() && !texture_is_key(layout->header.texture, texture);
  return is_chained ? BuildsOn::kFrameBefore : BuildsOn::kKeyFrame;
}

bool grid_builds_on(std::span<const std::uint8_t> bytes, std::span<const std::uint8_t> key) {
  const auto layout = read_frame_layout(bytes);
  const auto key_layout = read_frame_layout(key);
  if (!layout || !key_layout || layout->header.geometry != GeometryCodec::kGrid) return false;
  const auto head = read_grid_head(layout->sections.geometry);
  return head && !head->is_key && head->key == grid_id(key_layout->sections.geometry);
}

Bytes write_frame(const FrameHeader& header, const FrameSections& sections) {
  const bool has_texture = !sections.texture.empty();
  const bool has_quality = !sections.quality.empty();
  const std::size_t count = 1U + has_texture + has_quality;
  const std::size_t header_bytes = kFixedBytes + count * kEntryBytes;
  Bytes out(kMagic.begin(), kMagic.end());
  out.reserve(header_bytes + sections.geometry.size() + sections.texture.size() + sections.quality.size());
  append(out, kVersion);
  append(out, static_cast<std::uint8_t>(header.is_key ? kKeyFrame : 0));
  append(out, static_cast<std::uint16_t>(header_bytes));
  append(out, header.number);
  append(out, header.time_ns);
  for (const float x : header.volume.min) append(out, x);
  append(out, header.volume.size_m);
  append(out, header.vertices);
  append(out, header.triangles);
  append(out, has_texture ? header.texture_width : 0U);
  append(out, has_texture ? header.texture_height : 0U);
  append(out, static_cast<std::uint8_t>(count));
  append(out, static_cast<std::uint8_t>(kEntryBytes));
  append(out, static_cast<std::uint16_t>(kFixedBytes));
  append(out, std::uint32_t{0});
  const auto entry = [&](std::uint8_t kind, std::uint8_t codec, std::uint16_t flags, std::size_t size) {
    append(out, kind);
    append(out, codec);
    append(out, flags);
    append(out, static_cast<std::uint32_t>(size));
  };
  entry(kGeometrySection, static_cast<std::uint8_t>(header.geometry), kRequired, sections.geometry.size());
  if (has_texture)
    entry(kTextureSection, static_cast<std::uint8_t>(header.texture), 0, sections.texture.size());
  if (has_quality) entry(kQualitySection, kQualityCodec, 0, sections.quality.size());
  append_bytes(out, sections.geometry);
  append_bytes(out, sections.texture);
  append_bytes(out, sections.quality);
  return out;
}

}  // namespace relievo
