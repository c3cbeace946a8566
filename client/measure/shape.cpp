// SPDX-License-Identifier: Apache-2.0
#include "client/measure/shape.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <limits>
#include <random>
#include <vector>

namespace relievo {
namespace {

constexpr int kSamples = 200;  // half of the points may be of something else
constexpr std::size_t kJudges = 2000;
constexpr int kRounds = 20;
constexpr double kTukey = 4.685;  // 95 % as efficient as least squares where errors are normal
constexpr double kMadToSigma = 1.4826;
constexpr double kStill_m = 1e-10;

Eigen::Vector3d vector_of(const Vec3f& p) {
  return Eigen::Vector3f(p[0], p[1], p[2]).cast<double>();
}

Shape plane(const Eigen::Vector3d& through, Eigen::Vector3d normal) {
  if (normal.dot(through) > 0) normal = -normal;  // the camera is at the origin
  return {ShapeKind::kPlane, {normal[0], normal[1], normal[2]}, -normal.dot(through)};
}

Shape sphere(const Eigen::Vector3d& centre, double radius_m) {
  return {ShapeKind::kSphere, {centre[0], centre[1], centre[2]}, radius_m};
}

std::optional<Shape> through(ShapeKind kind, std::span<const Eigen::Vector3d> p) {
  if (kind == ShapeKind::kPlane) {
    const Eigen::Vector3d normal = (p[1] - p[0]).cross(p[2] - p[0]);
    if (!(normal.norm() > 1e-12)) return std::nullopt;
    return plane(p[0], normal.normalized());
  }
  Eigen::Matrix3d differences;
  Eigen::Vector3d squares;
  for (int i = 0; i < 3; ++i) {
    const Eigen::Vector3d d = p[static_cast<std::size_t>(i) + 1] - p[0];
    differences.row(i) = 2 * d.transpose();
    squares[i] = d.squaredNorm();
  }
  const Eigen::FullPivLU<Eigen::Matrix3d> solver(differences);
  if (!solver.isInvertible()) return std::nullopt;
  const Eigen::Vector3d from_first = solver.solve(squares);
  return sphere(p[0] + from_first, from_first.norm());
}

/// Of |height|, metres.
double median_height(const Shape& shape, std::span<const Vec3f> points, std::vector<double>& scratch) {
  scratch.clear();
  for (const Vec3f& p : points) scratch.push_back(std::fabs(shape.height_m(p)));
  const auto middle = scratch.begin() + static_cast<std::ptrdiff_t>(scratch.size() / 2);
  std::ranges::nth_element(scratch, middle);
  return *middle;
}

std::optional<Shape> best_sample(ShapeKind kind, std::span<const Vec3f> points) {
  std::vector<Vec3f> judges;
  const std::size_t step = std::max<std::size_t>(1, points.size() / kJudges);
  for (std::size_t i = 0; i < points.size(); i += step) judges.push_back(points[i]);
  std::minstd_rand random;
  std::vector<double> scratch;
  std::optional<Shape> best;
  double least = std::numeric_limits<double>::infinity();
  for (int i = 0; i < kSamples; ++i) {
    std::array<Eigen::Vector3d, 4> sample;
    for (Eigen::Vector3d& p : sample) p = vector_of(points[random() % points.size()]);
    const auto shape = through(kind, sample);
    if (!shape) continue;
    const double off = median_height(*shape, judges, scratch);
    if (!(off < least)) continue;
    least = off;
    best = shape;
  }
  return best;
}

/// Weighted least squares of distances: a plane's at once, of a sphere one step of Gauss-Newton.
std::optional<Shape> improved(const Shape& shape, std::span<const Vec3f> points, double sigma_m) {
  const double reach = kTukey * sigma_m;
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  Eigen::Matrix3d products = Eigen::Matrix3d::Zero();
  Eigen::Matrix4d normal = Eigen::Matrix4d::Zero();
  Eigen::Vector4d right = Eigen::Vector4d::Zero();
  double weights = 0;
  const Eigen::Vector3d origin = vector_of(points.front());
  for (const Vec3f& point : points) {
    const double off = shape.height_m(point);
    const double share = off / reach;
    if (!(std::fabs(share) < 1)) continue;
    const double weight = (1 - share * share) * (1 - share * share);
    weights += weight;
    if (shape.kind == ShapeKind::kPlane) {
      const Eigen::Vector3d p = vector_of(point) - origin;
      sum += weight * p;
      products += weight * p * p.transpose();
    } else {
      const auto n = shape.normal_at(point);
      const Eigen::Vector4d change(-n[0], -n[1], -n[2], -1);
      normal += weight * change * change.transpose();
      right -= weight * off * change;
    }
  }
  if (!(weights > 3)) return std::nullopt;
  if (shape.kind == ShapeKind::kPlane) {
    const Eigen::Vector3d mean = sum / weights;
    const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> axes(products / weights - mean * mean.transpose());
    return plane(origin + mean, axes.eigenvectors().col(0));
  }
  const Eigen::FullPivLU<Eigen::Matrix4d> solver(normal);
  if (!solver.isInvertible()) return std::nullopt;
  const Eigen::Vector4d by = solver.solve(right);
  return sphere(Eigen::Vector3d(shape.at[0], shape.at[1], shape.at[2]) + by.head<3>(), shape.size_m + by[3]);
}

}  // namespace

std::optional<ShapeKind> shape_kind_named(std::string_view name) {
  if (name == "plane") return ShapeKind::kPlane;
  if (name == "sphere") return ShapeKind::kSphere;
  return std::nullopt;
}

double Shape::height_m(const Vec3f& point) const {
  const Eigen::Vector3d v(at[0], at[1], at[2]);
  if (kind == ShapeKind::kPlane) return v.dot(vector_of(point)) + size_m;
  return (vector_of(point) - v).norm() - size_m;
}

std::array<double, 3> Shape::normal_at(const Vec3f& point) const {
  if (kind == ShapeKind::kPlane) return at;
  const Eigen::Vector3d n = (vector_of(point) - Eigen::Vector3d(at[0], at[1], at[2])).normalized();
  return {n[0], n[1], n[2]};
}

std::optional<Shape> fit_shape(ShapeKind kind, std::span<const Vec3f> points) {
  if (points.size() < 4) return std::nullopt;
  std::optional<Shape> shape = best_sample(kind, points);
  std::vector<double> scratch;
  for (int i = 0; shape && i < kRounds; ++i) {
    const double sigma_m = kMadToSigma * median_height(*shape, points, scratch);
    const auto next = improved(*shape, points, std::max(sigma_m, kStill_m));
    if (!next) return std::nullopt;
    const bool still = std::fabs(next->size_m - shape->size_m) < kStill_m;
    shape = next;
    if (still) break;
  }
  return shape;
}

}  // namespace relievo
