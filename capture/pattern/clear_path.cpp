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

/// The arcs that flip at least so many channels.
class ClearArcs {
 public:
  ClearArcs(const BcslGraph& graph, std::span<const Primary> palette, int least_flips)
      : graph_(graph), palette_(palette), least_flips_(least_flips) {}

  bool has(int from, int to) const {
    int flips = 0;
    for (int s = 0; s < graph_.slides(); ++s)
      flips += std::popcount(static_cast<unsigned>(primary(from, s) ^ primary(to, s)));
    return flips >= least_flips_;
  }

  std::size_t count() const {
    std::size_t arcs = 0;
    for (int v = 0; v < graph_.vertices(); ++v)
      for (int j = 0; j < graph_.degree(); ++j) arcs += has(v, graph_.neighbour(v, j));
    return arcs;
  }

 private:
  Primary primary(int vertex, int slide) const {
    return palette_[static_cast<std::size_t>(graph_.digit(vertex, slide))];
  }

  const BcslGraph& graph_;
  std::span<const Primary> palette_;
  int least_flips_;
};

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
  for (int flips = kMostFlips * graph.slides();; --flips) {
    const ClearArcs arcs(graph, palette, flips);
    const std::size_t count = arcs.count();
    if (count + 1 < static_cast<std::size_t>(stripes)) continue;
    // Where an arc flips so many channels the one back does, too.
    std::vector<int> path = graph.eulerian_path([&](int vertex, int k) {
      const int to = graph.neighbour(vertex, order[static_cast<std::size_t>((vertex + k) % graph.degree())]);
      return arcs.has(vertex, to) ? to : -1;
    });
    if (path.size() == count + 1) return path;
  }
}

}  // namespace relievo
