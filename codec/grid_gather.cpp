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
const Error kInNoCell{"surface has a triangle that is in no cell of the grid: send it as a mesh"};

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

/// How many vertices come before the second places, which are the last ones.
std::size_t count_firsts(const Surface& surface, int lines) {
  std::size_t count = surface.grid.size();
  while (count > 0 && surface.grid[count - 1].line >= lines) --count;
  return count;
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
        lines_(static_cast<std::uint32_t>(out.picture_lines())),
        firsts_(count_firsts(surface, out.picture_lines())),
        right_(surface.grid.size() + kSpareRight) {
    std::size_t count = surface.triangles.size();
    while (count > 0 && has_second(surface.triangles[count - 1])) --count;
    triangles_ = std::span(surface.triangles).first(count);
  }

  Status vertices();
  /// Of vertices that are in the grid.
  void quality();
  /// Those without second places.
  Status triangles();
  /// The others, after them.
  Status second_triangles();
  void drop_far_vertices();

 private:
  bool is_far(std::uint32_t v) const { return !(surface_.positions[v][2] < farthest_m_); }
  std::size_t at(std::uint32_t key) const {
    return (key >> 16) * stride_ + (key & 0xffffU) + StripeGrid::kMargin;
  }
  bool is_far(const Triangle& t) const { return far_ && (is_far(t[0]) || is_far(t[1]) || is_far(t[2])); }
  bool has_second(const Triangle& t) const { return t[0] >= firsts_ || t[1] >= firsts_ || t[2] >= firsts_; }
  Status put(std::span<const GridPoint> points, std::uint8_t* right, std::uint32_t lines);
  std::size_t fill(std::size_t n);
  Status add(const Triangle& triangle, const std::array<std::uint32_t, 3>& keys);
  bool copy(std::uint32_t vertex);

  const Surface& surface_;
  StripeGrid& out_;
  float farthest_m_, width_px_;
  std::size_t stride_;
  std::uint32_t lines_;                  // of the picture
  std::size_t firsts_;                   // vertices before the second places
  std::span<const Triangle> triangles_;  // those before the ones on second places
  std::vector<std::uint8_t> right_;
  bool far_ = false;
};

Status Gather::put(std::span<const GridPoint> points, std::uint8_t* right, std::uint32_t lines) {
  const GatherVertices job{.points = points,
                           .grid = out_,
                           .lines = static_cast<int>(lines),
                           .steps = static_cast<float>(1 << out_.step_bits),
                           .width_px = width_px_,
                           .right = right};
  switch (gather_kernels().vertices(job)) {
    case Gathered::kOutside:
      return Error{"surface has a vertex outside the grid of its calibration"};
    case Gathered::kTwice:
      return Error{"surface has two vertices at one place of the grid: send it as a mesh"};
    case Gathered::kAll:
      break;
  }
  return {};
}

Status Gather::vertices() {
  const std::span<const GridPoint> all = surface_.grid;
  if (Status status = put(all.first(firsts_), right_.data(), lines_); !status) return status;
  if (Status status = put(all.subspan(firsts_), right_.data() + firsts_, 2 * lines_); !status) return status;
  out_.vertices = static_cast<std::uint32_t>(surface_.grid.size());
  const Reach reach = gather_kernels().reach(surface_.positions, farthest_m_);
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
  const auto steps = static_cast<float>(1 << out_.step_bits);
  for (std::size_t i = 0; i < surface_.grid.size(); ++i) {
    const GridPoint& p = surface_.grid[i];
    const std::size_t place = at(place_key(p));
    if (!out_.sigmas.empty()) {
      // What was rounded before, as a stream that is sent on, is not rounded again.
      const bool rounded = p.column_px * steps != static_cast<float>(out_.columns[place]);
      out_.sigmas[place] = sigma_px_code(rounded ? sigma_of_rounded_px(p.sigma_px, 1 / steps) : p.sigma_px);
    }
    if (!out_.interpolated.empty()) out_.interpolated[place] = surface_.interpolated[i] != 0;
  }
}

/// The cell that triangles n and n + 1 fill, and those that follow it filled: how many triangles that is. 0:
/// they fill none.
std::size_t Gather::fill(std::size_t n) {
  const std::span<const Triangle> all = triangles_;
  if (n + 1 >= all.size() || far_ || all[n + 1][1] >= firsts_) return 0;
  const Triangle &first = all[n], &second = all[n + 1];
  std::uint32_t cell = 0;
  const std::uint8_t filled = filled_cell(surface_.grid.data(), first, second, cell);
  if (filled == 0 || out_.cells[at(cell)] != 0) return 0;
  out_.cells[at(cell)] = filled;
  const bool straight = filled == grid_cell::kStraight;
  const std::uint32_t upper = straight ? first[0] : second[1], lower = first[straight ? 1 : 0];
  std::size_t cells = 1;
  if ((right_[upper] & right_[lower]) != 0)
    cells += gather_kernels().fill_run({.triangles = all.subspan(n + 2),
                                        .right = right_.data(),
                                        .upper = upper + 1,
                                        .lower = lower + 1,
                                        .cell = &out_.cells[at(cell)] + 1});
  out_.triangles += static_cast<std::uint32_t>(2 * cells);
  return 2 * cells;
}

/// A triangle by itself, by the places of its corners.
Status Gather::add(const Triangle& triangle, const std::array<std::uint32_t, 3>& keys) {
  std::uint32_t cell = 0;
  const int corner = missing_corner(keys[0], keys[1], keys[2], cell);
  if (corner < 0) return kInNoCell;
  if (is_far(triangle)) return {};
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
  const auto key = [this](std::uint32_t v) { return place_key(surface_.grid[v]); };
  for (std::size_t n = 0; n < triangles_.size();) {
    const Triangle& t = triangles_[n];
    if (has_second(t))
      return Error{
          "surface has a triangle on a vertex that is not there, or on a second place before others"};
    if (const std::size_t filled = fill(n); filled > 0) {
      n += filled;
      continue;
    }
    if (Status status = add(t, {key(t[0]), key(t[1]), key(t[2])}); !status) return status;
    ++n;
  }
  return {};
}

/// To the second place where that vertex has its first one, if it is not there. False: another one is.
bool Gather::copy(std::uint32_t vertex) {
  const std::size_t from = at(place_key(surface_.grid[vertex])), to = from + lines_ * stride_;
  if (out_.columns[to] == out_.columns[from]) return true;
  if (out_.columns[to] != StripeGrid::kAbsent) return false;
  out_.columns[to] = out_.columns[from];
  if (!out_.sigmas.empty()) out_.sigmas[to] = out_.sigmas[from];
  if (!out_.interpolated.empty()) out_.interpolated[to] = out_.interpolated[from];
  ++out_.vertices;
  return true;
}

Status Gather::second_triangles() {
  for (const Triangle& t : std::span(surface_.triangles).subspan(triangles_.size())) {
    std::array<std::uint32_t, 3> keys{};
    for (std::size_t i = 0; i < 3; ++i) {
      if (t[i] >= surface_.grid.size()) return Error{"surface has a triangle on a vertex that is not there"};
      keys[i] = place_key(surface_.grid[t[i]]) + (t[i] < firsts_ ? lines_ * kBelowKey : 0);
    }
    if (Status status = add(t, keys); !status) return status;
    if (is_far(t)) continue;
    for (const std::uint32_t v : t)
      if (v < firsts_ && !copy(v)) return kInNoCell;
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

bool has_second_places(const Surface& surface, int lines) {
  return !surface.grid.empty() && surface.grid.back().line >= lines;
}

Status to_grid(const Surface& surface, const GridCalibration& calibration, const ToGrid& options,
               StripeGrid& out) {
  if (surface.grid.size() != surface.positions.size())
    return Error{"surface has no places on the grid of stripes and lines: send it as a mesh"};
  const int lines = calibration.lines();
  const bool twice = options.twice || has_second_places(surface, lines);
  if (twice && 2 * lines > kMostGridSide)
    return Error{"surface has second places in a picture of too many lines: send it as a mesh"};
  out.reset(calibration.boundaries(), twice ? 2 * lines : lines, options.step_bits, twice);
  Gather gather(surface, calibration, out);
  if (Status status = gather.vertices(); !status) return status;
  if (options.with_quality) gather.quality();
  if (Status status = gather.triangles(); !status) return status;
  if (Status status = gather.second_triangles(); !status) return status;
  gather.drop_far_vertices();
  return {};
}

}  // namespace relievo
