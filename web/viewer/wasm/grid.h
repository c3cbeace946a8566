// SPDX-License-Identifier: Apache-2.0
// What the page hands to the grid's decoder in WebAssembly, and its memory. Freestanding C with 128-bit
// vectors; built by scripts/build_wasm into src/grid.wasm. src/gridKernel.ts is the other side: the order of
// the fields is known there.
#pragma once
#include <wasm_simd128.h>

typedef signed int i32;
typedef unsigned int u32;
typedef unsigned char u8;
typedef unsigned short u16;
typedef unsigned long long u64;

enum { kAbsent = -(1 << 30), kMargin = 8, kBoth = 255, kStraight = 10, kTurned = 5 };

/// Every field takes four bytes. Grids are [line][stride] with kMargin places before a line's first; buffers
/// of one line have `stride` bytes or numbers, with 16 bytes more behind.
struct Job {
  // The grid, empty, and what it builds on; null: none.
  i32* columns;
  u8 *cells, *sigmas, *marks;
  const i32* key;
  i32 boundaries, lines, stride, step_bits;
  i32 slope1, slope2, slope3, key_weight, key_change, limit, spacing;
  // Tables: [number][2048] slots; where an alphabet is not used, every slot is 255.
  const u16* first;
  const u32 *cell_tables, *residual_tables, *sigma_tables;
  // A slice: its lines and streams, and what it holds (out).
  i32 begin, end;
  const u8 *control, *control_end, *residuals, *residuals_end, *sigma, *sigma_end, *raw, *raw_end;
  u32 vertices, triangles;
  // Scratch memory of a line each.
  u8 *there[2], *good[2], *key_there, *sizes, *contexts, *numbers, *symbols, *placed;
  i32* absent;
};
extern struct Job job;

enum { kRayStep = 8, kSheetSamples = 65 };

/// What turns the job's grid into points, and where they go. Buffers of one line as above.
struct Points {
  const float* rays;  // [line][x, y][sample], every kRayStep columns; null: the camera does not distort
  i32 ray_samples;
  float step_px, ray_per_px, ray_first, ray_skew, ray_y, ray_y_step, line_step, per_width, per_height;
  const float* sheets;  // [boundary][sample] by height; null: numerator / (a x + b y + c)
  float sheet_first, sheet_step;
  const float *numerator, *a, *b, *c, *rotation, *translation;
  const float* sigma_per_slope;  // of each code
  // The next vertex's number, 0 before the first line; kept from call to call, as are the numbers of the last
  // line.
  u32 next;
  u32* index[2];
  float *column, *x, *y, *z, *slope;  // scratch
  // Out, of the lines of one call; room for four more vertices and two more triangles.
  float *positions, *coordinates, *sigmas;
  u8* marks;
  u32* triangles;
  u32 written_triangles;
  i32 picture_lines;  // line picture_lines + l is line l of the picture again, with the second places
};
extern struct Points points;

static inline u32 load16(const u8* from) {
  u16 value;
  __builtin_memcpy(&value, from, 2);
  return value;
}
static inline u32 load32(const u8* from) {
  u32 value;
  __builtin_memcpy(&value, from, 4);
  return value;
}
static inline u64 load64(const u8* from) {
  u64 value;
  __builtin_memcpy(&value, from, 8);
  return value;
}
static inline void store64(u8* to, u64 value) {
  __builtin_memcpy(to, &value, 8);
}
static inline void fill(u8* to, int value, u32 count) {
  __builtin_memset(to, value, count);
}
