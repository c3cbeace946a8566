// SPDX-License-Identifier: Apache-2.0
#include "codec/grid_fit.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

namespace relievo {
namespace {

constexpr std::int32_t kAbsent = StripeGrid::kAbsent;
constexpr int kSampledLines = 40;
constexpr double kLimit_px = 2;
constexpr double kRidge = 4;  // steps squared a line: keeps weights small where nothing can be told

/// Normal equations of N weights, solved by elimination.
template <std::size_t N>
struct Fit {
  std::array<std::array<double, N>, N> a{};
  std::array<double, N> b{};

  void add(const std::array<std::int32_t, N>& x, std::int32_t y) {
    for (std::size_t i = 0; i < N; ++i) {
      for (std::size_t j = 0; j < N; ++j) a[i][j] += static_cast<double>(x[i]) * x[j];
      b[i] += static_cast<double>(x[i]) * y;
    }
  }
  std::array<std::int16_t, N> weights() {
    for (std::size_t i = 0; i < N; ++i) a[i][i] += kRidge * kSampledLines;
    for (std::size_t i = 0; i < N; ++i)
      for (std::size_t r = i + 1; r < N; ++r) {
        const double f = a[r][i] / a[i][i];  // positive definite: no pivot is 0
        for (std::size_t c = i; c < N; ++c) a[r][c] -= f * a[i][c];
        b[r] -= f * b[i];
      }
    std::array<std::int16_t, N> out{};
    std::array<double, N> w{};
    for (std::size_t i = N; i-- > 0;) {
      double sum = b[i];
      for (std::size_t c = i + 1; c < N; ++c) sum -= a[i][c] * w[c];
      w[i] = sum / a[i][i];
      const double limit = GridModel::kMostWeight;
      out[i] = static_cast<std::int16_t>(std::lround(std::clamp(256 * w[i], -limit, limit)));
    }
    return out;
  }
};

Fit<3> fit_of(const GridSlopes& sums) {
  const auto of = [](std::int64_t sum) { return static_cast<double>(sum); };
  Fit<3> fit;
  fit.a = {{{of(sums.x0x0), of(sums.x0x1), of(sums.x0x2)},
            {of(sums.x0x1), of(sums.x1x1), of(sums.x1x2)},
            {of(sums.x0x2), of(sums.x1x2), of(sums.x2x2)}}};
  fit.b = {of(sums.x0y), of(sums.x1y), of(sums.x2y)};
  return fit;
}

bool near(std::int32_t d, std::int32_t limit) {
  return d <= limit && d >= -limit;
}

std::int32_t usual_spacing(const StripeGrid& grid, int line_step) {
  std::vector<std::int32_t> all;
  for (int line = 0; line < grid.lines; line += 4 * line_step) {
    const std::int32_t* here = grid.columns.data() + grid.at(line, 0);
    for (int b = 1; b < grid.boundaries; b += 5)
      if (here[b] != kAbsent && here[b - 1] != kAbsent) all.push_back(here[b] - here[b - 1]);
  }
  if (all.empty()) return 0;
  const auto middle = all.begin() + static_cast<std::ptrdiff_t>(all.size() / 2);
  std::nth_element(all.begin(), middle, all.end());
  return std::clamp(*middle, 0, 1 << 15);
}

}  // namespace

GridModel fit_model(const StripeGrid& grid, const StripeGrid* key) {
  GridModel model;
  model.limit = static_cast<std::uint16_t>(kLimit_px * (1 << grid.step_bits));
  const std::int32_t limit = model.limit;
  const int line_step = std::max(1, grid.picture_lines() / kSampledLines);
  model.spacing = usual_spacing(grid, line_step);
  const auto row = [&](const StripeGrid& of, int line) { return of.columns.data() + of.at(line, 0); };
  GridSlopes sums;
  const int places =
      (grid.boundaries + 7) / 8 * 8;  // behind the last one are none, and eight are as quick as one
  for (int line = 4; line < grid.lines; line += line_step) {
    const GridRows rows{.up1 = row(grid, line - 1),
                        .up2 = row(grid, line - 2),
                        .up3 = row(grid, line - 3),
                        .up4 = row(grid, line - 4),
                        .key = nullptr,
                        .key_up = nullptr};
    grid_kernels().slopes(row(grid, line), rows, limit, places, sums);
  }
  Fit<3> slopes = fit_of(sums);
  const auto w = slopes.weights();
  model.slope1 = w[0];
  model.slope2 = w[1];
  model.slope3 = w[2];
  if (key == nullptr) return model;

  Fit<2> keys;
  std::vector<std::int32_t> expected(static_cast<std::size_t>(grid.stride()));
  for (int line = 4; line < grid.lines; line += line_step) {
    const std::int32_t *here = row(grid, line), *up1 = row(grid, line - 1);
    const std::int32_t *there = row(*key, line), *there_up = row(*key, line - 1);
    grid_kernels().predict(
        {up1, row(grid, line - 2), row(grid, line - 3), row(grid, line - 4), nullptr, nullptr}, model,
        grid.boundaries, expected.data());
    for (int b = 0; b < grid.boundaries; ++b) {
      if (here[b] == kAbsent || up1[b] == kAbsent || there[b] == kAbsent || there_up[b] == kAbsent) continue;
      const std::int32_t p = expected[static_cast<std::size_t>(b)];
      const std::array<std::int32_t, 2> x{there[b] - p, up1[b] - there_up[b]};
      if (near(here[b] - p, limit) && near(x[0], limit) && near(x[1], limit)) keys.add(x, here[b] - p);
    }
  }
  const auto k = keys.weights();
  model.key = k[0];
  model.key_change = k[1];
  return model;
}

}  // namespace relievo
