// SPDX-License-Identifier: Apache-2.0
// The path search's kernels: the portable ones against their definition written out, and every other set of
// instructions that this machine has against the portable ones.
#include "capture/reconstruct/line_path.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <random>
#include <string>
#include <tuple>

#include "capture/pattern/bcsl.h"

namespace relievo {
namespace {

constexpr GainRules kGains{.transition_slack = 0.9F,
                           .other_floor = -0.6F,
                           .contradiction = 0,
                           .contradicted = 1.5F,
                           .threshold = 1.3F};
constexpr OrderRules kOrder{.in_order = 1, .per_missing = 0.5F, .max_missing = 3};

BoundaryColours colours_of(const Pattern& pattern) {
  BoundaryColours out;
  for (int b = 0; b < pattern.boundaries(); ++b)
    out.add(pattern.colour(b, 0), pattern.colour(b + 1, 0), pattern.colour(b, 1), pattern.colour(b + 1, 1));
  out.fill_up();
  return out;
}

/// Agreements in steps of `step`, so that a coarse one makes many equal.
EdgeAgreement random_edge(std::mt19937& random, float step) {
  std::uniform_int_distribution<int> any(-static_cast<int>(1 / step), static_cast<int>(1 / step));
  EdgeAgreement out{};
  for (PerPrimary* side : {&out.left, &out.right, &out.other_left, &out.other_right})
    for (float& a : *side) a = step * static_cast<float>(any(random));
  out.left[0] = out.left[7] = out.right[0] = out.right[7] = -100;
  out.tracked = any(random) % 2 == 0;
  return out;
}

struct Chosen {
  std::vector<std::int32_t> boundary;
  std::vector<float> gain;
  bool operator==(const Chosen&) const = default;
};

/// Of a kernel that writes up to `places` boundaries.
Chosen written_by(decltype(PathKernels::choose) kernel, int places, const BoundaryColours& colours,
                  const EdgeAgreement& edge) {
  const auto size = static_cast<std::size_t>(places);
  Chosen out{std::vector<std::int32_t>(size, -9), std::vector<float>(size, -9)};
  const auto n =
      static_cast<std::size_t>(kernel(colours, edge, kGains, out.boundary.data(), out.gain.data()));
  out.boundary.resize(n);
  out.gain.resize(n);
  return out;
}

Chosen choose(const PathKernels& kernels, const BoundaryColours& colours, const EdgeAgreement& edge) {
  return written_by(kernels.choose, kPathCandidates, colours, edge);
}

Chosen near(const PathKernels& kernels, const BoundaryColours& colours, const EdgeAgreement& edge) {
  return written_by(kernels.near, colours.count + 8, colours, edge);
}

/// As the header says, of `most` boundaries.
Chosen expected_choice(const BoundaryColours& colours, const EdgeAgreement& edge,
                       std::size_t most = kPathCandidates) {
  const auto own = [&](int b) {
    const auto i = static_cast<std::size_t>(b);
    return edge.left[static_cast<std::size_t>(colours.left[i])] +
           edge.right[static_cast<std::size_t>(colours.right[i])];
  };
  float best = -1000;
  for (int b = 0; b < colours.count; ++b) best = std::max(best, own(b));
  std::vector<std::tuple<float, int>> all;  // worse first: less gain, behind
  for (int b = 0; b < colours.count; ++b) {
    const auto i = static_cast<std::size_t>(b);
    if (own(b) < best - kGains.transition_slack || own(b) < 0) continue;
    const float l = edge.other_left[static_cast<std::size_t>(colours.other_left[i])];
    const float r = edge.other_right[static_cast<std::size_t>(colours.other_right[i])];
    float other = l + r;
    if (!edge.tracked) other = std::max(other, kGains.other_floor);
    if (edge.tracked && (l < 0 || r < 0)) other -= kGains.contradicted;
    all.emplace_back(own(b) + other - kGains.threshold, -b);
  }
  std::sort(all.rbegin(), all.rend());
  if (all.size() > most) all.resize(most);
  std::sort(all.begin(), all.end(),
            [](const auto& a, const auto& b) { return std::get<1>(a) > std::get<1>(b); });
  Chosen out;
  for (const auto& [gain, b] : all) {
    out.gain.push_back(gain);
    out.boundary.push_back(-b);
  }
  return out;
}

class LinePath : public testing::TestWithParam<std::size_t> {
 protected:
  const PathKernels& kernels() const { return all_path_kernels()[GetParam()]; }
};

TEST_P(LinePath, ChoosesTheBestBoundaries) {
  std::mt19937 random(5);
  for (const int stripes : {2, 9, 10, 90, 300, 899}) {
    const BoundaryColours colours = colours_of(*make_pattern(6, 2, 0, stripes));
    for (const float step : {0.001F, 0.25F, 1.F}) {
      for (int round = 0; round < 50; ++round) {
        const EdgeAgreement edge = random_edge(random, step);
        const Chosen got = choose(kernels(), colours, edge);
        const Chosen expected = expected_choice(colours, edge);
        ASSERT_EQ(got.boundary, expected.boundary) << stripes << " stripes, round " << round;
        ASSERT_EQ(got.gain, expected.gain);
        ASSERT_TRUE(near(kernels(), colours, edge) == expected_choice(colours, edge, 10'000));
      }
    }
  }
}

// And writes none: the path search reads all places of an edge, and what was on the stack is no boundary.
TEST_P(LinePath, ChoosesNoneWhereNoneAgrees) {
  const BoundaryColours colours = colours_of(*make_pattern(6, 2, 0, 90));
  EdgeAgreement edge{};
  edge.left.fill(-0.5F);
  edge.right.fill(-0.5F);
  std::array<std::int32_t, kPathCandidates> boundary;
  std::array<float, kPathCandidates> gain;
  boundary.fill(-9);
  gain.fill(-9);
  EXPECT_EQ(kernels().choose(colours, edge, kGains, boundary.data(), gain.data()), 0);
  EXPECT_THAT(boundary, testing::Each(-9));
  EXPECT_THAT(gain, testing::Each(-9.F));
}

TEST_P(LinePath, ChoosesFromAVeryLongPattern) {
  std::mt19937 random(6);
  BoundaryColours colours;
  std::uniform_int_distribution<int> primary(1, 6);
  const auto any = [&] { return static_cast<Primary>(primary(random)); };
  for (int b = 0; b < 3000; ++b) {
    const Primary left = any(), right = any(), other_left = any(), other_right = any();
    colours.add(left, right, other_left, other_right);
  }
  colours.fill_up();
  for (int round = 0; round < 20; ++round) {
    const EdgeAgreement edge = random_edge(random, 0.25F);
    ASSERT_TRUE(choose(kernels(), colours, edge) == expected_choice(colours, edge));
    ASSERT_TRUE(near(kernels(), colours, edge) == expected_choice(colours, edge, 10'000));
  }
}

/// Candidates of a line of `edges` edges, of a sequence so short that many follow each other.
PathCandidates random_line(std::mt19937& random, int edges) {
  std::uniform_int_distribution<int> boundary(0, 20), used(0, kPathCandidates), gain(-8, 12);
  PathCandidates out;
  out.resize(static_cast<std::size_t>(edges));
  for (int& n : out.used) n = used(random);
  for (std::int32_t& b : out.boundary) b = boundary(random);
  for (float& g : out.gain) g = 0.25F * static_cast<float>(gain(random));
  return out;
}

TEST_P(LinePath, ExtendsTheBestPath) {
  std::mt19937 random(7);
  for (int round = 0; round < 100; ++round) {
    PathCandidates line = random_line(random, 12);
    for (int edge = 0; edge < 12; ++edge) {
      const int first = std::max(0, edge - 4);
      const float start = edge % 3 == 0 ? 0 : 0.5F * static_cast<float>(edge);
      const int start_from = edge % 3 == 0 ? -1 : 8 * (edge / 2);
      kernels().extend({first, edge, start, start_from}, kOrder, line);
      for (int k = 0; k < line.used[static_cast<std::size_t>(edge)]; ++k) {
        const auto here = static_cast<std::size_t>(8 * edge + k);
        float way = start;
        int from = start_from;
        for (int e = first; e < edge; ++e) {
          for (int j = 0; j < line.used[static_cast<std::size_t>(e)]; ++j) {
            const auto before = static_cast<std::size_t>(8 * e + j);
            const int missing = line.boundary[here] - line.boundary[before] - 1;
            if (missing < 0 || missing > kOrder.max_missing) continue;
            const float value =
                line.best[before] + kOrder.in_order - kOrder.per_missing * static_cast<float>(missing);
            if (value <= way) continue;
            way = value;
            from = static_cast<int>(before);
          }
        }
        ASSERT_EQ(line.best[here], way + line.gain[here]) << "edge " << edge << ", round " << round;
        ASSERT_EQ(line.from[here], from);
      }
    }
  }
}

INSTANTIATE_TEST_SUITE_P(, LinePath, testing::Range(std::size_t{0}, all_path_kernels().size()),
                         [](const auto& test) { return std::string(all_path_kernels()[test.param].name); });

}  // namespace
}  // namespace relievo
