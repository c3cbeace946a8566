// SPDX-License-Identifier: Apache-2.0
#include "client/shot/render.h"

#include <algorithm>
#include <cmath>
#include <string>

#include "base/lens.h"
#include "client/shot/raster.h"
#include "codec/surface_check.h"

namespace relievo {
namespace {

using Rgb = std::array<float, 3>;  // 0..255, sRGB

struct NamedMode {
  std::string_view name;
  ShotMode mode;
};
constexpr NamedMode kModes[] = {
    {"textured", ShotMode::kTextured},     {"shaded", ShotMode::kShaded},   {"wire", ShotMode::kWire},
    {"points", ShotMode::kPoints},         {"normals", ShotMode::kNormals}, {"depth", ShotMode::kDepth},
    {"confidence", ShotMode::kConfidence},
};

// As the viewer's materials.ts, palette.ts and quality.ts.
constexpr Rgb kClay{210, 204, 194}, kWire{134, 183, 255}, kFill{17, 21, 27}, kUnknown{179, 179, 188};
constexpr Rgb kDepthStops[] = {{253, 231, 37}, {160, 218, 57}, {74, 193, 109}, {31, 161, 135},
                               {39, 127, 142}, {54, 92, 141},  {70, 50, 127},  {68, 1, 84}};
constexpr float kBestSigma = 20e-6F, kWorstSigma = 2e-3F;
constexpr float kDimmed = 0.6F;
constexpr int kPointSize = 2;  // pixels

float clamped(float share) {
  return std::clamp(share, 0.0F, 1.0F);
}

Rgb depth_colour(float share) {
  constexpr int kLast = std::size(kDepthStops) - 1;
  const float at = clamped(share) * kLast;
  const int i = std::min(static_cast<int>(at), kLast - 1);
  const float t = at - static_cast<float>(i);
  Rgb out{};
  for (std::size_t c = 0; c < 3; ++c)
    out[c] = kDepthStops[i][c] + t * (kDepthStops[i + 1][c] - kDepthStops[i][c]);
  return out;
}

/// sRGB of a linear 0..1.
float encoded(float linear) {
  const float v = clamped(linear);
  return 255 * (v <= 0.0031308F ? 12.92F * v : 1.055F * std::pow(v, 1 / 2.4F) - 0.055F);
}

Rgb confidence_colour(float sigma_m, bool interpolated) {
  if (!(sigma_m > 0)) return kUnknown;
  const float share = clamped(std::log2(sigma_m / kBestSigma) / std::log2(kWorstSigma / kBestSigma));
  const float light = interpolated ? kDimmed : 1;
  return {encoded(light * std::min(1.0F, 2 * share)), encoded(light * std::min(1.0F, 2 - 2 * share)),
          encoded(light * 0.05F)};
}

/// Bilinear, between the centres of texels.
Rgb texel(const Image8& texture, const Vec2f& at) {
  const auto coordinate = [](float share, int size) {
    return std::clamp(share * static_cast<float>(size) - 0.5F, 0.0F, static_cast<float>(size - 1));
  };
  const float x = coordinate(at[0], texture.width()), y = coordinate(at[1], texture.height());
  const int x0 = static_cast<int>(x), y0 = static_cast<int>(y);
  const int x1 = std::min(x0 + 1, texture.width() - 1), y1 = std::min(y0 + 1, texture.height() - 1);
  const float tx = x - static_cast<float>(x0), ty = y - static_cast<float>(y0);
  const int channels = texture.channels();
  Rgb out{};
  for (std::size_t c = 0; c < 3; ++c) {
    const std::size_t channel = channels == 3 ? c : 0;
    const auto value = [&](int column, int row) {
      return static_cast<float>(texture.row(row)[static_cast<std::size_t>(column * channels) + channel]);
    };
    out[c] = (1 - ty) * ((1 - tx) * value(x0, y0) + tx * value(x1, y0)) +
             ty * ((1 - tx) * value(x0, y1) + tx * value(x1, y1));
  }
  return out;
}

Vec3f unit(const Vec3f& v) {
  const float length = std::sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]);
  return length > 0 ? Vec3f{v[0] / length, v[1] / length, v[2] / length} : v;
}

/// Clay under a light over the left shoulder and a little from everywhere; either side of the surface.
Rgb shaded(const Vec3f& normal_in_view) {
  Vec3f n = unit(normal_in_view);
  if (n[2] > 0) n = {-n[0], -n[1], -n[2]};
  const Vec3f light = unit({-0.55F, -0.65F, -0.75F});
  const float key = std::max(0.0F, n[0] * light[0] + n[1] * light[1] + n[2] * light[2]);
  const float sky = 0.5F - 0.5F * n[1];
  const float brightness = 0.16F + 0.22F * sky + 0.72F * key;
  return {std::min(255.0F, kClay[0] * brightness), std::min(255.0F, kClay[1] * brightness),
          std::min(255.0F, kClay[2] * brightness)};
}

class Renderer {
 public:
  Renderer(const Frame3D& frame, const ShotView& view, const RenderOptions& options)
      : frame_(frame),
        surface_(frame.surface),
        view_(view),
        options_(options),
        samples_(std::clamp(options.samples, 1, 4)),
        width_(view.lens.width * samples_),
        height_(view.lens.height * samples_),
        depth_(width_, height_),
        picture_(width_, height_, 4) {
    for (int y = 0; y < height_; ++y)
      for (int x = 0; x < width_; ++x) std::copy_n(options.background.begin(), 4, pixel(x, y));
  }

  Image8 draw() {
    project();
    const bool points = options_.mode == ShotMode::kPoints || surface_.triangles.empty();
    if (points) {
      draw_points();
    } else {
      if (surface_.normals.empty()) derived_ = surface_normals(surface_);
      draw_triangles();
      if (options_.mode == ShotMode::kWire) draw_wire();
    }
    return shrunk();
  }

 private:
  std::uint8_t* pixel(int x, int y) { return picture_.row(y) + static_cast<std::ptrdiff_t>(x) * 4; }
  void put(int x, int y, const Rgb& colour) {
    std::uint8_t* out = pixel(x, y);
    for (std::size_t c = 0; c < 3; ++c)
      out[c] = static_cast<std::uint8_t>(std::lround(std::clamp(colour[c], 0.0F, 255.0F)));
    out[3] = 255;
  }

  void project() {
    screen_.reserve(surface_.positions.size());
    const auto scale = static_cast<float>(samples_);
    for (const Vec3f& position : surface_.positions) {
      const Vec3f p = view_.to_view(position);
      ScreenPoint at;
      if (p[2] > 0 && std::isfinite(p[0]) && std::isfinite(p[1]) && std::isfinite(p[2])) {
        const auto [column, row] = distort(view_.lens, p[0] / p[2], p[1] / p[2]);
        at = {(static_cast<float>(column) + 0.5F) * scale - 0.5F,
              (static_cast<float>(row) + 0.5F) * scale - 0.5F, p[2]};
      }
      screen_.push_back(at);
    }
  }

  bool textured() const { return !frame_.texture.empty() && !surface_.texture_coordinates.empty(); }

  template <std::size_t N>
  static std::array<float, N> mix(const std::array<std::array<float, N>, 3>& of,
                                  const std::array<float, 3>& weights) {
    std::array<float, N> out{};
    for (std::size_t i = 0; i < N; ++i)
      out[i] = weights[0] * of[0][i] + weights[1] * of[1][i] + weights[2] * of[2][i];
    return out;
  }

  Rgb confidence(std::uint32_t v) const {
    return confidence_colour(surface_.sigmas_m.empty() ? 0 : surface_.sigmas_m[v],
                             !surface_.interpolated.empty() && surface_.interpolated[v] != 0);
  }

  float depth_share(float z) const {
    return (z - options_.depth.from_m) / std::max(options_.depth.to_m - options_.depth.from_m, 1e-6F);
  }

  void draw_triangles() {
    const auto& normals = surface_.normals.empty() ? derived_ : surface_.normals;
    for (const Triangle& t : surface_.triangles) {
      const std::array<ScreenPoint, 3> corners{screen_[t[0]], screen_[t[1]], screen_[t[2]]};
      const auto draw_with = [&](const auto& colour) {
        depth_.triangle(corners, [&](int x, int y, const std::array<float, 3>& w) { put(x, y, colour(w)); });
      };
      const auto normal = [&](const std::array<float, 3>& w) {
        return mix<3>({normals[t[0]], normals[t[1]], normals[t[2]]}, w);
      };
      if (options_.mode == ShotMode::kTextured && textured()) {
        const auto& uv = surface_.texture_coordinates;
        draw_with([&](const auto& w) {
          return texel(frame_.texture, mix<2>({uv[t[0]], uv[t[1]], uv[t[2]]}, w));
        });
      } else if (options_.mode == ShotMode::kWire) {
        draw_with([](const auto&) { return kFill; });
      } else if (options_.mode == ShotMode::kNormals) {
        // Red: to the right, green: up, blue: to the camera.
        draw_with([&](const auto& w) {
          const Vec3f n = unit(normal(w));
          return Rgb{127.5F * (n[0] + 1), 127.5F * (1 - n[1]), 127.5F * (1 - n[2])};
        });
      } else if (options_.mode == ShotMode::kDepth) {
        const auto& p = surface_.positions;
        draw_with([&](const auto& w) {
          return depth_colour(depth_share(w[0] * p[t[0]][2] + w[1] * p[t[1]][2] + w[2] * p[t[2]][2]));
        });
      } else if (options_.mode == ShotMode::kConfidence) {
        const std::array<Rgb, 3> colours{confidence(t[0]), confidence(t[1]), confidence(t[2])};
        draw_with([&](const auto& w) { return mix<3>(colours, w); });
      } else {
        draw_with([&](const auto& w) { return shaded(view_.direction_to_view(normal(w))); });
      }
    }
  }

  void draw_wire() {
    for (const Triangle& t : surface_.triangles)
      for (std::size_t i = 0; i < 3; ++i)
        depth_.line(screen_[t[i]], screen_[t[(i + 1) % 3]], [&](int x, int y) { put(x, y, kWire); });
  }

  void draw_points() {
    for (std::size_t v = 0; v < screen_.size(); ++v) {
      Rgb colour = kClay;
      if (options_.mode == ShotMode::kDepth)
        colour = depth_colour(depth_share(surface_.positions[v][2]));
      else if (options_.mode == ShotMode::kConfidence)
        colour = confidence(static_cast<std::uint32_t>(v));
      else if (textured())
        colour = texel(frame_.texture, surface_.texture_coordinates[v]);
      depth_.dot(screen_[v], kPointSize * samples_, [&](int x, int y) { put(x, y, colour); });
    }
  }

  /// The mean of a pixel's samples, colours weighed by how much they cover.
  Image8 shrunk() {
    if (samples_ == 1) return std::move(picture_);
    Image8 out(view_.lens.width, view_.lens.height, 4);
    const int count = samples_ * samples_;
    for (int y = 0; y < out.height(); ++y) {
      for (int x = 0; x < out.width(); ++x) {
        int sums[4] = {};
        for (int i = 0; i < count; ++i) {
          const std::uint8_t* sample = pixel(x * samples_ + i % samples_, y * samples_ + i / samples_);
          for (std::size_t c = 0; c < 3; ++c) sums[c] += sample[c] * sample[3];
          sums[3] += sample[3];
        }
        std::uint8_t* to = out.row(y) + static_cast<std::ptrdiff_t>(x) * 4;
        for (std::size_t c = 0; c < 3; ++c)
          to[c] = static_cast<std::uint8_t>(sums[3] > 0 ? (sums[c] + sums[3] / 2) / sums[3] : 0);
        to[3] = static_cast<std::uint8_t>((sums[3] + count / 2) / count);
      }
    }
    return out;
  }

  const Frame3D& frame_;
  const Surface& surface_;
  const ShotView& view_;
  const RenderOptions& options_;
  const int samples_, width_, height_;
  DepthBuffer depth_;
  Image8 picture_;
  std::vector<ScreenPoint> screen_;
  std::vector<Vec3f> derived_;
};

}  // namespace

std::optional<ShotMode> shot_mode_named(std::string_view name) {
  for (const NamedMode& m : kModes)
    if (m.name == name) return m.mode;
  return std::nullopt;
}

std::string_view shot_mode_names() {
  static const std::string names = [] {
    std::string all;
    for (const NamedMode& m : kModes) all += (all.empty() ? "" : ", ") + std::string(m.name);
    return all;
  }();
  return names;
}

DepthRange depth_range_of(const Surface& surface) {
  const Extent extent = extent_of(surface.positions);
  const float length = std::max(extent.max[2] - extent.min[2], 1e-4F);
  const float power = std::pow(10.0F, std::floor(std::log10(length / 10)));
  float step = 10 * power;
  for (const float s : {5.0F, 2.0F, 1.0F})
    if (s * power >= length / 10) step = s * power;
  return {std::floor(extent.min[2] / step) * step, std::ceil(extent.max[2] / step) * step};
}

Image8 render(const Frame3D& frame, const ShotView& view, const RenderOptions& options) {
  return Renderer(frame, view, options).draw();
}

}  // namespace relievo
