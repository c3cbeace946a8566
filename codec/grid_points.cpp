// SPDX-License-Identifier: Apache-2.0
#include "codec/grid_points.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "base/lens.h"
#include "codec/gather_kernels.h"

namespace relievo {
namespace {

constexpr int kRayStep = 8;        // columns between ray samples: linear between them is good to 1e-3 px
constexpr int kSheetSamples = 65;  // over the projector's height and a quarter beyond
constexpr int kSheetRounds = 4;    // of point -> height -> sheet; each gains about two digits
constexpr float kNone = std::numeric_limits<float>::quiet_NaN();

bool is_there(const std::int32_t* columns, std::size_t b) {
  return columns[b] != StripeGrid::kAbsent;
}

/// Kernels do eight places at once.
std::size_t whole_eights(int boundaries) {
  return static_cast<std::size_t>(boundaries + 7) / 8 * 8;
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
    for (auto* values : {&sheet_numerator_, &sheet_a_, &sheet_b_, &sheet_c_})
      values->resize(whole_eights(calibration.boundaries()), 1);
    return;
  }
  const double top = (0 - projector.cy()) / projector.fy();
  const double bottom = (projector.height - 1 - projector.cy()) / projector.fy();
  const double margin = (bottom - top) / 4;
  sheet_first_ = top - margin;
  sheet_step_ = (bottom - top + 2 * margin) / (kSheetSamples - 1);
}

/// Columns in pixels and directions of the line's vertices. Between samples where the line has many, exactly
/// where it has few, so that few vertices never cost much.
bool GridPoints::find_rays(const std::int32_t* columns, float step_px, int line, std::size_t count) {
  const PinholeModel& camera = calibration_.camera;
  const double row = line * calibration_.line_step_px;
  const auto places = static_cast<int>(line_.column.size());
  StraightRays rays;
  rays.step_px = step_px;
  rays.y = static_cast<float>((row - camera.cy()) / camera.fy());
  rays.per_px = static_cast<float>(1 / camera.fx());
  rays.first = static_cast<float>((camera.cx() + camera.matrix[1] * rays.y) / camera.fx());
  kernels_.straight_rays(columns, rays, places, line_.column.data(), line_.ray_x.data(), line_.ray_y.data());
  if (straight_rays_) return true;
  const auto samples = static_cast<std::size_t>(ray_samples_);
  const std::size_t start = static_cast<std::size_t>(line) * samples;
  std::uint8_t& known = line_known_[static_cast<std::size_t>(line)];
  if (known == 0 && 4 * count < samples) {
    for (std::size_t i = 0; i < line_.column.size(); ++i) {
      if (!is_there(columns, i)) continue;
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
  for (std::size_t i = 0; i < line_.column.size(); ++i) {
    if (!is_there(columns, i)) continue;
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

bool GridPoints::meet_curved_sheets(const std::int32_t* columns) {
  const auto& r = calibration_.projector_from_camera_rotation;
  const auto& t = calibration_.projector_from_camera_translation;
  const PinholeModel& projector = calibration_.projector;
  for (std::size_t boundary = 0; boundary < line_.column.size(); ++boundary) {
    if (!is_there(columns, boundary)) continue;
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
    const double x = line_.ray_x[boundary];
    const double y = line_.ray_y[boundary];
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
      line_.slope[boundary] = static_cast<float>(z * (r[0] - sheet * r[6]) / denominator);
    }
    line_.z[boundary] = static_cast<float>(z);
    if (!(z > 0 && z < 1e6)) return false;
  }
  return true;
}

bool GridPoints::make_line(const StripeGrid& grid, int line, Surface& out, const std::int32_t* index) {
  const int picture_line = line % calibration_.lines();  // of second places too
  const std::int32_t* columns = grid.columns.data() + grid.at(line, 0);
  const auto places = static_cast<int>(whole_eights(grid.boundaries));
  const auto first = static_cast<std::size_t>(index[0]);
  const std::size_t count = static_cast<std::size_t>(index[grid.boundaries]) - first;
  if (count == 0) return true;
  if (!find_rays(columns, 1.F / static_cast<float>(1 << grid.step_bits), picture_line, count)) return false;
  const bool has_quality = !grid.interpolated.empty() || !grid.sigmas.empty();
  const SheetRow row{columns, line_.ray_x.data(), line_.ray_y.data(),
                     has_quality ? line_.slope.data() : nullptr, line_.z.data()};
  const Sheets sheets{sheet_numerator_.data(), sheet_a_.data(), sheet_b_.data(), sheet_c_.data()};
  const bool met = straight_sheets_ ? kernels_.meet(row, sheets, places) : meet_curved_sheets(columns);
  if (!met) return false;
  kernels_.vertices({.columns = columns,
                     .column_px = line_.column.data(),
                     .ray_x = line_.ray_x.data(),
                     .ray_y = line_.ray_y.data(),
                     .z = line_.z.data(),
                     .per_width = 1.F / static_cast<float>(calibration_.camera.width),
                     .v = (static_cast<float>(picture_line * calibration_.line_step_px) + 0.5F) /
                          static_cast<float>(calibration_.camera.height),
                     .line = static_cast<std::uint16_t>(line),
                     .position = out.positions.data() + first,
                     .coordinate = out.texture_coordinates.data() + first,
                     .place = out.grid.data() + first},
                    places);
  if (has_quality) tell_quality(grid, line, out, first);
  return true;
}

void GridPoints::tell_quality(const StripeGrid& grid, int line, Surface& out, std::size_t first) const {
  static const std::array<float, 64> sigma_px = [] {
    std::array<float, 64> all{};
    for (std::size_t c = 0; c < all.size(); ++c) all[c] = sigma_px_of_code(static_cast<std::uint8_t>(c));
    return all;
  }();
  const auto per_fx = static_cast<float>(1 / calibration_.camera.fx());
  const std::size_t start = grid.at(line, 0);
  const std::int32_t* columns = grid.columns.data() + start;
  std::size_t v = first;
  for (std::size_t b = 0; b < static_cast<std::size_t>(grid.boundaries); ++b) {
    if (!is_there(columns, b)) continue;
    GridPoint& place = out.grid[v];
    if (!grid.interpolated.empty()) {
      place.interpolated = grid.interpolated[start + b] != 0;
      out.interpolated[v] = grid.interpolated[start + b];
    }
    if (!grid.sigmas.empty()) {
      place.sigma_px = sigma_px[grid.sigmas[start + b] & 63U];
      out.sigmas_m[v] = place.sigma_px * std::fabs(line_.slope[b]) * per_fx;
    }
    ++v;
  }
}

/// Triangles on copies are on what those are copies of.
void GridPoints::join_copies(Surface& out) const {
  const std::uint32_t apart = static_cast<std::uint32_t>(calibration_.lines()) * kBelowKey;
  const auto second = std::ranges::lower_bound(out.grid, apart, {}, place_key);
  const auto firsts = static_cast<std::uint32_t>(second - out.grid.begin());
  std::vector<std::uint32_t> joined;
  for (auto at = second; at != out.grid.end(); ++at) {
    const std::uint32_t place = place_key(*at) - apart;
    const auto first = std::ranges::lower_bound(out.grid.begin(), second, place, {}, place_key);
    const bool is_copy = first != second && place_key(*first) == place && first->column_px == at->column_px;
    joined.push_back(static_cast<std::uint32_t>((is_copy ? first : at) - out.grid.begin()));
  }
  for (std::size_t t = out.triangles.size(); t-- > 0 && out.triangles[t][0] >= firsts;)
    for (std::uint32_t& v : out.triangles[t])
      if (v >= firsts) v = joined[v - firsts];
}

Status GridPoints::to_surface(const StripeGrid& grid, Surface& out) {
  const auto places = static_cast<std::size_t>(grid.stride());
  for (auto* values : {&line_.column, &line_.ray_x, &line_.ray_y, &line_.slope, &line_.z})
    values->resize(whole_eights(grid.boundaries));
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
    std::swap(index_[0], index_[1]);
    const std::int32_t* columns = grid.columns.data() + grid.at(line, 0);
    std::int32_t* index = index_[1].data();
    next = kernels_.number(columns, grid.boundaries, next, index);
    index[grid.boundaries] = next;
    if (!make_line(grid, line, out, index))
      return Error{"grid has a vertex whose ray meets no light sheet of the calibration"};
    if (line > 0)
      triangle = kernels_.triangles(
          {.cells = grid.cells.data() + grid.at(line - 1, 0), .above = index_[0].data(), .below = index},
          grid.boundaries - 1, triangle);
  }
  if (grid.twice) join_copies(out);
  return {};
}

}  // namespace relievo
