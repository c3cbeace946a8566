// SPDX-License-Identifier: Apache-2.0
// Surfaces and pictures for tests: a wavy grid as stripes x lines give, seeded noise, no library.
#pragma once

#include <cmath>
#include <cstdint>

#include "base/frame3d.h"

namespace relievo::test {

/// Small, seeded, the same on every machine.
class Random {
 public:
  explicit Random(std::uint64_t seed) : state_(seed * 2862933555777941757u + 3037000493u) {}
  std::uint32_t bits() {
    state_ = state_ * 6364136223846793005u + 1442695040888963407u;
    return static_cast<std::uint32_t>(state_ >> 33);
  }
  std::uint32_t below(std::uint32_t limit) { return bits() % limit; }
  float unit() { return static_cast<float>(bits()) / 2147483648.0f; }  // 0 .. 1

 private:
  std::uint64_t state_;
};

/// columns x rows vertices about 1 m in front of the camera, with `noise_m` of depth noise and a hole.
inline Surface wavy_grid(int columns, int rows, float noise_m = 0.0005f, bool hole = true) {
  Surface surface;
  Random random(7);
  const auto u_of = [&](int c) { return (static_cast<float>(c) + 0.5f) / static_cast<float>(columns); };
  const auto v_of = [&](int r) { return (static_cast<float>(r) + 0.5f) / static_cast<float>(rows); };
  for (int r = 0; r < rows; ++r)
    for (int c = 0; c < columns; ++c) {
      const float u = u_of(c);
      const float v = v_of(r);
      const float z = 1.0f + 0.1f * std::sin(7 * u) * std::cos(5 * v) + noise_m * (random.unit() - 0.5f) * 2;
      surface.positions.push_back({(u - 0.5f) * z, (v - 0.5f) * z * 0.75f, z});
      surface.texture_coordinates.push_back({u, v});
    }
  const auto in_hole = [&](int c, int r) {
    return hole && std::hypot(u_of(c) - 0.4f, v_of(r) - 0.5f) < 0.1f;
  };
  const auto index = [&](int c, int r) { return static_cast<std::uint32_t>(r * columns + c); };
  for (int r = 0; r + 1 < rows; ++r)
    for (int c = 0; c + 1 < columns; ++c) {
      if (in_hole(c, r)) continue;
      surface.triangles.push_back({index(c, r), index(c, r + 1), index(c + 1, r)});
      surface.triangles.push_back({index(c + 1, r), index(c, r + 1), index(c + 1, r + 1)});
    }
  return surface;
}

inline Image8 picture(int width, int height, int channels = 3) {
  Image8 image(width, height, channels);
  for (int y = 0; y < height; ++y)
    for (int x = 0; x < width; ++x)
      for (int c = 0; c < channels; ++c)
        image.row(y)[x * channels + c] =
            static_cast<std::uint8_t>(128 + 100 * std::sin(0.05 * x + c) * std::cos(0.04 * y - c));
  return image;
}

inline Frame3D frame(int columns, int rows, int width = 64, int height = 48) {
  Frame3D result;
  result.number = 42;
  result.time_ns = 1'700'000'000'123'456'789;
  result.surface = wavy_grid(columns, rows);
  result.texture = picture(width, height);
  return result;
}

}  // namespace relievo::test
