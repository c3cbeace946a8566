// SPDX-License-Identifier: Apache-2.0
#include "capture/pattern/clear_path.h"

#include <bit>
#include <cassert>
#include <numeric>
#include <random>
#include <utility>

namespace relievo {
namespace {

// Asked of a boundary, a slide, at most. With 5 of two slides half as many codes are left, and boundaries
// near each other resemble each other more: what moves loses .0015 of its completeness.
constexpr int kMostFlips = 2;
// Of 64, that with which simulated scenes came out best, and others that it was not chosen by, too
// (docs/ACCURACY.md).
constexpr std::mt19937::result_type kSeed = 4;

/// Channels that flip from one stripe to the other, all slides together.
int flips(const BcslGraph& graph, std::span<const Primary> palette, int from, int to) {
  int out = 0;
  for (int s = 0; s < graph.slides(); ++s) {
    const auto primary = [&](int vertex) {
      return palette[static_cast<std::size_t>(graph.digit(vertex, s))];
    };
    out += std::popcount(static_cast<unsigned>(primary(from) ^ primary(to)));
  }
  return out;
}

/// The order in which a vertex's arcs are tried: in the natural one, neighbouring boundaries would repeat one
/// step of colours after the other, and be taken for each other.
std::vector<int> shuffled(int count) {
  std::vector<int> out(static_cast<std::size_t>(count));
  std::iota(out.begin(), out.end(), 0);
  std::mt19937 random(kSeed);  // its numbers are the same everywhere; those of std::shuffle are not
  for (std::size_t i = out.size(); i > 1; --i) std::swap(out[i - 1], out[random() % i]);
  return out;
}

}  // namespace

std::vector<int> clear_path(const BcslGraph& graph, std::span<const Primary> palette, int stripes) {
  assert(stripes <= graph.arcs() + 1);
  const std::vector<int> order = shuffled(graph.degree());
  for (int least = kMostFlips * graph.slides();; --least) {
    // Where an arc flips so many channels the one back does, too.
    std::vector<int> path = graph.eulerian_path([&](int vertex, int k) {
      const int to = graph.neighbour(vertex, order[static_cast<std::size_t>((vertex + k) % graph.degree())]);
      return flips(graph, palette, vertex, to) >= least ? to : -1;
    });
    if (path.size() >= static_cast<std::size_t>(stripes)) return path;
  }
}

}  // namespace relievo
