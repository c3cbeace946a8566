// SPDX-License-Identifier: Apache-2.0
#include "capture/calibrate/seen_board.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <numbers>

#include "capture/reconstruct/triangulate.h"

namespace relievo {
namespace {

constexpr double kBlur = 0.4;       // of Gray code, projector pixels to either side
constexpr float kNowhere = -1e6f;   // projector pixels
constexpr float kWidestReach = 24;  // projector pixels: grazing surfaces are dim mixtures anyway

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

/// NTSC: luma keeps its bandwidth, the colour differences lose most of theirs. One row of RGB.
void blur_chroma(std::vector<float>& rgb, double sigma) {
  const auto width = static_cast<int>(rgb.size() / 3);
  const int reach = static_cast<int>(std::ceil(3 * sigma));
  std::vector<float> weights;
  float total = 0;
  for (int i = -reach; i <= reach; ++i) {
    weights.push_back(static_cast<float>(std::exp(-0.5 * i * i / (sigma * sigma))));
    total += weights.back();
  }
  std::vector<float> luma(static_cast<std::size_t>(width));
  for (std::size_t x = 0; x < luma.size(); ++x)
    luma[x] = 0.299f * rgb[3 * x] + 0.587f * rgb[3 * x + 1] + 0.114f * rgb[3 * x + 2];
  const std::vector<float> sharp = rgb;
  for (int x = 0; x < width; ++x) {
    float sum[3] = {};
    for (int i = -reach; i <= reach; ++i) {
      const auto at = static_cast<std::size_t>(std::clamp(x + i, 0, width - 1));
      const float w = weights[static_cast<std::size_t>(i + reach)] / total;
      for (std::size_t c = 0; c < 3; ++c) sum[c] += w * (sharp[3 * at + c] - luma[at]);
    }
    const auto at = static_cast<std::size_t>(x);
    for (std::size_t c = 0; c < 3; ++c) rgb[3 * at + c] = luma[at] + sum[c];
  }
}

}  // namespace

SceneRandom::SceneRandom(std::uint32_t seed) : state_(0x9E3779B97F4A7C15u * (seed + 1u)) {}

double SceneRandom::uniform() {  // splitmix64
  std::uint64_t x = state_ += 0x9E3779B97F4A7C15u;
  x = (x ^ (x >> 30)) * 0xBF58476D1CE4E5B9u;
  x = (x ^ (x >> 27)) * 0x94D049BB133111EBu;
  return static_cast<double>((x ^ (x >> 31)) >> 11) * 0x1p-53;
}

double SceneRandom::normal() {
  const double u = std::max(1e-12, uniform());
  return std::sqrt(-2 * std::log(u)) * std::cos(2 * std::numbers::pi * uniform());
}

std::uint8_t exposed(double value, double noise, const CameraResponse& response, SceneRandom& random) {
  return response.value_of(static_cast<float>(value + noise * random.normal()));
}

Pose projector_pose(const Rig& rig) {
  const Eigen::AngleAxisd turn(Eigen::Matrix3d(Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(
      rig.projector_from_camera_rotation.data())));
  const Eigen::Vector3d v = turn.angle() * turn.axis();
  const auto& t = rig.projector_from_camera_translation;
  return {v[0], v[1], v[2], t[0], t[1], t[2]};
}

SeenBoard::SeenBoard(const Rig& rig, const BoardSurface& surface, const Pose& camera_from_board, int samples)
    : rig_(rig),
      response_(rig.camera_gamma),
      each_(static_cast<std::size_t>(samples * samples)),
      samples_(samples) {
  traced_.reserve(static_cast<std::size_t>(rig.camera.width * rig.camera.height) * each_);
  for (int y = 0; y < rig.camera.height; ++y) trace_row(surface, camera_from_board, y);
}

void SeenBoard::trace_row(const BoardSurface& surface, const Pose& camera_from_board, int y) {
  const auto r = rotation_matrix(camera_from_board);
  const Eigen::Vector3d t(camera_from_board[3], camera_from_board[4], camera_from_board[5]);
  const Eigen::Vector3d across(r[0], r[3], r[6]), down(r[1], r[4], r[7]), normal(r[2], r[5], r[8]);
  const Pose to_projector = compose(projector_pose(rig_), camera_from_board);
  const double soft_m = 0.6 * t[2] / rig_.camera.fx();  // a little more than half a camera pixel
  for (int x = 0; x < rig_.camera.width; ++x) {
    for (int s = 0; s < samples_ * samples_; ++s) {
      const double px = x + (s % samples_ + 0.5) / samples_ - 0.5,
                   py = y + (s / samples_ + 0.5) / samples_ - 0.5;
      const auto ray = undistort(rig_.camera, px, py);
      const Eigen::Vector3d direction =
          ray ? Eigen::Vector3d((*ray)[0], (*ray)[1], 1) : Eigen::Vector3d(0, 0, 1);
      const double facing = direction.dot(normal);
      if (!ray || std::fabs(facing) < 1e-6) {
        traced_.push_back({kNowhere, kNowhere, 0});
        continue;
      }
      const Eigen::Vector3d hit = direction * (t.dot(normal) / facing) - t;
      const Vec2d on_board = {hit.dot(across), hit.dot(down)};
      const Vec2d at = project_board(rig_.projector, to_projector, on_board);
      traced_.push_back({static_cast<float>(at[0]), static_cast<float>(at[1]),
                         static_cast<float>(surface.albedo(on_board[0], on_board[1], soft_m))});
    }
  }
}

bool SeenBoard::lit(const Sample& s) const {
  return s.column > -0.5f && s.row > -0.5f && s.column < static_cast<float>(rig_.projector.width) - 0.5f &&
         s.row < static_cast<float>(rig_.projector.height) - 0.5f;
}

/// Half of what one sample of the pixel covers along the axis, projector pixels.
float SeenBoard::reach(std::size_t pixel, bool along_rows) const {
  const auto width = static_cast<std::size_t>(rig_.camera.width);
  const std::size_t step = along_rows ? width : 1;
  const std::size_t next = pixel + step < traced_.size() / each_ ? pixel + step : pixel - step;
  const Sample &a = traced_[each_ * pixel], &b = traced_[each_ * next];
  const float apart = std::fabs(along_rows ? a.row - b.row : a.column - b.column);
  return std::min(kWidestReach, apart / static_cast<float>(2 * samples_));
}

Image8 SeenBoard::under(const GraySlide& slide, const BoardSceneOptions& options) const {
  const bool columns = slide.axis == GrayAxis::kColumns;
  SceneRandom random(options.seed);
  Image8 picture(rig_.camera.width, rig_.camera.height, 1);
  for (std::size_t i = 0; i < picture.size(); ++i) {
    double sum = 0;
    for (std::size_t s = each_ * i; s < each_ * (i + 1); ++s) {
      const Sample& sample = traced_[s];
      double light = options.ambient;
      if (lit(sample)) {
        light += light_at(slide, columns ? sample.column : sample.row,
                          columns ? rig_.projector.width : rig_.projector.height);
      }
      sum += light * sample.albedo;
    }
    picture.data()[i] = exposed(kBoardExposure * options.exposure * sum / static_cast<double>(each_),
                                options.noise, response_, random);
  }
  return picture;
}

Image8 SeenBoard::under(const StripeSlide& slide, const BoardSceneOptions& options) const {
  const Eigen::Matrix3f seen =
      Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(rig_.colour_matrix.data())
          .inverse()
          .cast<float>();
  const auto ambient = static_cast<float>(options.ambient);
  SceneRandom random(options.seed);
  Image8 picture(rig_.camera.width, rig_.camera.height, 3);
  const auto width = static_cast<std::size_t>(picture.width());
  std::vector<float> row(3 * width);
  for (int y = 0; y < picture.height(); ++y) {
    for (std::size_t x = 0; x < width; ++x) {
      const std::size_t pixel = static_cast<std::size_t>(y) * width + x;
      const float half = reach(pixel, slide.along_rows);
      Eigen::Vector3f projected = Eigen::Vector3f::Zero();
      float albedo = 0;
      for (std::size_t s = each_ * pixel; s < each_ * (pixel + 1); ++s) {
        const Sample& sample = traced_[s];
        albedo += sample.albedo;
        if (!lit(sample)) continue;
        const float at = slide.along_rows ? sample.row : sample.column;
        const sim::Vec3 mean = slide.light->mean(at - half, at + half);
        const Eigen::Vector3f light(mean.x, mean.y, mean.z);
        projected +=
            sample.albedo * (slide.complement ? Eigen::Vector3f(Eigen::Vector3f::Ones() - light) : light);
      }
      const Eigen::Vector3f value = seen * projected + Eigen::Vector3f::Constant(ambient * albedo);
      const auto scale = static_cast<float>(kBoardExposure * options.exposure / static_cast<double>(each_));
      for (int c = 0; c < 3; ++c) row[3 * x + static_cast<std::size_t>(c)] = scale * value[c];
    }
    if (options.chroma > 0) blur_chroma(row, options.chroma);
    for (std::size_t i = 0; i < row.size(); ++i)
      picture.row(y)[i] = exposed(static_cast<double>(row[i]), options.noise, response_, random);
  }
  return picture;
}

}  // namespace relievo
