// SPDX-License-Identifier: Apache-2.0
#include "codec/draco_mesh.h"

#include <draco/compression/decode.h>
#include <draco/compression/expert_encode.h>
#include <draco/mesh/mesh.h>
#include <draco/point_cloud/point_cloud.h>

#include <algorithm>
#include <cmath>
#include <exception>
#include <limits>
#include <memory>
#include <stdexcept>
#include <string>

#include "codec/draco_stream.h"
#include "codec/surface_check.h"
#include "codec/vertex_quality.h"

namespace relievo {
namespace {

constexpr std::uint32_t kDropped = std::numeric_limits<std::uint32_t>::max();
constexpr float kSmallestVolume_m = 1e-3f;  // a single point has no extent to quantise in

template <std::size_t N>
bool all_finite(const std::vector<std::array<float, N>>& values) {
  for (const auto& value : values)
    for (const float x : value)
      if (!std::isfinite(x)) return false;
  return true;
}

Volume bounding_volume(const std::vector<Vec3f>& positions) {
  Volume volume{.min = positions[0], .size_m = kSmallestVolume_m};
  Vec3f max = positions[0];
  for (const Vec3f& p : positions)
    for (std::size_t i = 0; i < 3; ++i) {
      volume.min[i] = std::min(volume.min[i], p[i]);
      max[i] = std::max(max[i], p[i]);
    }
  for (std::size_t i = 0; i < 3; ++i) volume.size_m = std::max(volume.size_m, max[i] - volume.min[i]);
  return volume;
}

bool inside(const Volume& volume, const Vec3f& p) {
  for (std::size_t i = 0; i < 3; ++i)
    if (p[i] < volume.min[i] || p[i] - volume.min[i] > volume.size_m) return false;
  return true;
}

/// What is sent of a surface: `new_index` of each old vertex (kDropped: left out).
struct Selection {
  std::vector<std::uint32_t> new_index;
  std::uint32_t vertices = 0;
  std::vector<Triangle> triangles;  // new indices
};

Selection select(const Surface& surface, const Volume& volume) {
  Selection kept;
  const std::size_t count = surface.positions.size();
  std::vector<std::uint8_t> wanted(count);
  for (std::size_t i = 0; i < count; ++i) wanted[i] = inside(volume, surface.positions[i]);
  if (!surface.triangles.empty()) {
    std::vector<std::uint8_t> used(count, 0);
    kept.triangles.reserve(surface.triangles.size());
    for (const Triangle& t : surface.triangles) {
      if (t[0] == t[1] || t[1] == t[2] || t[2] == t[0]) continue;
      if (!wanted[t[0]] || !wanted[t[1]] || !wanted[t[2]]) continue;
      used[t[0]] = used[t[1]] = used[t[2]] = 1;
      kept.triangles.push_back(t);
    }
    wanted.swap(used);
  }
  kept.new_index.assign(count, kDropped);
  for (std::size_t i = 0; i < count; ++i)
    if (wanted[i]) kept.new_index[i] = kept.vertices++;
  for (Triangle& t : kept.triangles)
    for (std::uint32_t& index : t) index = kept.new_index[index];
  return kept;
}

template <std::size_t N>
int add_attribute(draco::PointCloud& cloud, draco::GeometryAttribute::Type type,
                  const std::vector<std::array<float, N>>& values, const Selection& kept) {
  draco::GeometryAttribute layout;
  layout.Init(type, nullptr, N, draco::DT_FLOAT32, false, N * sizeof(float), 0);
  const int id = cloud.AddAttribute(layout, true, kept.vertices);
  draco::PointAttribute* attribute = cloud.attribute(id);
  for (std::size_t i = 0; i < values.size(); ++i)
    if (kept.new_index[i] != kDropped)
      attribute->SetAttributeValue(draco::AttributeValueIndex(kept.new_index[i]), values[i].data());
  return id;
}

/// On the steps that are sent, so that no rounding of Draco's can differ from that of other sections.
std::vector<Vec2f> stepped(std::vector<Vec2f> coordinates, int bits) {
  const auto largest = static_cast<float>((1 << bits) - 1);
  for (Vec2f& c : coordinates)
    for (float& x : c) x = static_cast<float>(coordinate_step(x, bits)) / largest;
  return coordinates;
}

/// Smallest stream first; where it is smaller than FORMAT.md allows (1 byte for 8 vertices or triangles, so
/// that a decoder can bound its memory by what it received) the plainer coding, which cannot be.
enum class Packing { kBest, kPlain };

/// Fills the bytes and the ids of `out`, whose volume is that of the quantisation.
Status encode(const Surface& surface, const Selection& kept, const EncodeOptions& options, Packing packing,
              EncodedGeometry& out) {
  const Volume& volume = out.volume;
  const bool is_mesh = !kept.triangles.empty();
  draco::Mesh mesh;  // is a PointCloud too
  mesh.set_num_points(kept.vertices);
  mesh.SetNumFaces(kept.triangles.size());
  for (std::size_t i = 0; i < kept.triangles.size(); ++i) {
    const Triangle& t = kept.triangles[i];
    mesh.SetFace(draco::FaceIndex(static_cast<std::uint32_t>(i)),
                 {draco::PointIndex(t[0]), draco::PointIndex(t[1]), draco::PointIndex(t[2])});
  }
  const int position = add_attribute(mesh, draco::GeometryAttribute::POSITION, surface.positions, kept);
  int coordinate = -1;
  if (!surface.texture_coordinates.empty())
    coordinate = add_attribute(mesh, draco::GeometryAttribute::TEX_COORD,
                               stepped(surface.texture_coordinates, options.texture_coordinate_bits), kept);
  int normal = -1;
  if (!surface.normals.empty() && options.normal_bits > 0)
    normal = add_attribute(mesh, draco::GeometryAttribute::NORMAL, surface.normals, kept);

  draco::PointCloud& cloud = mesh;
  draco::ExpertEncoder encoder = is_mesh ? draco::ExpertEncoder(mesh) : draco::ExpertEncoder(cloud);
  encoder.SetSpeedOptions(options.draco_speed, options.draco_speed);
  encoder.SetEncodingMethod(is_mesh ? static_cast<int>(draco::MESH_EDGEBREAKER_ENCODING)
                                    : static_cast<int>(draco::POINT_CLOUD_SEQUENTIAL_ENCODING));
  // One connectivity for all attributes: smaller, faster, and no hidden vertices for a decoder to make.
  encoder.options().SetGlobalBool("split_mesh_on_seams", true);
  if (packing == Packing::kPlain) {
    encoder.SetEncodingSubmethod(draco::MESH_EDGEBREAKER_STANDARD_ENCODING);
    if (!is_mesh) encoder.SetUseBuiltInAttributeCompression(false);
  }
  encoder.SetAttributeExplicitQuantization(position, options.position_bits, 3, volume.min.data(),
                                           volume.size_m);
  const Vec2f origin{0, 0};
  if (coordinate >= 0)
    encoder.SetAttributeExplicitQuantization(coordinate, options.texture_coordinate_bits, 2, origin.data(),
                                             1.0f);
  if (normal >= 0) encoder.SetAttributeQuantization(normal, options.normal_bits);
  // Not Draco's choice below speed 4, predictors from positions: see GuardedMesh.
  if (is_mesh && options.draco_speed < 4) {
    const auto scheme = options.draco_speed < 2 ? draco::MESH_PREDICTION_CONSTRAINED_MULTI_PARALLELOGRAM
                                                : draco::MESH_PREDICTION_PARALLELOGRAM;
    if (coordinate >= 0) encoder.SetAttributePredictionScheme(coordinate, scheme);
    if (normal >= 0) encoder.SetAttributePredictionScheme(normal, draco::PREDICTION_DIFFERENCE);
  }

  draco::EncoderBuffer buffer;
  const draco::Status status = encoder.EncodeToBuffer(&buffer);
  if (!status.ok()) return Error{"Draco cannot encode this surface: " + status.error_msg_string()};
  out.bytes.assign(buffer.data(), buffer.data() + buffer.size());
  out.position_id = position;
  out.coordinate_id = coordinate;
  out.normal_id = normal;
  return {};
}

std::string is_not(const DracoCounts& found, std::uint32_t vertices, std::uint32_t triangles) {
  return "geometry holds " + std::to_string(found.vertices) + " vertices and " +
         std::to_string(found.triangles) + " triangles, but the frame declares " + std::to_string(vertices) +
         " and " + std::to_string(triangles);
}

/// Draco makes room for whatever attributes a stream declares, up to 255 components each and as many as it
/// likes. It tells the mesh first: the only place to refuse. Positions are filed as a generic attribute, so
/// that predictors which start from positions do not find them: the one for texture coordinates works through
/// up to 2^31 flags that a stream of a few bytes can declare. encode() does not use those.
class GuardedMesh final : public draco::Mesh {
 public:
  void SetAttribute(int id, std::unique_ptr<draco::PointAttribute> attribute) override {
    const auto type = attribute->attribute_type();
    const int components = type == draco::GeometryAttribute::TEX_COORD ? 2 : 3;
    int* known = type == draco::GeometryAttribute::POSITION    ? &position_id
                 : type == draco::GeometryAttribute::TEX_COORD ? &coordinate_id
                 : type == draco::GeometryAttribute::NORMAL    ? &normal_id
                                                               : nullptr;
    if (known == nullptr || *known >= 0 || attribute->num_components() != components ||
        attribute->data_type() != draco::DT_FLOAT32)
      throw std::runtime_error("an attribute that the format does not allow");
    *known = id;
    if (known == &position_id) attribute->set_attribute_type(draco::GeometryAttribute::GENERIC);
    draco::Mesh::SetAttribute(id, std::move(attribute));
  }

  int position_id = -1;  // -1: not there
  int coordinate_id = -1;
  int normal_id = -1;
};

template <std::size_t N>
Status read_attribute(const draco::PointCloud& cloud, int id, std::vector<std::array<float, N>>& values) {
  if (id < 0) return {};
  const draco::PointAttribute* attribute = cloud.attribute(id);
  values.resize(cloud.num_points());
  for (std::uint32_t i = 0; i < cloud.num_points(); ++i) {
    const draco::AttributeValueIndex at = attribute->mapped_index(draco::PointIndex(i));
    if (at.value() >= attribute->size()) return Error{"geometry refers to a value that it does not hold"};
    attribute->GetValue(at, &values[i]);
  }
  if (!all_finite(values)) return Error{"geometry holds a value that is not finite"};
  return {};
}

Result<Surface> to_surface(const GuardedMesh& mesh, std::uint32_t vertices, std::uint32_t triangles) {
  const DracoCounts found{mesh.num_points(), mesh.num_faces()};
  if (found.vertices != vertices || found.triangles != triangles)
    return Error{is_not(found, vertices, triangles)};
  Surface surface;
  if (auto s = read_attribute(mesh, mesh.position_id, surface.positions); !s) return s.error();
  if (auto s = read_attribute(mesh, mesh.normal_id, surface.normals); !s) return s.error();
  if (auto s = read_attribute(mesh, mesh.coordinate_id, surface.texture_coordinates); !s) return s.error();
  if (surface.positions.empty()) return Error{"geometry holds no positions"};
  surface.triangles.resize(triangles);
  for (std::uint32_t i = 0; i < triangles; ++i) {
    const draco::Mesh::Face& face = mesh.face(draco::FaceIndex(i));
    for (std::size_t k = 0; k < 3; ++k) {
      if (face[k].value() >= vertices) return Error{"geometry has a triangle on a vertex it does not hold"};
      surface.triangles[i][k] = face[k].value();
    }
  }
  return surface;
}

}  // namespace

Result<EncodedGeometry> encode_draco(const Surface& surface, const EncodeOptions& options) {
  if (auto status = check_surface(surface); !status) return status.error();
  EncodedGeometry encoded;
  encoded.volume = options.volume;
  if (surface.positions.empty()) return encoded;
  if (encoded.volume.size_m == 0) encoded.volume = bounding_volume(surface.positions);
  const Selection kept = select(surface, encoded.volume);
  if (kept.vertices == 0) return encoded;
  encoded.sent.reserve(kept.vertices);
  for (std::uint32_t v = 0; v < kept.new_index.size(); ++v)
    if (kept.new_index[v] != kDropped) encoded.sent.push_back(v);
  try {
    for (const Packing packing : {Packing::kBest, Packing::kPlain}) {
      if (auto status = encode(surface, kept, options, packing, encoded); !status) return status.error();
      const auto counts = allowed_draco_counts(encoded.bytes);
      if (!counts) return counts.error().in("what Draco encoded cannot be sent");
      encoded.vertices = counts->vertices;
      encoded.triangles = counts->triangles;
      const std::uint64_t items = encoded.triangles > 0 ? encoded.triangles : encoded.vertices;
      if (items <= 8 * static_cast<std::uint64_t>(encoded.bytes.size())) break;
    }
  } catch (const std::exception& e) {
    return Error{std::string("Draco cannot encode this surface: ") + e.what()};
  }
  return encoded;
}

Result<Surface> decode_draco(std::span<const std::uint8_t> bytes, std::uint32_t vertices,
                             std::uint32_t triangles) {
  const auto declared = allowed_draco_counts(bytes);
  if (!declared) return declared.error();
  if (declared->vertices != vertices || declared->triangles != triangles)
    return Error{is_not(*declared, vertices, triangles)};
  try {
    draco::DecoderBuffer buffer;
    buffer.Init(reinterpret_cast<const char*>(bytes.data()), bytes.size());
    GuardedMesh mesh;
    draco::Decoder decoder;  // one a buffer: a decoder cannot be used again
    const draco::Status status =
        triangles > 0 ? decoder.DecodeBufferToGeometry(&buffer, &mesh)
                      : decoder.DecodeBufferToGeometry(&buffer, static_cast<draco::PointCloud*>(&mesh));
    if (!status.ok()) return Error{"geometry cannot be decoded: " + status.error_msg_string()};
    return to_surface(mesh, vertices, triangles);
  } catch (const std::exception& e) {
    return Error{std::string("geometry cannot be decoded: ") + e.what()};
  }
}

}  // namespace relievo
