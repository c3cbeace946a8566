// SPDX-License-Identifier: Apache-2.0
#include "capture/calibrate/board_scene.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <numbers>
#include <utility>

#include "capture/pattern/gray_code.h"
#include "capture/reconstruct/triangulate.h"

namespace relievo {
namespace {

constexpr double kWhite = 0.85, kWall = 0.25;  // albedo of the colour captures
bool sees(const PinholeModel& lens, const Pose& pose, const Board& board) {
  const double pad = 0.6 * board.square_m;  // the outer squares
  for (const double x : {-pad, (board.columns - 1) * board.square_m + pad}) {
    for (const double y : {-pad, (board.rows - 1) * board.square_m + pad}) {
      const Vec2d at = project_board(lens, pose, {x, y});
      if (!(at[0] > 4 && at[1] > 4 && at[0] < lens.width - 5 && at[1] < lens.height - 5)) return false;
    }
  }
  return true;
}

}  // namespace

std::vector<Pose> example_poses(const Rig& rig, const Board& board, double distance_m, int count,
                                std::uint32_t seed) {
  SceneRandom random(seed);
  const Pose projector = projector_pose(rig);
  std::vector<Pose> out;
  for (int tries = 0; tries < 4000 && static_cast<int>(out.size()) < count; ++tries) {
    // Tilts go around the clock, so that a few views already differ in all directions.
    const double clock =
        2 * std::numbers::pi * (static_cast<double>(out.size()) / count + 0.1 * random.uniform());
    const double tilt = random.between(0.3, 0.65), roll = random.between(-0.25, 0.25);
    const Eigen::Matrix3d rotation =
        (Eigen::AngleAxisd(tilt, Eigen::Vector3d(std::cos(clock), std::sin(clock), 0)) *
         Eigen::AngleAxisd(roll, Eigen::Vector3d::UnitZ()))
            .toRotationMatrix();
    const Eigen::Vector3d middle(board.square_m * (board.columns - 1) / 2,
                                 board.square_m * (board.rows - 1) / 2, 0);
    const double z = distance_m * random.between(0.85, 1.15);
    const Eigen::Vector3d centre(random.between(-0.3, 0.3) * z * rig.camera.width / rig.camera.fx(),
                                 random.between(-0.3, 0.3) * z * rig.camera.height / rig.camera.fy(), z);
    const Eigen::AngleAxisd turn(rotation);
    const Eigen::Vector3d v = turn.angle() * turn.axis(), t = centre - rotation * middle;
    const Pose pose = {v[0], v[1], v[2], t[0], t[1], t[2]};
    if (sees(rig.camera, pose, board) && sees(rig.projector, compose(projector, pose), board))
      out.push_back(pose);
  }
  return out;
}

std::vector<Image8> render_gray_view(const Rig& rig, const Board& board, const Pose& camera_from_board,
                                     const BoardSceneOptions& options) {
  const SeenBoard view(rig, BoardSurface(board), camera_from_board, options.samples);
  std::vector<Image8> out;
  BoardSceneOptions each = options;
  for (const GraySlide& slide : gray_slides(rig.projector.width, rig.projector.height)) {
    out.push_back(view.under(slide, each));
    each.seed += 7919;
  }
  return out;
}

StripeStack render_stripe_view(const Rig& rig, const Board& board, const Pose& camera_from_board,
                               const Pattern& pattern, double defocus_px, const BoardSceneOptions& options) {
  const SeenBoard view(rig, BoardSurface(board), camera_from_board, options.samples);
  StripeStack out{rig.projector.width, rig.projector.height, pattern, {}, {}};
  const Pattern rows = row_pattern(pattern, rig.projector.width, rig.projector.height);
  BoardSceneOptions each = options;
  for (const bool along_rows : {false, true}) {
    for (int slide = 0; slide < pattern.slides; ++slide) {
      const sim::StripeLight light(along_rows ? rows : pattern, slide,
                                   along_rows ? rig.projector.height : rig.projector.width, defocus_px);
      Image8 pictures[2];
      for (const bool complement : {false, true}) {
        pictures[complement] = view.under({&light, along_rows, complement}, each);
        each.seed += 7919;
      }
      (along_rows ? out.rows : out.columns).push_back({std::move(pictures[0]), std::move(pictures[1])});
    }
  }
  return out;
}

Image8 render_colour_capture(const Rig& rig, Primary colour, double distance_m,
                             const BoardSceneOptions& options) {
  const Eigen::Matrix3d seen =
      Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(rig.colour_matrix.data()).inverse();
  const Eigen::Vector3d light =
      seen * Eigen::Vector3d(colour & 1 ? 1 : 0, colour & 2 ? 1 : 0, colour & 4 ? 1 : 0);
  const CameraResponse response(rig.camera_gamma);
  SceneRandom random(options.seed + 101u * colour);
  Image8 out(rig.camera.width, rig.camera.height, 3);
  const auto& t = rig.projector_from_camera_translation;
  const auto& r = rig.projector_from_camera_rotation;
  for (int y = 0; y < out.height(); ++y) {
    for (int x = 0; x < out.width(); ++x) {
      const double X = distance_m * (x - rig.camera.cx()) / rig.camera.fx(),
                   Y = distance_m * (y - rig.camera.cy()) / rig.camera.fy();
      const auto in = [&](std::size_t i) {
        return r[3 * i] * X + r[3 * i + 1] * Y + r[3 * i + 2] * distance_m + t[i];
      };
      const auto at = distort(rig.projector, in(0) / in(2), in(1) / in(2));
      const bool lit = at[0] > -0.5 && at[1] > -0.5 && at[0] < rig.projector.width - 0.5 &&
                       at[1] < rig.projector.height - 0.5;
      const bool sheet = std::abs(x - out.width() / 2) < out.width() / 4 &&
                         std::abs(y - out.height() / 2) < out.height() / 4;
      const double albedo = sheet ? kWhite : kWall;
      for (int c = 0; c < 3; ++c) {
        const double value = (lit ? light[c] : 0) + options.ambient * 0.25;
        out.row(y)[3 * x + c] =
            exposed(kBoardExposure * options.exposure * albedo * value, options.noise, response, random);
      }
    }
  }
  return out;
}

}  // namespace relievo
