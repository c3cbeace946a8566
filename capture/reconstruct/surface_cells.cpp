// SPDX-License-Identifier: Apache-2.0
#include "capture/reconstruct/surface_cells.h"

#include "base/variants.h"
#include "capture/reconstruct/eight.h"

namespace relievo {
namespace {

struct Corner {
  Eight x, y, z, x_z, y_z;
  RELIEVO_INLINE void load_from(const VertexRow& row, int b) {
    load(row.x + b, x);
    load(row.y + b, y);
    load(row.z + b, z);
    load(row.x_z + b, x_z);
    load(row.y_z + b, y_z);
  }
};

/// a where `mask` is set, elsewhere b.
RELIEVO_INLINE void choose(const EightInts& mask, const Corner& a, const Corner& b, Corner& out) {
  out.x = mask ? a.x : b.x;
  out.y = mask ? a.y : b.y;
  out.z = mask ? a.z : b.z;
}

/// No depth step between two neighbours on the grid. False also where one is not there.
RELIEVO_INLINE void connected(const Corner& a, const Corner& b, float ratio, EightInts& out) {
  const Eight depth = a.z - b.z;
  // Extent across the view: the part of a - b that is at right angles to the ray through their middle.
  const Eight z = 0.5F * (a.z + b.z);
  const Eight dx = (a.x_z - b.x_z) * z;
  const Eight dy = (a.y_z - b.y_z) * z;
  out = depth * depth <= ratio * ratio * (dx * dx + dy * dy);
}

struct Normal {
  Eight x, y, z;
};

/// The triangle's normal, twice its area long, and whether it faces the camera well enough: it may be
/// reversed where the surface is seen through a fold.
RELIEVO_INLINE void face(const Corner& a, const Corner& b, const Corner& c, float least, Normal& n,
                         EightInts& good) {
  const Eight ux = b.x - a.x, uy = b.y - a.y, uz = b.z - a.z;
  const Eight vx = c.x - a.x, vy = c.y - a.y, vz = c.z - a.z;
  n.x = uy * vz - uz * vy;
  n.y = uz * vx - ux * vz;
  n.z = ux * vy - uy * vx;
  const Eight facing = -(n.x * a.x + n.y * a.y + n.z * a.z);
  const Eight size = n.x * n.x + n.y * n.y + n.z * n.z;
  const Eight distance = a.x * a.x + a.y * a.y + a.z * a.z;
  good = (facing > 0) & (facing * facing >= least * least * size * distance);
}

RELIEVO_INLINE void keep(const EightInts& mask, Normal& n) {
  const Eight none{};
  n.x = mask ? n.x : none;
  n.y = mask ? n.y : none;
  n.z = mask ? n.z : none;
}

/// Sums over the cells to the right of eight vertices, `here`, and to their left; the ones before these eight
/// are `before`, which becomes `left`.
RELIEVO_INLINE void add_left(const Eight& here, const Eight& left, Eight& before, Eight& out) {
  out = here + __builtin_shufflevector(before, left, 7, 8, 9, 10, 11, 12, 13, 14);
  before = left;
}

/// What the cells add to the normals of their corners, and of the upper line.
struct NormalSums {
  // There is no cell to the left of the first: what changes no sum, not even a zero's sign.
  Eight upper_before[3], lower_before[3];
  RELIEVO_INLINE void start() {
    const Eight zero{};
    for (int axis = 0; axis < 3; ++axis) upper_before[axis] = lower_before[axis] = -zero;
  }
};

RELIEVO_INLINE void make_body(const CellRow& row, const CellLimits& limits, std::uint8_t* cells,
                              const NormalRow& unit, const NormalRow& next, CellCounts& counts) {
  EightInts steps{};  // negative
  EightInts edge_on{};
  NormalSums sums;
  sums.start();
  for (int b = 0; b < row.count; b += 8) {
    Corner q0, q1, q2, q3;
    q0.load_from(row.above, b);
    q1.load_from(row.below, b);
    q2.load_from(row.below, b + 1);
    q3.load_from(row.above, b + 1);

    // Of a whole cell the diagonal with the smaller depth step follows the surface. Otherwise the one between
    // the corners that are there.
    const Eight falling = q0.z - q2.z;
    const Eight rising = q1.z - q3.z;
    const Eight falling_step = falling < 0 ? -falling : falling;
    const Eight rising_step = rising < 0 ? -rising : rising;
    const EightInts straight = (falling == falling) & ((rising != rising) | (falling_step <= rising_step));
    Corner p0, p1, p2, p3;
    choose(straight, q0, q1, p0);
    choose(straight, q1, q2, p1);
    choose(straight, q2, q3, p2);
    choose(straight, q3, q0, p3);
    p0.x_z = straight ? q0.x_z : q1.x_z;
    p0.y_z = straight ? q0.y_z : q1.y_z;
    p2.x_z = straight ? q2.x_z : q3.x_z;
    p2.y_z = straight ? q2.y_z : q3.y_z;

    const float ratio = limits.depth_step_ratio;
    EightInts left, lower, right, upper, diagonal;
    connected(q0, q1, ratio, left);
    connected(q1, q2, ratio, lower);
    connected(q2, q3, ratio, right);
    connected(q3, q0, ratio, upper);
    connected(p0, p2, ratio, diagonal);
    const EightInts there = (p0.z == p0.z) & (p2.z == p2.z);
    const EightInts first_there = there & (p1.z == p1.z);
    const EightInts second_there = there & (p3.z == p3.z);
    const EightInts first_one = first_there & lower & diagonal & (straight ? left : right);
    const EightInts second_one = second_there & upper & diagonal & (straight ? right : left);
    Normal n1, n2;
    EightInts good1, good2;
    face(p0, p1, p2, limits.least_facing, n1, good1);
    face(p2, p3, p0, limits.least_facing, n2, good2);
    const EightInts first_joins = first_one & good1;
    const EightInts second_joins = second_one & good2;
    // A triangle's sides but the diagonal must be linked.
    EightInts left_on, right_on, lower_on, upper_on, sure_down;
    const int at = b / 8;
    spread(row.links.down[at], left_on);
    spread((row.links.down[at] | row.links.down[at + 1] << 8) >> 1, right_on);
    spread(row.links.across_above[at], upper_on);
    spread(row.links.across_below[at], lower_on);
    spread(row.links.sure_down[at], sure_down);
    const EightInts first = first_joins & lower_on & (straight ? left_on : right_on);
    const EightInts second = second_joins & upper_on & (straight ? right_on : left_on);
    steps += (first_there & ~first) & ~(first_one & ~good1);
    steps += (second_there & ~second) & ~(second_one & ~good2);
    edge_on += first_one & ~good1;
    edge_on += second_one & ~good2;

    store((~straight & cell::kTurned) | (first & cell::kFirst) | (second & cell::kSecond) |
              (first_joins & cell::kFirstJoins) | (second_joins & cell::kSecondJoins) |
              ((q0.z == q0.z) & cell::kCorner) | (sure_down & cell::kSureDown),
          cells + b);

    keep(first, n1);
    keep(second, n2);
    const Eight one[3] = {n1.x, n1.y, n1.z};
    const Eight two[3] = {n2.x, n2.y, n2.z};
    for (int axis = 0; axis < 3; ++axis) {
      const Eight both = one[axis] + two[axis];
      Eight of_upper, of_lower, above;
      add_left(straight ? both : two[axis], straight ? two[axis] : both, sums.upper_before[axis], of_upper);
      add_left(straight ? one[axis] : both, straight ? both : one[axis], sums.lower_before[axis], of_lower);
      load(unit.axis(axis) + b, above);
      store(above + of_upper, unit.axis(axis) + b);
      store(of_lower, next.axis(axis) + b);
    }
  }
  for (int i = 0; i < 8; ++i) {
    counts.step += static_cast<std::size_t>(-steps[i]);
    counts.edge_on += static_cast<std::size_t>(-edge_on[i]);
  }
}

/// Of eight vertices.
RELIEVO_INLINE void unit_body(int count, const NormalRow& row) {
  const Eight zero{};
  const Eight one = zero + 1;
  for (int b = 0; b < count; b += 8) {
    Eight x, y, z;
    load(row.axis(0) + b, x);
    load(row.axis(1) + b, y);
    load(row.axis(2) + b, z);
    const Eight square = x * x + y * y + z * z;
    const EightInts none = square <= 0;
    Eight length = none ? one : square;
    take_root(length);
    const Eight per_length = one / length;
    store(x * per_length, row.axis(0) + b);
    store(y * per_length, row.axis(1) + b);
    store(none ? -one : z * per_length, row.axis(2) + b);
  }
}

RELIEVO_INLINE void views_body(const float* x, const float* y, const float* z, int count, float* x_z,
                               float* y_z) {
  for (int b = 0; b < count; b += 8) {
    Eight vx, vy, vz;
    load(x + b, vx);
    load(y + b, vy);
    load(z + b, vz);
    store(vx / vz, x_z + b);
    store(vy / vz, y_z + b);
  }
}

/// All kernels for one set of instructions, as static functions of a struct.
#define RELIEVO_KERNELS(set, attributes)                                                                \
  struct set {                                                                                          \
    attributes static void views(const float* x, const float* y, const float* z, int count, float* x_z, \
                                 float* y_z) {                                                          \
      views_body(x, y, z, count, x_z, y_z);                                                             \
    }                                                                                                   \
    attributes static void make(const CellRow& row, const CellLimits& limits, std::uint8_t* cells,      \
                                const NormalRow& unit, const NormalRow& next, CellCounts& counts) {     \
      make_body(row, limits, cells, unit, next, counts);                                                \
      unit_body(row.count, unit);                                                                       \
    }                                                                                                   \
  }

RELIEVO_KERNELS(Portable, );
#if defined(__x86_64__)
RELIEVO_KERNELS(Avx2, [[gnu::target("avx2")]]);
#endif

}  // namespace

const std::vector<CellKernels>& all_cell_kernels() {
  const CellKernels portable{"portable", Portable::views, Portable::make};
#if defined(__x86_64__)
  static const auto kernels = variants(portable, {"avx2", Avx2::views, Avx2::make});
#else
  static const auto kernels = variants(portable);
#endif
  return kernels;
}

const CellKernels& cell_kernels() {
  return all_cell_kernels().back();
}

}  // namespace relievo
