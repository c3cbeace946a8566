// SPDX-License-Identifier: Apache-2.0
#include "capture/pattern/gray_decode.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>
#include <numeric>

namespace relievo {
namespace {

constexpr int kMaxStep = 4;           // projector pixels between neighbouring camera pixels of one surface
constexpr std::size_t kFitEdges = 8;  // a window with fewer grows
constexpr std::size_t kMinEdges = 5;
constexpr double kFitSteepness = 2;  // projector pixels a camera pixel: farther edges are another surface
constexpr double kInlier = 0.75;     // projector pixels from the plane
constexpr int kRounds = 3;
constexpr double kMaxShift = 1.5;    // of the fitted plane from the whole column read
constexpr std::size_t kFewest = 50;  // one pixel in so many that are read may be read wrongly

/// Whole columns (or rows) as read, -1 where not clear or outside of the projector.
struct Codes {
  std::vector<int> code;
  const std::vector<GrayPair>* pairs = nullptr;
};

int difference(const GrayPair& pair, std::size_t pixel) {
  return int{pair.lit.data()[pixel]} - int{pair.inverse.data()[pixel]};
}

/// Difference by sum: independent of albedo, so that an edge does not shift where the surface changes colour.
double contrast_at(const GrayPair& pair, std::size_t pixel) {
  const int sum = int{pair.lit.data()[pixel]} + int{pair.inverse.data()[pixel]};
  return sum > 0 ? static_cast<double>(difference(pair, pixel)) / sum : 0;
}

int read_code(const std::vector<GrayPair>& pairs, std::size_t pixel, double clear) {
  std::uint32_t gray = 0;
  int unclear = -1;
  for (std::size_t bit = 0; bit < pairs.size(); ++bit) {
    const int d = difference(pairs[bit], pixel);
    if (d > 0) gray |= 1u << bit;
    if (std::abs(d) >= clear) continue;
    if (unclear >= 0) return -1;
    unclear = static_cast<int>(bit);
  }
  const int code = static_cast<int>(binary_from_gray(gray));
  if (unclear >= 0) {
    const int other = static_cast<int>(binary_from_gray(gray ^ 1u << unclear));
    if (std::abs(code - other) != 1) return -1;
  }
  return code;
}

/// The edges between pixel `from` at (x, y) and its neighbour `to`, one step right or down.
void add_edges(const Codes& codes, std::size_t from, std::size_t to, std::array<float, 2> at, bool down,
               std::vector<GrayEdge>& edges) {
  const int a = codes.code[from];
  const int b = codes.code[to];
  if (a < 0 || b < 0 || a == b || std::abs(a - b) > kMaxStep) return;
  for (int left = std::min(a, b); left < std::max(a, b); ++left) {
    const GrayPair& pair = (*codes.pairs)[static_cast<std::size_t>(gray_bit_between(left))];
    const double here = contrast_at(pair, from);
    const double there = contrast_at(pair, to);
    if ((here > 0) == (there > 0)) continue;
    const auto t = static_cast<float>(here / (here - there));
    edges.push_back({at[0] + (down ? 0 : t), at[1] + (down ? t : 0), static_cast<float>(left) + 0.5f});
  }
}

GrayEdges find_edges(const Codes& codes, int width, int height, WorkerPool& pool) {
  std::vector<GrayEdges> parts(static_cast<std::size_t>(height));
  pool.for_ranges(height, [&](int begin, int end, int) {
    for (int y = begin; y < end; ++y) {
      GrayEdges& part = parts[static_cast<std::size_t>(y)];
      for (int x = 0; x < width; ++x) {
        part.first.push_back(static_cast<std::uint32_t>(part.edges.size()));
        const std::size_t pixel =
            static_cast<std::size_t>(y) * static_cast<std::size_t>(width) + static_cast<std::size_t>(x);
        const auto fx = static_cast<float>(x), fy = static_cast<float>(y);
        if (x > 0) add_edges(codes, pixel - 1, pixel, {fx - 1, fy}, false, part.edges);
        if (y > 0)
          add_edges(codes, pixel - static_cast<std::size_t>(width), pixel, {fx, fy - 1}, true, part.edges);
      }
    }
  });
  GrayEdges all;
  all.first.reserve(codes.code.size() + 1);
  for (const GrayEdges& part : parts) {
    const auto before = static_cast<std::uint32_t>(all.edges.size());
    for (const std::uint32_t i : part.first) all.first.push_back(before + i);
    all.edges.insert(all.edges.end(), part.edges.begin(), part.edges.end());
  }
  all.first.push_back(static_cast<std::uint32_t>(all.edges.size()));
  return all;
}

/// A plane value = a + gx * (x - x0) + gy * (y - y0) through edges, by normal equations.
class PlaneFit {
 public:
  void add(double dx, double dy, double value) {
    const std::array<double, 3> row = {1, dx, dy};
    for (std::size_t i = 0; i < 3; ++i) {
      for (std::size_t j = 0; j < 3; ++j) normal_[i][j] += row[i] * row[j];
      right_[i] += row[i] * value;
    }
    ++count_;
  }
  std::size_t count() const { return count_; }

  /// False where the edges do not span a plane.
  bool solve(std::array<double, 3>& plane) const {
    const auto& n = normal_;
    const double c00 = n[1][1] * n[2][2] - n[1][2] * n[1][2];
    const double c01 = n[0][2] * n[1][2] - n[0][1] * n[2][2];
    const double c02 = n[0][1] * n[1][2] - n[0][2] * n[1][1];
    const double det = n[0][0] * c00 + n[0][1] * c01 + n[0][2] * c02;
    if (!(det > 1e-3 * n[0][0] * n[0][0] * n[0][0])) return false;
    const double c11 = n[0][0] * n[2][2] - n[0][2] * n[0][2];
    const double c12 = n[0][1] * n[0][2] - n[0][0] * n[1][2];
    const double c22 = n[0][0] * n[1][1] - n[0][1] * n[0][1];
    plane = {(c00 * right_[0] + c01 * right_[1] + c02 * right_[2]) / det,
             (c01 * right_[0] + c11 * right_[1] + c12 * right_[2]) / det,
             (c02 * right_[0] + c12 * right_[1] + c22 * right_[2]) / det};
    return true;
  }

 private:
  std::array<std::array<double, 3>, 3> normal_{};
  std::array<double, 3> right_{};
  std::size_t count_ = 0;
};

/// Sub-pixel column of pixel (x, y), or none where no plane fits the edges around.
class EdgeSurface {
 public:
  EdgeSurface(const GrayEdges& edges, int width, int height)
      : edges_(edges), width_(width), height_(height) {}

  bool at(int x, int y, int code, int window, double& value) {
    for (int grow = 1; grow <= 4; grow *= 2) {
      if (gather(x, y, code, window * grow) && fit(x, y, code, value)) return true;
    }
    return false;
  }

 private:
  /// Whether there are edges enough, of two columns at least.
  bool gather(int x, int y, int code, int reach) {
    near_.clear();
    const auto w = static_cast<std::size_t>(width_);
    float low = 1e9f, high = -1e9f;
    for (int v = std::max(0, y - reach); v <= std::min(height_ - 1, y + reach); ++v) {
      const std::size_t row = static_cast<std::size_t>(v) * w;
      const std::size_t begin = edges_.first[row + static_cast<std::size_t>(std::max(0, x - reach))];
      const std::size_t end =
          edges_.first[row + static_cast<std::size_t>(std::min(width_ - 1, x + reach)) + 1];
      for (std::size_t i = begin; i < end; ++i) {
        const GrayEdge& e = edges_.edges[i];
        if (std::fabs(e.value - static_cast<float>(code)) > kFitSteepness * reach + 1) continue;
        near_.push_back(e);
        low = std::min(low, e.value);
        high = std::max(high, e.value);
      }
    }
    return near_.size() >= kFitEdges && high > low;
  }

  bool fit(int x, int y, int code, double& value) const {
    std::array<double, 3> plane{};
    for (int round = 0; round < kRounds; ++round) {
      PlaneFit sums;
      double squares = 0;
      for (const GrayEdge& e : near_) {
        const double dx = e.x - static_cast<float>(x), dy = e.y - static_cast<float>(y);
        if (round > 0) {
          const double off = plane[0] + plane[1] * dx + plane[2] * dy - e.value;
          if (std::fabs(off) > kInlier * (kRounds - round)) continue;
          squares += off * off;
        }
        sums.add(dx, dy, e.value);
      }
      if (sums.count() < kMinEdges || !sums.solve(plane)) return false;
    }
    value = plane[0];
    return std::fabs(value - code) <= kMaxShift;
  }

  const GrayEdges& edges_;
  int width_, height_;
  std::vector<GrayEdge> near_;
};

/// Whether a third of the neighbours read about the same.
bool has_company(const std::vector<int>& code, int width, int height, int x, int y) {
  const auto at = [&](int u, int v) {
    return code[static_cast<std::size_t>(v) * static_cast<std::size_t>(width) + static_cast<std::size_t>(u)];
  };
  int alike = 0;
  for (int v = std::max(0, y - 1); v <= std::min(height - 1, y + 1); ++v) {
    for (int u = std::max(0, x - 1); u <= std::min(width - 1, x + 1); ++u) {
      if ((u != x || v != y) && at(u, v) >= 0 && std::abs(at(u, v) - at(x, y)) <= 2) ++alike;
    }
  }
  return alike >= 3;
}

ImageF map_of(const Codes& codes, const GrayEdges& edges, int width, int height, int window, int count,
              WorkerPool& pool) {
  ImageF map(width, height, 1);
  pool.for_ranges(height, [&](int begin, int end, int) {
    EdgeSurface surface(edges, width, height);
    for (int y = begin; y < end; ++y) {
      for (int x = 0; x < width; ++x) {
        const int code = codes.code[static_cast<std::size_t>(y) * static_cast<std::size_t>(width) +
                                    static_cast<std::size_t>(x)];
        float& out = map.row(y)[x];
        out = -1;
        if (code < 0) continue;
        double value = code;
        if (window > 0 && surface.at(x, y, code, window, value)) {
          out = static_cast<float>(std::clamp(value, 0.0, count - 1.0));
        } else if (has_company(codes.code, width, height, x, y)) {
          out = static_cast<float>(code);
        }
      }
    }
  });
  return map;
}

Status check(const GrayStack& stack) {
  for (const GrayAxis axis : {GrayAxis::kColumns, GrayAxis::kRows}) {
    const bool columns = axis == GrayAxis::kColumns;
    const auto& pairs = columns ? stack.columns : stack.rows;
    const int count = columns ? stack.projector_width : stack.projector_height;
    const std::string name = columns ? "columns" : "rows";
    if (count < 2 || count > 16384) return Error{"the projector must have 2 to 16384 " + name};
    if (static_cast<int>(pairs.size()) < gray_bits(count)) {
      return Error{std::to_string(count) + " projector " + name + " need " +
                   std::to_string(gray_bits(count)) + " bits, the stack has " + std::to_string(pairs.size())};
    }
    for (const GrayPair& pair : pairs) {
      for (const Image8* picture : {&pair.lit, &pair.inverse}) {
        if (picture->width() != stack.width() || picture->height() != stack.height() || picture->empty()) {
          return Error{"the pictures of a Gray-code stack must be of one size"};
        }
      }
    }
  }
  return {};
}

}  // namespace

Result<GrayMaps> decode_gray(const GrayStack& stack, const GrayDecodeOptions& options, WorkerPool& pool) {
  if (const Status good = check(stack); !good) return good.error();
  const int width = stack.width(), height = stack.height();
  const std::size_t pixels = static_cast<std::size_t>(width) * static_cast<std::size_t>(height);
  Codes columns{std::vector<int>(pixels, -1), &stack.columns};
  Codes rows{std::vector<int>(pixels, -1), &stack.rows};
  std::vector<std::uint8_t> lit(pixels), beyond(pixels);
  pool.for_ranges(height, [&](int begin, int end, int) {
    const std::size_t last = static_cast<std::size_t>(end) * static_cast<std::size_t>(width);
    for (std::size_t i = static_cast<std::size_t>(begin) * static_cast<std::size_t>(width); i < last; ++i) {
      int contrast = 0;
      for (const auto* pairs : {&stack.columns, &stack.rows}) {
        for (const GrayPair& pair : *pairs) contrast = std::max(contrast, std::abs(difference(pair, i)));
      }
      if (contrast < options.min_contrast) continue;
      lit[i] = 1;
      const double clear = std::max<double>(options.min_difference, options.min_share * contrast);
      const int column = read_code(stack.columns, i, clear), row = read_code(stack.rows, i, clear);
      const bool has_column = column < stack.projector_width, has_row = row < stack.projector_height;
      columns.code[i] = has_column ? column : -1;
      rows.code[i] = has_row ? row : -1;
      beyond[i] = column >= 0 && row >= 0 && !(has_column && has_row);
    }
  });

  GrayMaps maps;
  maps.column_edges = find_edges(columns, width, height, pool);
  maps.row_edges = find_edges(rows, width, height, pool);
  maps.columns =
      map_of(columns, maps.column_edges, width, height, options.window_px, stack.projector_width, pool);
  maps.rows = map_of(rows, maps.row_edges, width, height, options.window_px, stack.projector_height, pool);
  for (std::size_t i = 0; i < pixels; ++i) {
    maps.lit += lit[i];
    maps.beyond += beyond[i];
    float& column = maps.columns.data()[i];
    float& row = maps.rows.data()[i];
    if (column >= 0 && row >= 0) {
      ++maps.decoded;
      continue;
    }
    if (lit[i]) ++(columns.code[i] < 0 || rows.code[i] < 0 ? maps.uncertain : maps.lone);
    column = row = -1;
  }
  return maps;
}

std::string beyond_projector(const GrayStack& stack, const GrayMaps& maps) {
  const std::size_t read = maps.lit - maps.uncertain + maps.beyond;
  if (kFewest * maps.beyond <= read) return {};
  return std::to_string(maps.beyond) + " of " + std::to_string(read) +
         " pixels see columns or rows outside of " + std::to_string(stack.projector_width) + "x" +
         std::to_string(stack.projector_height) +
         ": is --projector right, and are the pictures in the order of projection?";
}

}  // namespace relievo
