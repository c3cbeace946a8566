// SPDX-License-Identifier: Apache-2.0
// A plane under a striped projector, drawn exactly: stripes integrated over each pixel, no noise, no lens
// distortion. Small enough that a test can afford a whole take of it. Independent of the simulator.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <string>

#include "base/pattern.h"
#include "base/rig.h"
#include "capture/pattern/bcsl.h"
#include "capture/pattern/schedule.h"
#include "capture/source/field_source.h"
#include "capture/source/npy.h"
#include "capture/source/take_files.h"

namespace relievo::test {

/// The plane z = depth_m + slope * x, in the camera's frame.
struct StripedScene {
  Rig rig;
  Pattern pattern;
  double depth_m = 1;
  double slope = 0.2;
  double blur_px = 1.5;    // width of the box a stripe's edge is blurred with
  double ambient = 10;     // grey levels
  double reflected = 190;  // grey levels of white

  /// Metres along the camera's z axis of the plane at normalised image column x/z.
  double depth(double x) const { return depth_m / (1 - slope * x); }

  /// The projector's column lit at this camera column (the plane and the rig do not vary with the row).
  double projector_column(double camera_column) const {
    const double x = (camera_column - rig.camera.cx()) / rig.camera.fx();
    const double z = depth(x);
    const double across = x * z + rig.projector_from_camera_translation[0];
    return rig.projector.fx() * across / z + rig.projector.cx();
  }

  /// Where the camera sees a boundary of the pattern.
  double camera_column(int boundary) const {
    const double target = pattern.boundary_column_px(boundary, rig.projector.width);
    double low = -1000;
    double high = 2000;
    for (int i = 0; i < 60; ++i) {
      const double middle = 0.5 * (low + high);
      (projector_column(middle) < target ? low : high) = middle;
    }
    return low;
  }
};

/// 160x120 camera, 256x192 projector beside it, 16 stripes of (6,2)-BCSL.
inline StripedScene striped_scene(Scan scan = Scan::kInterlaced) {
  StripedScene scene;
  Rig& rig = scene.rig;
  rig.scan = scan;
  rig.frame_rate = 29.97;
  rig.camera = {160, 120, {200, 0, 79.5, 0, 200, 59.5, 0, 0, 1}, {}};
  rig.projector = {256, 192, {300, 0, 187.5, 0, 300, 95.5, 0, 0, 1}, {}};
  rig.projector_from_camera_rotation = {1, 0, 0, 0, 1, 0, 0, 0, 1};
  rig.projector_from_camera_translation = {-0.2, 0, 0};
  rig.colour_matrix = {1, 0, 0, 0, 1, 0, 0, 0, 1};
  scene.pattern = *make_pattern(6, 2, 3, 16);
  return scene;
}

/// How bright each channel of the slide is, 0..1, seen at one camera column.
inline std::array<double, 3> stripe_light(const StripedScene& scene, int slide, double camera_column) {
  const double per_column = scene.pattern.stripes() / static_cast<double>(scene.rig.projector.width);
  const double a = (scene.projector_column(camera_column - 0.5 * scene.blur_px) + 0.5) * per_column;
  const double b = (scene.projector_column(camera_column + 0.5 * scene.blur_px) + 0.5) * per_column;
  std::array<double, 3> light{};
  for (int s = 0; s < scene.pattern.stripes(); ++s) {
    const double share = (std::min(b, s + 1.0) - std::max(a, static_cast<double>(s))) / (b - a);
    if (share <= 0) continue;
    const Primary colour = scene.pattern.colour(s, slide);
    for (std::size_t c = 0; c < 3; ++c) light[c] += (colour >> c & 1) * share;
  }
  return light;
}

/// One field, camera size.
inline Image8 draw_field(const StripedScene& scene, int slide, bool complement) {
  Image8 picture(scene.rig.camera.width, scene.rig.camera.height, 3);
  for (int x = 0; x < picture.width(); ++x) {
    const auto light = stripe_light(scene, slide, x);
    const double stripes = scene.pattern.stripes();
    const double place = (scene.projector_column(x) + 0.5) / scene.rig.projector.width * stripes;
    const bool lit = place >= 0 && place < stripes;
    for (int c = 0; c < 3; ++c) {
      const double own = light[static_cast<std::size_t>(c)];
      const double value = scene.ambient + scene.reflected * (!lit ? 0 : complement ? 1 - own : own);
      for (int y = 0; y < picture.height(); ++y)
        picture.row(y)[3 * x + c] = static_cast<std::uint8_t>(std::lround(std::clamp(value, 0.0, 255.0)));
    }
  }
  return picture;
}

/// One field under what a scheme shows.
inline Image8 draw_field(const StripedScene& scene, const Exposure& exposure) {
  if (exposure.light != Light::kWhite)
    return draw_field(scene, exposure.slide, exposure.light == Light::kComplement);
  Image8 slide = draw_field(scene, 0, false);
  const Image8 complement = draw_field(scene, 0, true);
  const int ambient = static_cast<int>(std::lround(scene.ambient));
  for (std::size_t i = 0; i < slide.size(); ++i) {
    slide.data()[i] =
        static_cast<std::uint8_t>(std::min(255, slide.data()[i] + complement.data()[i] - ambient));
  }
  return slide;
}

/// Camera frame `number`, counted with the lost ones, under the pattern's scheme and the rig's field order.
inline CapturedFrame draw_scheme_frame(const StripedScene& scene, std::uint64_t number) {
  CapturedFrame frame;
  frame.number = number;
  frame.time_ns = std::llround(static_cast<double>(number) * 1e9 / scene.rig.frame_rate);
  frame.scan = scene.rig.scan;
  frame.field_order = scene.rig.field_order;
  frame.picture = draw_field(scene, shown(scene.pattern, number, 0));
  Image8 second = draw_field(scene, shown(scene.pattern, number, 1));
  if (frame.scan == Scan::kProgressive) {
    frame.complement = std::move(second);
  } else {
    for (int y = first_row(frame.field_order, 1); y < frame.picture.height(); y += 2)
      std::copy_n(second.row(y), second.stride(), frame.picture.row(y));
  }
  return frame;
}

/// Camera frame `number` under `slide` (0 or 1).
inline CapturedFrame draw_frame(const StripedScene& scene, std::uint64_t number, int slide) {
  CapturedFrame frame;
  frame.number = number;
  frame.time_ns = std::llround(static_cast<double>(number) * 1e9 / scene.rig.frame_rate);
  frame.scan = scene.rig.scan;
  frame.picture = draw_field(scene, slide, false);
  Image8 complement = draw_field(scene, slide, true);
  if (frame.scan == Scan::kProgressive) {
    frame.complement = std::move(complement);
  } else {
    for (int y = 1; y < frame.picture.height(); y += 2)
      std::copy_n(complement.row(y), complement.stride(), frame.picture.row(y));
  }
  return frame;
}

/// Slides alternate: 1, 2, 1, ...
inline CapturedFrame draw_frame(const StripedScene& scene, std::uint64_t number) {
  return draw_frame(scene, number, static_cast<int>(number % 2));
}

/// Depth as a take's truth has it.
inline ImageF draw_truth(const StripedScene& scene) {
  const PinholeModel& camera = scene.rig.camera;
  ImageF truth(camera.width, camera.height, 1);
  for (int y = 0; y < camera.height; ++y)
    for (int x = 0; x < camera.width; ++x)
      truth.row(y)[x] = static_cast<float>(scene.depth((x - camera.cx()) / camera.fx()));
  return truth;
}

/// A take of `frames` frames with truth. False where the disk does not take it.
inline bool write_striped_take(const StripedScene& scene, const std::filesystem::path& take, int frames) {
  std::filesystem::create_directories(take / "frames");
  std::filesystem::create_directories(take / "truth");
  std::ofstream(take / "rig.yaml") << to_yaml(scene.rig);
  std::ofstream(take / "pattern.yaml") << to_yaml(scene.pattern);
  std::ofstream stamps(take / "timestamps.csv");
  stamps << "frame,time_s\n";
  const ImageF truth = draw_truth(scene);
  bool ok = true;
  for (int t = 0; t < frames; ++t) {
    const auto number = static_cast<std::uint64_t>(t);
    stamps << t << "," << std::to_string(t / scene.rig.frame_rate) << "\n";
    const CapturedFrame frame = draw_frame(scene, number);
    if (scene.rig.scan == Scan::kProgressive) {
      ok = ok && write_picture(take_picture(take, 2 * number), frame.picture).ok() &&
           write_picture(take_picture(take, 2 * number + 1), frame.complement).ok();
    } else {
      ok = ok && write_picture(take_picture(take, number), frame.picture).ok();
    }
    ok = ok && write_npy(take_truth(take, number), truth).ok();
  }
  return ok && stamps.good();
}

}  // namespace relievo::test
