// SPDX-License-Identifier: Apache-2.0
// glTF 2.0 binary: a JSON chunk that describes the places in a binary chunk.
#include <array>
#include <cmath>
#include <limits>
#include <nlohmann/json.hpp>
#include <string>

#include "base/whole_file.h"
#include "codec/byte_io.h"
#include "codec/export.h"
#include "codec/jpeg_texture.h"
#include "codec/surface_check.h"

namespace relievo {
namespace {

using nlohmann::json;

constexpr int kFloat = 5126;
constexpr int kUint32 = 5125;
constexpr int kArrayBuffer = 34962;
constexpr int kElementBuffer = 34963;
constexpr int kPoints = 0;
constexpr int kTriangles = 4;

/// The binary chunk as it grows, with the JSON that describes it.
struct Document {
  json root;
  Bytes binary;

  int end_view(std::size_t start, int target) {
    json view = {{"buffer", 0}, {"byteOffset", start}, {"byteLength", binary.size() - start}};
    if (target != 0) view["target"] = target;
    root["bufferViews"].push_back(std::move(view));
    binary.resize((binary.size() + 3) / 4 * 4);
    return static_cast<int>(root["bufferViews"].size()) - 1;
  }
  int add_accessor(json accessor) {
    root["accessors"].push_back(std::move(accessor));
    return static_cast<int>(root["accessors"].size()) - 1;
  }

  template <std::size_t N>
  int add_floats(const std::vector<std::array<float, N>>& values) {
    const std::size_t start = binary.size();
    for (const auto& value : values)
      for (const float x : value) append(binary, x);
    return add_accessor({{"bufferView", end_view(start, kArrayBuffer)},
                         {"componentType", kFloat},
                         {"count", values.size()},
                         {"type", N == 3 ? "VEC3" : "VEC2"}});
  }
  int add_scalars(const std::vector<float>& values) {
    const std::size_t start = binary.size();
    for (const float x : values) append(binary, x);
    return add_accessor({{"bufferView", end_view(start, kArrayBuffer)},
                         {"componentType", kFloat},
                         {"count", values.size()},
                         {"type", "SCALAR"}});
  }
  int add_indices(const std::vector<Triangle>& triangles) {
    const std::size_t start = binary.size();
    for (const Triangle& triangle : triangles)
      for (const std::uint32_t index : triangle) append(binary, index);
    return add_accessor({{"bufferView", end_view(start, kElementBuffer)},
                         {"componentType", kUint32},
                         {"count", 3 * triangles.size()},
                         {"type", "SCALAR"}});
  }
};

/// Half a turn about x: camera frame (y down, z forward) to glTF's (y up, z backward).
std::vector<Vec3f> turned(std::vector<Vec3f> vectors) {
  for (Vec3f& v : vectors) v = {v[0], -v[1], -v[2]};
  return vectors;
}

/// glTF wants unit vectors; quantised ones are only nearly so.
std::vector<Vec3f> unit_normals(const Surface& surface) {
  std::vector<Vec3f> normals = surface.normals.empty() ? surface_normals(surface) : surface.normals;
  for (Vec3f& n : normals) {
    const double length = std::hypot(n[0], n[1], n[2]);
    for (float& x : n) x = length > 0 ? static_cast<float>(x / length) : 0.0f;
    if (!(length > 0)) n = {0, 0, -1};
  }
  return normals;
}

void add_bounds(json& accessor, const std::vector<Vec3f>& positions) {
  Vec3f low = positions[0];
  Vec3f high = positions[0];
  for (const Vec3f& p : positions)
    for (std::size_t i = 0; i < 3; ++i) {
      low[i] = std::min(low[i], p[i]);
      high[i] = std::max(high[i], p[i]);
    }
  accessor["min"] = {double{low[0]}, double{low[1]}, double{low[2]}};
  accessor["max"] = {double{high[0]}, double{high[1]}, double{high[2]}};
}

Status add_material(Document& document, const Image8& texture, int jpeg_quality) {
  const std::size_t start = document.binary.size();
  if (auto status = append_jpeg(texture.view(), jpeg_quality, document.binary); !status) return status;
  const int view = document.end_view(start, 0);
  document.root["images"] = json::array({{{"bufferView", view}, {"mimeType", "image/jpeg"}}});
  document.root["samplers"] =
      json::array({{{"magFilter", 9729}, {"minFilter", 9729}, {"wrapS", 33071}, {"wrapT", 33071}}});
  document.root["textures"] = json::array({{{"sampler", 0}, {"source", 0}}});
  document.root["extensionsUsed"] = {"KHR_materials_unlit"};
  document.root["materials"] =
      json::array({{{"pbrMetallicRoughness",
                     {{"baseColorTexture", {{"index", 0}}}, {"metallicFactor", 0}, {"roughnessFactor", 1}}},
                    {"doubleSided", true},
                    {"extensions", {{"KHR_materials_unlit", json::object()}}}}});
  return {};
}

Status add_mesh(Document& document, const Frame3D& frame, int jpeg_quality) {
  const Surface& surface = frame.surface;
  const std::vector<Vec3f> positions = turned(surface.positions);
  json attributes;
  attributes["POSITION"] = document.add_floats(positions);
  add_bounds(document.root["accessors"].back(), positions);
  attributes["NORMAL"] = document.add_floats(turned(unit_normals(surface)));
  json primitive = {{"mode", surface.triangles.empty() ? kPoints : kTriangles}};
  if (!surface.triangles.empty()) primitive["indices"] = document.add_indices(surface.triangles);
  if (!surface.texture_coordinates.empty() && !frame.texture.empty()) {
    attributes["TEXCOORD_0"] = document.add_floats(surface.texture_coordinates);
    if (auto status = add_material(document, frame.texture, jpeg_quality); !status) return status;
    primitive["material"] = 0;
  }
  // Attributes of an application's own start with an underscore (glTF 2.0, 3.7.2.1).
  if (!surface.sigmas_m.empty()) attributes["_SIGMA"] = document.add_scalars(surface.sigmas_m);
  if (!surface.interpolated.empty())
    attributes["_INTERPOLATED"] =
        document.add_scalars({surface.interpolated.begin(), surface.interpolated.end()});
  primitive["attributes"] = std::move(attributes);
  document.root["meshes"] = json::array({{{"primitives", json::array({std::move(primitive)})}}});
  document.root["nodes"] = json::array({{{"mesh", 0}, {"name", "surface"}}});
  document.root["scenes"][0]["nodes"] = {0};
  document.root["buffers"] = json::array({{{"byteLength", document.binary.size()}}});
  return {};
}

void append_chunk(Bytes& out, std::string_view type, std::span<const std::uint8_t> content,
                  std::uint8_t padding) {
  const std::size_t padded = (content.size() + 3) / 4 * 4;
  append(out, static_cast<std::uint32_t>(padded));
  out.insert(out.end(), type.begin(), type.end());
  append_bytes(out, content);
  out.resize(out.size() + padded - content.size(), padding);
}

}  // namespace

Result<Bytes> encode_glb(const Frame3D& frame, int jpeg_quality) {
  if (jpeg_quality < 1 || jpeg_quality > 100) return Error{"jpeg_quality is not 1 to 100"};
  if (auto status = check_surface(frame.surface); !status) return status.error();
  Document document;
  document.root["asset"] = {{"version", "2.0"}, {"generator", "relievo " RELIEVO_VERSION}};
  document.root["scene"] = 0;
  // Times as text: a JSON number in a browser holds 53 bits.
  document.root["scenes"] =
      json::array({{{"extras", {{"frame", frame.number}, {"time_ns", std::to_string(frame.time_ns)}}}}});
  if (!frame.surface.positions.empty())
    if (auto status = add_mesh(document, frame, jpeg_quality); !status) return status.error();
  const std::string text = document.root.dump();
  const std::size_t size = 12 + 8 + text.size() + 3 + 8 + document.binary.size() + 3;
  if (size > std::numeric_limits<std::uint32_t>::max())
    return Error{"the frame is too large for a GLB (4 GiB)"};
  Bytes out{'g', 'l', 'T', 'F'};
  out.reserve(size);
  append(out, std::uint32_t{2});
  append(out, std::uint32_t{0});
  append_chunk(out, "JSON", Bytes(text.begin(), text.end()), ' ');
  if (!document.binary.empty()) append_chunk(out, std::string_view("BIN\0", 4), document.binary, 0);
  put(out, 8, static_cast<std::uint32_t>(out.size()));
  return out;
}

Status write_glb(const std::filesystem::path& path, const Frame3D& frame, int jpeg_quality) {
  const auto bytes = encode_glb(frame, jpeg_quality);
  return bytes ? write_whole_file(path, *bytes) : Status(bytes.error().in("cannot write " + path.string()));
}

}  // namespace relievo
