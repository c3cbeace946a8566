// SPDX-License-Identifier: Apache-2.0
// A speaking head with shoulders before a wall (paper figure 12): what the demo shows.
#include <cmath>
#include <numbers>

#include "capture/source/sim/head_sculpt.h"
#include "capture/source/sim/scene.h"

namespace relievo::sim {
namespace {

class FaceScene final : public Scene {
 public:
  Shapes at(double phase, double) const override {
    // Whole turns of the period only, so that it repeats; sums of a few, so that it does not look so.
    const float a = 2 * std::numbers::pi_v<float> * static_cast<float>(phase);
    const auto wave = [a](float turns, float shift) { return std::sin(turns * a + shift); };
    Expression e;
    const float speaking = smoothstep(-0.75f, -0.1f, std::cos(a + 0.7f));  // with one pause a period
    e.jaw =
        speaking * clamp01(0.36f + 0.34f * wave(9, 0.4f) + 0.24f * wave(13, 1.7f) + 0.14f * wave(5, 2.6f));
    e.round = speaking * clamp01(0.35f + 0.5f * wave(6, 1.1f) + 0.25f * wave(11, 0.2f));
    e.smile = clamp01(0.9f * (1 - speaking) + 0.15f);
    e.blink = std::exp(-std::pow((std::fmod(static_cast<float>(phase) + 0.22f, 1.0f) - 0.5f) / 0.022f, 2.0f));
    e.brow = clamp01(0.45f + 0.5f * wave(2, 0.9f) + 0.2f * wave(5, 0.3f));
    const float yaw = 0.24f * wave(1, 0.0f) + 0.07f * wave(2, 1.3f) + 0.012f * wave(5, 0.5f);
    const float pitch = 0.05f * wave(1, 0.6f) + 0.035f * wave(3, 0.2f) + 0.012f * wave(7, 1.0f);
    const float roll = 0.035f * wave(1, 2.0f) + 0.015f * wave(3, 1.1f);
    e.gaze_x = std::fmin(1.0f, std::fmax(-1.0f, 1.6f * yaw));  // eyes stay on the camera
    e.gaze_y = -1.2f * pitch;

    const Mat3 turn = turn_y(yaw) * turn_x(pitch) * turn_z(roll);
    const Vec3 neck{0.0f, 0.140f, 1.055f};  // the head turns about the top of the neck
    const Pose head{turn,
                    neck + turn * Vec3{0, -0.125f, 0} + Vec3{0.006f * wave(1, 0.4f), 0.002f * wave(4, 0), 0}};
    const float breath = 0.0020f * wave(1, 1.5f);
    const Pose bust{turn_y(0.1f * yaw), {0, 0.015f - breath, 1.068f - breath}};
    return {make_plane({0, 0, 1.42f}, {0, 0, -1},
                       {.albedo = {0.66f, 0.67f, 0.69f}, .mottle = 0.03f, .grain_m = 0.03f}),
            make_cylinder_map(head, sculpt_.at(e)), make_cylinder_map(bust, bust_)};
  }

 private:
  HeadSculpt sculpt_;
  std::shared_ptr<const CylinderMap> bust_ = make_bust();
};

}  // namespace

Result<std::shared_ptr<const Scene>> make_face_scene(const std::string&) {
  return std::shared_ptr<const Scene>(std::make_shared<FaceScene>());
}

}  // namespace relievo::sim
