// SPDX-License-Identifier: Apache-2.0
// A surface as a picture of depths, for what reads those of depth cameras.
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <nlohmann/json.hpp>
#include <vector>

#include "base/json_text.h"
#include "base/lens.h"
#include "base/whole_file.h"
#include "codec/export.h"
#include "codec/surface_check.h"
#include "codec/texture_png.h"

namespace relievo {
namespace {

constexpr double kNearest_m = 1e-6;  // of a vertex before the camera
constexpr double kMostUnits = 65'535;

struct Corner {
  double column, row, inverse_z;
};

/// z at each pixel's centre, infinite where nothing is. 1/z is linear in the picture.
class DepthPicture {
 public:
  explicit DepthPicture(const PinholeModel& camera)
      : camera_(camera),
        z_m_(static_cast<std::size_t>(camera.width) * static_cast<std::size_t>(camera.height),
             std::numeric_limits<double>::infinity()) {}

  void draw(const Surface& surface) {
    std::vector<Corner> corners;
    corners.reserve(surface.positions.size());
    for (const Vec3f& p : surface.positions) corners.push_back(seen(p));
    for (const Triangle& t : surface.triangles) draw(corners[t[0]], corners[t[1]], corners[t[2]]);
  }
  double at(std::size_t pixel) const { return z_m_[pixel]; }
  std::size_t size() const { return z_m_.size(); }

 private:
  Corner seen(const Vec3f& p) const {
    const double z = static_cast<double>(p[2]);
    if (!(z > kNearest_m)) return {0, 0, -1};
    const double x = static_cast<double>(p[0]) / z;
    const double y = static_cast<double>(p[1]) / z;
    const auto& k = camera_.matrix;
    return {k[0] * x + k[1] * y + k[2], k[4] * y + k[5], 1 / z};
  }

  void draw(const Corner& a, const Corner& b, const Corner& c) {
    if (std::min({a.inverse_z, b.inverse_z, c.inverse_z}) <= 0) return;
    const double area = (b.column - a.column) * (c.row - a.row) - (c.column - a.column) * (b.row - a.row);
    if (area == 0) return;
    const int first_row = first(std::min({a.row, b.row, c.row}));
    const int last_row = last(std::max({a.row, b.row, c.row}), camera_.height);
    const int first_column = first(std::min({a.column, b.column, c.column}));
    const int last_column = last(std::max({a.column, b.column, c.column}), camera_.width);
    for (int row = first_row; row <= last_row; ++row) {
      for (int column = first_column; column <= last_column; ++column) {
        const double wb =
            ((column - a.column) * (c.row - a.row) - (c.column - a.column) * (row - a.row)) / area;
        const double wc =
            ((b.column - a.column) * (row - a.row) - (column - a.column) * (b.row - a.row)) / area;
        if (wb < 0 || wc < 0 || wb + wc > 1) continue;
        const double z =
            1 / (a.inverse_z + wb * (b.inverse_z - a.inverse_z) + wc * (c.inverse_z - a.inverse_z));
        double& nearest = z_m_[static_cast<std::size_t>(row) * static_cast<std::size_t>(camera_.width) +
                               static_cast<std::size_t>(column)];
        nearest = std::min(nearest, z);
      }
    }
  }
  static int first(double lowest) { return static_cast<int>(std::ceil(std::clamp(lowest, 0.0, 1e9))); }
  static int last(double highest, int count) {
    return static_cast<int>(std::floor(std::clamp(highest, -1.0, count - 1.0)));
  }

  const PinholeModel& camera_;
  std::vector<double> z_m_;
};

}  // namespace

PinholeModel pinhole_of(const PinholeModel& camera) {
  PinholeModel pinhole = camera;
  pinhole.distortion = {};
  return pinhole;
}

Status write_depth_png(const std::filesystem::path& path, const Surface& surface, const PinholeModel& camera,
                       double unit_m) {
  if (auto status = check_surface(surface); !status) return status;
  if (!(unit_m > 0)) return Error{"the unit of depths is not above 0"};
  DepthPicture picture(camera);
  picture.draw(surface);
  std::vector<std::uint16_t> units(picture.size());
  for (std::size_t i = 0; i < units.size(); ++i) {
    const double depth = std::round(picture.at(i) / unit_m);
    units[i] = depth <= kMostUnits ? static_cast<std::uint16_t>(depth) : std::uint16_t{0};
  }
  Bytes out;
  if (auto status = append_grey16_png(units, camera.width, camera.height, out); !status)
    return status.error().in("cannot write " + path.string());
  return write_whole_file(path, out);
}

Image8 straightened(View8 picture, const PinholeModel& camera) {
  Image8 out(picture.width, picture.height, picture.channels);
  for (int row = 0; row < out.height(); ++row) {
    for (int column = 0; column < out.width(); ++column) {
      const double y = (row - camera.matrix[5]) / camera.matrix[4];
      const double x = (column - camera.matrix[2] - camera.matrix[1] * y) / camera.matrix[0];
      const auto from = distort(camera, x, y);
      const double c = std::clamp(from[0], 0.0, picture.width - 1.0);
      const double r = std::clamp(from[1], 0.0, picture.height - 1.0);
      const bool outside = std::fabs(c - from[0]) > 0.5 || std::fabs(r - from[1]) > 0.5;
      const int c0 = static_cast<int>(c), r0 = static_cast<int>(r);
      const int c1 = std::min(c0 + 1, picture.width - 1), r1 = std::min(r0 + 1, picture.height - 1);
      for (int k = 0; k < picture.channels; ++k) {
        const auto value = [&](int cc, int rr) -> double {
          return picture.row(rr)[cc * picture.channels + k];
        };
        const double top = value(c0, r0) + (c - c0) * (value(c1, r0) - value(c0, r0));
        const double bottom = value(c0, r1) + (c - c0) * (value(c1, r1) - value(c0, r1));
        out.row(row)[column * picture.channels + k] =
            outside ? std::uint8_t{0}
                    : static_cast<std::uint8_t>(std::lround(top + (r - r0) * (bottom - top)));
      }
    }
  }
  return out;
}

Status write_camera_json(const std::filesystem::path& path, const PinholeModel& camera, double unit_m) {
  const nlohmann::json told = {{"width", camera.width},  {"height", camera.height},
                               {"fx", camera.matrix[0]}, {"skew", camera.matrix[1]},
                               {"cx", camera.matrix[2]}, {"fy", camera.matrix[4]},
                               {"cy", camera.matrix[5]}, {"distortion", nlohmann::json::array()},
                               {"depth_unit_m", unit_m}, {"depth_scale", 1 / unit_m}};
  return write_whole_file(path, json_text(told) + "\n");
}

}  // namespace relievo
