// SPDX-License-Identifier: Apache-2.0
// glTF 2.0 binary: a JSON chunk that describes the places in a binary chunk.
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <utility>

#include "base/json_text.h"
#include "base/whole_file.h"
#include "codec/byte_io.h"
#include "codec/draco_mesh.h"
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
constexpr const char* kDracoExtension = "KHR_draco_mesh_compression";
constexpr int kDracoPositionBits = 14;
constexpr int kDracoNormalBits = 10;
constexpr const char* kTooLarge = "that is too large for a GLB (4 GiB)";

/// Times as text: a JSON number in a browser holds 53 bits.
json moment_of(const Frame3D& frame) {
  return {{"frame", frame.number}, {"time_ns", std::to_string(frame.time_ns)}};
}

/// The binary chunk as it grows, with the JSON that describes it.
struct Document {
  json root;
  Bytes binary;

  int end_view(std::size_t start, int target) {
    json view = {{"buffer", 0}, {"byteOffset", start}, {"byteLength", binary.size() - start}};
    if (target != 0) view["target"] = target;
    binary.resize((binary.size() + 3) / 4 * 4);
    return add("bufferViews", std::move(view));
  }
  /// To one of the lists of the root; its index there.
  int add(const char* list, json entry) {
    root[list].push_back(std::move(entry));
    return static_cast<int>(root[list].size()) - 1;
  }
  /// An extension, once.
  void use(const char* list, const char* extension) {
    json& names = root[list];
    if (std::ranges::find(names, extension) == names.end()) names.push_back(extension);
  }
  int add_accessor(json accessor) { return add("accessors", std::move(accessor)); }

  template <std::size_t N>
  int add_floats(const std::vector<std::array<float, N>>& values, int target = kArrayBuffer) {
    const std::size_t start = binary.size();
    for (const auto& value : values)
      for (const float x : value) append(binary, x);
    return add_accessor({{"bufferView", end_view(start, target)},
                         {"componentType", kFloat},
                         {"count", values.size()},
                         {"type", N == 3 ? "VEC3" : "VEC2"}});
  }
  int add_scalars(const std::vector<float>& values, int target = kArrayBuffer) {
    const std::size_t start = binary.size();
    for (const float x : values) append(binary, x);
    return add_accessor({{"bufferView", end_view(start, target)},
                         {"componentType", kFloat},
                         {"count", values.size()},
                         {"type", "SCALAR"}});
  }
  /// Of an animation, rising; players want to know its ends.
  int add_times(const std::vector<float>& times) {
    const int accessor = add_scalars(times, 0);
    root["accessors"].back()["min"] = {double{times.front()}};
    root["accessors"].back()["max"] = {double{times.back()}};
    return accessor;
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

std::pair<Vec3f, Vec3f> bounds(const std::vector<Vec3f>& positions) {
  Vec3f low = positions[0];
  Vec3f high = positions[0];
  for (const Vec3f& p : positions)
    for (std::size_t i = 0; i < 3; ++i) {
      low[i] = std::min(low[i], p[i]);
      high[i] = std::max(high[i], p[i]);
    }
  return {low, high};
}

void add_bounds(json& accessor, const std::vector<Vec3f>& positions) {
  const auto [low, high] = bounds(positions);
  accessor["min"] = {double{low[0]}, double{low[1]}, double{low[2]}};
  accessor["max"] = {double{high[0]}, double{high[1]}, double{high[2]}};
}

/// Its index.
Result<int> add_material(Document& document, const Image8& texture, int jpeg_quality) {
  const std::size_t start = document.binary.size();
  if (auto status = append_jpeg(texture.view(), jpeg_quality, document.binary); !status)
    return status.error();
  const int view = document.end_view(start, 0);
  const int image = document.add("images", {{"bufferView", view}, {"mimeType", "image/jpeg"}});
  document.root["samplers"] =
      json::array({{{"magFilter", 9729}, {"minFilter", 9729}, {"wrapS", 33071}, {"wrapT", 33071}}});
  const int shown = document.add("textures", {{"sampler", 0}, {"source", image}});
  document.use("extensionsUsed", "KHR_materials_unlit");
  return document.add(
      "materials",
      {{"pbrMetallicRoughness",
        {{"baseColorTexture", {{"index", shown}}}, {"metallicFactor", 0}, {"roughnessFactor", 1}}},
       {"doubleSided", true},
       {"extensions", {{"KHR_materials_unlit", json::object()}}}});
}

/// What glTF shows of a frame, in its axes: unit normals, and coordinates where there is a picture for them.
Surface to_gltf(const Frame3D& frame) {
  const Surface& surface = frame.surface;
  Surface out;
  out.positions = turned(surface.positions);
  out.normals = turned(unit_normals(surface));
  if (!frame.texture.empty()) out.texture_coordinates = surface.texture_coordinates;
  out.triangles = surface.triangles;
  out.sigmas_m = surface.sigmas_m;
  out.interpolated = surface.interpolated;
  return out;
}

json plain_primitive(Document& document, const Surface& surface) {
  json attributes;
  attributes["POSITION"] = document.add_floats(surface.positions);
  add_bounds(document.root["accessors"].back(), surface.positions);
  attributes["NORMAL"] = document.add_floats(surface.normals);
  json primitive = {{"mode", surface.triangles.empty() ? kPoints : kTriangles}};
  if (!surface.triangles.empty()) primitive["indices"] = document.add_indices(surface.triangles);
  if (!surface.texture_coordinates.empty())
    attributes["TEXCOORD_0"] = document.add_floats(surface.texture_coordinates);
  // Attributes of an application's own start with an underscore (glTF 2.0, 3.7.2.1).
  if (!surface.sigmas_m.empty()) attributes["_SIGMA"] = document.add_scalars(surface.sigmas_m);
  if (!surface.interpolated.empty())
    attributes["_INTERPOLATED"] =
        document.add_scalars({surface.interpolated.begin(), surface.interpolated.end()});
  primitive["attributes"] = std::move(attributes);
  return primitive;
}

/// The box on a grid that does not depend on the frame: multiples of 1, 2, 4, 8 .. micrometres, as few as the
/// positions fit with into kDracoPositionBits. Whole micrometres, since Draco's encoder is told of the box as
/// text with six decimals.
Volume snapped_volume(const std::vector<Vec3f>& positions) {
  constexpr int kSteps = (1 << kDracoPositionBits) - 1;
  const auto [low, high] = bounds(positions);
  double edge_um = 0;
  for (std::size_t i = 0; i < 3; ++i) edge_um = std::max(edge_um, 1e6 * (double{high[i]} - double{low[i]}));
  int exponent = 0;
  // Fewer steps than there are: the low end goes down to a multiple, and numbers are rounded.
  std::frexp(edge_um / (kSteps - 2), &exponent);
  const double step_m = std::ldexp(1e-6, std::max(exponent, 0));
  Volume volume{.min = {}, .size_m = static_cast<float>(step_m * kSteps)};
  for (std::size_t i = 0; i < 3; ++i)
    volume.min[i] = static_cast<float>(step_m * std::floor(low[i] / step_m));
  return volume;
}

/// Nothing where no triangle has three corners.
Result<std::optional<json>> draco_primitive(Document& document, const Surface& surface) {
  const Volume volume = snapped_volume(surface.positions);
  if (!std::isfinite(volume.size_m)) return Error{"the surface is too large for Draco"};
  const auto coded = encode_draco(
      surface, {.position_bits = kDracoPositionBits, .normal_bits = kDracoNormalBits, .volume = volume});
  if (!coded) return coded.error();
  if (coded->triangles == 0) return std::optional<json>();
  // Accessors tell what comes out, the exact bounds among it.
  const auto decoded = decode_draco(coded->bytes, coded->vertices, coded->triangles);
  if (!decoded) return decoded.error();
  const std::size_t start = document.binary.size();
  append_bytes(document.binary, coded->bytes);
  json ids, attributes;
  const auto add = [&](const char* name, int id, const char* type) {
    if (id < 0) return;
    ids[name] = id;
    attributes[name] =
        document.add_accessor({{"componentType", kFloat}, {"count", coded->vertices}, {"type", type}});
  };
  const int view = document.end_view(start, 0);
  add("POSITION", coded->position_id, "VEC3");
  add_bounds(document.root["accessors"].back(), decoded->positions);
  add("NORMAL", coded->normal_id, "VEC3");
  add("TEXCOORD_0", coded->coordinate_id, "VEC2");
  const int indices = document.add_accessor(
      {{"componentType", kUint32}, {"count", 3 * std::size_t{coded->triangles}}, {"type", "SCALAR"}});
  for (const char* list : {"extensionsUsed", "extensionsRequired"}) document.use(list, kDracoExtension);
  return std::optional<json>(
      {{"mode", kTriangles},
       {"attributes", std::move(attributes)},
       {"indices", indices},
       {"extensions", {{kDracoExtension, {{"bufferView", view}, {"attributes", std::move(ids)}}}}}});
}

/// Of a surface with at least one vertex.
Result<json> add_primitive(Document& document, const Surface& surface, bool draco) {
  if (draco && !surface.triangles.empty()) {
    auto primitive = draco_primitive(document, surface);
    if (!primitive) return primitive.error();
    if (*primitive) return **std::move(primitive);
  }
  return plain_primitive(document, surface);
}

/// The node that shows the frame; its index.
Result<int> add_node(Document& document, const Frame3D& frame, const GlbOptions& options) {
  const Surface surface = to_gltf(frame);
  auto primitive = add_primitive(document, surface, options.draco);
  if (!primitive) return primitive.error();
  if (!surface.texture_coordinates.empty()) {
    const auto material = add_material(document, frame.texture, options.jpeg_quality);
    if (!material) return material.error();
    (*primitive)["material"] = *material;
  }
  const int mesh = document.add("meshes", {{"primitives", json::array({*std::move(primitive)})}});
  const int node = document.add("nodes", {{"mesh", mesh}, {"name", "surface"}});
  document.root["scenes"][0]["nodes"].push_back(node);
  return node;
}

Status check(const Frame3D& frame, const GlbOptions& options) {
  if (options.jpeg_quality < 1 || options.jpeg_quality > 100) return Error{"jpeg_quality is not 1 to 100"};
  return check_surface(frame.surface);
}

Document start_document() {
  Document document;
  document.root["asset"] = {{"version", "2.0"}, {"generator", "relievo " RELIEVO_VERSION}};
  document.root["scene"] = 0;
  document.root["scenes"] = json::array({json::object()});
  return document;
}

void append_chunk(Bytes& out, std::string_view type, std::span<const std::uint8_t> content,
                  std::uint8_t padding) {
  const std::size_t padded = (content.size() + 3) / 4 * 4;
  append(out, static_cast<std::uint32_t>(padded));
  out.insert(out.end(), type.begin(), type.end());
  append_bytes(out, content);
  out.resize(out.size() + padded - content.size(), padding);
}

Result<Bytes> to_glb(Document& document) {
  if (!document.binary.empty())
    document.root["buffers"] = json::array({{{"byteLength", document.binary.size()}}});
  const std::string text = json_line(document.root);
  const std::size_t size = 12 + 8 + text.size() + 3 + 8 + document.binary.size() + 3;
  if (size > std::numeric_limits<std::uint32_t>::max()) return Error{kTooLarge};
  Bytes out{'g', 'l', 'T', 'F'};
  out.reserve(size);
  append(out, std::uint32_t{2});
  append(out, std::uint32_t{0});
  append_chunk(out, "JSON", Bytes(text.begin(), text.end()), ' ');
  if (!document.binary.empty()) append_chunk(out, std::string_view("BIN\0", 4), document.binary, 0);
  put(out, 8, static_cast<std::uint32_t>(out.size()));
  return out;
}

}  // namespace

Result<Bytes> encode_glb(const Frame3D& frame, const GlbOptions& options) {
  if (auto status = check(frame, options); !status) return status.error();
  Document document = start_document();
  document.root["scenes"][0]["extras"] = moment_of(frame);
  if (!frame.surface.positions.empty())
    if (auto node = add_node(document, frame, options); !node) return node.error();
  return to_glb(document);
}

Status write_glb(const std::filesystem::path& path, const Frame3D& frame, const GlbOptions& options) {
  const auto bytes = encode_glb(frame, options);
  return bytes ? write_whole_file(path, *bytes) : Status(bytes.error().in("cannot write " + path.string()));
}

struct GlbAnimation::State {
  struct Shown {
    std::optional<int> node;  // nothing: an empty surface
    double time_s;
  };

  Document document = start_document();
  std::vector<Shown> shown;
  std::int64_t first_ns = 0;

  /// The node is there, at scale 1, from one moment to the next; before and after, at scale 0, it is not
  /// (glTF 2.0, 3.5.3). The last one stays at the end.
  void show(int node, double begin_s, double end_s, bool is_last, json& animation) {
    std::vector<float> times;
    std::vector<Vec3f> scales;
    const auto from = [&](double time_s, float scale) {
      times.push_back(static_cast<float>(time_s));
      scales.push_back({scale, scale, scale});
    };
    if (begin_s > 0) from(0, 0);
    from(begin_s, 1);
    from(end_s, is_last ? 1 : 0);
    const int input = document.add_times(times);
    const int output = document.add_floats(scales, 0);
    animation["samplers"].push_back({{"input", input}, {"output", output}, {"interpolation", "STEP"}});
    animation["channels"].push_back(
        {{"sampler", animation["samplers"].size() - 1}, {"target", {{"node", node}, {"path", "scale"}}}});
  }
};

GlbAnimation::GlbAnimation() : state_(std::make_unique<State>()) {}
GlbAnimation::~GlbAnimation() = default;

Status GlbAnimation::add(const Frame3D& frame, const GlbOptions& options) {
  State& s = *state_;
  if (auto status = check(frame, options); !status) return status;
  if (s.shown.empty()) s.first_ns = frame.time_ns;
  const double time_s = 1e-9 * static_cast<double>(frame.time_ns - s.first_ns);
  if (!s.shown.empty() && !(time_s > s.shown.back().time_s))
    return Error{"frame " + std::to_string(frame.number) + " is not later than the one before it"};
  State::Shown shown{{}, time_s};
  if (!frame.surface.positions.empty()) {
    const auto node = add_node(s.document, frame, options);
    if (!node) return node.error();
    s.document.root["nodes"].back()["extras"] = moment_of(frame);
    shown.node = *node;
  }
  s.shown.push_back(shown);
  if (s.document.binary.size() > std::numeric_limits<std::uint32_t>::max()) return Error{kTooLarge};
  return {};
}

Result<Bytes> GlbAnimation::finish() {
  State& s = *state_;
  json animation = {{"name", "frames"}};
  for (std::size_t i = 0; i < s.shown.size(); ++i) {
    if (!s.shown[i].node) continue;
    const bool is_last = i + 1 == s.shown.size();
    if (is_last && i == 0) break;  // always there
    const double begin_s = s.shown[i].time_s;
    // The last one as long as the one before, or a player that repeats would not show it.
    const double end_s = is_last ? 2 * begin_s - s.shown[i - 1].time_s : s.shown[i + 1].time_s;
    s.show(*s.shown[i].node, begin_s, end_s, is_last, animation);
    // A player without animation, and one before it starts, shows the first frame alone.
    if (i > 0) s.document.root["nodes"][static_cast<std::size_t>(*s.shown[i].node)]["scale"] = {0, 0, 0};
  }
  if (animation.contains("channels")) s.document.add("animations", std::move(animation));
  return to_glb(s.document);
}

}  // namespace relievo
