// SPDX-License-Identifier: Apache-2.0
#include "capture/calibrate/board_scene.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <numbers>
#include <random>

#include "capture/pattern/gray_code.h"
#include "capture/reconstruct/triangulate.h"

namespace relievo {
namespace {

constexpr double kWhite = 0.85, kBlack = 0.08, kWall = 0.25;  // albedo
constexpr double kMarginSquares = 1.5;                        // of white paper around the squares
constexpr double kExposure = 220;  // grey level of albedo 1 in the projector's light
constexpr double kBlur = 0.4;      // projector pixels to either side

/// Uniform in [0, 1), the same on every platform.
class Random {
 public:
  explicit Random(std::uint32_t seed) : engine_(seed) {}
  double uniform() { return static_cast<double>(engine_()) / 4294967296.0; }
  double between(double low, double high) { return low + (high - low) * uniform(); }
  double normal() {
    const double u = std::max(1e-12, uniform());
    return std::sqrt(-2 * std::log(u)) * std::cos(2 * std::numbers::pi * uniform());
  }

 private:
  std::mt19937 engine_;
};

std::uint8_t grey(double value, double noise, Random& random) {
  return static_cast<std::uint8_t>(std::clamp(value + noise * random.normal() + 0.5, 0.0, 255.0));
}

Pose projector_pose(const Rig& rig) {
  const Eigen::AngleAxisd turn(Eigen::Matrix3d(Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(
      rig.projector_from_camera_rotation.data())));
  const Eigen::Vector3d v = turn.angle() * turn.axis();
  const auto& t = rig.projector_from_camera_translation;
  return {v[0], v[1], v[2], t[0], t[1], t[2]};
}

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

/// +1 and -1 in turn from line to line of a unit grid, going through 0 within `soft` of each line.
double stripe(double x, double soft) {
  const double line = std::round(x);
  const double ramp = std::clamp((x - line) / soft, -1.0, 1.0);
  return std::fmod(std::fabs(line), 2.0) < 0.5 ? ramp : -ramp;
}

/// The board's white paper, its squares, and the wall that is flush with it. Edges of squares are `soft_m`
/// wide to either side, as a lens that resolves a pixel shows them: sharper ones would alias.
double albedo_at(const Board& board, double x_m, double y_m, double soft_m) {
  const double x = x_m / board.square_m + 1, y = y_m / board.square_m + 1;  // squares from the outer corner
  if (x < -kMarginSquares || y < -kMarginSquares || x > board.columns + 1 + kMarginSquares ||
      y > board.rows + 1 + kMarginSquares) {
    return kWall;
  }
  if (x < 0 || y < 0 || x >= board.columns + 1 || y >= board.rows + 1) return kWhite;
  const double soft = soft_m / board.square_m;
  return (kWhite + kBlack) / 2 - (kWhite - kBlack) / 2 * stripe(x, soft) * stripe(y, soft);
}

/// What one ray of a camera pixel meets.
struct Sample {
  float column, row;  // projector pixels
  float albedo;
};

/// Light that the slide throws at a position along its axis, blurred a little.
double light_at(const GraySlide& slide, double position, int count) {
  if (slide.kind != GraySlide::Kind::kBit) return slide.kind == GraySlide::Kind::kWhite ? 1 : 0;
  double sum = 0;
  for (const double shift : {-kBlur, 0.0, kBlur}) {
    const auto at = static_cast<int>(std::lround(position + shift));
    if (at < 0 || at >= count) continue;
    const bool bit = (gray_from_binary(static_cast<std::uint32_t>(at)) >> slide.bit & 1u) != 0;
    sum += bit != slide.inverse ? 1.0 / 3 : 0;
  }
  return sum;
}

std::vector<Sample> trace(const Rig& rig, const Board& board, const Pose& camera_from_board, int samples) {
  const auto r = rotation_matrix(camera_from_board);
  const Eigen::Vector3d t(camera_from_board[3], camera_from_board[4], camera_from_board[5]);
  const Eigen::Vector3d across(r[0], r[3], r[6]), down(r[1], r[4], r[7]), normal(r[2], r[5], r[8]);
  const Pose to_projector = compose(projector_pose(rig), camera_from_board);
  const double soft_m = 0.6 * t[2] / rig.camera.fx();  // a little more than half a camera pixel
  std::vector<Sample> out;
  out.reserve(static_cast<std::size_t>(rig.camera.width * rig.camera.height * samples * samples));
  for (int y = 0; y < rig.camera.height; ++y) {
    for (int x = 0; x < rig.camera.width; ++x) {
      for (int s = 0; s < samples * samples; ++s) {
        const double px = x + (s % samples + 0.5) / samples - 0.5,
                     py = y + (s / samples + 0.5) / samples - 0.5;
        const auto ray = undistort(rig.camera, px, py);
        const Eigen::Vector3d direction =
            ray ? Eigen::Vector3d((*ray)[0], (*ray)[1], 1) : Eigen::Vector3d(0, 0, 1);
        const double facing = direction.dot(normal);
        if (!ray || std::fabs(facing) < 1e-6) {
          out.push_back({-1e6f, -1e6f, 0});
          continue;
        }
        const Eigen::Vector3d hit = direction * (t.dot(normal) / facing) - t;
        const Vec2d on_board = {hit.dot(across), hit.dot(down)};
        const Vec2d lit = project_board(rig.projector, to_projector, on_board);
        out.push_back({static_cast<float>(lit[0]), static_cast<float>(lit[1]),
                       static_cast<float>(albedo_at(board, on_board[0], on_board[1], soft_m))});
      }
    }
  }
  return out;
}

bool in_picture(const Sample& s, const PinholeModel& projector) {
  return s.column > -0.5f && s.row > -0.5f && s.column < static_cast<float>(projector.width) - 0.5f &&
         s.row < static_cast<float>(projector.height) - 0.5f;
}

}  // namespace

std::vector<Pose> example_poses(const Rig& rig, const Board& board, double distance_m, int count,
                                std::uint32_t seed) {
  Random random(seed);
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
  const std::vector<Sample> samples = trace(rig, board, camera_from_board, options.samples);
  const auto each = static_cast<std::size_t>(options.samples * options.samples);
  Random random(options.seed);
  std::vector<Image8> out;
  for (const GraySlide& slide : gray_slides(rig.projector.width, rig.projector.height)) {
    const bool columns = slide.axis == GrayAxis::kColumns;
    Image8& picture = out.emplace_back(rig.camera.width, rig.camera.height, 1);
    for (std::size_t i = 0; i < picture.size(); ++i) {
      double sum = 0;
      for (std::size_t s = each * i; s < each * (i + 1); ++s) {
        const Sample& sample = samples[s];
        double light = options.ambient;
        if (in_picture(sample, rig.projector)) {
          light += light_at(slide, columns ? sample.column : sample.row,
                            columns ? rig.projector.width : rig.projector.height);
        }
        sum += light * sample.albedo;
      }
      picture.data()[i] = grey(kExposure * sum / static_cast<double>(each), options.noise, random);
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
  Random random(options.seed + 101u * colour);
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
      const Sample place{static_cast<float>(at[0]), static_cast<float>(at[1]), 0};
      const bool sheet = std::abs(x - out.width() / 2) < out.width() / 4 &&
                         std::abs(y - out.height() / 2) < out.height() / 4;
      const double albedo = sheet ? kWhite : kWall;
      for (int c = 0; c < 3; ++c) {
        const double value = (in_picture(place, rig.projector) ? light[c] : 0) + options.ambient * 0.25;
        out.row(y)[3 * x + c] = grey(kExposure * albedo * value, options.noise, random);
      }
    }
  }
  return out;
}

}  // namespace relievo
