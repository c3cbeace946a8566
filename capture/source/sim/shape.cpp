// SPDX-License-Identifier: Apache-2.0
#include "capture/source/sim/shape.h"

#include <algorithm>
#include <array>
#include <cstdint>

namespace relievo::sim {
namespace {

constexpr float kSkin = 2e-4f;  // metres a shadow ray starts off its own surface

std::uint32_t hash(std::uint32_t x, std::uint32_t y) {
  std::uint32_t h = x * 0x9E3779B1u ^ (y + 0x7F4A7C15u) * 0x85EBCA77u;
  h ^= h >> 15;
  h *= 0x2C1B3C6Du;
  h ^= h >> 13;
  return h;
}

class Plane final : public Shape {
 public:
  Plane(Vec3 point, Vec3 normal, const Paint& paint)
      : normal_(normal), offset_(dot(point, normal)), paint_(paint) {
    across_ = unit(cross(normal, std::abs(normal.y) > 0.9f ? Vec3{1, 0, 0} : Vec3{0, 1, 0}));
    down_ = cross(across_, normal);
  }

  bool hit(Vec3 direction, Hit& hit) const override {
    const float depth = offset_ / dot(normal_, direction);
    if (!(depth > 0 && depth < hit.depth)) return false;
    hit.depth = depth;
    return true;
  }
  Material material(Vec3 direction, const Hit& hit) const override {
    const Vec3 p = direction * hit.depth;
    return {normal_, paint_.at({dot(p, across_), dot(p, down_), 0}), paint_.gloss};
  }
  bool blocks(Vec3 from, Vec3 light) const override {
    const float a = dot(normal_, from) - offset_, b = dot(normal_, light) - offset_;
    return a * b < 0 && std::abs(a) > kSkin;
  }

 private:
  Vec3 normal_;
  float offset_;
  Paint paint_;
  Vec3 across_, down_;
};

class Ellipsoid final : public Shape {
 public:
  Ellipsoid(const Pose& pose, Vec3 half, const Paint& paint) : pose_(pose), half_(half), paint_(paint) {}

  bool hit(Vec3 direction, Hit& hit) const override {
    float t;
    if (!first(scaled(pose_.to_local({})), scaled(pose_.rotation.back(direction)), t)) return false;
    if (!(t < hit.depth)) return false;
    hit.depth = t;
    return true;
  }
  Material material(Vec3 direction, const Hit& hit) const override {
    const Vec3 p = pose_.to_local(direction * hit.depth);
    const Vec3 n{p.x / (half_.x * half_.x), p.y / (half_.y * half_.y), p.z / (half_.z * half_.z)};
    return {unit(pose_.rotation * n), paint_.at(p), paint_.gloss};
  }
  bool blocks(Vec3 from, Vec3 light) const override {
    const Vec3 ray = light - from;
    float t;
    const Vec3 o = scaled(pose_.to_local(from + ray * (kSkin / length(ray)))),
               d = scaled(pose_.rotation.back(ray));
    if (dot(o, o) < 1) return dot(o, d) < 0;  // starts inside its own surface by rounding
    return first(o, d, t) && t < 1;
  }
  Sphere bound() const override { return {pose_.position, std::max({half_.x, half_.y, half_.z})}; }

 private:
  Vec3 scaled(Vec3 v) const { return {v.x / half_.x, v.y / half_.y, v.z / half_.z}; }

  /// First crossing t > 0 of the unit sphere from outside.
  static bool first(Vec3 o, Vec3 d, float& t) {
    const float a = dot(d, d), b = dot(o, d), c = dot(o, o) - 1;
    if (b >= 0) return false;
    const Vec3 nearest = o - d * (b / a);  // avoids the cancellation of b*b - a*c
    const float discriminant = 1 - dot(nearest, nearest);
    if (discriminant <= 0) return false;
    t = c / (-b + std::sqrt(a * discriminant));
    return t > 0;
  }

  Pose pose_;
  Vec3 half_;
  Paint paint_;
};

class Box final : public Shape {
 public:
  Box(const Pose& pose, Vec3 half, const Paint& paint) : pose_(pose), half_(half), paint_(paint) {}

  bool hit(Vec3 direction, Hit& hit) const override {
    float t, exit;
    unsigned face;
    if (!slabs(pose_.to_local({}), pose_.rotation.back(direction), t, exit, face)) return false;
    if (!(t > 0 && t < hit.depth)) return false;
    hit.depth = t;
    hit.patch = face;
    return true;
  }
  Material material(Vec3 direction, const Hit& hit) const override {
    const Vec3 p = pose_.to_local(direction * hit.depth);
    const Vec3 normals[3] = {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
    const Vec3 d = pose_.rotation.back(direction);
    const float along[3] = {d.x, d.y, d.z};
    const Vec3 n = normals[hit.patch] * (along[hit.patch] > 0 ? -1.0f : 1.0f);
    // Faces share no axis with the noise plane, so that none is streaked.
    return {pose_.rotation * n, paint_.at({p.x + 0.7f * p.z, p.y + 0.6f * p.z, 0}), paint_.gloss};
  }
  bool blocks(Vec3 from, Vec3 light) const override {
    const Vec3 ray = light - from;
    float t, exit;
    unsigned face;
    if (!slabs(pose_.to_local(from), pose_.rotation.back(ray), t, exit, face)) return false;
    return exit * length(ray) > kSkin && t < 1;
  }
  Sphere bound() const override { return {pose_.position, length(half_)}; }

 private:
  bool slabs(Vec3 o, Vec3 d, float& enter, float& exit, unsigned& face) const {
    enter = -std::numeric_limits<float>::infinity();
    exit = std::numeric_limits<float>::infinity();
    face = 0;
    const float os[3] = {o.x, o.y, o.z}, ds[3] = {d.x, d.y, d.z}, hs[3] = {half_.x, half_.y, half_.z};
    for (unsigned i = 0; i < 3; ++i) {
      const float near = (-std::copysign(hs[i], ds[i]) - os[i]) / ds[i];
      const float far = (std::copysign(hs[i], ds[i]) - os[i]) / ds[i];
      if (near > enter) {
        enter = near;
        face = i;
      }
      exit = std::min(exit, far);
    }
    return enter < exit && exit > 0;
  }

  Pose pose_;
  Vec3 half_;
  Paint paint_;
};

class Capsule final : public Shape {
 public:
  Capsule(Vec3 a, Vec3 b, float radius, const Paint& paint)
      : a_(a), axis_(b - a), axis_2_(dot(axis_, axis_)), radius_(radius), paint_(paint) {}

  bool hit(Vec3 direction, Hit& hit) const override {
    float t;
    if (!first({}, direction, t) || !(t < hit.depth)) return false;
    hit.depth = t;
    return true;
  }
  Material material(Vec3 direction, const Hit& hit) const override {
    const Vec3 p = direction * hit.depth - a_;
    const float along = clamp01(dot(p, axis_) / axis_2_);
    const Vec3 n = unit(p - axis_ * along);
    return {n, paint_.at({std::atan2(n.x, -n.z) * radius_, along * std::sqrt(axis_2_), 0}), paint_.gloss};
  }
  bool blocks(Vec3 from, Vec3 light) const override {
    const Vec3 ray = light - from;
    const Vec3 start = from + ray * (kSkin / length(ray));
    const Vec3 p = start - a_;
    const Vec3 off = p - axis_ * clamp01(dot(p, axis_) / axis_2_);
    if (dot(off, off) < radius_ * radius_) return dot(off, ray) < 0;
    float t;
    return first(start, ray, t) && t < 1;
  }
  Sphere bound() const override { return {a_ + axis_ * 0.5f, 0.5f * std::sqrt(axis_2_) + radius_}; }

 private:
  bool first(Vec3 o, Vec3 d, float& t) const {
    const Vec3 oa = o - a_;
    const float bd = dot(axis_, d), bo = dot(axis_, oa), dd = dot(d, d), od = dot(oa, d);
    const float qa = axis_2_ * dd - bd * bd, qb = axis_2_ * od - bo * bd;
    const float qc = axis_2_ * dot(oa, oa) - bo * bo - radius_ * radius_ * axis_2_;
    const float h = qb * qb - qa * qc;
    if (h < 0) return false;
    const float side = (-qb - std::sqrt(h)) / qa;
    const float y = bo + side * bd;
    if (y > 0 && y < axis_2_) {
      t = side;
      return t > 0;
    }
    const Vec3 oc = y <= 0 ? oa : oa - axis_;  // the round end
    const float b = dot(d, oc), c = dot(oc, oc) - radius_ * radius_, h2 = b * b - dd * c;
    if (h2 < 0) return false;
    t = (-b - std::sqrt(h2)) / dd;
    return t > 0;
  }

  Vec3 a_, axis_;
  float axis_2_, radius_;
  Paint paint_;
};

}  // namespace

float smooth_noise(float x, float y) {
  static const auto lattice = [] {
    std::array<float, 256 * 256> out{};
    for (std::uint32_t i = 0; i < out.size(); ++i) {
      out[i] = static_cast<float>(hash(i & 255, i >> 8) & 0xFFFF) / 32767.5f - 1;
    }
    return out;
  }();
  const int floor_x = floor_int(x), floor_y = floor_int(y);
  const auto ix = static_cast<unsigned>(floor_x), iy = static_cast<unsigned>(floor_y);
  const auto at = [&](unsigned dx, unsigned dy) {
    return lattice[((iy + dy) & 255) * 256 + ((ix + dx) & 255)];
  };
  float u = x - static_cast<float>(floor_x), v = y - static_cast<float>(floor_y);
  u = u * u * (3 - 2 * u);
  v = v * v * (3 - 2 * v);
  const float top = at(0, 0) + (at(1, 0) - at(0, 0)) * u, low = at(0, 1) + (at(1, 1) - at(0, 1)) * u;
  return top + (low - top) * v;
}

Vec3 Paint::at(Vec3 local) const {
  if (mottle == 0) return albedo;
  const float x = local.x / grain_m, y = local.y / grain_m;
  return albedo *
         (1 + mottle * (0.6f * smooth_noise(x, y) + 0.4f * smooth_noise(2.3f * x + 17, 2.3f * y + 5)));
}

std::shared_ptr<const Shape> make_plane(Vec3 point, Vec3 normal, const Paint& paint) {
  return std::make_shared<Plane>(point, normal, paint);
}
std::shared_ptr<const Shape> make_ellipsoid(const Pose& pose, Vec3 half, const Paint& paint) {
  return std::make_shared<Ellipsoid>(pose, half, paint);
}
std::shared_ptr<const Shape> make_box(const Pose& pose, Vec3 half, const Paint& paint) {
  return std::make_shared<Box>(pose, half, paint);
}
std::shared_ptr<const Shape> make_capsule(Vec3 a, Vec3 b, float radius, const Paint& paint) {
  return std::make_shared<Capsule>(a, b, radius, paint);
}

}  // namespace relievo::sim
