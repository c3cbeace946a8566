// SPDX-License-Identifier: Apache-2.0
#include "capture/calibrate/local_homography.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <vector>

namespace relievo {
namespace {

constexpr int kMinEdges = 40;       // an axis
constexpr double kTightest = 0.15;  // projector pixels: edges nearer than this always agree
constexpr double kSpread = 3;       // robust sigmas
constexpr int kRounds = 8;

/// An edge relative to the corner, on a scale of about one.
struct Sample {
  double x, y, value;
  bool column;
};

struct Frame {
  double scale;          // camera pixels
  double column0, row0;  // projector pixels around the corner
};

void gather(const GrayEdges& edges, int width, int height, Vec2d at, double radius, bool column, double scale,
            std::vector<Sample>& out) {
  const int r = static_cast<int>(std::ceil(radius)) + 1;
  const int cx = static_cast<int>(std::lround(at[0])), cy = static_cast<int>(std::lround(at[1]));
  const int left = std::max(0, cx - r), right = std::min(width - 1, cx + r);
  if (left > right) return;
  for (int y = std::max(0, cy - r); y <= std::min(height - 1, cy + r); ++y) {
    const std::size_t row = static_cast<std::size_t>(y) * static_cast<std::size_t>(width);
    const std::size_t begin = edges.first[row + static_cast<std::size_t>(left)];
    const std::size_t end = edges.first[row + static_cast<std::size_t>(right) + 1];
    for (std::size_t i = begin; i < end; ++i) {
      const GrayEdge& e = edges.edges[i];
      const double dx = double{e.x} - at[0], dy = double{e.y} - at[1];
      if (dx * dx + dy * dy <= radius * radius)
        out.push_back({dx / scale, dy / scale, double{e.value}, column});
    }
  }
}

double median(std::vector<double> values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

double median_value(const std::vector<Sample>& samples, bool column) {
  std::vector<double> values;
  for (const Sample& s : samples) {
    if (s.column == column) values.push_back(s.value);
  }
  return median(std::move(values));
}

/// A plane through edges of two columns alone would say nothing of how they bend.
bool enough_values(const std::vector<Sample>& samples, bool column) {
  std::vector<double> values;
  for (const Sample& s : samples) {
    if (s.column == column && std::find(values.begin(), values.end(), s.value) == values.end()) {
      values.push_back(s.value);
      if (values.size() == 3) return true;
    }
  }
  return false;
}

using Vector8 = Eigen::Matrix<double, 8, 1>;

/// h: u = (h0 x + h1 y + h2) / (1 + h6 x + h7 y), v likewise with h3..h5; values are relative to the frame.
double predicted(const Vector8& h, const Sample& s) {
  const int k = s.column ? 0 : 3;
  return (h[k] * s.x + h[k + 1] * s.y + h[k + 2]) / (1 + h[6] * s.x + h[7] * s.y);
}

/// Least squares over the edges with a weight; each gives one equation, of its own axis.
std::optional<Vector8> solve(const std::vector<Sample>& samples, const std::vector<double>& weights) {
  Eigen::Matrix<double, 8, 8> normal = Eigen::Matrix<double, 8, 8>::Zero();
  Vector8 right = Vector8::Zero();
  for (std::size_t i = 0; i < samples.size(); ++i) {
    if (weights[i] == 0) continue;
    const Sample& s = samples[i];
    Vector8 row = Vector8::Zero();
    const int k = s.column ? 0 : 3;
    row[k] = s.x;
    row[k + 1] = s.y;
    row[k + 2] = 1;
    row[6] = -s.value * s.x;
    row[7] = -s.value * s.y;
    normal += weights[i] * row * row.transpose();
    right += weights[i] * s.value * row;
  }
  const Eigen::LDLT<Eigen::Matrix<double, 8, 8>> factors(normal);
  if (factors.info() != Eigen::Success || !factors.isPositive()) return std::nullopt;
  const Vector8 h = factors.solve(right);
  if (!h.allFinite()) return std::nullopt;
  return h;
}

}  // namespace

std::optional<ProjectedCorner> project_corner(const ProjectorEdges& edges, Vec2d camera_px,
                                              double radius_px) {
  std::vector<Sample> samples;
  gather(edges.columns, edges.width, edges.height, camera_px, radius_px, true, radius_px, samples);
  const auto columns = static_cast<int>(samples.size());
  gather(edges.rows, edges.width, edges.height, camera_px, radius_px, false, radius_px, samples);
  const int rows = static_cast<int>(samples.size()) - columns;
  if (columns < kMinEdges || rows < kMinEdges) return std::nullopt;
  if (!enough_values(samples, true) || !enough_values(samples, false)) return std::nullopt;
  const Frame frame{radius_px, median_value(samples, true), median_value(samples, false)};
  for (Sample& s : samples) s.value -= s.column ? frame.column0 : frame.row0;

  // Iteratively reweighted from an L1-like start, so that a share of wrong edges (misread bits) does no harm.
  std::vector<double> weights(samples.size(), 1.0), off(samples.size());
  std::optional<Vector8> h;
  for (int round = 0; round < kRounds; ++round) {
    h = solve(samples, weights);
    if (!h) return std::nullopt;
    for (std::size_t i = 0; i < samples.size(); ++i)
      off[i] = std::fabs(predicted(*h, samples[i]) - samples[i].value);
    const double limit = std::max(kTightest, kSpread * 1.4826 * median(off));
    for (std::size_t i = 0; i < samples.size(); ++i) {
      weights[i] = round < 3 ? 1 / std::max(0.05, off[i]) : off[i] <= limit ? 1 : 0;
    }
  }
  ProjectedCorner out;
  out.projector_px = {(*h)[2] + frame.column0, (*h)[5] + frame.row0};
  int agreeing_columns = 0, agreeing_rows = 0;
  double squares = 0;
  for (std::size_t i = 0; i < samples.size(); ++i) {
    if (weights[i] == 0) continue;
    ++(samples[i].column ? agreeing_columns : agreeing_rows);
    squares += off[i] * off[i];
  }
  out.edges = agreeing_columns + agreeing_rows;
  if (agreeing_columns < std::max(kMinEdges, columns / 2) || agreeing_rows < std::max(kMinEdges, rows / 2)) {
    return std::nullopt;
  }
  out.rms_px = std::sqrt(squares / out.edges);
  return out;
}

}  // namespace relievo
