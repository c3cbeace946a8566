// SPDX-License-Identifier: Apache-2.0
// (b,s)-boundary coded structured light, paper section 3: the graph of stripe colours, its Eulerian path
// (3.1) and the table that turns the colours on both sides of a boundary into its position (3.2).
// A vertex is one stripe's colour on every slide: s base-b digits, slide 1's the most significant. An arc is
// a boundary between two stripes that differ on every slide. All functions are pure; any thread.
#pragma once

#include <array>
#include <cstddef>
#include <functional>
#include <optional>
#include <span>
#include <string_view>
#include <vector>

#include "base/pattern.h"
#include "base/result.h"

namespace relievo {

/// The directed graph of section 3.1: b^s vertices, each with (b-1)^s arcs out and as many in.
class BcslGraph {
 public:
  /// Largest graph taken: its Eulerian path needs about 10 bytes an arc.
  static constexpr long long kMaxArcs = 100'000'000;

  /// Fails where base < 3, slides < 1, or the graph has more than kMaxArcs arcs.
  static Result<BcslGraph> create(int base, int slides);

  int base() const { return base_; }
  int slides() const { return slides_; }
  int vertices() const { return vertices_; }
  int degree() const { return degree_; }
  int arcs() const { return vertices_ * degree_; }

  /// Digit of `vertex` (0..vertices()-1) on slide 0..slides()-1.
  int digit(int vertex, int slide) const;

  /// Vertex of `slides()` digits (each 0..base()-1), slide 1's first.
  int vertex(std::span<const int> digits) const;

  /// Neighbour d(j) of Table 1, j in 0..degree()-1: each digit of `vertex` plus 1 plus the matching
  /// base-(b-1) digit of j, modulo b.
  int neighbour(int vertex, int j) const;

  /// The j with neighbour(from, j) == to, or -1 where the two share a colour on some slide. O(slides).
  int neighbour_index(int from, int to) const;

  /// Every arc once: arcs() + 1 vertices, from vertex 0 back to it; always the same path, the one of Table 1.
  std::vector<int> eulerian_path() const;

  /// As eulerian_path(), over some arcs alone and in another order: nth(v, k) is the vertex that is tried
  /// k-th from v, k in 0..degree()-1, or -1: that arc is left out. Each vertex must keep as many arcs in as
  /// out; those that cannot be reached from vertex 0 are missing in the path.
  std::vector<int> eulerian_path(const std::function<int(int, int)>& nth) const;

 private:
  BcslGraph(int base, int slides, int vertices, int degree)
      : base_(base), slides_(slides), vertices_(vertices), degree_(degree) {}

  int base_, slides_, vertices_, degree_;
};

/// Colours of base b as projected, all of them neither black nor white: the first `base` of red, green, blue,
/// cyan, magenta, yellow. Empty where base is over 6: no more primaries can be told from their complements.
std::vector<Primary> default_palette(int base);

/// Which of a graph's many Eulerian paths.
enum class CodePath {
  kClear,  // whose boundaries are seen best (capture/pattern/clear_path.h)
  kPaper,  // that of Table 1
};
/// "clear" or "paper".
std::optional<CodePath> code_path_named(std::string_view name);

/// `stripes` stripes of such a path of the (base, slides) graph from stripe `first_stripe` on, in the default
/// palette. Fails where the graph or the palette does not exist or the path is too short.
Result<Pattern> make_pattern(int base, int slides, int first_stripe, int stripes,
                             CodePath which = CodePath::kClear);

/// Section 3.2, Table 1: the position of each boundary code of one pattern. 4 bytes an arc of the graph.
class DecodingTable {
 public:
  /// Fails as BcslGraph::create, and where a stripe is no vertex, shares a colour with its neighbour or a
  /// boundary code repeats.
  static Result<DecodingTable> create(const Pattern& pattern);

  const BcslGraph& graph() const { return graph_; }

  /// Boundary (0..pattern.boundaries()-1) between stripes of these vertices, or -1 where the pattern has
  /// none. Constant time.
  int boundary(int vertex_left, int vertex_right) const {
    const int j = graph_.neighbour_index(vertex_left, vertex_right);
    return j < 0 ? -1 : entry(vertex_left, j);
  }

  /// The same from the projected colours on each side, slides() each, slide 1's first; -1 also where a colour
  /// is not in the palette. Constant time, no division: for inner loops.
  int boundary_of_colours(std::span<const Primary> left, std::span<const Primary> right) const {
    int vertex = 0, j = 0;
    const int base = graph_.base();
    for (int s = 0; s < graph_.slides(); ++s) {
      const auto i = static_cast<std::size_t>(s);
      const int l = digit_of_[left[i] & 7u], r = digit_of_[right[i] & 7u];
      if (l < 0 || r < 0 || l == r) return -1;
      vertex = vertex * base + l;
      j = j * (base - 1) + (r > l ? r - l : r - l + base) - 1;
    }
    return entry(vertex, j);
  }

  /// Table 1's entry of row V(vertex) and column d(j), or -1.
  int entry(int vertex, int j) const {
    return boundary_[static_cast<std::size_t>(vertex) * static_cast<std::size_t>(graph_.degree()) +
                     static_cast<std::size_t>(j)];
  }

 private:
  explicit DecodingTable(const BcslGraph& graph);

  BcslGraph graph_;
  std::array<int, 8> digit_of_{};  // palette digit of each primary, or -1
  std::vector<int> boundary_;
};

}  // namespace relievo
