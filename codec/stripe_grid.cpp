// SPDX-License-Identifier: Apache-2.0
#include "codec/stripe_grid.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstddef>
#include <cstring>
#include <string>

namespace relievo {
namespace {

constexpr int kLargestCode = 63;
constexpr float kSmallest_px = 1e-4F;
constexpr float kStepsPerOctave = 4;
constexpr float kNearest_share = 0.25F;  // of a depth, that a step may change it by

template <typename T>
T rounded(const T& values) {
  T out{};
  for (std::size_t i = 0; i < values.size(); ++i) out[i] = static_cast<double>(static_cast<float>(values[i]));
  return out;
}
PinholeModel rounded(const PinholeModel& model) {
  return {model.width, model.height, rounded(model.matrix), rounded(model.distortion)};
}

/// A place's boundary and line in one number: the bytes in which GridPoint keeps them.
std::uint32_t key_of(const GridPoint& at) {
  static_assert(offsetof(GridPoint, boundary) == 0 && offsetof(GridPoint, line) == 2 &&
                std::endian::native == std::endian::little);
  std::uint32_t key;
  std::memcpy(&key, &at, sizeof key);
  return key;
}
constexpr std::uint32_t kRight = 1, kBelow = 1U << 16;  // from a place's key to its neighbours'

/// The usual case: two triangles, one after the other, that fill a cell. 0: they do not. Without branches
/// on the diagonal, which is hard to foresee.
std::uint8_t filled_cell(const GridPoint* at, const Triangle& first, const Triangle& second,
                         std::uint32_t& cell) {
  if (first[2] != second[0] || first[0] != second[2]) return 0;
  const std::uint32_t a = key_of(at[first[0]]), b = key_of(at[first[1]]), c = key_of(at[first[2]]),
                      d = key_of(at[second[1]]);
  // The ring a b c d begins upper left, or else lower left. As masks, since compilers make branches of
  // choices.
  const std::uint32_t straight = b - a == kBelow ? ~0U : 0U;
  const auto choose = [straight](std::uint32_t one, std::uint32_t other) {
    return (one & straight) | (other & ~straight);
  };
  cell = choose(a, d);
  const std::uint32_t wrong = ((b - a) ^ choose(kBelow, kRight)) | ((c - b) ^ choose(kRight, 0U - kBelow)) |
                              ((c - d) ^ choose(kBelow, kRight));
  return wrong != 0 ? std::uint8_t{0}
                    : static_cast<std::uint8_t>(choose(grid_cell::kStraight, grid_cell::kTurned));
}

/// Two numbers of vertices side by side, as they lie in memory.
std::uint64_t pair_of(std::uint32_t first, std::uint32_t second) {
  return static_cast<std::uint64_t>(second) << 32 | first;
}
constexpr std::uint64_t kNextPair = (std::uint64_t{1} << 32) + 1;

/// 0 or 1, without a branch, which on the diagonal is hard to foresee.
unsigned is_not_0(std::uint64_t x) {
  return static_cast<unsigned>((x | (0 - x)) >> 63);
}

/// Filled cells that follow one on its line, of vertices numbered one after the other: `upper` and `lower`
/// are that cell's left corners, `cell` where it is kept. `right[v]`: vertex v + 1 is the place right of v.
/// How many there were; their triangles begin at `triangle`.
std::size_t fill_run(const Triangle* triangle, const Triangle* end, const std::uint8_t* right,
                     std::uint32_t upper, std::uint32_t lower, std::uint8_t* cell) {
  static_assert(sizeof(Triangle) == 3 * sizeof(std::uint32_t) && std::endian::native == std::endian::little);
  const Triangle* const begin = triangle;
  // Both rings of four corners as two triangles, four numbers in 64 bits each: a b c | c d a.
  std::uint64_t straight0 = pair_of(upper, lower), both1 = pair_of(lower, lower) + kNextPair;
  std::uint64_t straight2 = pair_of(upper + 1, upper);
  for (;;) {
    straight0 += kNextPair;
    both1 += kNextPair;
    straight2 += kNextPair;
    ++upper;
    ++lower;
    ++cell;
    if (end - triangle < 2 || (right[upper] & right[lower]) == 0 || *cell != 0) break;
    std::uint64_t have[3];
    std::memcpy(have, triangle, sizeof have);
    const std::uint64_t turned1 = pair_of(upper, upper) + kNextPair;
    const std::uint64_t not_straight = (have[0] ^ straight0) | (have[1] ^ both1) | (have[2] ^ straight2);
    const std::uint64_t not_turned =
        (have[0] ^ pair_of(lower, lower + 1)) | (have[1] ^ turned1) | (have[2] ^ straight0);
    if ((is_not_0(not_straight) & is_not_0(not_turned)) != 0) break;
    *cell = static_cast<std::uint8_t>(grid_cell::kStraight ^
                                      (is_not_0(not_straight) * (grid_cell::kStraight ^ grid_cell::kTurned)));
    triangle += 2;
  }
  return static_cast<std::size_t>(triangle - begin) / 2;
}

std::int32_t floor_of(float x) {
  const auto whole = static_cast<std::int32_t>(x);
  return whole - (x < static_cast<float>(whole) ? 1 : 0);
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

}  // namespace

GridCalibration grid_calibration(const Rig& rig, const Pattern& pattern) {
  GridCalibration out;
  out.camera = rounded(rig.camera);
  out.projector = rounded(rig.projector);
  out.projector_from_camera_rotation = rounded(rig.projector_from_camera_rotation);
  out.projector_from_camera_translation = rounded(rig.projector_from_camera_translation);
  out.stripes = pattern.stripes();
  out.line_step_px = rig.scan == Scan::kInterlaced ? 2 : 1;
  return out;
}

bool GridCalibration::operator==(const GridCalibration& other) const {
  const auto same = [](const PinholeModel& a, const PinholeModel& b) {
    return a.width == b.width && a.height == b.height && a.matrix == b.matrix && a.distortion == b.distortion;
  };
  return same(camera, other.camera) && same(projector, other.projector) && stripes == other.stripes &&
         line_step_px == other.line_step_px &&
         projector_from_camera_rotation == other.projector_from_camera_rotation &&
         projector_from_camera_translation == other.projector_from_camera_translation;
}

void StripeGrid::reset(int boundaries_, int lines_, int step_bits_) {
  boundaries = boundaries_;
  lines = lines_;
  step_bits = step_bits_;
  const std::size_t size = at(lines, 0);
  columns.assign(size, kAbsent);
  cells.assign(size, 0);
  sigmas.clear();
  interpolated.clear();
  vertices = 0;
  triangles = 0;
}

/// By the bits of the number: its octave, and which quarter of it.
std::uint8_t sigma_px_code(float sigma_px) {
  if (!(sigma_px > 0)) return 0;
  constexpr float kEighth = 1.0905077F;  // of an octave: rounds to the nearest
  const auto bits = std::bit_cast<std::uint32_t>(sigma_px * (kEighth / kSmallest_px));
  const std::uint32_t part = bits & 0x7fffffU;
  const auto octave = static_cast<int>(bits >> 23) - 127;
  const int quarter = (part >= 0x1837f0U) + (part >= 0x3504f3U) + (part >= 0x5744fdU);
  return static_cast<std::uint8_t>(
      1 + std::clamp(static_cast<int>(kStepsPerOctave) * octave + quarter, 0, kLargestCode - 1));
}

float sigma_px_of_code(std::uint8_t code) {
  return code == 0 ? 0 : kSmallest_px * std::exp2(static_cast<float>(code - 1) / kStepsPerOctave);
}

Status to_grid(const Surface& surface, const GridCalibration& calibration, int step_bits, bool with_quality,
               StripeGrid& out) {
  const std::size_t count = surface.positions.size();
  if (surface.grid.size() != count)
    return Error{"surface has no places on the grid of stripes and lines: send it as a mesh"};
  out.reset(calibration.boundaries(), calibration.lines(), step_bits);
  if (with_quality && count > 0) {
    if (!surface.sigmas_m.empty()) out.sigmas.assign(out.columns.size(), 0);
    if (!surface.interpolated.empty() &&
        std::ranges::count(surface.interpolated, 0) != std::ssize(surface.interpolated))
      out.interpolated.assign(out.columns.size(), 0);
  }
  const auto steps = static_cast<float>(1 << step_bits);
  const auto width = static_cast<float>(calibration.camera.width);
  const auto& t = calibration.projector_from_camera_translation;
  const double baseline = std::hypot(t[0], t[1], t[2]);
  // dz/dx is z^2 / (f b) or less.
  const auto farthest =
      static_cast<float>(kNearest_share * calibration.camera.fx() * baseline * static_cast<double>(steps));
  const auto boundaries = static_cast<unsigned>(out.boundaries);
  const auto lines = static_cast<unsigned>(out.lines);
  const std::ptrdiff_t stride = out.stride();
  bool far = false;
  std::vector<std::uint8_t> right(count + 1, 0);  // of each vertex: the next one lies right of it
  std::uint32_t before = ~0U;
  for (std::size_t i = 0; i < count; ++i) {
    const GridPoint& p = surface.grid[i];
    const std::uint32_t key = key_of(p);
    if (i > 0) right[i - 1] = key - before == kRight;
    before = key;
    if (p.boundary >= boundaries || p.line >= lines || !(p.column_px > -0.5F && p.column_px < width))
      return Error{"surface has a vertex outside the grid of its calibration"};
    const std::size_t at = out.at(p.line, p.boundary);
    if (out.columns[at] != StripeGrid::kAbsent)
      return Error{"surface has two vertices at one place of the grid: send it as a mesh"};
    out.columns[at] = floor_of(p.column_px * steps + 0.5F);
    far |= !(surface.positions[i][2] < farthest);
    if (!out.sigmas.empty()) out.sigmas[at] = sigma_px_code(p.sigma_px);
    if (!out.interpolated.empty()) out.interpolated[at] = surface.interpolated[i] != 0;
  }
  out.vertices = static_cast<std::uint32_t>(count);
  const auto is_far = [&](std::uint32_t v) { return !(surface.positions[v][2] < farthest); };
  const auto cells_at = [&](std::uint32_t cell) {
    return static_cast<std::size_t>((cell >> 16) * stride + (cell & 0xffffU)) + StripeGrid::kMargin;
  };
  const std::size_t triangles = surface.triangles.size();
  for (std::size_t n = 0; n < triangles; ++n) {
    const Triangle& triangle = surface.triangles[n];
    if (triangle[0] >= count || triangle[1] >= count || triangle[2] >= count)
      return Error{"surface has a triangle on a vertex that is not there"};
    std::uint32_t cell = 0;
    if (n + 1 < triangles && !far && surface.triangles[n + 1][1] < count) {
      const std::uint8_t filled = filled_cell(surface.grid.data(), triangle, surface.triangles[n + 1], cell);
      if (filled != 0 && out.cells[cells_at(cell)] == 0) {
        out.cells[cells_at(cell)] = filled;
        const bool straight = filled == grid_cell::kStraight;
        const Triangle& next = surface.triangles[n + 1];
        const std::uint32_t upper = straight ? triangle[0] : next[1], lower = triangle[straight ? 1 : 0];
        std::size_t run = 0;
        // Of this cell, too, so that the run begins where it ends.
        if ((right[upper] & right[lower]) != 0)
          run = fill_run(surface.triangles.data() + n + 2, surface.triangles.data() + triangles, right.data(),
                         upper, lower, &out.cells[cells_at(cell)]);
        out.triangles += static_cast<std::uint32_t>(2 * (1 + run));
        n += 1 + 2 * run;
        continue;
      }
    }
    const int corner = missing_corner(key_of(surface.grid[triangle[0]]), key_of(surface.grid[triangle[1]]),
                                      key_of(surface.grid[triangle[2]]), cell);
    if (corner < 0) return Error{"surface has a triangle that is in no cell of the grid: send it as a mesh"};
    if (far && (is_far(triangle[0]) || is_far(triangle[1]) || is_far(triangle[2]))) continue;
    std::uint8_t& cells = out.cells[cells_at(cell)];
    const auto one = static_cast<std::uint8_t>(1U << corner);
    const auto both = static_cast<std::uint8_t>(cells | one);
    if (cells != 0 && (both == cells || (both != grid_cell::kStraight && both != grid_cell::kTurned)))
      return Error{"surface has triangles that overlap: send it as a mesh"};
    cells = both;
    ++out.triangles;
  }
  if (!far) return {};
  for (std::uint32_t v = 0; v < count; ++v) {
    if (!is_far(v)) continue;
    const std::size_t at = out.at(surface.grid[v].line, surface.grid[v].boundary);
    out.columns[at] = StripeGrid::kAbsent;
    if (!out.sigmas.empty()) out.sigmas[at] = 0;
    if (!out.interpolated.empty()) out.interpolated[at] = 0;
    --out.vertices;
  }
  return {};
}

}  // namespace relievo
