// SPDX-License-Identifier: Apache-2.0
// glTF 2.0 binary: a JSON chunk that describes the places in a binary chunk.
#include <array>
#include <cmath>
#include <limits>
#include <nlohmann/json.hpp>
#include <optional>
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
  document.root["extensionsUsed"] = {"KHR_materials_unlit"};
  return document.add(
      "materials",
      {{"pbrMetallicRoughness",
        {{"baseColorTexture", {{"index", shown}}}, {"metallicFactor", 0}, {"roughnessFactor", 1}}},
       {"doubleSided", true},
       {"extensions", {{"KHR_materials_unlit", json::object()}}}});
}

/// The node that shows the frame; its index.
Result<int> add_node(Document& document, const Frame3D& frame, int jpeg_quality) {
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
    const auto material = add_material(document, frame.texture, jpeg_quality);
    if (!material) return material.error();
    primitive["material"] = *material;
  }
  // Attributes of an application's own start with an underscore (glTF 2.0, 3.7.2.1).
  if (!surface.sigmas_m.empty()) attributes["_SIGMA"] = document.add_scalars(surface.sigmas_m);
  if (!surface.interpolated.empty())
    attributes["_INTERPOLATED"] =
        document.add_scalars({surface.interpolated.begin(), surface.interpolated.end()});
  primitive["attributes"] = std::move(attributes);
  const int mesh = document.add("meshes", {{"primitives", json::array({std::move(primitive)})}});
  const int node = document.add("nodes", {{"mesh", mesh}, {"name", "surface"}});
  document.root["scenes"][0]["nodes"].push_back(node);
  return node;
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
  const std::string text = document.root.dump();
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

Result<Bytes> encode_glb(const Frame3D& frame, int jpeg_quality) {
  if (jpeg_quality < 1 || jpeg_quality > 100) return Error{"jpeg_quality is not 1 to 100"};
  if (auto status = check_surface(frame.surface); !status) return status.error();
  Document document = start_document();
  document.root["scenes"][0]["extras"] = moment_of(frame);
  if (!frame.surface.positions.empty())
    if (auto node = add_node(document, frame, jpeg_quality); !node) return node.error();
  return to_glb(document);
}

Status write_glb(const std::filesystem::path& path, const Frame3D& frame, int jpeg_quality) {
  const auto bytes = encode_glb(frame, jpeg_quality);
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

Status GlbAnimation::add(const Frame3D& frame, int jpeg_quality) {
  State& s = *state_;
  if (jpeg_quality < 1 || jpeg_quality > 100) return Error{"jpeg_quality is not 1 to 100"};
  if (auto status = check_surface(frame.surface); !status) return status;
  if (s.shown.empty()) s.first_ns = frame.time_ns;
  const double time_s = 1e-9 * static_cast<double>(frame.time_ns - s.first_ns);
  if (!s.shown.empty() && !(time_s > s.shown.back().time_s))
    return Error{"frame " + std::to_string(frame.number) + " is not later than the one before it"};
  State::Shown shown{{}, time_s};
  if (!frame.surface.positions.empty()) {
    const auto node = add_node(s.document, frame, jpeg_quality);
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
