// SPDX-License-Identifier: Apache-2.0
#include "capture/calibrate/plane_check.h"

#include <Eigen/Dense>
#include <cmath>

#include "capture/calibrate/ray_pairs.h"
#include "capture/reconstruct/triangulate.h"

namespace relievo {
namespace {

struct Seen {
  Vec2d board_m;
  Eigen::Vector3d point;
};

Eigen::Vector3d centre_of(const std::vector<Seen>& corners) {
  Eigen::Vector3d centre = Eigen::Vector3d::Zero();
  for (const Seen& c : corners) centre += c.point;
  return centre / static_cast<double>(corners.size());
}

/// Over the whole board, where the corners' own errors hardly count.
double scale_error(const std::vector<Seen>& corners) {
  const Eigen::Vector3d centre = centre_of(corners);
  Eigen::Vector2d board_centre = Eigen::Vector2d::Zero();
  for (const Seen& c : corners) board_centre += Eigen::Vector2d(c.board_m[0], c.board_m[1]);
  board_centre /= static_cast<double>(corners.size());
  double seen = 0, board = 0;
  for (const Seen& c : corners) {
    seen += (c.point - centre).squaredNorm();
    board += (Eigen::Vector2d(c.board_m[0], c.board_m[1]) - board_centre).squaredNorm();
  }
  return std::sqrt(seen / board) - 1;
}

double plane_rms(const std::vector<Seen>& corners) {
  const Eigen::Vector3d centre = centre_of(corners);
  Eigen::Matrix3d spread = Eigen::Matrix3d::Zero();
  for (const Seen& c : corners) spread += (c.point - centre) * (c.point - centre).transpose();
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> axes(spread);
  return std::sqrt(std::max(0.0, axes.eigenvalues()[0]) / static_cast<double>(corners.size()));
}

}  // namespace

PlaneCheck check_plane(const Rig& rig, const BoardView& view) {
  std::vector<Seen> seen;
  double square = 1e9;  // side, as the least distance on the board
  for (const CornerSight& c : view.corners) {
    for (const CornerSight& d : view.corners) {
      const double apart = std::hypot(c.board_m[0] - d.board_m[0], c.board_m[1] - d.board_m[1]);
      if (apart > 0) square = std::min(square, apart);
    }
    const auto on_camera = undistort(rig.camera, c.camera_px[0], c.camera_px[1]);
    const auto on_projector = undistort(rig.projector, c.projector_px[0], c.projector_px[1]);
    const auto meeting = on_camera && on_projector ? meet(rig, *on_camera, *on_projector) : std::nullopt;
    if (meeting) seen.push_back({c.board_m, {meeting->point[0], meeting->point[1], meeting->point[2]}});
  }
  PlaneCheck out;
  out.corners = seen.size();
  if (seen.size() < 4) return out;
  out.plane_rms_m = plane_rms(seen);
  out.scale_error = scale_error(seen);
  double squares = 0;
  for (std::size_t i = 0; i < seen.size(); ++i) {
    for (std::size_t j = i + 1; j < seen.size(); ++j) {
      const double apart =
          std::hypot(seen[i].board_m[0] - seen[j].board_m[0], seen[i].board_m[1] - seen[j].board_m[1]);
      if (apart > 1.01 * square) continue;
      squares += std::pow((seen[i].point - seen[j].point).norm() - apart, 2);
      ++out.lengths;
    }
  }
  if (out.lengths > 0) out.length_rms_m = std::sqrt(squares / static_cast<double>(out.lengths));
  return out;
}

PlaneCheck together(const std::vector<PlaneCheck>& checks) {
  PlaneCheck out;
  for (const PlaneCheck& c : checks) {
    out.plane_rms_m += static_cast<double>(c.corners) * c.plane_rms_m * c.plane_rms_m;
    out.length_rms_m += static_cast<double>(c.lengths) * c.length_rms_m * c.length_rms_m;
    out.scale_error += static_cast<double>(c.corners) * c.scale_error * c.scale_error;
    out.corners += c.corners;
    out.lengths += c.lengths;
  }
  if (out.corners > 0) {
    out.plane_rms_m = std::sqrt(out.plane_rms_m / static_cast<double>(out.corners));
    out.scale_error = std::sqrt(out.scale_error / static_cast<double>(out.corners));
  }
  if (out.lengths > 0) out.length_rms_m = std::sqrt(out.length_rms_m / static_cast<double>(out.lengths));
  return out;
}

}  // namespace relievo
