// SPDX-License-Identifier: Apache-2.0
#include "capture/pattern/bcsl.h"

#include <algorithm>
#include <cassert>
#include <string>

#include "capture/pattern/clear_path.h"

namespace relievo {
namespace {

std::string name_of(int base, int slides) {
  return "(" + std::to_string(base) + "," + std::to_string(slides) + ")-BCSL";
}

/// A vertex as its digits, as the paper writes it: 20, or 10.3 where digits have two places.
std::string digits_of(const BcslGraph& graph, int vertex) {
  std::string out;
  for (int s = 0; s < graph.slides(); ++s) {
    if (s > 0 && graph.base() > 10) out += '.';
    out += std::to_string(graph.digit(vertex, s));
  }
  return out;
}

}  // namespace

Result<BcslGraph> BcslGraph::create(int base, int slides) {
  if (base < 3) {
    return Error{"a boundary code needs at least 3 colours, not " + std::to_string(base) +
                 ": with fewer its graph is not connected"};
  }
  if (slides < 1) return Error{"a boundary code needs at least 1 slide, not " + std::to_string(slides)};
  long long vertices = 1, degree = 1;
  for (int s = 0; s < slides; ++s) {
    vertices *= base;
    degree *= base - 1;
    // Each factor alone first: their product could overflow.
    if (vertices > kMaxArcs || degree > kMaxArcs || vertices * degree > kMaxArcs) {
      return Error{"a " + name_of(base, slides) + " has more than " + std::to_string(kMaxArcs) +
                   " boundary codes, too many to hold: use fewer colours or slides"};
    }
  }
  return BcslGraph(base, slides, static_cast<int>(vertices), static_cast<int>(degree));
}

int BcslGraph::digit(int vertex, int slide) const {
  assert(vertex >= 0 && vertex < vertices_ && slide >= 0 && slide < slides_);
  for (int s = slides_ - 1; s > slide; --s) vertex /= base_;
  return vertex % base_;
}

int BcslGraph::vertex(std::span<const int> digits) const {
  assert(static_cast<int>(digits.size()) == slides_);
  int value = 0;
  for (const int digit : digits) {
    assert(digit >= 0 && digit < base_);
    value = value * base_ + digit;
  }
  return value;
}

int BcslGraph::neighbour(int vertex, int j) const {
  assert(vertex >= 0 && vertex < vertices_ && j >= 0 && j < degree_);
  int result = 0;
  for (int s = 0, place = 1; s < slides_; ++s, place *= base_) {
    result += place * ((vertex % base_ + 1 + j % (base_ - 1)) % base_);
    vertex /= base_;
    j /= base_ - 1;
  }
  return result;
}

int BcslGraph::neighbour_index(int from, int to) const {
  assert(from >= 0 && from < vertices_ && to >= 0 && to < vertices_);
  int j = 0;
  for (int s = 0, place = 1; s < slides_; ++s, place *= base_ - 1) {
    const int step = (to % base_ - from % base_ + base_) % base_;
    if (step == 0) return -1;
    j += place * (step - 1);
    from /= base_;
    to /= base_;
  }
  return j;
}

std::vector<int> BcslGraph::eulerian_path() const {
  return eulerian_path([this](int vertex, int j) { return neighbour(vertex, j); });
}

// Hierholzer's algorithm with an explicit stack: walk unused arcs until stuck, then back out, which closes
// the tour from its end. As every vertex has as many arcs in as out, the first place to be stuck is vertex 0.
std::vector<int> BcslGraph::eulerian_path(const std::function<int(int, int)>& nth) const {
  std::vector<int> next(static_cast<std::size_t>(vertices_), 0);  // first untried arc of each vertex
  std::vector<int> walk{0}, path;
  while (!walk.empty()) {
    const int at = walk.back();
    int& j = next[static_cast<std::size_t>(at)];
    if (j < degree_) {
      if (const int to = nth(at, j++); to >= 0) walk.push_back(to);
    } else {
      path.push_back(at);
      walk.pop_back();
    }
  }
  std::reverse(path.begin(), path.end());
  return path;
}

std::vector<Primary> default_palette(int base) {
  static constexpr std::array<Primary, 6> kPrimaries = {0b001, 0b010, 0b100, 0b110, 0b101, 0b011};
  if (base < 0 || base > static_cast<int>(kPrimaries.size())) return {};
  return {kPrimaries.begin(), kPrimaries.begin() + base};
}

std::optional<CodePath> code_path_named(std::string_view name) {
  if (name == "clear") return CodePath::kClear;
  if (name == "paper") return CodePath::kPaper;
  return std::nullopt;
}

Result<Pattern> make_pattern(int base, int slides, int first_stripe, int stripes, CodePath which) {
  const Result<BcslGraph> graph = BcslGraph::create(base, slides);
  if (!graph) return graph.error();
  std::vector<Primary> palette = default_palette(base);
  if (palette.empty()) {
    return Error{"no palette of " + std::to_string(base) +
                 " colours: only the 6 primaries that are neither black nor white can be told from their "
                 "complements, so use a base of 3 to 6"};
  }
  if (stripes < 2) return Error{"a pattern needs at least 2 stripes, not " + std::to_string(stripes)};
  const int available = graph->arcs() + 1;
  if (first_stripe < 0 || first_stripe >= available || stripes > available - first_stripe) {
    return Error{std::to_string(stripes) + " stripes from stripe " + std::to_string(first_stripe) +
                 " do not fit a " + name_of(base, slides) + ", whose path has stripes 0 to " +
                 std::to_string(available - 1)};
  }
  const std::vector<int> path = which == CodePath::kPaper
                                    ? graph->eulerian_path()
                                    : clear_path(*graph, palette, first_stripe + stripes);
  const auto begin = path.begin() + first_stripe;
  return Pattern{base, slides, std::move(palette), std::vector<int>(begin, begin + stripes)};
}

DecodingTable::DecodingTable(const BcslGraph& graph)
    : graph_(graph), boundary_(static_cast<std::size_t>(graph.arcs()), -1) {
  digit_of_.fill(-1);
}

Result<DecodingTable> DecodingTable::create(const Pattern& pattern) {
  const Result<BcslGraph> graph = BcslGraph::create(pattern.base, pattern.slides);
  if (!graph) return graph.error();
  DecodingTable table(*graph);
  for (std::size_t d = 0; d < pattern.palette.size(); ++d) {
    table.digit_of_[pattern.palette[d] & 7u] = static_cast<int>(d);
  }
  for (int i = 0; i < pattern.stripes(); ++i) {
    const int vertex = pattern.sequence[static_cast<std::size_t>(i)];
    if (vertex < 0 || vertex >= graph->vertices()) {
      return Error{"stripe " + std::to_string(i) + " is " + std::to_string(vertex) + ", not one of the " +
                   std::to_string(graph->vertices()) + " colour combinations of a " +
                   name_of(pattern.base, pattern.slides)};
    }
  }
  for (int i = 0; i < pattern.boundaries(); ++i) {
    const int left = pattern.sequence[static_cast<std::size_t>(i)];
    const int right = pattern.sequence[static_cast<std::size_t>(i) + 1];
    const std::string code = digits_of(*graph, left) + "|" + digits_of(*graph, right);
    const int j = graph->neighbour_index(left, right);
    if (j < 0) {
      return Error{"boundary " + std::to_string(i) + " (" + code + ") keeps its colour on a slide"};
    }
    int& entry = table.boundary_[static_cast<std::size_t>(left) * static_cast<std::size_t>(graph->degree()) +
                                 static_cast<std::size_t>(j)];
    if (entry >= 0) {
      return Error{"boundary " + std::to_string(i) + " repeats the code " + code + " of boundary " +
                   std::to_string(entry)};
    }
    entry = i;
  }
  return table;
}

}  // namespace relievo
