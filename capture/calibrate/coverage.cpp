// SPDX-License-Identifier: Apache-2.0
#include "capture/calibrate/coverage.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <numbers>
#include <opencv2/calib3d.hpp>
#include <optional>

namespace relievo {
namespace {

constexpr const char* kCells[] = {"top left", "top",         "top right", "left",        "middle",
                                  "right",    "bottom left", "bottom",    "bottom right"};
constexpr const char* kSides[] = {"left", "right", "upper", "lower"};
constexpr double kLeastTilt_deg = 12;
constexpr double kSmall = 0.25;    // of the picture's width: a board that fills less says little
constexpr double kRepeats = 0.02;  // of the picture's width, that corners lie apart on average

/// How much farther away the board's right and lower sides are: slopes of depth over x and y.
std::optional<std::array<double, 2>> slopes(const PinholeModel& camera, const MeasuredView& view) {
  std::vector<cv::Point3d> board;
  std::vector<cv::Point2d> seen;
  for (const CornerSight& c : view.corners) {
    board.emplace_back(c.board_m[0], c.board_m[1], 0);
    seen.emplace_back(c.camera_px[0], c.camera_px[1]);
  }
  const double focal = camera.fx() > 0 ? camera.fx() : 1.5 * camera.width;
  const cv::Matx33d matrix(focal, 0, (camera.width - 1) / 2.0, 0, focal, (camera.height - 1) / 2.0, 0, 0, 1);
  try {
    cv::Mat turn, shift, rotation;
    if (!cv::solvePnP(board, seen, matrix, cv::noArray(), turn, shift)) return std::nullopt;
    cv::Rodrigues(turn, rotation);
    const double nx = rotation.at<double>(0, 2), ny = rotation.at<double>(1, 2),
                 nz = rotation.at<double>(2, 2);
    if (std::fabs(nz) < 0.1) return std::nullopt;
    return std::array{-nx / nz, -ny / nz};
  } catch (const cv::Exception&) {  // corners in a line
    return std::nullopt;
  }
}

std::string listed(const std::vector<std::string>& words) {
  std::string out;
  for (std::size_t i = 0; i < words.size(); ++i)
    out += (i == 0 ? "" : i + 1 == words.size() ? " and " : ", ") + words[i];
  return out;
}

}  // namespace

Coverage::Coverage(const PinholeModel& camera, const PinholeModel& projector)
    : camera_(camera), projector_(projector) {}

bool Coverage::repeats(const MeasuredView& view) const {
  return std::any_of(added_.begin(), added_.end(), [&](const std::vector<CornerSight>& before) {
    double sum = 0;
    int count = 0;
    for (const CornerSight& a : before) {
      for (const CornerSight& b : view.corners) {
        if (a.board_m != b.board_m) continue;
        sum += std::hypot(a.camera_px[0] - b.camera_px[0], a.camera_px[1] - b.camera_px[1]);
        ++count;
      }
    }
    return count > 0 && sum < kRepeats * camera_.width * count;
  });
}

std::string Coverage::add(const MeasuredView& view) {
  added_.push_back(view.corners);
  for (const CornerSight& c : view.corners) {
    const auto third = [](double at, int size) { return std::clamp(static_cast<int>(3 * at / size), 0, 2); };
    const int cell = 3 * third(c.camera_px[1], camera_.height) + third(c.camera_px[0], camera_.width);
    cells_[static_cast<std::size_t>(cell)] = true;
  }
  std::string out = std::to_string(view.corners.size()) + " corners";
  const auto slope = slopes(camera_, view);
  if (!slope) return out;
  for (std::size_t axis = 0; axis < 2; ++axis) {
    const double degrees = std::atan((*slope)[axis]) * 180 / std::numbers::pi;
    if (std::fabs(degrees) < kLeastTilt_deg) continue;
    const std::size_t side = 2 * axis + (degrees > 0 ? 1 : 0);
    tilts_[side] = true;
    char text[64];
    std::snprintf(text, sizeof text, ", its %s side farther away by %.0f degrees", kSides[side],
                  std::fabs(degrees));
    out += text;
  }
  return out;
}

std::string Coverage::missing() const {
  std::vector<std::string> cells, sides;
  for (std::size_t i = 0; i < cells_.size(); ++i) {
    if (!cells_[i]) cells.emplace_back(kCells[i]);
  }
  for (std::size_t i = 0; i < tilts_.size(); ++i) {
    if (!tilts_[i]) sides.emplace_back(kSides[i]);
  }
  std::string out;
  if (!cells.empty()) out = "the board in the " + listed(cells) + " of the picture";
  if (!sides.empty()) out += (out.empty() ? "its " : "; its ") + listed(sides) + " side farther away";
  return out;
}

std::vector<std::string> Coverage::tilts() const {
  std::vector<std::string> out;
  for (std::size_t i = 0; i < tilts_.size(); ++i) {
    if (tilts_[i]) out.emplace_back(kSides[i]);
  }
  return out;
}

double Coverage::last_width() const {
  if (added_.empty() || added_.back().empty()) return 1;
  const auto [left, right] = std::minmax_element(
      added_.back().begin(), added_.back().end(),
      [](const CornerSight& a, const CornerSight& b) { return a.camera_px[0] < b.camera_px[0]; });
  return (right->camera_px[0] - left->camera_px[0]) / camera_.width;
}

std::string Coverage::next() const {
  const auto cell = std::find(cells_.begin(), cells_.end(), false);
  const auto side = std::find(tilts_.begin(), tilts_.end(), false);
  std::string out;
  if (cell != cells_.end()) out = "in the " + std::string(kCells[cell - cells_.begin()]) + " of the picture";
  if (last_width() < kSmall) out += out.empty() ? "nearer" : ", nearer";
  if (side != tilts_.end())
    out += std::string(out.empty() ? "" : ", ") + "so that its " + kSides[side - tilts_.begin()] +
           " side is farther away by some 25 degrees";
  return out;
}

}  // namespace relievo
