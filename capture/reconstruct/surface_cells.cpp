// SPDX-License-Identifier: Apache-2.0
#include "capture/reconstruct/surface_cells.h"

#include <cmath>
#include <cstring>

#include "base/variants.h"

namespace relievo {
namespace {

// Eight cells at once; a processor with narrower registers takes several for them.
using Eight = float __attribute__((vector_size(32)));
using EightInts = std::int32_t __attribute__((vector_size(32)));  // as a mask: 0 or -1
using EightBytes = std::uint8_t __attribute__((vector_size(8)));

#define RELIEVO_INLINE [[gnu::always_inline]] inline

RELIEVO_INLINE void load(const float* from, Eight& to) {
  std::memcpy(&to, from, sizeof to);
}
RELIEVO_INLINE void store(const Eight& from, float* to) {
  std::memcpy(to, &from, sizeof from);
}
RELIEVO_INLINE void load_links(const std::uint8_t* from, EightInts& to) {
  EightBytes bytes;
  std::memcpy(&bytes, from, sizeof bytes);
  to = __builtin_convertvector(bytes, EightInts) != 0;
}

struct Corner {
  Eight x, y, z, x_z, y_z;
  RELIEVO_INLINE void load_from(const VertexRow& row, int b) {
    load(row.x + b, x);
    load(row.y + b, y);
    load(row.z + b, z);
    load(row.x_z + b, x_z);
    load(row.y_z + b, y_z);
  }
  RELIEVO_INLINE void choose(const EightInts& mask, const Corner& a, const Corner& b) {
    x = mask ? a.x : b.x;
    y = mask ? a.y : b.y;
    z = mask ? a.z : b.z;
    x_z = mask ? a.x_z : b.x_z;
    y_z = mask ? a.y_z : b.y_z;
  }
};

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

RELIEVO_INLINE void make_body(const VertexRow& above, const VertexRow& below, const CellLinks& links,
                              int count, const CellLimits& limits, std::uint8_t* cells,
                              const CellNormals& normals, CellCounts& counts) {
  EightInts steps{};  // negative
  EightInts edge_on{};
  for (int b = 0; b < count; b += 8) {
    Corner q0, q1, q2, q3;
    q0.load_from(above, b);
    q1.load_from(below, b);
    q2.load_from(below, b + 1);
    q3.load_from(above, b + 1);
    EightInts left, lower, right, upper;  // sides from each corner to the next
    load_links(links.down + b, left);
    load_links(links.across_below + b, lower);
    load_links(links.down + b + 1, right);
    load_links(links.across_above + b, upper);

    // Of a whole cell the diagonal with the smaller depth step follows the surface. Otherwise the one between
    // the corners that are there.
    const Eight falling = q0.z - q2.z;
    const Eight rising = q1.z - q3.z;
    const Eight falling_step = falling < 0 ? -falling : falling;
    const Eight rising_step = rising < 0 ? -rising : rising;
    const EightInts straight = (falling == falling) & ((rising != rising) | (falling_step <= rising_step));
    Corner p0, p1, p2, p3;
    p0.choose(straight, q0, q1);
    p1.choose(straight, q1, q2);
    p2.choose(straight, q2, q3);
    p3.choose(straight, q3, q0);

    EightInts c01, c12, c20, c23, c30;
    connected(p0, p1, limits.depth_step_ratio, c01);
    connected(p1, p2, limits.depth_step_ratio, c12);
    connected(p2, p0, limits.depth_step_ratio, c20);
    connected(p2, p3, limits.depth_step_ratio, c23);
    connected(p3, p0, limits.depth_step_ratio, c30);
    const EightInts there = (p0.z == p0.z) & (p2.z == p2.z);
    const EightInts first_there = there & (p1.z == p1.z);
    const EightInts second_there = there & (p3.z == p3.z);
    const EightInts first_one = first_there & c01 & c12 & c20;
    const EightInts second_one = second_there & c23 & c30 & c20;
    Normal n1, n2;
    EightInts good1, good2;
    face(p0, p1, p2, limits.least_facing, n1, good1);
    face(p2, p3, p0, limits.least_facing, n2, good2);
    const EightInts first_joins = first_one & good1;
    const EightInts second_joins = second_one & good2;
    // A triangle's sides but the diagonal must be linked.
    const EightInts first = first_joins & (straight ? left & lower : lower & right);
    const EightInts second = second_joins & (straight ? right & upper : upper & left);
    steps += (first_there & ~first) & ~(first_one & ~good1);
    steps += (second_there & ~second) & ~(second_one & ~good2);
    edge_on += first_one & ~good1;
    edge_on += second_one & ~good2;

    const EightInts bits = (~straight & cell::kTurned) | (first & cell::kFirst) | (second & cell::kSecond) |
                           (first_joins & cell::kFirstJoins) | (second_joins & cell::kSecondJoins);
    const EightBytes bytes = __builtin_convertvector(bits, EightBytes);
    std::memcpy(cells + b, &bytes, sizeof bytes);

    keep(first, n1);
    keep(second, n2);
    const Normal both{n1.x + n2.x, n1.y + n2.y, n1.z + n2.z};
    const auto add = [&](int corner, const Normal& when_straight, const Normal& when_turned)
        __attribute__((always_inline)) {
      store(straight ? when_straight.x : when_turned.x, normals.plane(corner, 0) + b);
      store(straight ? when_straight.y : when_turned.y, normals.plane(corner, 1) + b);
      store(straight ? when_straight.z : when_turned.z, normals.plane(corner, 2) + b);
    };
    add(0, both, n2);
    add(1, n1, both);
    add(2, both, n1);
    add(3, n2, both);
  }
  for (int i = 0; i < 8; ++i) {
    counts.step += static_cast<std::size_t>(-steps[i]);
    counts.edge_on += static_cast<std::size_t>(-edge_on[i]);
  }
}

RELIEVO_INLINE void normals_body(const CellNormals& above, const CellNormals& below, int count, float* out,
                                 std::ptrdiff_t out_stride) {
  // Of the cell to the right a vertex is the left corner; there is no cell to the left of the first.
  for (int axis = 0; axis < 3; ++axis) {
    const float* __restrict right_above = above.plane(1, axis);
    const float* __restrict left_above = above.plane(2, axis) - 1;
    const float* __restrict right_below = below.plane(0, axis);
    const float* __restrict left_below = below.plane(3, axis) - 1;
    float* __restrict to = out + axis * out_stride;
    to[0] = right_above[0] + right_below[0];
    for (int b = 1; b < count; ++b)
      to[b] = (right_above[b] + left_above[b]) + (right_below[b] + left_below[b]);
  }
  float* __restrict x = out;
  float* __restrict y = out + out_stride;
  float* __restrict z = out + 2 * out_stride;
  for (int b = 0; b < count; ++b) {
    const float square = x[b] * x[b] + y[b] * y[b] + z[b] * z[b];
    const bool none = square <= 0;
    const float per_length = 1 / std::sqrt(none ? 1 : square);
    x[b] *= per_length;
    y[b] *= per_length;
    z[b] = none ? -1 : z[b] * per_length;
  }
}

/// All kernels for one set of instructions, as static functions of a struct.
#define RELIEVO_KERNELS(set, attributes)                                                                \
  struct set {                                                                                          \
    attributes static void make(const VertexRow& above, const VertexRow& below, const CellLinks& links, \
                                int count, const CellLimits& limits, std::uint8_t* cells,               \
                                const CellNormals& normals, CellCounts& counts) {                       \
      make_body(above, below, links, count, limits, cells, normals, counts);                            \
    }                                                                                                   \
    attributes static void normals(const CellNormals& above, const CellNormals& below, int count,       \
                                   float* out, std::ptrdiff_t out_stride) {                             \
      normals_body(above, below, count, out, out_stride);                                               \
    }                                                                                                   \
  }

RELIEVO_KERNELS(Portable, );
#if defined(__x86_64__)
RELIEVO_KERNELS(Avx2, [[gnu::target("avx2")]]);
#endif

}  // namespace

const std::vector<CellKernels>& all_cell_kernels() {
  const CellKernels portable{"portable", Portable::make, Portable::normals};
#if defined(__x86_64__)
  static const auto kernels = variants(portable, {"avx2", Avx2::make, Avx2::normals});
#else
  static const auto kernels = variants(portable);
#endif
  return kernels;
}

const CellKernels& cell_kernels() {
  return all_cell_kernels().back();
}

}  // namespace relievo
