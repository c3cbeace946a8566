// SPDX-License-Identifier: Apache-2.0
#include "capture/reconstruct/field_balance.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>

#include "base/fit_image.h"

namespace relievo {
namespace {

constexpr int kLines = 64;      // of a frame, of which are read
constexpr int kStride = 27;     // in this order, so that any first ones are all over the picture,
constexpr int kLeastLines = 8;  // so many and more until there are
constexpr std::size_t kEnoughPairs = 600;
constexpr std::size_t kLeastPairs = 100;  // fewer tell nothing
constexpr float kLeastRise = 10;          // grey levels over three columns,
constexpr float kLeastRiseShare = 0.25;   // and of the exposures' sum
constexpr float kLeastSum = 20;           // grey levels
constexpr float kTogether_px = 1;         // channels that cross zero so near each other do so at one boundary
constexpr int kRounds = 3;
constexpr float kOutlier = 2.5F;       // standard deviations
constexpr float kAlike = 4;            // pairs that say that channels are alike
constexpr float kLeastCertain = 30;    // chi squared of three offsets
constexpr double kLeastExcess = 5e-3;  // less shifts no edge by what matters

using Matrix3 = Eigen::Matrix<double, 3, 3, Eigen::RowMajor>;
using Matrix5 = Eigen::Matrix<float, 5, 5>;
// Offsets of red, green and blue, and by how many columns green and blue lie behind red.
using Vector5 = Eigen::Matrix<float, 5, 1>;

using ChannelTables = std::array<std::array<std::uint8_t, 256>, 3>;

/// out = row, each channel by its own table.
void look_up(const std::uint8_t* row, int width, const ChannelTables& tables, std::uint8_t* out) {
  for (int x = 0; x < width; ++x)
    for (std::size_t c = 0; c < 3; ++c)
      out[3 * x + static_cast<int>(c)] = tables[c][row[3 * x + static_cast<int>(c)]];
}

}  // namespace

FieldBalance::FieldBalance(const std::array<double, 9>& colour_matrix) {
  const Matrix3 mixing = Matrix3(Eigen::Map<const Matrix3>(colour_matrix.data())).inverse();
  Eigen::Map<Matrix3>(mixing_.data()) = mixing;
  for (std::size_t i = 0; i < 9; ++i)
    weights_.colour[i] = static_cast<float>(colour_matrix[i]) / RowKernels::kLowPassed;
  weights_.luma = {};
}

/// Where the difference's channels cross zero on a line.
void FieldBalance::read_line(const DetectionLines& lines, int line) {
  const RowKernels& kernels = row_kernels();
  const int width = lines.own.width;
  const auto row = static_cast<std::size_t>(3 * width);
  const auto of_row = [&](std::size_t i) { return rows_.data() + i * row; };
  const FieldRows seen{of_row(0), of_row(1)};
  const FieldRows smooth{of_row(2), of_row(3)};
  kernels.combine_fields(lines.own.row(line), lines.other_above(line), lines.other_below(line), 3 * width,
                         seen);
  for (const auto plane : {&FieldRows::difference, &FieldRows::sum})
    kernels.low_pass(seen.*plane, seen.*plane, seen.*plane, 3 * width, of_row(4), smooth.*plane);
  float* difference = planes_.data();
  float* sum = difference + row;
  float* unused = sum + row;
  kernels.to_planes(smooth, width, weights_, {difference, unused});
  kernels.to_planes({smooth.sum, smooth.sum}, width, weights_, {sum, unused});
  kernels.crossings(difference, width, kLeastRise, flags_.data());
  crossings_.clear();
  const auto sign = static_cast<float>(lines.sign());
  for (int x = 1; x + 2 < width; ++x) {
    for (int c = 0; c < 3 && flags_[static_cast<std::size_t>(x)] >> c != 0; ++c) {
      if ((flags_[static_cast<std::size_t>(x)] >> c & 1) == 0) continue;
      const float* d = difference + c * width + x;
      const float both = 0.5F * (sum[c * width + x] + sum[c * width + x + 1]);
      if (both < kLeastSum || std::fabs(d[2] - d[-1]) < kLeastRiseShare * both) continue;
      crossings_.push_back({static_cast<std::uint8_t>(c), static_cast<float>(x) + d[0] / (d[0] - d[1]),
                            sign * both / (d[1] - d[0])});
    }
  }
}

/// Adds those that belong together.
void FieldBalance::pair_line(int width) {
  const std::size_t most = std::min(pairs_.capacity(), pairs_.size() + static_cast<std::size_t>(width));
  std::sort(crossings_.begin(), crossings_.end(),
            [](const Crossing& a, const Crossing& b) { return a.column_px < b.column_px; });
  for (std::size_t i = 0; i < crossings_.size(); ++i) {
    const Crossing& a = crossings_[i];
    for (std::size_t k = i + 1; k < std::min(i + 3, crossings_.size()); ++k) {
      const Crossing& b = crossings_[k];
      if (b.column_px - a.column_px > kTogether_px || pairs_.size() >= most) break;
      if (a.channel == b.channel) continue;
      const float weight = 1 / std::hypot(a.rise_px, b.rise_px);
      pairs_.push_back({a.channel, b.channel, weight, weight * (b.column_px - a.column_px),
                        weight * a.rise_px, -weight * b.rise_px});
    }
  }
}

/// Of the difference's calibrated channels, of the sum's: an offset shifts a crossing by itself times the
/// inverse rise, so that of two at one boundary the distances say what both are. By least squares without
/// outliers.
std::array<double, 3> FieldBalance::offsets() {
  Vector5 found = Vector5::Zero();
  if (pairs_.size() < kLeastPairs) return {};
  float limit = 1e9F;
  float certain = 0;
  for (int round = 0; round < kRounds; ++round) {
    Matrix5 normal = Matrix5::Identity() * 1e-3F;
    Vector5 right = Vector5::Zero();
    for (int c = 0; c < 3; ++c) {
      const int next = (c + 1) % 3;
      normal(c, c) += 2 * kAlike;
      normal(c, next) -= kAlike;
      normal(next, c) -= kAlike;
    }
    residuals_.clear();
    for (const Pair& pair : pairs_) {
      Vector5 a = Vector5::Zero();
      a[pair.first] = pair.by_first;
      a[pair.second] = pair.by_second;
      if (pair.first > 0) a[2 + pair.first] -= pair.weight;
      if (pair.second > 0) a[2 + pair.second] += pair.weight;
      const float residual = std::fabs(pair.apart - a.dot(found));
      residuals_.push_back(residual);
      if (residual > limit) continue;
      normal.noalias() += a * a.transpose();
      right += pair.apart * a;
    }
    found = normal.ldlt().solve(right);
    const auto middle = residuals_.begin() + static_cast<std::ptrdiff_t>(residuals_.size() / 2);
    std::nth_element(residuals_.begin(), middle, residuals_.end());
    const float sigma = 1.4826F * *middle + 1e-6F;
    limit = kOutlier * sigma;
    const Eigen::Matrix<float, 3, 2> with_shift = normal.topRightCorner<3, 2>();
    const Eigen::Matrix2f of_shift = normal.bottomRightCorner<2, 2>();
    const Eigen::Matrix3f alone =
        normal.topLeftCorner<3, 3>() - with_shift * of_shift.inverse() * with_shift.transpose();
    certain = found.head<3>().dot(alone * found.head<3>()) / (sigma * sigma);
  }
  if (certain < kLeastCertain) return {};
  return {found[0], found[1], found[2]};
}

void FieldBalance::measure(const DetectionLines& lines) {
  const int width = lines.own.width;
  const auto row = static_cast<std::size_t>(3 * width);
  rows_.resize(5 * row);
  planes_.resize(2 * row + static_cast<std::size_t>(width));
  flags_.resize(static_cast<std::size_t>(width));
  crossings_.reserve(row);
  pairs_.reserve(kLines * static_cast<std::size_t>(width));
  residuals_.reserve(pairs_.capacity());
  pairs_.clear();
  excess_ = {};
  if (lines.other.empty()) return;
  for (int i = 0; i < kLines && (i < kLeastLines || pairs_.size() < kEnoughPairs); ++i) {
    const int place = kStride * i % kLines;
    read_line(lines, (2 * place + 1) * lines.own.height / (2 * kLines));
    pair_line(width);
  }
  const std::array<double, 3> offset = offsets();
  const Eigen::Map<const Matrix3> mixing(mixing_.data());
  const Eigen::Vector3d of_captured = mixing * Eigen::Map<const Eigen::Vector3d>(offset.data());
  const Eigen::Vector3d white = mixing.rowwise().sum();
  for (int c = 0; c < 3; ++c) excess_[static_cast<std::size_t>(c)] = 2 * of_captured[c] / white[c];
}

/// The brighter one is made darker, so that nothing saturates.
void FieldBalance::darken(const CapturedFrame& frame, WorkerPool& pool) {
  std::array<ChannelTables, 2> tables;  // of the slide's and of the other exposure
  for (std::size_t c = 0; c < 3; ++c) {
    for (std::size_t exposure = 0; exposure < 2; ++exposure) {
      const double more = std::clamp(exposure == 0 ? excess_[c] : -excess_[c], 0.0, 1.0);
      const double share = (1 - more / 2) / (1 + more / 2);
      for (std::size_t value = 0; value < 256; ++value)
        tables[exposure][c][value] =
            static_cast<std::uint8_t>(std::lround(share * static_cast<double>(value)));
    }
  }
  balanced_.take_heading(frame);
  const bool interlaced = frame.scan == Scan::kInterlaced;
  const auto each_row = [&](const Image8& from, Image8& to, const auto& exposure_of) {
    fit_image(from.width(), from.height(), from.channels(), to);
    pool.for_ranges(from.height(), [&](int begin, int end, int) {
      for (int y = begin; y < end; ++y) look_up(from.row(y), from.width(), tables[exposure_of(y)], to.row(y));
    });
  };
  const std::size_t even = interlaced && frame.field_order == FieldOrder::kBottom ? 1 : 0;
  each_row(frame.picture, balanced_.picture,
           [&](int y) { return interlaced && y % 2 == 1 ? 1 - even : even; });
  if (!interlaced) each_row(frame.complement, balanced_.complement, [](int) { return std::size_t{1}; });
}

const CapturedFrame& FieldBalance::balance(const CapturedFrame& frame, WorkerPool& pool) {
  measure(DetectionLines(frame));
  if (std::all_of(excess_.begin(), excess_.end(), [](double e) { return std::fabs(e) < kLeastExcess; }))
    return frame;
  darken(frame, pool);
  return balanced_;
}

}  // namespace relievo
