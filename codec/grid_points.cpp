// SPDX-License-Identifier: Apache-2.0
#include "codec/grid_points.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "base/lens.h"

namespace relievo {
namespace {

constexpr int kRayStep = 8;        // columns between ray samples: linear between them is good to 1e-3 px
constexpr int kSheetSamples = 65;  // over the projector's height and a quarter beyond
constexpr int kSheetRounds = 4;    // of point -> height -> sheet; each gains about two digits
constexpr float kNone = std::numeric_limits<float>::quiet_NaN();

// ThreadSanitizer's runtime is not there yet when the loader chooses a clone.
#if defined(__x86_64__) && !defined(__SANITIZE_THREAD__)
#define RELIEVO_WIDE [[gnu::target_clones("avx2", "default")]]
#else
#define RELIEVO_WIDE
#endif

/// z = numerator / (a x + b y + c), the four of the vertex's own boundary. False where a z is not in front.
RELIEVO_WIDE bool meet_straight_sheets(const std::int32_t* boundary, const float* x, const float* y,
                                       const float* numerator, const float* a, const float* b, const float* c,
                                       int count, float* slope, float* z) {
  int good = 0;
  for (int i = 0; i < count; ++i) {
    const std::int32_t s = boundary[i];
    const float denominator = a[s] * x[i] + b[s] * y[i] + c[s];
    z[i] = numerator[s] / denominator;
    slope[i] = z[i] * a[s] / denominator;
    good += z[i] > 0 && z[i] < 1e6F;
  }
  return good == count;
}

}  // namespace

GridPoints::GridPoints(const GridCalibration& calibration)
    : calibration_(calibration),
      straight_rays_(!distorts(calibration.camera)),
      straight_sheets_(!distorts(calibration.projector) && calibration.projector.matrix[1] == 0),
      ray_samples_((calibration.camera.width + kRayStep - 1) / kRayStep + 1) {
  const auto lines = static_cast<std::size_t>(calibration.lines());
  const auto boundaries = static_cast<std::size_t>(calibration.boundaries());
  line_known_.assign(lines, 0);
  sheet_known_.assign(boundaries, 0);
  const PinholeModel& projector = calibration.projector;
  if (straight_sheets_) {
    const auto& r = calibration.projector_from_camera_rotation;
    const auto& t = calibration.projector_from_camera_translation;
    for (std::size_t s = 0; s < boundaries; ++s) {
      const double column = (static_cast<double>(s) + 1) * projector.width / calibration.stripes - 0.5;
      const double x = (column - projector.cx()) / projector.fx();
      sheet_numerator_.push_back(static_cast<float>(x * t[2] - t[0]));
      sheet_a_.push_back(static_cast<float>(r[0] - x * r[6]));
      sheet_b_.push_back(static_cast<float>(r[1] - x * r[7]));
      sheet_c_.push_back(static_cast<float>(r[2] - x * r[8]));
    }
    return;
  }
  const double top = (0 - projector.cy()) / projector.fy();
  const double bottom = (projector.height - 1 - projector.cy()) / projector.fy();
  const double margin = (bottom - top) / 4;
  sheet_first_ = top - margin;
  sheet_step_ = (bottom - top + 2 * margin) / (kSheetSamples - 1);
}

/// Directions of the line's vertices. Between samples where the line has many, exactly where it has few, so
/// that few vertices never cost much.
bool GridPoints::find_rays(int line, std::size_t count) {
  const PinholeModel& camera = calibration_.camera;
  const double row = line * calibration_.line_step_px;
  if (straight_rays_) {
    const auto y = static_cast<float>((row - camera.cy()) / camera.fy());
    const auto per_px = static_cast<float>(1 / camera.fx());
    const auto first = static_cast<float>((camera.cx() + camera.matrix[1] * y) / camera.fx());
    for (std::size_t i = 0; i < count; ++i) {
      line_.ray_x[i] = line_.column[i] * per_px - first;
      line_.ray_y[i] = y;
    }
    return true;
  }
  const auto samples = static_cast<std::size_t>(ray_samples_);
  const std::size_t start = static_cast<std::size_t>(line) * samples;
  std::uint8_t& known = line_known_[static_cast<std::size_t>(line)];
  if (known == 0 && 4 * count < samples) {
    for (std::size_t i = 0; i < count; ++i) {
      const auto ray = undistort(camera, static_cast<double>(line_.column[i]), row);
      if (!ray) return false;
      line_.ray_x[i] = static_cast<float>((*ray)[0]);
      line_.ray_y[i] = static_cast<float>((*ray)[1]);
    }
    return true;
  }
  if (known == 0) {
    known = 1;
    rays_x_.resize(line_known_.size() * samples);
    rays_y_.resize(line_known_.size() * samples);
    for (std::size_t s = 0; s < samples; ++s) {
      const auto ray = undistort(camera, static_cast<double>(s) * kRayStep, row);
      rays_x_[start + s] = ray ? static_cast<float>((*ray)[0]) : kNone;
      rays_y_[start + s] = ray ? static_cast<float>((*ray)[1]) : kNone;
    }
  }
  for (std::size_t i = 0; i < count; ++i) {
    const float at = line_.column[i] / kRayStep;
    const int s = std::clamp(static_cast<int>(at), 0, ray_samples_ - 2);
    const float f = at - static_cast<float>(s);
    const float* x = rays_x_.data() + start + s;
    const float* y = rays_y_.data() + start + s;
    line_.ray_x[i] = x[0] + f * (x[1] - x[0]);
    line_.ray_y[i] = y[0] + f * (y[1] - y[0]);
  }
  return true;
}

bool GridPoints::meet_curved_sheets(std::size_t count) {
  const auto& r = calibration_.projector_from_camera_rotation;
  const auto& t = calibration_.projector_from_camera_translation;
  const PinholeModel& projector = calibration_.projector;
  for (std::size_t i = 0; i < count; ++i) {
    const auto boundary = static_cast<std::size_t>(line_.boundary[i]);
    if (sheet_known_[boundary] == 0) {
      sheet_known_[boundary] = 1;
      sheets_.resize(sheet_known_.size() * kSheetSamples);
      const double column =
          (static_cast<double>(boundary) + 1) * projector.width / calibration_.stripes - 0.5;
      for (int s = 0; s < kSheetSamples; ++s) {
        const double y = sheet_first_ + s * sheet_step_;
        const double target = (column - projector.cx() - projector.matrix[1] * y) / projector.fx();
        sheets_[boundary * kSheetSamples + static_cast<std::size_t>(s)] =
            static_cast<float>(sheet_at(projector.distortion, target, y));
      }
    }
    const float* samples = sheets_.data() + boundary * kSheetSamples;
    const double x = line_.ray_x[i];
    const double y = line_.ray_y[i];
    const double dx = r[0] * x + r[1] * y + r[2];
    const double dy = r[3] * x + r[4] * y + r[5];
    const double dz = r[6] * x + r[7] * y + r[8];
    double height = 0;
    double z = 0;
    for (int round = 0; round < kSheetRounds; ++round) {
      const double at = std::clamp((height - sheet_first_) / sheet_step_, 0.0, kSheetSamples - 1.001);
      if (!(at >= 0)) return false;  // not a number
      const int s = static_cast<int>(at);
      const double sheet = samples[s] + (at - s) * (samples[s + 1] - samples[s]);
      const double denominator = dx - sheet * dz;
      z = (sheet * t[2] - t[0]) / denominator;
      height = (z * dy + t[1]) / (z * dz + t[2]);
      line_.a[i] = static_cast<float>(z * (r[0] - sheet * r[6]) / denominator);
    }
    line_.z[i] = static_cast<float>(z);
    if (!(z > 0 && z < 1e6)) return false;
  }
  return true;
}

bool GridPoints::make_line(const StripeGrid& grid, int line, Surface& out, std::size_t first) {
  const std::int32_t* columns = grid.columns.data() + grid.at(line, 0);
  const float step = 1.F / static_cast<float>(1 << grid.step_bits);
  std::size_t count = 0;
  for (int b = 0; b < grid.boundaries; ++b) {
    line_.boundary[count] = b;
    line_.column[count] = static_cast<float>(columns[b]) * step;
    count += columns[b] != StripeGrid::kAbsent;
  }
  if (count == 0) return true;
  if (!find_rays(line, count)) return false;
  const bool met =
      straight_sheets_
          ? meet_straight_sheets(line_.boundary.data(), line_.ray_x.data(), line_.ray_y.data(),
                                 sheet_numerator_.data(), sheet_a_.data(), sheet_b_.data(), sheet_c_.data(),
                                 static_cast<int>(count), line_.a.data(), line_.z.data())
          : meet_curved_sheets(count);
  if (!met) return false;
  const float per_width = 1.F / static_cast<float>(calibration_.camera.width);
  const float v = (static_cast<float>(line * calibration_.line_step_px) + 0.5F) /
                  static_cast<float>(calibration_.camera.height);
  Vec3f* position = out.positions.data() + first;
  Vec2f* coordinate = out.texture_coordinates.data() + first;
  GridPoint* place = out.grid.data() + first;
  for (std::size_t i = 0; i < count; ++i) {
    const float z = line_.z[i];
    position[i] = {z * line_.ray_x[i], z * line_.ray_y[i], z};
    coordinate[i] = {(line_.column[i] + 0.5F) * per_width, v};
    place[i].boundary = static_cast<std::uint16_t>(line_.boundary[i]);
    place[i].line = static_cast<std::uint16_t>(line);
    place[i].column_px = line_.column[i];
    place[i].sigma_px = 0;
    place[i].interpolated = false;
  }
  if (!grid.interpolated.empty()) {
    const std::uint8_t* marks = grid.interpolated.data() + grid.at(line, 0);
    for (std::size_t i = 0; i < count; ++i) {
      place[i].interpolated = marks[line_.boundary[i]] != 0;
      out.interpolated[first + i] = marks[line_.boundary[i]];
    }
  }
  if (grid.sigmas.empty()) return true;
  static const std::array<float, 64> sigma_px = [] {
    std::array<float, 64> all{};
    for (std::size_t c = 0; c < all.size(); ++c) all[c] = sigma_px_of_code(static_cast<std::uint8_t>(c));
    return all;
  }();
  const auto per_fx = static_cast<float>(1 / calibration_.camera.fx());
  const std::uint8_t* codes = grid.sigmas.data() + grid.at(line, 0);
  for (std::size_t i = 0; i < count; ++i) {
    place[i].sigma_px = sigma_px[codes[line_.boundary[i]] & 63U];
    out.sigmas_m[first + i] = place[i].sigma_px * std::fabs(line_.a[i]) * per_fx;
  }
  return true;
}

namespace {

/// Triangle without corner c, counter-clockwise; of kStraight and kTurned in this order.
constexpr std::array<int, 4> kOrder{3, 1, 0, 2};

Triangle* write_cells(const std::uint8_t* cells, const std::int32_t* above, const std::int32_t* below,
                      int count, Triangle* to) {
  const auto index = [](std::int32_t i) { return static_cast<std::uint32_t>(i); };
  for (int b = 0; b < count; ++b) {
    const std::uint8_t cell = cells[b];
    if (cell == 0) continue;
    const std::array<std::uint32_t, 4> q{index(above[b]), index(below[b]), index(below[b + 1]),
                                         index(above[b + 1])};
    if (cell == grid_cell::kStraight) {
      *to++ = {q[0], q[1], q[2]};
      *to++ = {q[2], q[3], q[0]};
    } else if (cell == grid_cell::kTurned) {
      *to++ = {q[1], q[2], q[3]};
      *to++ = {q[3], q[0], q[1]};
    } else {
      for (const int lack : kOrder) {
        if ((cell >> lack & 1) == 0) continue;
        const auto c = static_cast<std::size_t>(lack);
        *to++ = {q[(c + 1) & 3U], q[(c + 2) & 3U], q[(c + 3) & 3U]};
      }
    }
  }
  return to;
}

}  // namespace

Status GridPoints::to_surface(const StripeGrid& grid, Surface& out) {
  const auto places = static_cast<std::size_t>(grid.stride());
  line_.boundary.resize(places);
  for (auto* v : {&line_.column, &line_.ray_x, &line_.ray_y, &line_.a, &line_.z}) v->resize(places);
  out.positions.resize(grid.vertices);
  out.texture_coordinates.resize(grid.vertices);
  out.grid.resize(grid.vertices);
  out.triangles.resize(grid.triangles);
  out.normals.clear();
  // Where one is told, both are: 0 of what is not.
  const bool quality = !grid.sigmas.empty() || !grid.interpolated.empty();
  out.sigmas_m.assign(quality ? grid.vertices : 0, 0);
  out.interpolated.assign(quality ? grid.vertices : 0, 0);
  std::int32_t next = 0;
  Triangle* triangle = out.triangles.data();
  for (auto& index : index_) index.assign(places, -1);
  for (int line = 0; line < grid.lines; ++line) {
    const auto first = static_cast<std::size_t>(next);
    std::swap(index_[0], index_[1]);
    const std::int32_t* columns = grid.columns.data() + grid.at(line, 0);
    std::int32_t* index = index_[1].data();
    for (int b = 0; b < grid.boundaries; ++b) {
      index[b] = next;
      next += columns[b] != StripeGrid::kAbsent;
    }
    if (!make_line(grid, line, out, first))
      return Error{"grid has a vertex whose ray meets no light sheet of the calibration"};
    if (line > 0)
      triangle = write_cells(grid.cells.data() + grid.at(line - 1, 0), index_[0].data(), index,
                             grid.boundaries - 1, triangle);
  }
  return {};
}

}  // namespace relievo
