// SPDX-License-Identifier: Apache-2.0
// Links of whole rows: what each set of instructions makes of them is what surface_goes_on_across() and
// surface_goes_on_along() say of each place.
#include "capture/reconstruct/column_links.h"

#include <gtest/gtest.h>

#include <random>

#include "capture/reconstruct/eight.h"

namespace relievo {
namespace {

/// Columns that rise by some pixels with steps and gaps among them, and at times anything.
DecodedGrid scattered(int boundaries, int lines, std::mt19937& random) {
  std::normal_distribution<float> off(0, 0.4F);
  DecodedGrid out;
  out.reset(boundaries, lines);
  for (int line = 0; line < lines; ++line) {
    float column = 20;
    for (int b = 0; b < boundaries; ++b) {
      column += 6 + off(random) + (random() % 12 == 0 ? 30 * off(random) : 0);
      if (random() % 5 == 0) continue;
      const float extreme[] = {0, -0.F, 1e30F, -1e30F, 3e38F, 80, 84};
      const float sigma_px[] = {0, 0.05F, 0.11F, kSure_px, 0.3F};
      out.put(line, b, random() % 40 == 0 ? extreme[random() % 7] : column, sigma_px[random() % 5], 1);
    }
  }
  return out;
}

TEST(ColumnLinks, OfAWholeRowAreThoseOfEachPlace) {
  std::mt19937 random(11);
  std::size_t links = 0;
  std::size_t steps = 0;
  for (const int boundaries : {1, 2, 7, 8, 9, 89, 299}) {
    for (const float noise_px : {0.F, 0.06F}) {
      const ColumnScale scale{boundaries % 2 + 1, noise_px};
      const DecodedGrid grid = scattered(boundaries, 30, random);
      GridLinks found;
      WorkerPool pool(3);
      find_links(grid, scale, pool, found);
      const auto sure = [&](int l, int b) { return grid.sigma_px(l)[b] < kSure_px; };
      const auto known = [&](int l, int b) { return grid.column_px(l)[b] == grid.column_px(l)[b]; };
      for (int l = 0; l < 30; ++l) {
        const float* c = grid.column_px(l);
        const auto at = [&](int line, int b) { return grid.column_px(line)[b]; };
        for (int b = 0; b < boundaries; ++b) {
          const bool pair = known(l, b) && known(l, b + 1);
          const bool across = pair && surface_goes_on_across({c[b - 1], c[b], c[b + 1], c[b + 2]}, 1, scale);
          ASSERT_EQ(bit_of(found.across(l), b), across) << l << ", " << b;
          const bool along =
              known(l, b) && known(l + 1, b) &&
              surface_goes_on_along({at(l - 1, b), at(l, b), at(l + 1, b), at(l + 2, b)}, 1, scale);
          const bool both = along && sure(l, b) && sure(l + 1, b);
          ASSERT_EQ(bit_of(found.along(l), b), along) << l << ", " << b;
          ASSERT_EQ(bit_of(found.sure_along(l), b), both) << l << ", " << b;
          links += across;
          steps += pair && !across;
        }
      }
    }
  }
  EXPECT_GT(links, 5000U);
  EXPECT_GT(steps, 1000U);
}

TEST(ColumnLinks, AllKernelsFindTheSame) {
  std::mt19937 random(12);
  for (const int boundaries : {1, 7, 8, 9, 299}) {
    const DecodedGrid grid = scattered(boundaries, 40, random);
    for (int l = 0; l < 40; ++l) {
      const auto find = [&](const LinkKernels& kernels) {
        const std::size_t bytes = grid.stride() / 8;
        std::vector<std::uint8_t> out(3 * bytes, 77);
        kernels.find({grid.column_px(l - 1), grid.column_px(l), grid.column_px(l + 1), grid.column_px(l + 2),
                      grid.sigma_px(l), grid.sigma_px(l + 1)},
                     {2, 0.05F}, boundaries, {out.data(), out.data() + bytes, out.data() + 2 * bytes});
        return out;
      };
      const auto reference = find(all_link_kernels().front());
      for (const LinkKernels& kernels : all_link_kernels())
        ASSERT_EQ(find(kernels), reference) << kernels.name << ", " << boundaries;
    }
  }
}

TEST(ColumnLinks, NoneLeadOutOfTheGrid) {
  DecodedGrid grid;
  grid.reset(5, 4);
  for (int l = 0; l < 4; ++l)
    for (int b = 0; b < 5; ++b) grid.put(l, b, 10 * static_cast<float>(b), 0, 1);
  GridLinks links;
  WorkerPool pool(1);
  find_links(grid, {}, pool, links);
  for (int b = 0; b < 13; ++b) {
    for (const std::uint8_t* row : {links.along(-1), links.along(3), links.across(-1), links.across(4),
                                    links.sure_along(-1), links.sure_along(3)})
      EXPECT_FALSE(bit_of(row, b)) << b;
    EXPECT_EQ(bit_of(links.across(2), b), b < 4) << b;
    EXPECT_EQ(bit_of(links.along(2), b), b < 5) << b;
    EXPECT_EQ(bit_of(links.sure_along(2), b), b < 5) << b;
  }
}

}  // namespace
}  // namespace relievo
