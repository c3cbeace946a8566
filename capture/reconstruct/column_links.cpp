// SPDX-License-Identifier: Apache-2.0
#include "capture/reconstruct/column_links.h"

#include <algorithm>

#include "base/variants.h"
#include "capture/reconstruct/eight.h"

namespace relievo {
namespace {

/// One difference of columns and those beside it.
struct Steps {
  Eight before, here, behind;
  EightInts know_before, know_behind;
  RELIEVO_INLINE void take(const Eight& x0, const Eight& x1, const Eight& x2, const Eight& x3) {
    before = x1 - x0;
    here = x2 - x1;
    behind = x3 - x2;
    know_before = before == before;
    know_behind = behind == behind;
  }
  /// How far `here` is outside of what lies between the other two, or beside the one that is known: no more
  /// than that. Where neither is, nothing is said.
  RELIEVO_INLINE void within(const Eight& between, const Eight& beside, EightInts& out) const {
    const Eight low = behind < before ? behind : before;
    const Eight high = before < behind ? behind : before;
    const EightInts inside = (here >= low - between) & (here <= high + between);
    const Eight one = know_before ? before : behind;
    const Eight off = here - one;
    const Eight distance = off < 0 ? -off : off;
    out = know_before & know_behind ? inside : distance <= beside;
  }
};

/// surface_goes_on_across() and surface_goes_on_along(), of neighbours.
RELIEVO_INLINE void find_body(const ColumnRows& rows, const ColumnScale& scale, int count,
                              const LinkRow& out) {
  const ColumnLimits limits(scale);
  const Eight none{};
  for (int b = 0; b < count; b += 8) {
    Eight left, here, right, right_but_one, above, below, further, sigma_here, sigma_below;
    load(rows.here + b - 1, left);
    load(rows.here + b, here);
    load(rows.here + b + 1, right);
    load(rows.here + b + 2, right_but_one);
    load(rows.above + b, above);
    load(rows.below + b, below);
    load(rows.further + b, further);
    load(rows.sigma_here + b, sigma_here);
    load(rows.sigma_below + b, sigma_below);

    // Where either is not there, the difference compares as neither less nor more.
    Steps steps;
    EightInts on;
    steps.take(left, here, right, right_but_one);
    const Eight one = steps.know_before ? steps.before : steps.behind;
    const Eight least = one < steps.here ? one : steps.here;
    steps.within(limits.across + ColumnLimits::kAcrossShare * steps.here,
                 limits.across + ColumnLimits::kAcrossOpen * least, on);
    const EightInts narrow = steps.here <= ColumnLimits::kWidest_px;
    on = (steps.here > none) & (steps.know_before | steps.know_behind ? on : narrow);
    out.across[b / 8] = gather(on);

    steps.take(above, here, below, further);
    const Eight slack = none + limits.along;
    steps.within(slack, slack, on);
    const Eight lean = steps.here < 0 ? -steps.here : steps.here;
    on = steps.know_before | steps.know_behind ? on : lean <= limits.lean;
    const EightInts sure = on & (sigma_here < kSure_px) & (sigma_below < kSure_px);
    out.along[b / 8] = gather(on);
    out.sure_along[b / 8] = gather(sure);
  }
}

void find_portable(const ColumnRows& rows, const ColumnScale& scale, int count, const LinkRow& out) {
  find_body(rows, scale, count, out);
}
#if defined(__x86_64__)
[[gnu::target("avx2")]] void find_avx2(const ColumnRows& rows, const ColumnScale& scale, int count,
                                       const LinkRow& out) {
  find_body(rows, scale, count, out);
}
#endif

}  // namespace

const std::vector<LinkKernels>& all_link_kernels() {
  const LinkKernels portable{"portable", find_portable};
#if defined(__x86_64__)
  static const auto kernels = variants(portable, {"avx2", find_avx2});
#else
  static const auto kernels = variants(portable);
#endif
  return kernels;
}

const LinkKernels& link_kernels() {
  return all_link_kernels().back();
}

void GridLinks::fit(const DecodedGrid& grid) {
  const std::size_t bytes = grid.stride() / 8 + 1;
  if (bytes_ == bytes && lines_ == grid.lines()) return;
  bytes_ = bytes;
  lines_ = grid.lines();
  links_.assign(3 * static_cast<std::size_t>(lines_ + 2) * bytes_, 0);
}

void find_links(const DecodedGrid& grid, const ColumnScale& scale, WorkerPool& pool, GridLinks& out) {
  out.fit(grid);
  pool.for_ranges(grid.lines(), [&](int begin, int end, int) {
    for (int l = begin; l < end; ++l) {
      const ColumnRows rows{grid.column_px(l - 1), grid.column_px(l), grid.column_px(l + 1),
                            grid.column_px(l + 2), grid.sigma_px(l),  grid.sigma_px(l + 1)};
      link_kernels().find(rows, scale, grid.boundaries(), out.row(l));
    }
  });
}

}  // namespace relievo
