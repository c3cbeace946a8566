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
#include "codec/depth_picture.h"
#include "codec/export.h"
#include "codec/surface_check.h"
#include "codec/texture_png.h"

namespace relievo {
namespace {

constexpr double kMostUnits = 65'535;

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
