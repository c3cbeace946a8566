// SPDX-License-Identifier: Apache-2.0
// From the stripe grid to a surface: codec/FORMAT.md, "From the grid to a surface". The same steps as
// codec/grid_points.cpp and src/gridPoints.ts, which is the reference in the browser.
#include "grid.h"

struct Points points;
struct Points* points_at(void) {
  return &points;
}

static inline int is_there(const i32* columns, int b) {
  return columns[b] != kAbsent;
}

/// Numbers of the vertices at a line's places, and of the first behind it.
static void number_line(const i32* columns, u32* index) {
  u32 next = points.next;
  for (int b = 0; b < job.boundaries; ++b) {
    index[b] = next;
    next += is_there(columns, b);
  }
  index[job.boundaries] = next;
  points.next = next;
}

/// Columns in pixels and directions of the vertices of a line, of the picture; of no meaning where there is
/// none.
static void find_rays(const i32* columns, int line) {
  const float* rays = points.rays ? points.rays + (u32)line * 2 * (u32)points.ray_samples : 0;
  const float y = points.ray_y + (float)line * points.ray_y_step,
              first = points.ray_first + y * points.ray_skew;
  for (int b = 0; b < job.boundaries; b += 4) {
    const v128_t column = wasm_f32x4_mul(wasm_f32x4_convert_i32x4(wasm_v128_load(columns + b)),
                                         wasm_f32x4_splat(points.step_px));
    wasm_v128_store(points.column + b, column);
    wasm_v128_store(points.x + b, wasm_f32x4_sub(wasm_f32x4_mul(column, wasm_f32x4_splat(points.ray_per_px)),
                                                 wasm_f32x4_splat(first)));
    wasm_v128_store(points.y + b, wasm_f32x4_splat(y));
  }
  if (!rays) return;
  const float* rays_y = rays + points.ray_samples;
  for (int b = 0; b < job.boundaries; ++b) {
    if (!is_there(columns, b)) continue;
    const float at = points.column[b] / kRayStep;
    int s = at > 0 ? (int)at : 0;
    if (s > points.ray_samples - 2) s = points.ray_samples - 2;
    const float f = at - (float)s;
    points.x[b] = rays[s] + f * (rays[s + 1] - rays[s]);
    points.y[b] = rays_y[s] + f * (rays_y[s + 1] - rays_y[s]);
  }
}

/// Depths of a line's vertices, and how they change with the ray's x. False where one is not in front of the
/// camera.
static int meet_straight(const i32* columns) {
  v128_t bad = wasm_i32x4_splat(0);
  for (int b = 0; b < job.boundaries; b += 4) {
    const v128_t a = wasm_v128_load(points.a + b);
    v128_t denominator = wasm_f32x4_mul(a, wasm_v128_load(points.x + b));
    denominator = wasm_f32x4_add(denominator,
                                 wasm_f32x4_mul(wasm_v128_load(points.b + b), wasm_v128_load(points.y + b)));
    denominator = wasm_f32x4_add(denominator, wasm_v128_load(points.c + b));
    const v128_t z = wasm_f32x4_div(wasm_v128_load(points.numerator + b), denominator);
    wasm_v128_store(points.z + b, z);
    wasm_v128_store(points.slope + b, wasm_f32x4_div(wasm_f32x4_mul(z, a), denominator));
    const v128_t front =
        wasm_v128_and(wasm_f32x4_gt(z, wasm_f32x4_splat(0)), wasm_f32x4_lt(z, wasm_f32x4_splat(1e6F)));
    const v128_t there = wasm_i32x4_ne(wasm_v128_load(columns + b), wasm_i32x4_splat(kAbsent));
    bad = wasm_v128_or(bad, wasm_v128_andnot(there, front));
  }
  return !wasm_v128_any_true(bad);
}

/// The same with a distorting projector: point -> height -> sheet, each round gains about two digits.
static int meet_curved(const i32* columns) {
  const float *r = points.rotation, *t = points.translation;
  for (int b = 0; b < job.boundaries; ++b) {
    if (!is_there(columns, b)) continue;
    const float* sheets = points.sheets + b * kSheetSamples;
    const double x = points.x[b], y = points.y[b];
    const double dx = r[0] * x + r[1] * y + r[2], dy = r[3] * x + r[4] * y + r[5],
                 dz = r[6] * x + r[7] * y + r[8];
    double height = 0, z = 0, slope = 0;
    for (int round = 0; round < 4; ++round) {
      double at = (height - points.sheet_first) / points.sheet_step;
      if (!(at > 0)) at = 0;
      if (at > kSheetSamples - 1.001) at = kSheetSamples - 1.001;
      const int s = (int)at;
      const double sheet = sheets[s] + (at - s) * (sheets[s + 1] - sheets[s]);
      const double denominator = dx - sheet * dz;
      z = (sheet * t[2] - t[0]) / denominator;
      height = (z * dy + t[1]) / (z * dz + t[2]);
      slope = z * (r[0] - sheet * r[6]) / denominator;
    }
    points.z[b] = (float)z;
    points.slope[b] = (float)slope;
    if (!(z > 0 && z < 1e6)) return 0;
  }
  return 1;
}

static float *position, *coordinate;
static u32* triangle;

static void write_four(int b, v128_t v) {
  const v128_t z = wasm_v128_load(points.z + b);
  const v128_t x = wasm_f32x4_mul(z, wasm_v128_load(points.x + b)),
               y = wasm_f32x4_mul(z, wasm_v128_load(points.y + b));
  const v128_t xy = wasm_i32x4_shuffle(x, y, 0, 4, 1, 5), xy_high = wasm_i32x4_shuffle(x, y, 2, 6, 3, 7);
  wasm_v128_store(position, wasm_i32x4_shuffle(xy, wasm_i32x4_shuffle(z, x, 0, 5, 0, 5), 0, 1, 4, 5));
  wasm_v128_store(position + 4,
                  wasm_i32x4_shuffle(wasm_i32x4_shuffle(y, z, 1, 5, 1, 5), xy_high, 0, 1, 4, 5));
  wasm_v128_store(position + 8, wasm_i32x4_shuffle(wasm_i32x4_shuffle(z, x, 2, 7, 2, 7),
                                                   wasm_i32x4_shuffle(y, z, 3, 7, 3, 7), 0, 1, 4, 5));
  position += 12;
  const v128_t u = wasm_f32x4_mul(wasm_f32x4_add(wasm_v128_load(points.column + b), wasm_f32x4_splat(0.5F)),
                                  wasm_f32x4_splat(points.per_width));
  wasm_v128_store(coordinate, wasm_i32x4_shuffle(u, v, 0, 4, 1, 5));
  wasm_v128_store(coordinate + 4, wasm_i32x4_shuffle(u, v, 2, 6, 3, 7));
  coordinate += 8;
}

static void write_vertices(const i32* columns, int line) {
  const float v = ((float)line * points.line_step + 0.5F) * points.per_height;
  for (int b = 0; b < job.boundaries; b += 4) {
    const v128_t there = wasm_i32x4_ne(wasm_v128_load(columns + b), wasm_i32x4_splat(kAbsent));
    if (wasm_i32x4_all_true(there)) {
      write_four(b, wasm_f32x4_splat(v));
      continue;
    }
    if (!wasm_v128_any_true(there)) continue;
    for (int i = b; i < b + 4; ++i) {  // behind the last boundary there are no vertices
      if (!is_there(columns, i)) continue;
      const float z = points.z[i];
      *position++ = z * points.x[i];
      *position++ = z * points.y[i];
      *position++ = z;
      *coordinate++ = (points.column[i] + 0.5F) * points.per_width;
      *coordinate++ = v;
    }
  }
}

static void write_quality(const i32* columns, int line, u32 at) {
  const u8* sigmas = job.sigmas ? job.sigmas + line * job.stride + kMargin : 0;
  const u8* marks = job.marks ? job.marks + line * job.stride + kMargin : 0;
  for (int b = 0; b < job.boundaries; ++b) {
    if (!is_there(columns, b)) continue;
    const float slope = points.slope[b];
    points.sigmas[at] = sigmas ? points.sigma_per_slope[sigmas[b] & 63] * (slope < 0 ? -slope : slope) : 0;
    points.marks[at++] = marks ? marks[b] : 0;
  }
}

/// The diagonals of four cells with both triangles: -1 where it is the one from corner 0 to 2.
static inline v128_t diagonals(const i32* above, const i32* below, int b) {
  const v128_t spacing = wasm_i32x4_splat(job.spacing);
  const v128_t falling =
      wasm_i32x4_sub(wasm_i32x4_sub(wasm_v128_load(below + b + 1), wasm_v128_load(above + b)), spacing);
  const v128_t rising =
      wasm_i32x4_sub(wasm_i32x4_sub(wasm_v128_load(above + b + 1), wasm_v128_load(below + b)), spacing);
  return wasm_i32x4_le(wasm_i32x4_abs(falling), wasm_i32x4_abs(rising));
}

/// Eight cells, all with both triangles: their corners are numbered one after the other.
static void write_eight(const i32* above, const i32* below, u32 a, u32 l, int b) {
  i32 straight[8];
  wasm_v128_store(straight, diagonals(above, below, b));
  wasm_v128_store(straight + 4, diagonals(above, below, b + 4));
  // Upper left a, lower left l: a l l' | l' a' a or l l' a' | a' a l.
  v128_t one = wasm_i32x4_make((i32)a, (i32)l, (i32)l + 1, (i32)l + 1),
         other = wasm_i32x4_make((i32)l, (i32)l + 1, (i32)a + 1, (i32)a + 1);
  v128_t one_more = wasm_i32x4_make((i32)a + 1, (i32)a, 0, 0),
         other_more = wasm_i32x4_make((i32)a, (i32)l, 0, 0);
  const v128_t step = wasm_i32x4_splat(1);
  for (int i = 0; i < 8; ++i) {
    const v128_t mask = wasm_v128_load32_splat(straight + i);
    wasm_v128_store(triangle, wasm_v128_bitselect(one, other, mask));
    wasm_v128_store64_lane(triangle + 4, wasm_v128_bitselect(one_more, other_more, mask), 0);
    triangle += 6;
    one = wasm_i32x4_add(one, step);
    other = wasm_i32x4_add(other, step);
    one_more = wasm_i32x4_add(one_more, step);
    other_more = wasm_i32x4_add(other_more, step);
  }
}

/// Cells between a line and the one below.
static void write_cells(const u8* cells, const i32* above, const i32* below, const u32* index_above,
                        const u32* index_below) {
  static const u8 order[4] = {3, 1, 0, 2};  // of the corners that triangles lack
  const int count = job.boundaries - 1;
  for (int b = 0; b < count; b += 8) {
    const u64 eight = load64(cells + b);
    if (eight == 0) continue;
    if (eight == ~0ULL) {
      write_eight(above, below, index_above[b], index_below[b], b);
      continue;
    }
    const int last = b + 8 < count ? b + 8 : count;
    for (int i = b; i < last; ++i) {
      u32 cell = cells[i];
      if (cell == 0) continue;
      if (cell == kBoth) {
        const i32 falling = below[i + 1] - above[i] - job.spacing,
                  rising = above[i + 1] - below[i] - job.spacing;
        cell = (falling < 0 ? -falling : falling) <= (rising < 0 ? -rising : rising) ? kStraight : kTurned;
      }
      const u32 q[4] = {index_above[i], index_below[i], index_below[i + 1], index_above[i + 1]};
      for (int k = 0; k < 4; ++k) {
        const u32 lack = order[k];
        if (!(cell >> lack & 1)) continue;
        *triangle++ = q[(lack + 1) & 3];
        *triangle++ = q[(lack + 2) & 3];
        *triangle++ = q[(lack + 3) & 3];
      }
    }
  }
}

/// Lines [begin, end), after those before them: their vertices, and the triangles between each and the line
/// above. False where a ray meets no light sheet in front of the camera.
int surface_lines(int begin, int end) {
  position = points.positions;
  coordinate = points.coordinates;
  triangle = points.triangles;
  const u32 start = points.next;
  for (int line = begin; line < end; ++line) {
    const i32* columns = job.columns + line * job.stride + kMargin;
    u32* const index = points.index[line & 1];
    const int picture_line = line < points.picture_lines ? line : line - points.picture_lines;
    const u32 first = points.next;
    number_line(columns, index);
    if (points.next > first) {
      find_rays(columns, picture_line);
      if (!(points.sheets ? meet_curved(columns) : meet_straight(columns))) return 0;
      write_vertices(columns, picture_line);
      if (job.sigmas || job.marks) write_quality(columns, line, first - start);
    }
    if (line > 0)
      write_cells(job.cells + (line - 1) * job.stride + kMargin, columns - job.stride, columns,
                  points.index[~line & 1], index);
  }
  points.written_triangles = (u32)(triangle - points.triangles) / 3;
  return 1;
}
