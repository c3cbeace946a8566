// SPDX-License-Identifier: Apache-2.0
// From a surface to its grid: vertices and triangles to their places.
#include <algorithm>
#include <array>
#include <cmath>
#include <string>

#include "codec/gather_kernels.h"
#include "codec/stripe_grid.h"

namespace relievo {
namespace {

constexpr float kNearest_share = 0.25F;  // of a depth, that a step may change it by

/// The usual case: two triangles, one after the other, that fill a cell. 0: they do not. Without branches
/// on the diagonal, which is hard to foresee.
std::uint8_t filled_cell(const GridPoint* at, const Triangle& first, const Triangle& second,
                         std::uint32_t& cell) {
  if (first[2] != second[0] || first[0] != second[2]) return 0;
  const std::uint32_t a = place_key(at[first[0]]), b = place_key(at[first[1]]), c = place_key(at[first[2]]),
                      d = place_key(at[second[1]]);
  // The ring a b c d begins upper left, or else lower left. As masks, since compilers make branches of
  // choices.
  const std::uint32_t straight = b - a == kBelowKey ? ~0U : 0U;
  const auto choose = [straight](std::uint32_t one, std::uint32_t other) {
    return (one & straight) | (other & ~straight);
  };
  cell = choose(a, d);
  const std::uint32_t wrong = ((b - a) ^ choose(kBelowKey, kRightKey)) |
                              ((c - b) ^ choose(kRightKey, 0U - kBelowKey)) |
                              ((c - d) ^ choose(kBelowKey, kRightKey));
  return wrong != 0 ? std::uint8_t{0}
                    : static_cast<std::uint8_t>(choose(grid_cell::kStraight, grid_cell::kTurned));
}

/// Of a triangle whose vertices lie at three corners of one cell: the corner that it lacks. -1: they do not.
int missing_corner(std::uint32_t a, std::uint32_t b, std::uint32_t c, std::uint32_t& cell) {
  const std::uint32_t boundary = std::min({a & 0xffffU, b & 0xffffU, c & 0xffffU});
  const std::uint32_t line = std::min({a >> 16, b >> 16, c >> 16});
  cell = line << 16 | boundary;
  unsigned corners = 0;
  for (const std::uint32_t key : {a, b, c}) {
    const std::uint32_t d = key - cell;
    if ((d & ~0x10001U) != 0) return -1;
    corners |= 1U << (d >> 15 | (d & 1U));  // line and column of the corner
  }
  switch (corners) {  // bits: upper left, upper right, lower left, lower right
    case 0b1110:
      return 0;
    case 0b1011:
      return 1;
    case 0b0111:
      return 2;
    case 0b1101:
      return 3;
    default:
      return -1;
  }
}

/// Depths at which a step of a column changes them by more than kNearest_share: dz/dx is z^2 / (f b) or less.
float farthest_m(const GridCalibration& calibration, int step_bits) {
  const auto& t = calibration.projector_from_camera_translation;
  const double baseline = std::hypot(t[0], t[1], t[2]);
  return static_cast<float>(kNearest_share * calibration.camera.fx() * baseline * (1 << step_bits));
}

/// A surface on its way to a grid.
class Gather {
 public:
  Gather(const Surface& surface, const GridCalibration& calibration, StripeGrid& out)
      : surface_(surface),
        out_(out),
        farthest_m_(farthest_m(calibration, out.step_bits)),
        width_px_(static_cast<float>(calibration.camera.width)),
        stride_(static_cast<std::size_t>(out.stride())),
        right_(surface.grid.size() + kSpareRight) {}

  Status vertices();
  /// Of vertices that are in the grid.
  void quality();
  Status triangles();
  void drop_far_vertices();

 private:
  bool is_far(std::uint32_t v) const { return !(surface_.positions[v][2] < farthest_m_); }
  std::size_t at(std::uint32_t key) const {
    return (key >> 16) * stride_ + (key & 0xffffU) + StripeGrid::kMargin;
  }
  std::size_t fill(std::size_t n);
  Status add(const Triangle& triangle);

  const Surface& surface_;
  StripeGrid& out_;
  float farthest_m_, width_px_;
  std::size_t stride_;
  std::vector<std::uint8_t> right_;
  bool far_ = false;
};

Status Gather::vertices() {
  const GatherVertices job{.points = surface_.grid,
                           .grid = out_,
                           .steps = static_cast<float>(1 << out_.step_bits),
                           .width_px = width_px_,
                           .right = right_.data()};
  const GatherKernels& kernels = gather_kernels();
  switch (kernels.vertices(job)) {
    case Gathered::kOutside:
      return Error{"surface has a vertex outside the grid of its calibration"};
    case Gathered::kTwice:
      return Error{"surface has two vertices at one place of the grid: send it as a mesh"};
    case Gathered::kAll:
      break;
  }
  out_.vertices = static_cast<std::uint32_t>(surface_.grid.size());
  const Reach reach = kernels.reach(surface_.positions, farthest_m_);
  if (reach == Reach::kNotFinite) return Error{"surface has a position that is not finite"};
  far_ = reach == Reach::kFar;
  return {};
}

void Gather::quality() {
  if (surface_.grid.empty()) return;
  if (!surface_.sigmas_m.empty()) out_.sigmas.assign(out_.columns.size(), 0);
  if (!surface_.interpolated.empty() &&
      std::ranges::count(surface_.interpolated, 0) != std::ssize(surface_.interpolated))
    out_.interpolated.assign(out_.columns.size(), 0);
  for (std::size_t i = 0; i < surface_.grid.size(); ++i) {
    const GridPoint& p = surface_.grid[i];
    const std::size_t place = at(place_key(p));
    if (!out_.sigmas.empty()) out_.sigmas[place] = sigma_px_code(p.sigma_px);
    if (!out_.interpolated.empty()) out_.interpolated[place] = surface_.interpolated[i] != 0;
  }
}

/// The cell that triangles n and n + 1 fill, and those that follow it filled: how many triangles that is. 0:
/// they fill none.
std::size_t Gather::fill(std::size_t n) {
  const std::vector<Triangle>& all = surface_.triangles;
  if (n + 1 >= all.size() || far_ || all[n + 1][1] >= surface_.grid.size()) return 0;
  const Triangle &first = all[n], &second = all[n + 1];
  std::uint32_t cell = 0;
  const std::uint8_t filled = filled_cell(surface_.grid.data(), first, second, cell);
  if (filled == 0 || out_.cells[at(cell)] != 0) return 0;
  out_.cells[at(cell)] = filled;
  const bool straight = filled == grid_cell::kStraight;
  const std::uint32_t upper = straight ? first[0] : second[1], lower = first[straight ? 1 : 0];
  std::size_t cells = 1;
  if ((right_[upper] & right_[lower]) != 0)
    cells += gather_kernels().fill_run({.triangles = std::span(all).subspan(n + 2),
                                        .right = right_.data(),
                                        .upper = upper + 1,
                                        .lower = lower + 1,
                                        .cell = &out_.cells[at(cell)] + 1});
  out_.triangles += static_cast<std::uint32_t>(2 * cells);
  return 2 * cells;
}

/// A triangle by itself.
Status Gather::add(const Triangle& t) {
  const auto key = [this](std::uint32_t v) { return place_key(surface_.grid[v]); };
  std::uint32_t cell = 0;
  const int corner = missing_corner(key(t[0]), key(t[1]), key(t[2]), cell);
  if (corner < 0) return Error{"surface has a triangle that is in no cell of the grid: send it as a mesh"};
  if (far_ && (is_far(t[0]) || is_far(t[1]) || is_far(t[2]))) return {};
  std::uint8_t& cells = out_.cells[at(cell)];
  const auto one = static_cast<std::uint8_t>(1U << corner);
  const auto both = static_cast<std::uint8_t>(cells | one);
  if (cells != 0 && (both == cells || (both != grid_cell::kStraight && both != grid_cell::kTurned)))
    return Error{"surface has triangles that overlap: send it as a mesh"};
  cells = both;
  ++out_.triangles;
  return {};
}

Status Gather::triangles() {
  const std::size_t count = surface_.grid.size();
  for (std::size_t n = 0; n < surface_.triangles.size();) {
    const Triangle& triangle = surface_.triangles[n];
    if (triangle[0] >= count || triangle[1] >= count || triangle[2] >= count)
      return Error{"surface has a triangle on a vertex that is not there"};
    if (const std::size_t filled = fill(n); filled > 0) {
      n += filled;
      continue;
    }
    if (Status status = add(triangle); !status) return status;
    ++n;
  }
  return {};
}

void Gather::drop_far_vertices() {
  if (!far_) return;
  for (std::uint32_t v = 0; v < surface_.grid.size(); ++v) {
    if (!is_far(v)) continue;
    const std::size_t place = at(place_key(surface_.grid[v]));
    out_.columns[place] = StripeGrid::kAbsent;
    if (!out_.sigmas.empty()) out_.sigmas[place] = 0;
    if (!out_.interpolated.empty()) out_.interpolated[place] = 0;
    --out_.vertices;
  }
}

}  // namespace

Status to_grid(const Surface& surface, const GridCalibration& calibration, int step_bits, bool with_quality,
               StripeGrid& out) {
  if (surface.grid.size() != surface.positions.size())
    return Error{"surface has no places on the grid of stripes and lines: send it as a mesh"};
  out.reset(calibration.boundaries(), calibration.lines(), step_bits);
  Gather gather(surface, calibration, out);
  if (Status status = gather.vertices(); !status) return status;
  if (with_quality) gather.quality();
  if (Status status = gather.triangles(); !status) return status;
  gather.drop_far_vertices();
  return {};
}

}  // namespace relievo
