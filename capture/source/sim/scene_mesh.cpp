// SPDX-License-Identifier: Apache-2.0
// Any triangle mesh, turning slowly before a plane; rays by Embree.
#include <embree3/rtcore.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "capture/source/sim/mesh_file.h"
#include "capture/source/sim/scene.h"

namespace relievo::sim {
namespace {

/// The mesh scaled to fit a ball of radius 0.15 m about the origin, y down, and its ray accelerator.
class RayMesh {
 public:
  /// Null where Embree cannot start.
  static std::shared_ptr<const RayMesh> create(MeshFile mesh) {
    const RTCDevice device = rtcNewDevice("threads=1");
    if (!device) return nullptr;
    return std::shared_ptr<const RayMesh>(new RayMesh(device, std::move(mesh)));
  }
  RayMesh(const RayMesh&) = delete;
  RayMesh& operator=(const RayMesh&) = delete;
  ~RayMesh() {
    rtcReleaseScene(scene_);
    rtcReleaseDevice(device_);
  }

  static constexpr float kRadius = 0.15f;

  bool intersect(Vec3 o, Vec3 d, float limit, Hit& hit) const {
    RTCRayHit query{};
    query.ray = ray(o, d, 0, limit);
    query.hit.geomID = RTC_INVALID_GEOMETRY_ID;
    RTCIntersectContext context;
    rtcInitIntersectContext(&context);
    rtcIntersect1(scene_, &context, &query);
    if (query.hit.geomID == RTC_INVALID_GEOMETRY_ID || !(query.ray.tfar < limit)) return false;
    hit = {query.ray.tfar, query.hit.primID, query.hit.u, query.hit.v};
    return true;
  }

  bool blocked(Vec3 o, Vec3 d, float from) const {
    RTCRay query = ray(o, d, from, 1);
    RTCIntersectContext context;
    rtcInitIntersectContext(&context);
    rtcOccluded1(scene_, &context, &query);
    return query.tfar < 0;
  }

  Vec3 normal(const Hit& hit) const { return interpolate(normals_, hit); }

  Vec3 albedo(const Hit& hit) const {
    if (!mesh_.corner_texture.empty()) return textured(hit);
    if (!mesh_.colours.empty()) return interpolate(mesh_.colours, hit);
    return {0.7f, 0.7f, 0.7f};
  }

 private:
  RayMesh(RTCDevice device, MeshFile mesh) : device_(device), mesh_(std::move(mesh)) {
    fit();
    normals_.resize(mesh_.positions.size());
    for (const auto& [a, b, c] : mesh_.triangles) {
      const Vec3 n = cross(mesh_.positions[b] - mesh_.positions[a], mesh_.positions[c] - mesh_.positions[a]);
      for (const std::uint32_t v : {a, b, c}) normals_[v] = normals_[v] + n;  // weighted by area
    }
    scene_ = rtcNewScene(device_);
    rtcSetSceneFlags(scene_, RTC_SCENE_FLAG_ROBUST);  // no ray slips between neighbours
    const RTCGeometry geometry = rtcNewGeometry(device_, RTC_GEOMETRY_TYPE_TRIANGLE);
    auto* vertices = static_cast<Vec3*>(rtcSetNewGeometryBuffer(
        geometry, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3, sizeof(Vec3), mesh_.positions.size()));
    auto* triangles = static_cast<std::array<std::uint32_t, 3>*>(
        rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3,
                                3 * sizeof(std::uint32_t), mesh_.triangles.size()));
    std::copy(mesh_.positions.begin(), mesh_.positions.end(), vertices);
    std::copy(mesh_.triangles.begin(), mesh_.triangles.end(), triangles);
    rtcCommitGeometry(geometry);
    rtcAttachGeometry(scene_, geometry);
    rtcReleaseGeometry(geometry);
    rtcCommitScene(scene_);
  }

  /// Meshes come with y up and any size.
  void fit() {
    Vec3 low = mesh_.positions[0], high = low;
    for (const Vec3& p : mesh_.positions) {
      low = {std::min(low.x, p.x), std::min(low.y, p.y), std::min(low.z, p.z)};
      high = {std::max(high.x, p.x), std::max(high.y, p.y), std::max(high.z, p.z)};
    }
    const Vec3 middle = (low + high) * 0.5f;
    const float scale = kRadius / std::max(1e-20f, 0.5f * length(high - low));
    for (Vec3& p : mesh_.positions) {
      const Vec3 q = (p - middle) * scale;
      p = {q.x, -q.y, -q.z};
    }
  }

  static RTCRay ray(Vec3 o, Vec3 d, float near, float far) {
    RTCRay r{};
    r.org_x = o.x;
    r.org_y = o.y;
    r.org_z = o.z;
    r.dir_x = d.x;
    r.dir_y = d.y;
    r.dir_z = d.z;
    r.tnear = near;
    r.tfar = far;
    r.mask = ~0u;
    return r;
  }

  Vec3 interpolate(const std::vector<Vec3>& values, const Hit& hit) const {
    const auto& [a, b, c] = mesh_.triangles[hit.patch];
    return values[a] * (1 - hit.patch_u - hit.patch_v) + values[b] * hit.patch_u + values[c] * hit.patch_v;
  }

  Vec3 textured(const Hit& hit) const {
    const std::array<float, 2>* t = &mesh_.corner_texture[std::size_t{3} * hit.patch];
    const float w = 1 - hit.patch_u - hit.patch_v;
    const auto place = [&](std::size_t i) {
      const float v = t[0][i] * w + t[1][i] * hit.patch_u + t[2][i] * hit.patch_v;
      return v - std::floor(v);
    };
    const Image8& image = mesh_.texture;
    const float x = std::max(0.0f, place(0) * static_cast<float>(image.width()) - 0.5f);
    const float y = std::max(0.0f, (1 - place(1)) * static_cast<float>(image.height()) - 0.5f);
    const int x0 = std::min(static_cast<int>(x), image.width() - 1),
              y0 = std::min(static_cast<int>(y), image.height() - 1);
    const int x1 = std::min(x0 + 1, image.width() - 1), y1 = std::min(y0 + 1, image.height() - 1);
    const auto at = [&](int cx, int cy) {
      const std::uint8_t* p = image.row(cy) + 3 * cx;
      return Vec3{static_cast<float>(p[0]), static_cast<float>(p[1]), static_cast<float>(p[2])} *
             (1 / 255.0f);
    };
    const float u = x - static_cast<float>(x0), v = y - static_cast<float>(y0);
    return mix(mix(at(x0, y0), at(x1, y0), u), mix(at(x0, y1), at(x1, y1), u), v);
  }

  RTCDevice device_;
  RTCScene scene_ = nullptr;
  MeshFile mesh_;
  std::vector<Vec3> normals_;  // one a position, not unit
};

class PosedMesh final : public Shape {
 public:
  PosedMesh(const Pose& pose, std::shared_ptr<const RayMesh> mesh)
      : pose_(pose), mesh_(std::move(mesh)), origin_(pose.to_local({})) {}

  bool hit(Vec3 direction, Hit& hit) const override {
    return mesh_->intersect(origin_, pose_.rotation.back(direction), hit.depth, hit);
  }
  Material material(Vec3 direction, const Hit& hit) const override {
    Vec3 n = pose_.rotation * mesh_->normal(hit);
    const float size = length(n);
    n = size > 0 ? n * (1 / size) : Vec3{0, 0, -1};
    if (dot(n, direction) > 0) n = n * -1.0f;  // scans are often wound the other way
    return {n, mesh_->albedo(hit), 0.02f};
  }
  bool blocks(Vec3 from, Vec3 light) const override {
    const Vec3 ray = light - from;
    return mesh_->blocked(pose_.to_local(from), pose_.rotation.back(ray), 4e-4f / length(ray));
  }
  Sphere bound() const override { return {pose_.position, RayMesh::kRadius * 1.001f}; }

 private:
  Pose pose_;
  std::shared_ptr<const RayMesh> mesh_;
  Vec3 origin_;
};

class MeshScene final : public Scene {
 public:
  explicit MeshScene(std::shared_ptr<const RayMesh> mesh) : mesh_(std::move(mesh)) {}

  Shapes at(double phase, double) const override {
    const float turn = 0.45f * std::sin(2 * std::numbers::pi_v<float> * static_cast<float>(phase));
    return {make_plane({0, 0, 1.3f}, {0, 0, -1}, {.albedo = {0.62f, 0.62f, 0.60f}, .mottle = 0.04f}),
            std::make_shared<PosedMesh>(Pose{turn_y(turn), {0, 0, 1.0f}}, mesh_)};
  }

 private:
  std::shared_ptr<const RayMesh> mesh_;
};

}  // namespace

Result<std::shared_ptr<const Scene>> make_mesh_scene(const std::string& argument) {
  Result<MeshFile> mesh = read_mesh(argument);
  if (!mesh) return mesh.error();
  auto rays = RayMesh::create(*std::move(mesh));
  if (!rays) return Error{"Embree cannot start on this machine"};
  return std::shared_ptr<const Scene>(std::make_shared<MeshScene>(std::move(rays)));
}

}  // namespace relievo::sim
