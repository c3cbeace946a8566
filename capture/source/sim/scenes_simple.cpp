// SPDX-License-Identifier: Apache-2.0
// The scenes made of plain shapes: a tilted plane, a vase with a cube (paper figure 11), a walker (figure
// 13).
#include <cmath>
#include <numbers>

#include "capture/source/sim/cylinder_map.h"
#include "capture/source/sim/scene.h"

namespace relievo::sim {
namespace {

constexpr float kPi = std::numbers::pi_v<float>;

class PlaneScene final : public Scene {
 public:
  Shapes at(double, double) const override {
    // Tilted about both axes, so that depth differs in every pixel.
    return {make_plane({0, 0, 1.0f}, unit({0.2f, -0.1f, -1.0f}), {.albedo = {0.8f, 0.8f, 0.8f}})};
  }
};

class ObjectScene final : public Scene {
 public:
  ObjectScene() : vase_(make_vase()) {}

  Shapes at(double phase, double) const override {
    const float turn = 0.35f * std::sin(2 * kPi * static_cast<float>(phase));
    const Pose vase{turn_y(turn), {-0.09f, 0.0f, 0.98f}};
    const Pose cube{turn_y(0.5f), {0.12f, 0.078f, 0.95f}};
    return {make_plane({0, 0, 1.25f}, {0, 0, -1}, {.albedo = {0.66f, 0.65f, 0.62f}, .mottle = 0.05f}),
            make_cylinder_map(vase, vase_),
            make_box(cube, {0.05f, 0.05f, 0.05f},
                     {.albedo = {0.62f, 0.34f, 0.27f}, .mottle = 0.12f, .grain_m = 0.012f})};
  }

 private:
  static std::shared_ptr<const CylinderMap> make_vase() {
    auto map = std::make_shared<CylinderMap>();
    map->angle_limit = 3.1f;
    map->top_m = -0.15f;
    map->bottom_m = 0.128f;
    map->gloss = 0.06f;
    map->resize(720, 400);
    for (int row = 0; row < map->rows; ++row) {
      const float y = map->height(row);
      const float v = (y - map->top_m) / (map->bottom_m - map->top_m);  // 0 rim .. 1 foot
      const float belly = 0.082f * std::exp(-std::pow((v - 0.62f) / 0.27f, 2.0f));
      const float rim = 0.022f * std::exp(-std::pow(v / 0.09f, 2.0f));
      const float profile = 0.030f + belly + rim - 0.012f * smoothstep(0.9f, 1.0f, v);
      for (int column = 0; column < map->columns; ++column) {
        const float a = map->angle(column);
        const float waist = std::exp(-std::pow((v - 0.6f) / 0.3f, 2.0f));
        const float lobes = 0.0035f * waist * std::cos(7 * a + 5 * v);
        map->radius_m[map->at(column, row)] = profile + lobes;
        const Vec3 clay{0.70f, 0.64f, 0.52f}, glaze{0.30f, 0.46f, 0.58f};
        const float band = smoothstep(-0.2f, 0.2f, std::sin(40 * v)) * smoothstep(0.34f, 0.40f, v) *
                           (1 - smoothstep(0.84f, 0.9f, v));
        const float grain = smooth_noise(a * 30, v * 60) * 0.05f;
        map->albedo[map->at(column, row)] = mix(clay, glaze, 0.75f * band) * (1 + grain);
      }
    }
    return map;
  }

  std::shared_ptr<const CylinderMap> vase_;
};

/// A person of balls and swept balls, 1.75 m, who walks to and fro at up to 1 m/s.
class WalkScene final : public Scene {
 public:
  SceneView view() const override {
    return {.distance_m = 3.0, .camera_f_px = 780, .projector_f_px = 1110, .baseline_m = 0.5};
  }

  Shapes at(double phase, double period_s) const override {
    const float a = 2 * kPi * static_cast<float>(phase);
    const float reach = static_cast<float>(1.0 * period_s) / (2 * kPi);  // metres: the speed peaks at 1 m/s
    const float x = reach * std::sin(a);
    // Faces where it goes; turns by way of facing the camera.
    const float heading = -0.5f * kPi * std::tanh(2.5f * std::cos(a));
    const float gait = 2 * a;  // two strides a pass, the feet nearly at rest on the ground
    const float bob = 0.015f * std::cos(2 * gait);
    const Mat3 turn = turn_y(heading);
    const Vec3 hip{x, 0.03f + bob, 2.95f};
    // Body frame: -z is forward, x the body's left as the camera sees it head on, y down.
    const auto body = [&](float bx, float by, float bz) { return hip + turn * Vec3{bx, by, bz}; };

    const Paint shirt{.albedo = {0.62f, 0.42f, 0.34f}, .mottle = 0.10f, .grain_m = 0.03f};
    const Paint trousers{.albedo = {0.36f, 0.42f, 0.55f}, .mottle = 0.08f, .grain_m = 0.02f};
    const Paint skin{.albedo = {0.76f, 0.58f, 0.48f}, .mottle = 0.03f, .grain_m = 0.02f, .gloss = 0.03f};
    const Paint hair{.albedo = {0.34f, 0.25f, 0.18f}, .mottle = 0.2f, .grain_m = 0.008f};
    const Paint shoe{.albedo = {0.40f, 0.36f, 0.32f}};

    Shapes out{make_plane({0, 0, 3.7f}, {0, 0, -1},
                          {.albedo = {0.68f, 0.67f, 0.64f}, .mottle = 0.04f, .grain_m = 0.1f})};
    const auto limb = [&](Vec3 from, Vec3 to, float radius, const Paint& paint) {
      out.push_back(make_capsule(from, to, radius, paint));
    };
    const auto ball = [&](Vec3 centre, Vec3 half, const Paint& paint) {
      out.push_back(make_ellipsoid({turn, centre}, half, paint));
    };
    ball(body(0, -0.02f, 0), {0.165f, 0.13f, 0.12f}, trousers);
    ball(body(0, -0.27f, 0.005f), {0.165f, 0.27f, 0.115f}, shirt);
    ball(body(0, -0.40f, 0), {0.20f, 0.13f, 0.115f}, shirt);
    limb(body(0, -0.50f, 0), body(0, -0.60f, -0.01f), 0.055f, skin);
    ball(body(0, -0.70f, -0.015f), {0.076f, 0.115f, 0.098f}, skin);
    ball(body(0, -0.735f, 0.008f), {0.083f, 0.095f, 0.103f}, hair);
    ball(body(0, -0.69f, -0.113f), {0.013f, 0.022f, 0.018f}, skin);
    for (const float side : {-1.0f, 1.0f}) {
      const float swing = 0.45f * std::sin(gait) * side;  // positive: this leg is forward
      const float knee_bend = 0.35f + 0.35f * std::cos(gait * 1.0f + (side > 0 ? 0.0f : kPi));
      const Vec3 hip_joint = body(side * 0.09f, 0.02f, 0);
      const Vec3 knee = hip_joint + turn * Vec3{0, 0.42f * std::cos(swing), -0.42f * std::sin(swing)};
      const float shin_angle = swing - knee_bend;
      const Vec3 ankle = knee + turn * Vec3{0, 0.42f * std::cos(shin_angle), -0.42f * std::sin(shin_angle)};
      limb(hip_joint, knee, 0.078f, trousers);
      limb(knee, ankle, 0.055f, trousers);
      limb(ankle + Vec3{0, 0.03f, 0}, ankle + turn * Vec3{0, 0.045f, -0.15f}, 0.04f, shoe);
      const float arm = -0.40f * std::sin(gait) * side;
      const Vec3 shoulder = body(side * 0.205f, -0.45f, 0);
      const Vec3 elbow = shoulder + turn * Vec3{side * 0.04f, 0.29f * std::cos(arm), -0.29f * std::sin(arm)};
      const Vec3 wrist =
          elbow + turn * Vec3{0, 0.26f * std::cos(arm + 0.35f), -0.26f * std::sin(arm + 0.35f)};
      limb(shoulder, elbow, 0.05f, shirt);
      limb(elbow, wrist, 0.04f, skin);
      ball(wrist + turn * Vec3{0, 0.05f, -0.01f}, {0.03f, 0.06f, 0.045f}, skin);
    }
    return out;
  }
};

}  // namespace

Result<std::shared_ptr<const Scene>> make_plane_scene(const std::string&) {
  return std::shared_ptr<const Scene>(std::make_shared<PlaneScene>());
}
Result<std::shared_ptr<const Scene>> make_object_scene(const std::string&) {
  return std::shared_ptr<const Scene>(std::make_shared<ObjectScene>());
}
Result<std::shared_ptr<const Scene>> make_walk_scene(const std::string&) {
  return std::shared_ptr<const Scene>(std::make_shared<WalkScene>());
}

}  // namespace relievo::sim
