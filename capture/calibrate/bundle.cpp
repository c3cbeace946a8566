// SPDX-License-Identifier: Apache-2.0
#include "capture/calibrate/bundle.h"

#include <Eigen/Dense>
#include <cmath>

#include "capture/reconstruct/triangulate.h"

namespace relievo {
namespace {

constexpr int kLens = 9;                // fx fy cx cy k1 k2 p1 p2 k3
constexpr int kShared = 2 * kLens + 6;  // both lenses, projector_from_camera
constexpr int kPose = 6;
constexpr int kMaxRounds = 200;
constexpr double kStep = 1e-6;  // of central differences, relative to a parameter's scale

Eigen::Matrix3d rotation_of(const Pose& pose) {
  const Eigen::Vector3d v(pose[0], pose[1], pose[2]);
  const double angle = v.norm();
  if (angle < 1e-12) return Eigen::Matrix3d::Identity();
  return Eigen::AngleAxisd(angle, v / angle).toRotationMatrix();
}

Eigen::Vector3d translation_of(const Pose& pose) {
  return {pose[3], pose[4], pose[5]};
}

Pose pose_of(const Eigen::Matrix3d& rotation, const Eigen::Vector3d& translation) {
  const Eigen::AngleAxisd turn(rotation);
  const Eigen::Vector3d v = turn.angle() * turn.axis();
  return {v[0], v[1], v[2], translation[0], translation[1], translation[2]};
}

void read_lens(const PinholeModel& lens, double* p) {
  p[0] = lens.fx();
  p[1] = lens.fy();
  p[2] = lens.cx();
  p[3] = lens.cy();
  for (std::size_t i = 0; i < 5; ++i) p[4 + i] = lens.distortion[i];
}

PinholeModel lens_of(const PinholeModel& size, const double* p) {
  PinholeModel lens = size;
  lens.matrix = {p[0], 0, p[2], 0, p[1], p[3], 0, 0, 1};
  for (std::size_t i = 0; i < 5; ++i) lens.distortion[i] = p[4 + i];
  return lens;
}

Pose pose_at(const double* p) {
  return {p[0], p[1], p[2], p[3], p[4], p[5]};
}

class Adjuster {
 public:
  Adjuster(const BundleProblem& problem, const BundlePriors& priors) : problem_(problem), priors_(priors) {
    x_.resize(kShared + kPose * static_cast<Eigen::Index>(problem.views.size()));
    read_lens(problem.camera, x_.data());
    read_lens(problem.projector, x_.data() + kLens);
    std::copy(problem.projector_from_camera.begin(), problem.projector_from_camera.end(),
              x_.data() + 2 * kLens);
    for (std::size_t v = 0; v < problem.views.size(); ++v) {
      const Pose& pose = problem.views[v].camera_from_board;
      std::copy(pose.begin(), pose.end(), x_.data() + offset(v));
    }
  }

  Result<BundleResult> run() {
    double damping = 1e-3;
    double cost = cost_at(x_);
    int rounds = 0;
    Eigen::MatrixXd normal;
    Eigen::VectorXd gradient;
    bool fresh = true;
    for (; rounds < kMaxRounds && damping < 1e12; ++rounds) {
      if (fresh) linearise(normal, gradient);
      Eigen::MatrixXd damped = normal;
      damped.diagonal() *= 1 + damping;
      const Eigen::LDLT<Eigen::MatrixXd> factors(damped);
      const Eigen::VectorXd step = factors.solve(-gradient);
      if (!step.allFinite()) return degenerate();
      const Eigen::VectorXd next = x_ + step;
      const double next_cost = cost_at(next);
      fresh = next_cost < cost;
      if (!fresh) {
        damping *= 8;
        continue;
      }
      const double gain = (cost - next_cost) / cost;
      x_ = next;
      cost = next_cost;
      damping = std::max(1e-12, damping / 5);
      if (gain < 1e-10) break;
    }
    if (!std::isfinite(cost)) return degenerate();
    return result(rounds);
  }

 private:
  static Eigen::Index offset(std::size_t view) { return kShared + kPose * static_cast<Eigen::Index>(view); }
  static Error degenerate() {
    return {"the views do not determine the rig: take more, with the board tilted in different directions"};
  }

  /// Residuals of one view, in sigmas: four a corner.
  void residuals(const Eigen::VectorXd& x, std::size_t view, Eigen::VectorXd& out) const {
    const BoardView& seen = problem_.views[view];
    const PinholeModel camera = lens_of(problem_.camera, x.data());
    const PinholeModel projector = lens_of(problem_.projector, x.data() + kLens);
    const Pose board = pose_at(x.data() + offset(view));
    const Pose between = pose_at(x.data() + 2 * kLens);
    const Eigen::Matrix3d rc = rotation_of(board), rp = rotation_of(between);
    const Eigen::Vector3d tc = translation_of(board), tp = translation_of(between);
    out.resize(4 * static_cast<Eigen::Index>(seen.corners.size()));
    for (std::size_t i = 0; i < seen.corners.size(); ++i) {
      const CornerSight& corner = seen.corners[i];
      const Eigen::Vector3d in_camera = rc * Eigen::Vector3d(corner.board_m[0], corner.board_m[1], 0) + tc;
      const Eigen::Vector3d in_projector = rp * in_camera + tp;
      const auto c = distort(camera, in_camera[0] / in_camera[2], in_camera[1] / in_camera[2]);
      const auto p = distort(projector, in_projector[0] / in_projector[2], in_projector[1] / in_projector[2]);
      const auto at = 4 * static_cast<Eigen::Index>(i);
      out[at] = (c[0] - corner.camera_px[0]) / priors_.noise_px;
      out[at + 1] = (c[1] - corner.camera_px[1]) / priors_.noise_px;
      out[at + 2] = (p[0] - corner.projector_px[0]) / priors_.noise_px;
      out[at + 3] = (p[1] - corner.projector_px[1]) / priors_.noise_px;
    }
  }

  /// Prior residuals in sigmas, with their derivative by the parameter they are about.
  struct Prior {
    int parameter;
    double residual, slope;
  };
  std::vector<Prior> priors(const Eigen::VectorXd& x) const {
    std::vector<Prior> out;
    const auto about = [&](int parameter, double value, double sigma) {
      out.push_back({parameter, (x[parameter] - value) / sigma, 1 / sigma});
    };
    const auto lens = [&](int first, const PinholeModel& size, std::array<double, 2> centre,
                          std::array<double, 4> bend) {
      about(first + 2, (size.width - 1) / 2.0, centre[0] * size.width);
      about(first + 3, (size.height - 1) / 2.0, centre[1] * size.width);
      about(first + 4, 0, bend[0]);
      about(first + 5, 0, bend[1]);
      about(first + 6, 0, bend[3]);
      about(first + 7, 0, bend[3]);
      about(first + 8, 0, bend[2]);
    };
    const BundlePriors& p = priors_;
    lens(0, problem_.camera, {p.centre, p.centre}, {p.k1, p.k2, p.k3, p.tangential});
    lens(kLens, problem_.projector, {p.projector_centre_x, p.projector_centre_y},
         {p.projector_k1, p.projector_k2, p.projector_k3, p.projector_tangential});
    return out;
  }
  /// log(fx / fy) of a lens, in sigmas.
  double aspect(const Eigen::VectorXd& x, int first) const {
    return std::log(x[first] / x[first + 1]) / priors_.aspect;
  }

  double cost_at(const Eigen::VectorXd& x) const {
    double cost = 0;
    Eigen::VectorXd r;
    const double c2 = loss_squared();
    for (std::size_t v = 0; v < problem_.views.size(); ++v) {
      residuals(x, v, r);
      for (Eigen::Index i = 0; i < r.size(); i += 2) {
        cost += c2 * std::log1p((r[i] * r[i] + r[i + 1] * r[i + 1]) / c2);
      }
    }
    for (const Prior& p : priors(x)) cost += p.residual * p.residual;
    for (const int first : {0, kLens}) cost += aspect(x, first) * aspect(x, first);
    return std::isfinite(cost) ? cost : std::numeric_limits<double>::infinity();
  }

  double loss_squared() const { return std::pow(priors_.loss_px / priors_.noise_px, 2); }

  static double scale_of(int shared_parameter) {
    const int in_lens = shared_parameter % kLens;
    return shared_parameter < 2 * kLens && in_lens < 4 ? 1000 : 1;
  }

  /// Gauss-Newton's normal equations with the loss's weights.
  void linearise(Eigen::MatrixXd& normal, Eigen::VectorXd& gradient) const {
    normal = Eigen::MatrixXd::Zero(x_.size(), x_.size());
    gradient = Eigen::VectorXd::Zero(x_.size());
    const double c2 = loss_squared();
    Eigen::VectorXd r, plus, minus;
    for (std::size_t v = 0; v < problem_.views.size(); ++v) {
      residuals(x_, v, r);
      Eigen::MatrixXd j(r.size(), kShared + kPose);
      Eigen::VectorXd x = x_;
      for (int k = 0; k < kShared + kPose; ++k) {
        const Eigen::Index at = k < kShared ? k : offset(v) + k - kShared;
        const double h = kStep * (k < kShared ? scale_of(k) : 1);
        x[at] = x_[at] + h;
        residuals(x, v, plus);
        x[at] = x_[at] - h;
        residuals(x, v, minus);
        x[at] = x_[at];
        j.col(k) = (plus - minus) / (2 * h);
      }
      Eigen::VectorXd w(r.size());
      for (Eigen::Index i = 0; i < r.size(); i += 2) {
        w[i] = w[i + 1] = 1 / (1 + (r[i] * r[i] + r[i + 1] * r[i + 1]) / c2);
      }
      const Eigen::MatrixXd h = j.transpose() * w.asDiagonal() * j;
      const Eigen::VectorXd g = j.transpose() * w.asDiagonal() * r;
      const Eigen::Index o = offset(v);
      normal.topLeftCorner(kShared, kShared) += h.topLeftCorner(kShared, kShared);
      normal.block(0, o, kShared, kPose) += h.topRightCorner(kShared, kPose);
      normal.block(o, 0, kPose, kShared) += h.bottomLeftCorner(kPose, kShared);
      normal.block(o, o, kPose, kPose) += h.bottomRightCorner(kPose, kPose);
      gradient.head(kShared) += g.head(kShared);
      gradient.segment(o, kPose) += g.tail(kPose);
    }
    for (const Prior& p : priors(x_)) {
      normal(p.parameter, p.parameter) += p.slope * p.slope;
      gradient[p.parameter] += p.slope * p.residual;
    }
    for (const int first : {0, kLens}) {
      const double dx = 1 / (x_[first] * priors_.aspect), dy = -1 / (x_[first + 1] * priors_.aspect);
      normal(first, first) += dx * dx;
      normal(first + 1, first + 1) += dy * dy;
      normal(first, first + 1) += dx * dy;
      normal(first + 1, first) += dx * dy;
      gradient[first] += dx * aspect(x_, first);
      gradient[first + 1] += dy * aspect(x_, first);
    }
  }

  Devices devices(const Eigen::VectorXd& x) const {
    return {lens_of(problem_.camera, x.data()), lens_of(problem_.projector, x.data() + kLens),
            pose_at(x.data() + 2 * kLens)};
  }

  Result<BundleResult> result(int rounds) const {
    Eigen::MatrixXd normal;
    Eigen::VectorXd gradient;
    linearise(normal, gradient);
    const Eigen::MatrixXd covariance = normal.ldlt().solve(Eigen::MatrixXd::Identity(x_.size(), x_.size()));
    BundleResult out;
    for (std::size_t i = 0; i < 4; ++i) {
      const auto k = static_cast<Eigen::Index>(i);
      out.sigma_px[i] = std::sqrt(std::max(0.0, covariance(k, k)));
      out.sigma_px[4 + i] = std::sqrt(std::max(0.0, covariance(kLens + k, kLens + k)));
    }
    static_cast<Devices&>(out) = devices(x_);
    if (!(out.camera.fx() > 0 && out.camera.fy() > 0 && out.projector.fx() > 0 && out.projector.fy() > 0)) {
      return degenerate();
    }
    const Eigen::MatrixXd directions = covariance.topLeftCorner(kShared, kShared).llt().matrixL();
    for (int k = 0; k < kShared; ++k) out.deviations.push_back(devices(x_.head(kShared) + directions.col(k)));
    for (std::size_t v = 0; v < problem_.views.size(); ++v) {
      out.camera_from_board.push_back(pose_at(x_.data() + offset(v)));
    }
    out.cost = cost_at(x_);
    out.rounds = rounds;
    return out;
  }

  const BundleProblem& problem_;
  const BundlePriors& priors_;
  Eigen::VectorXd x_;
};

}  // namespace

Result<BundleResult> adjust_bundle(const BundleProblem& problem, const BundlePriors& priors) {
  return Adjuster(problem, priors).run();
}

Rig rig_of(const Devices& devices) {
  Rig rig;
  rig.camera = devices.camera;
  rig.projector = devices.projector;
  rig.projector_from_camera_rotation = rotation_matrix(devices.projector_from_camera);
  for (std::size_t i = 0; i < 3; ++i)
    rig.projector_from_camera_translation[i] = devices.projector_from_camera[3 + i];
  return rig;
}

Vec2d project_board(const PinholeModel& lens, const Pose& lens_from_board, Vec2d board_m) {
  const Eigen::Vector3d p = rotation_of(lens_from_board) * Eigen::Vector3d(board_m[0], board_m[1], 0) +
                            translation_of(lens_from_board);
  return distort(lens, p[0] / p[2], p[1] / p[2]);
}

Pose compose(const Pose& second, const Pose& first) {
  const Eigen::Matrix3d r = rotation_of(second);
  return pose_of(r * rotation_of(first), r * translation_of(first) + translation_of(second));
}

Pose inverse(const Pose& pose) {
  const Eigen::Matrix3d r = rotation_of(pose).transpose();
  return pose_of(r, -(r * translation_of(pose)));
}

std::array<double, 9> rotation_matrix(const Pose& pose) {
  std::array<double, 9> out{};
  Eigen::Map<Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(out.data()) = rotation_of(pose);
  return out;
}

}  // namespace relievo
