// SPDX-License-Identifier: Apache-2.0
// A slice of the stripe grid from its streams: codec/FORMAT.md, "A slice". The same steps as
// codec/grid_decoder.cpp and src/gridDecoder.ts, which is the reference in the browser. One thread; all
// memory is the caller's (grid.h).
#include "grid.h"

enum {
  kBlockTable = 32,
  kCellTable = 34,
  kCellBlockTable = 42,
  kMarkTable = 43,
  kAlone = 7,
  kDirect = 48,
  kLargestSize = 60,
  kMostSymbols = 72,
  kSigmaTables = 5,
  kFirstSigma = 32,
  kMostSigma = 63,
  kMostPixels = 1 << 14,
  kScaleBits = 11,
  kScale = 1 << kScaleBits,
  kLow = 1 << 15,
};
#define kOnes 0x0101010101010101ULL

struct Job job;
struct Job* job_at(void) {
  return &job;
}

/// Of words of 16 bits; behind their end it reads zeros and is no longer ok.
typedef struct {
  u32 x[4];
  const u8 *at, *end;
  int ok;
} Decoder;
static Decoder control, residuals, sigmas;
static struct {
  const u8 *at, *end;
  u64 bits;
  int held, ok;
} raw;

static void open(Decoder* d, const u8* at, const u8* end, int lanes) {
  d->ok = end - at >= 4 * lanes;
  if (!d->ok) return;
  for (int i = 0; i < lanes; ++i) d->x[i] = load32(at + 4 * i);
  d->at = at + 4 * lanes;
  d->end = end;
}
static int finished(const Decoder* d, int lanes) {
  int fine = d->ok && d->at == d->end;
  for (int i = 0; i < lanes; ++i) fine &= d->x[i] == kLow;
  return fine;
}
static inline u32 refill(Decoder* d, u32 x) {
  if (x >= kLow) return x;
  if (d->end - d->at < 2) {
    d->ok = 0;
    return x << 16;
  }
  x = x << 16 | load16(d->at);
  d->at += 2;
  return x;
}
static inline u32 next_state(u32 x, u32 slot) {
  return (slot >> 8 & 0xfff) * (x >> kScaleBits) + (slot >> 20);
}

/// The next symbol of a stream with one lane; `two`: of an alphabet of two.
static inline u32 one(Decoder* d, const u32* table) {
  const u32 slot = table[d->x[0] & (kScale - 1)];
  d->x[0] = refill(d, next_state(d->x[0], slot));
  return slot & 255;
}
static inline u32 two(Decoder* d, u32 first) {
  const u32 x = d->x[0], slot = x & (kScale - 1);
  const u32 second = slot >= first;
  d->x[0] = refill(d, (second ? kScale - first : first) * (x >> kScaleBits) + slot - (second ? first : 0));
  return second;
}

/// A row of `count` symbols, each from the table of its number; the lanes take turns from the first on.
static void row(Decoder* d, const u32* tables, const u8* numbers, u32 count, u8* out) {
  if (d->end - d->at < 2 * (long)count) {
    for (u32 i = 0; i < count; ++i) {
      const u32 slot = tables[numbers[i] * kScale + (d->x[i & 3] & (kScale - 1))];
      d->x[i & 3] = refill(d, next_state(d->x[i & 3], slot));
      out[i] = (u8)slot;
    }
    return;
  }
  // Words enough for the row, whatever it holds: nothing to check.
  const u8* at = d->at;
  u32 a = d->x[0], b = d->x[1], c = d->x[2], e = d->x[3], i = 0;
#define STEP(x, k)                                                         \
  {                                                                        \
    const u32 slot = tables[numbers[i + k] * kScale + (x & (kScale - 1))]; \
    x = next_state(x, slot);                                               \
    const u32 more = x << 16 | load16(at);                                 \
    const int low = x < kLow;                                              \
    x = low ? more : x;                                                    \
    at += low << 1;                                                        \
    out[i + k] = (u8)slot;                                                 \
  }
  for (; i + 4 <= count; i += 4) {
    STEP(a, 0) STEP(b, 1) STEP(c, 2) STEP(e, 3)
  }
  if (i < count) STEP(a, 0)
  if (i + 1 < count) STEP(b, 1)
  if (i + 2 < count) STEP(c, 2)
  d->x[0] = a;
  d->x[1] = b;
  d->x[2] = c;
  d->x[3] = e;
  d->at = at;
}

static u32 raw_bits(int count) {
  while (raw.held < count) {
    if (raw.at < raw.end)
      raw.bits |= (u64)*raw.at++ << raw.held;
    else
      raw.ok = 0;
    raw.held += 8;
  }
  const u32 value = (u32)(raw.bits & ((1ULL << count) - 1));
  raw.bits >>= count;
  raw.held -= count;
  return value;
}
static u32 number_of(u32 symbol) {
  if (symbol < kDirect) return symbol;
  const int bits = (int)symbol - kDirect + 3;
  return (1U << bits) + raw_bits(bits) - 8 + kDirect;
}
static inline i32 unzigzag(u32 z) {
  return (i32)(z >> 1 ^ (~(z & 1) + 1));
}

/// Which places of a line hold a vertex; `above` is the line before's.
static void read_places(const u8* above, u8* here, int line) {
  const int n = job.boundaries;
  const u8* key = 0;
  if (job.key) {
    const i32* from = job.key + line * job.stride + kMargin;
    for (int b = 0; b < n; ++b) job.key_there[kMargin + b] = from[b] != kAbsent;
    key = job.key_there + kMargin;
  }
  for (int b = 0; b < n; b += 8) {
    const int last = b + 8 < n ? b + 8 : n;
    if (last - b == 8) {
      const u32 v = here[b - 1];
      const u64 all = v * kOnes;
      if (load64(above + b) == all && above[b - 1] == v && above[b + 8] == v &&
          (!key || load64(key + b) == all) && !two(&control, job.first[kBlockTable + v])) {
        store64(here + b, all);
        continue;
      }
    }
    for (int i = b; i < last; ++i) {
      const u32 context =
          here[i - 1] | above[i] << 1 | above[i + 1] << 2 | above[i - 1] << 3 | (key ? key[i] << 4 : 0);
      here[i] = (u8)two(&control, job.first[context]);
    }
  }
}

/// Between a line and the one below. False where a symbol is none.
static int read_cells(const u8* above, const u8* below, const u8* good_above, u8* good_here, int line) {
  u8* cells = job.cells + line * job.stride + kMargin;
  const int count = job.boundaries - 1;
  good_here[-1] = 1;
  for (int b = 0; b < count; b += 8) {
    const int last = b + 8 < count ? b + 8 : count;
    if (last - b == 8 && good_here[b - 1] && load64(good_above + b) == kOnes && load64(above + b) == kOnes &&
        load64(below + b) == kOnes && above[b + 8] && below[b + 8] &&
        !two(&control, job.first[kCellBlockTable])) {
      store64(cells + b, ~0ULL);  // kBoth
      store64(good_here + b, kOnes);
      job.triangles += 16;
      continue;
    }
    for (int i = b; i < last; ++i) {
      const u32 c0 = above[i], c1 = below[i], c2 = below[i + 1], c3 = above[i + 1];
      const u32 corners = c0 + c1 + c2 + c3;
      good_here[i] = 0;
      if (corners < 3) continue;
      const u32 table = (corners == 4 ? 4 : 0) + 2 * good_here[i - 1] + good_above[i];
      const u32 symbol = one(&control, job.cell_tables + table * kScale);
      if (symbol > 5 || (corners == 3 && symbol > 1)) return 0;
      good_here[i] = symbol == 0;
      if (symbol == 1) continue;
      job.triangles += symbol == 0 && corners == 4 ? 2 : 1;
      if (corners == 3)
        cells[i] = !c0 ? 1 : !c1 ? 2 : !c2 ? 4 : 8;
      else
        cells[i] = symbol == 0 ? kBoth : (u8)(1 << (symbol - 2));
    }
  }
  return 1;
}

static void read_marks(const u8* here, int line) {
  u8* marks = job.marks + line * job.stride + kMargin;
  const u8* above = line > job.begin ? marks - job.stride : 0;
  for (int b = 0; b < job.boundaries; ++b)
    if (here[b])
      marks[b] = (u8)two(&control, job.first[kMarkTable + (above ? above[b] << 1 : 0) + marks[b - 1]]);
}

static const i32* line_of(const i32* columns, int line) {
  return (line < job.begin ? job.absent : columns + line * job.stride) + kMargin;
}

/// A difference of two places; none where it is beyond the limit.
static inline v128_t within(v128_t a, v128_t b, v128_t limit) {
  const v128_t d = wasm_i32x4_sub(a, b);
  return wasm_v128_and(d, wasm_i32x4_le(wasm_i32x4_abs(d), limit));
}
static inline v128_t near(v128_t d, v128_t limit) {
  // Of absent places the difference may be the least number, whose size is none.
  return wasm_v128_and(wasm_i32x4_le(d, limit), wasm_i32x4_ge(d, wasm_i32x4_neg(limit)));
}

typedef struct {
  const i32 *up1, *up2, *up3, *up4, *key, *key_up;
} Rows;

/// Four places from b on, of no meaning where nothing is above.
static inline v128_t expected(const Rows* r, int b) {
  const v128_t limit = wasm_i32x4_splat(job.limit);
  const v128_t up1 = wasm_v128_load(r->up1 + b), up2 = wasm_v128_load(r->up2 + b),
               up3 = wasm_v128_load(r->up3 + b);
  const v128_t d1 = within(up1, up2, limit), d2 = within(up2, up3, limit),
               d3 = within(up3, wasm_v128_load(r->up4 + b), limit);
  v128_t sum = wasm_i32x4_splat(128);
  sum = wasm_i32x4_add(sum, wasm_i32x4_mul(d1, wasm_i32x4_splat(job.slope1)));
  sum = wasm_i32x4_add(sum, wasm_i32x4_mul(d2, wasm_i32x4_splat(job.slope2)));
  sum = wasm_i32x4_add(sum, wasm_i32x4_mul(d3, wasm_i32x4_splat(job.slope3)));
  v128_t p = wasm_i32x4_add(up1, wasm_i32x4_shr(sum, 8));
  if (!r->key) return p;
  const v128_t change = wasm_i32x4_sub(up1, wasm_v128_load(r->key_up + b));
  const v128_t d = wasm_i32x4_sub(wasm_v128_load(r->key + b), p);
  const v128_t both = wasm_v128_and(near(change, limit), near(d, limit));
  v128_t more = wasm_i32x4_add(wasm_i32x4_mul(wasm_v128_and(d, both), wasm_i32x4_splat(job.key_weight)),
                               wasm_i32x4_mul(wasm_v128_and(change, both), wasm_i32x4_splat(job.key_change)));
  more = wasm_i32x4_shr(wasm_i32x4_add(more, wasm_i32x4_splat(128)), 8);
  return wasm_i32x4_add(p, wasm_v128_and(more, both));
}

/// Eight bytes as numbers.
static inline v128_t widen(const u8* from) {
  return wasm_u16x8_load8x8(from);
}
static inline v128_t absent_of(v128_t columns) {
  return wasm_i32x4_eq(columns, wasm_i32x4_splat(kAbsent));
}

/// Tables of the residuals of a line, one a place.
static void read_contexts(const i32* up1, const u8* sizes, int count) {
  for (int b = 0; b < count; b += 8) {
    const v128_t here = wasm_v128_load64_zero(sizes + b);
    v128_t t = wasm_i8x16_add(wasm_v128_load64_zero(sizes + b - 1), wasm_v128_load64_zero(sizes + b + 1));
    t = wasm_i8x16_add(t, wasm_i8x16_add(here, here));
    v128_t table = wasm_i8x16_splat(0);
    for (int k = 0; k < 6; ++k)
      table = wasm_i8x16_sub(table, wasm_u8x16_ge(t, wasm_u8x16_splat((u8)(1 << k))));
    const v128_t low = absent_of(wasm_v128_load(up1 + b)), high = absent_of(wasm_v128_load(up1 + b + 4));
    const v128_t words = wasm_i16x8_narrow_i32x4(low, high);
    const v128_t alone = wasm_i8x16_narrow_i16x8(words, words);
    wasm_v128_store64_lane(job.contexts + b, wasm_v128_bitselect(wasm_u8x16_splat(kAlone), table, alone), 0);
  }
}

/// A vertex with nothing above it.
static i32 expected_alone(const i32* here, const Rows* r, int b) {
  if (r->key && r->key[b] != kAbsent) return r->key[b];
  if (here[b - 1] != kAbsent)
    return here[b - 2] != kAbsent ? 2 * here[b - 1] - here[b - 2] : here[b - 1] + job.spacing;
  if (r->up1[b + 1] != kAbsent) return r->up1[b + 1] - job.spacing;
  for (int l = b - 1; l >= 0; --l)
    if (here[l] != kAbsent) return here[l] + (b - l) * job.spacing;
  return b * job.spacing;
}

/// The vertices of eight places that need a look each: nothing above, or a residual that is not its own
/// symbol.
static int read_alone(const Rows* r, const u8* there, int b, i32* here, i32 most) {
  for (int i = b; i < b + 8; ++i) {
    const u32 symbol = job.placed[i];
    if (!there[i] || (job.contexts[i] != kAlone && symbol < kDirect)) continue;
    if (symbol >= kMostSymbols) return 0;  // of a table that is not there
    const i32 d = unzigzag(number_of(symbol));
    const i32 p = job.contexts[i] == kAlone ? expected_alone(here, r, i) : here[i];
    const i32 column = p + d;
    if (column < -most || column > most) return 0;
    here[i] = column;
    const i32 size = d < 0 ? -d : d;
    job.sizes[kMargin + i] = (u8)(size < kLargestSize ? size : kLargestSize);
  }
  return 1;
}

static int read_columns(const u8* there, int line) {
  const Rows r = {line_of(job.columns, line - 1),
                  line_of(job.columns, line - 2),
                  line_of(job.columns, line - 3),
                  line_of(job.columns, line - 4),
                  job.key ? job.key + line * job.stride + kMargin : 0,
                  job.key ? line_of(job.key, line - 1) : 0};
  i32* here = job.columns + line * job.stride + kMargin;
  u8* sizes = job.sizes + kMargin;
  const int n = job.boundaries;
  read_contexts(r.up1, sizes, n);
  u32 count = 0;
  for (int b = 0; b < n; b += 8) {
    if (load64(there + b) == kOnes) {
      store64(job.numbers + count, load64(job.contexts + b));
      count += 8;
      continue;
    }
    for (int i = b; i < b + 8; ++i) {  // behind the last boundary there are no vertices
      job.numbers[count] = job.contexts[i];
      count += there[i];
    }
  }
  row(&residuals, job.residual_tables, job.numbers, count, job.symbols);
  const i32 most = kMostPixels << job.step_bits;
  v128_t unfair = wasm_i32x4_splat(0);
  u32 next = 0;
  for (int b = 0; b < n; b += 8) {
    const u64 present = load64(there + b);
    if (present == 0) continue;
    if (present == kOnes) {
      store64(job.placed + b, load64(job.symbols + next));
      next += 8;
    } else {
      for (int i = b; i < b + 8; ++i) {
        job.placed[i] = job.symbols[next];
        next += there[i];
      }
    }
    const v128_t symbols = widen(job.placed + b), contexts = widen(job.contexts + b),
                 places = widen(there + b);
    // d of a folded number: 16 bits are enough for those that are their own symbols.
    const v128_t odd = wasm_i16x8_neg(wasm_v128_and(symbols, wasm_i16x8_splat(1)));
    const v128_t d = wasm_v128_xor(wasm_u16x8_shr(symbols, 1), odd);
    const v128_t itself = wasm_v128_or(wasm_i16x8_eq(contexts, wasm_i16x8_splat(kAlone)),
                                       wasm_i16x8_ge(symbols, wasm_i16x8_splat(kDirect)));
    const v128_t is_there = wasm_i16x8_ne(places, wasm_i16x8_splat(0));
    const v128_t done = wasm_v128_andnot(is_there, itself);
    const v128_t old_sizes = widen(sizes + b);
    const v128_t new_sizes = wasm_v128_bitselect(wasm_i16x8_abs(d), old_sizes, done);
    wasm_v128_store64_lane(sizes + b, wasm_u8x16_narrow_i16x8(new_sizes, new_sizes), 0);
    for (int half = 0; half < 2; ++half) {
      const v128_t p = expected(&r, b + 4 * half);
      const v128_t change = half ? wasm_i32x4_extend_high_i16x8(d) : wasm_i32x4_extend_low_i16x8(d);
      const v128_t fits = half ? wasm_i32x4_extend_high_i16x8(done) : wasm_i32x4_extend_low_i16x8(done);
      const v128_t is = half ? wasm_i32x4_extend_high_i16x8(is_there) : wasm_i32x4_extend_low_i16x8(is_there);
      const v128_t column = wasm_i32x4_add(p, change);
      const v128_t beyond = wasm_v128_or(wasm_i32x4_gt(column, wasm_i32x4_splat(most)),
                                         wasm_i32x4_lt(column, wasm_i32x4_splat(-most)));
      unfair = wasm_v128_or(unfair, wasm_v128_and(fits, beyond));
      // Of those that need a look each: what is expected of them.
      const v128_t put = wasm_v128_bitselect(column, p, fits);
      wasm_v128_store(here + b + 4 * half, wasm_v128_bitselect(put, wasm_i32x4_splat(kAbsent), is));
    }
    if (wasm_v128_any_true(wasm_v128_and(is_there, itself)) && !read_alone(&r, there, b, here, most))
      return 0;
  }
  job.vertices += count;
  return !wasm_v128_any_true(unfair);
}

/// Whether none of eight places is empty.
static inline int all_there(const i32* columns) {
  const v128_t low = absent_of(wasm_v128_load(columns)), high = absent_of(wasm_v128_load(columns + 4));
  return !wasm_v128_any_true(wasm_v128_or(low, high));
}

/// How exact the columns of a line are.
static int read_sigmas(const u8* there, int line) {
  const i32 *above = line_of(job.columns, line - 1), *further = line_of(job.columns, line - 2);
  u8* codes = job.sigmas + line * job.stride + kMargin;
  const u8 *up1 = codes - job.stride, *up2 = up1 - job.stride;  // not read where nothing is
  u32 count = 0;
  for (int b = 0; b < job.boundaries; b += 8) {
    if (load64(there + b) == kOnes && all_there(above + b) && all_there(further + b)) {
      const v128_t d = wasm_i16x8_abs(wasm_i16x8_sub(widen(up1 + b), widen(up2 + b)));
      const v128_t table = wasm_i16x8_min(d, wasm_i16x8_splat(kSigmaTables - 2));
      wasm_v128_store64_lane(job.numbers + count, wasm_u8x16_narrow_i16x8(table, table), 0);
      count += 8;
      continue;
    }
    for (int i = b; i < b + 8; ++i) {  // behind the last boundary there are no vertices
      if (!there[i]) continue;
      u32 table = kSigmaTables - 1;
      if (above[i] != kAbsent) {
        table = 0;
        if (further[i] != kAbsent) {
          const i32 d = up1[i] - up2[i], size = d < 0 ? -d : d;
          table = size < kSigmaTables - 2 ? (u32)size : kSigmaTables - 2;
        }
      }
      job.numbers[count++] = (u8)table;
    }
  }
  row(&sigmas, job.sigma_tables, job.numbers, count, job.symbols);
  i32 last = kFirstSigma;
  u32 next = 0;
  for (int b = 0; b < job.boundaries; b += 8) {
    if (load64(there + b) == kOnes && all_there(above + b)) {
      const v128_t symbols = widen(job.symbols + next);
      const v128_t odd = wasm_i16x8_neg(wasm_v128_and(symbols, wasm_i16x8_splat(1)));
      const v128_t code = wasm_i16x8_add(widen(up1 + b), wasm_v128_xor(wasm_u16x8_shr(symbols, 1), odd));
      // Those that are their own symbols, all within bounds.
      const v128_t fair = wasm_v128_and(wasm_i16x8_lt(symbols, wasm_i16x8_splat(kDirect)),
                                        wasm_u16x8_le(code, wasm_i16x8_splat(kMostSigma)));
      if (wasm_i16x8_all_true(fair)) {
        wasm_v128_store64_lane(codes + b, wasm_u8x16_narrow_i16x8(code, code), 0);
        last = codes[b + 7];
        next += 8;
        continue;
      }
    }
    for (int i = b; i < b + 8; ++i) {
      if (!there[i]) continue;
      const u32 symbol = job.symbols[next++];
      if (symbol >= kMostSymbols) return 0;
      last = unzigzag(number_of(symbol)) + (above[i] != kAbsent ? up1[i] : last);
      if (last < 0 || last > kMostSigma) return 0;
      codes[i] = (u8)last;
    }
  }
  return 1;
}

/// Lines [begin, end) of the job; adds to its vertices and triangles. False where the slice is damaged; any
/// streams.
int decode_slice(void) {
  const u32 stride = (u32)job.stride;
  u8 *here = job.there[0] + kMargin, *below = job.there[1] + kMargin;
  u8 *good_above = job.good[0] + kMargin, *good_here = job.good[1] + kMargin;
  for (int i = 0; i < 2; ++i) {
    fill(job.there[i], 0, stride);
    fill(job.good[i], 1, stride);
  }
  fill(job.key_there, 0, stride);
  fill(job.sizes, 1, stride);
  fill(job.placed, 0, stride);
  for (int i = 0; i < job.stride; ++i) job.absent[i] = kAbsent;
  open(&control, job.control, job.control_end, 1);
  open(&residuals, job.residuals, job.residuals_end, 4);
  if (job.sigmas) open(&sigmas, job.sigma, job.sigma_end, 4);
  if (!control.ok || !residuals.ok || (job.sigmas && !sigmas.ok)) return 0;
  raw.at = job.raw;
  raw.end = job.raw_end;
  raw.bits = 0;
  raw.held = 0;
  raw.ok = 1;
  job.vertices = job.triangles = 0;
  read_places(below, here, job.begin);
  for (int line = job.begin; line < job.end; ++line) {
    if (job.marks) read_marks(here, line);
    if (line + 1 < job.lines) {
      read_places(here, below, line + 1);
      if (!read_cells(here, below, good_above, good_here, line)) return 0;
      u8* const good = good_above;
      good_above = good_here;
      good_here = good;
    }
    if (!read_columns(here, line) || (job.sigmas && !read_sigmas(here, line))) return 0;
    if (!control.ok || !residuals.ok || !raw.ok) return 0;
    u8* const there = here;
    here = below;
    below = there;
  }
  return finished(&control, 1) && finished(&residuals, 4) && (!job.sigmas || finished(&sigmas, 4)) &&
         raw.at == raw.end;
}
