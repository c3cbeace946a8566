// SPDX-License-Identifier: Apache-2.0
#include "codec/draco_grid.h"

#include <algorithm>
#include <array>
#include <cstdlib>
#include <string>
#include <vector>

#include "codec/byte_io.h"
#include "codec/draco_numbers.h"
#include "codec/draco_stream.h"
#include "codec/grid_fit.h"
#include "codec/grid_head.h"
#include "codec/grid_symbols.h"

namespace relievo {
namespace {

using namespace grid;

using Numbers = std::vector<std::int32_t>;
constexpr std::int32_t kAbsent = StripeGrid::kAbsent;
constexpr std::uint64_t kMostChangesPerVertex = 4;  // its place, the one below, two cells
const Error kDamaged{"grid is damaged"};

/// What encoder and decoder expect of each vertex, line by line, from those before it.
class Expectation {
 public:
  Expectation(const StripeGrid& grid, const GridModel& model)
      : grid_(grid),
        model_(model),
        predicted_(static_cast<std::size_t>(grid.stride())),
        absent_(predicted_.size(), kAbsent) {}

  void start(int line) {
    here_ = grid_.columns.data() + grid_.at(line, 0);
    up1_ = row(line - 1);
    grid_kernels().predict({up1_, row(line - 2), row(line - 3), row(line - 4), nullptr, nullptr}, model_,
                           grid_.boundaries, predicted_.data() + StripeGrid::kMargin);
    last_ = {};
    sigma_ = kFirstSigma;
    codes_ = grid_.sigmas.empty() ? nullptr : grid_.sigmas.data() + grid_.at(line, 0);
  }
  std::int32_t column(int b) const {
    return up1_[b] != kAbsent ? predicted_[static_cast<std::size_t>(b + StripeGrid::kMargin)]
                              : expected_alone(here_, up1_, nullptr, b, last_, model_.spacing);
  }
  std::int32_t sigma(int b) const { return up1_[b] != kAbsent ? codes_[b - grid_.stride()] : sigma_; }
  /// Once column and sigma at `b` are those of the vertex.
  void done(int b) {
    last_ = {here_[b], b};
    if (codes_ != nullptr) sigma_ = codes_[b];
  }

 private:
  const std::int32_t* row(int line) const {
    return line < 0 ? absent_.data() + StripeGrid::kMargin : grid_.columns.data() + grid_.at(line, 0);
  }

  const StripeGrid& grid_;
  const GridModel& model_;
  Numbers predicted_, absent_;
  const std::int32_t *here_ = nullptr, *up1_ = nullptr;
  const std::uint8_t* codes_ = nullptr;
  Last last_;
  std::int32_t sigma_ = kFirstSigma;
};

/// The lists of one cloud, a number a vertex: columns and, where the grid has them, sigmas and marks.
struct VertexLists {
  std::array<Numbers, 3> all;
  std::size_t count;
  Numbers& columns = all[0];
  Numbers* sigmas;  // null: the grid has none
  Numbers* marks;

  VertexLists(bool has_sigmas, bool has_marks)
      : count(1U + (has_sigmas ? 1U : 0U) + (has_marks ? 1U : 0U)),
        sigmas(has_sigmas ? &all[1] : nullptr),
        marks(has_marks ? &all[count - 1] : nullptr) {}
  VertexLists(const VertexLists&) = delete;
  VertexLists& operator=(const VertexLists&) = delete;
  std::span<Numbers> lists() { return std::span(all).first(count); }
};

template <typename Vertex>
void for_vertices(const StripeGrid& grid, int line, const std::vector<std::uint8_t>& there,
                  const Vertex& vertex) {
  for (int b = 0; b < grid.boundaries; ++b)
    if (there[grid.at(line, b)] != 0) vertex(b);
}

void list_vertices(StripeGrid& grid, const GridModel& model, const std::vector<std::uint8_t>& there,
                   std::span<const std::uint8_t> tolerance, VertexLists& out) {
  Expectation expected(grid, model);
  std::uint8_t mark = 0;
  for (int line = 0; line < grid.lines; ++line) {
    expected.start(line);
    for_vertices(grid, line, there, [&](int b) {
      const std::size_t at = grid.at(line, b);
      std::int32_t residual = grid.columns[at] - expected.column(b);
      if (!tolerance.empty() && std::abs(residual) <= tolerance[at]) {
        grid.columns[at] -= residual;
        residual = 0;
      }
      out.columns.push_back(residual);
      if (out.sigmas != nullptr) out.sigmas->push_back(grid.sigmas[at] - expected.sigma(b));
      if (out.marks != nullptr) {
        out.marks->push_back(unzigzag(grid.interpolated[at] ^ mark));
        mark = grid.interpolated[at];
      }
      expected.done(b);
    });
  }
}

bool place_vertices(VertexLists& in, const GridModel& model, const std::vector<std::uint8_t>& there,
                    StripeGrid& grid) {
  Expectation expected(grid, model);
  const std::int64_t most = std::int64_t{kMostPixels} << grid.step_bits;
  std::uint32_t mark = 0;
  std::size_t n = 0;
  bool fair = true;
  for (int line = 0; line < grid.lines && fair; ++line) {
    expected.start(line);
    for_vertices(grid, line, there, [&](int b) {
      const std::size_t at = grid.at(line, b);
      const std::int64_t column = std::int64_t{expected.column(b)} + in.columns[n];
      std::int64_t sigma = 0;
      if (in.sigmas != nullptr) sigma = std::int64_t{expected.sigma(b)} + (*in.sigmas)[n];
      if (in.marks != nullptr) mark ^= zigzag((*in.marks)[n]);
      ++n;
      fair = fair && column >= -most && column <= most && sigma >= 0 && sigma <= kMostSigma && mark <= 1;
      if (!fair) return;
      grid.columns[at] = static_cast<std::int32_t>(column);
      if (in.sigmas != nullptr) grid.sigmas[at] = static_cast<std::uint8_t>(sigma);
      if (in.marks != nullptr) grid.interpolated[at] = static_cast<std::uint8_t>(mark);
      expected.done(b);
    });
  }
  return fair;
}

/// The lists of the other cloud: of the places that are not as expected, how many before are, and what it is.
struct PlaceLists {
  std::array<Numbers, 2> all;
  Numbers& runs = all[0];
  Numbers& changes = all[1];
};

/// Changes of a place: whether it is there if not the one above is; twice what the cell below it holds.
constexpr std::uint32_t kOtherThanAbove = 1;

/// Fills the counts of `grid` too.
void list_places(StripeGrid& grid, const std::vector<std::uint8_t>& there, PlaceLists& out) {
  const auto stride = static_cast<std::size_t>(grid.stride());
  grid.vertices = grid.triangles = 0;
  std::uint32_t run = 0;
  for (int line = 0; line < grid.lines; ++line) {
    for (int b = 0; b < grid.boundaries; ++b) {
      const std::size_t at = grid.at(line, b);
      std::uint32_t change = there[at] ^ (line > 0 ? there[at - stride] : 0U);
      grid.vertices += there[at];
      const unsigned around = line + 1 < grid.lines && b + 1 < grid.boundaries
                                  ? corners_there(there.data() + at, there.data() + at + stride, 0)
                                  : 0;
      const int corners = kCornerCounts[around];
      if (corners >= 3) {
        const int symbol = cell_symbol(grid.cells[at], corners);
        grid.triangles += triangles_of(symbol, corners);
        change |= static_cast<std::uint32_t>(symbol) << 1;
      }
      if (change == 0) {
        ++run;
        continue;
      }
      out.runs.push_back(unzigzag(run));
      out.changes.push_back(unzigzag(change));
      run = 0;
    }
  }
}

/// What changes at each place, by StripeGrid::at(). Empty: damaged.
std::vector<std::uint8_t> spread_changes(const PlaceLists& in, const StripeGrid& grid) {
  std::vector<std::uint8_t> changes(grid.columns.size(), 0);
  const auto boundaries = static_cast<std::uint64_t>(grid.boundaries);
  const std::uint64_t places = boundaries * static_cast<std::uint64_t>(grid.lines);
  std::uint64_t place = 0;
  for (std::size_t i = 0; i < in.runs.size(); ++i, ++place) {
    place += zigzag(in.runs[i]);
    const std::uint32_t change = zigzag(in.changes[i]);
    if (place >= places || change == 0 || change >= 2 * kCellSymbols) return {};
    changes[grid.at(static_cast<int>(place / boundaries), static_cast<int>(place % boundaries))] =
        static_cast<std::uint8_t>(change);
  }
  return changes;
}

/// Which places hold a vertex; counts them.
std::vector<std::uint8_t> find_places(const std::vector<std::uint8_t>& changes, StripeGrid& grid) {
  std::vector<std::uint8_t> there(changes.size(), 0);
  const auto stride = static_cast<std::size_t>(grid.stride());
  for (int line = 0; line < grid.lines; ++line) {
    const std::size_t begin = grid.at(line, 0);
    for (std::size_t at = begin; at < begin + static_cast<std::size_t>(grid.boundaries); ++at) {
      const std::uint32_t above = line > 0 ? there[at - stride] : 0U;
      there[at] = static_cast<std::uint8_t>(above ^ (changes[at] & kOtherThanAbove));
      grid.vertices += there[at];
    }
  }
  return there;
}

/// Fills the cells and counts their triangles. False: damaged.
bool fill_cells(const std::vector<std::uint8_t>& changes, const std::vector<std::uint8_t>& there,
                StripeGrid& grid) {
  const auto stride = static_cast<std::size_t>(grid.stride());
  for (int line = 0; line < grid.lines; ++line) {
    for (int b = 0; b < grid.boundaries; ++b) {
      const std::size_t at = grid.at(line, b);
      const int symbol = changes[at] >> 1;
      const unsigned around = line + 1 < grid.lines && b + 1 < grid.boundaries
                                  ? corners_there(there.data() + at, there.data() + at + stride, 0)
                                  : 0;
      const int corners = kCornerCounts[around];
      if (symbol > (corners == 4 ? kCellSymbols - 1 : corners == 3 ? 1 : 0)) return false;
      if (corners < 3) continue;
      grid.triangles += triangles_of(symbol, corners);
      grid.cells[at] = cell_of(symbol, corners, missing_of(around));
    }
  }
  return true;
}

std::uint64_t places_of(int boundaries, int lines) {
  return static_cast<std::uint64_t>(boundaries) * static_cast<std::uint64_t>(lines);
}

/// The parts of a coded grid.
struct Layout {
  GridHead head;
  std::span<const std::uint8_t> vertices, places;  // Draco streams
};

void write_tail(const GridHead& head, std::size_t vertex_bytes, std::size_t place_bytes, Bytes& out) {
  const std::size_t begin = out.size();
  write_grid_fields(head, out);
  append(out, static_cast<std::uint32_t>(vertex_bytes));
  append(out, static_cast<std::uint32_t>(place_bytes));
  append(out, static_cast<std::uint16_t>(out.size() - begin + sizeof(std::uint16_t)));
}

Result<Layout> read_layout(std::span<const std::uint8_t> coded) {
  const Error cut{"grid is cut short"};
  if (coded.size() < sizeof(std::uint16_t)) return cut;
  const auto tail_bytes = ByteReader(coded.last(sizeof(std::uint16_t))).read<std::uint16_t>();
  if (tail_bytes > coded.size()) return cut;
  ByteReader tail(coded.last(tail_bytes));
  ByteReader in(coded.first(coded.size() - tail_bytes));
  Layout layout;
  GridHead& head = layout.head;
  if (auto status = read_grid_fields(tail, head); !status) return status.error();
  if (!head.is_key || head.slice_lines != head.lines || head.model.key != 0 || head.model.key_change != 0)
    return Error{"grid is of a kind that the format does not allow in Draco"};
  layout.vertices = in.take(tail.read<std::uint32_t>());
  layout.places = in.take(tail.read<std::uint32_t>());
  if (!tail.ok() || tail.remaining() != sizeof(std::uint16_t) || !in.ok()) return cut;
  const auto padding = in.take(in.remaining());
  if (std::ranges::any_of(padding, [](std::uint8_t b) { return b != 0; }))
    return Error{"grid has bytes between its parts"};
  const std::uint64_t places = places_of(head.boundaries, head.lines);
  if (places > kMostGridPlaces || places > kMostPlacesPerByte * coded.size())
    return Error{"grid has more places than its bytes can tell of"};
  return layout;
}

}  // namespace

Result<Bytes> encode_draco_grid(StripeGrid& grid, const GridCalibration& calibration,
                                std::span<const std::uint8_t> tolerance, float step_mm) {
  GridHead head;
  head.is_key = true;
  head.has_sigmas = !grid.sigmas.empty();
  head.has_interpolated = !grid.interpolated.empty();
  head.step_bits = grid.step_bits;
  head.boundaries = grid.boundaries;
  head.lines = head.slice_lines = grid.lines;
  head.twice = grid.twice;
  head.model = fit_model(grid, nullptr);
  head.step_mm = step_mm;
  head.calibration = calibration;

  std::vector<std::uint8_t> there(grid.columns.size());
  std::ranges::transform(grid.columns, there.begin(), [](std::int32_t c) { return c != kAbsent ? 1 : 0; });
  PlaceLists places;
  list_places(grid, there, places);
  VertexLists vertices(head.has_sigmas, head.has_interpolated);
  list_vertices(grid, head.model, there, tolerance, vertices);
  auto coded = encode_numbers(vertices.lists());
  if (!coded) return coded.error();
  const auto coded_places = encode_numbers(places.all);
  if (!coded_places) return coded_places.error();

  Bytes out = *std::move(coded);
  const std::size_t vertex_bytes = out.size();
  append_bytes(out, *coded_places);
  Bytes tail;
  write_tail(head, vertex_bytes, coded_places->size(), tail);
  out.resize(std::max<std::size_t>(out.size() + tail.size(), least_grid_bytes(grid)) - tail.size());
  append_bytes(out, tail);
  return out;
}

Result<GridHead> decode_draco_grid(std::span<const std::uint8_t> coded, std::uint32_t vertices,
                                   std::uint32_t triangles, StripeGrid& out) {
  const auto layout = read_layout(coded);
  if (!layout) return layout.error();
  const GridHead& head = layout->head;
  const auto changes_declared = allowed_draco_counts(layout->places);
  if (!changes_declared) return changes_declared.error();
  if (changes_declared->vertices > kMostChangesPerVertex * vertices) return kDamaged;
  PlaceLists places;
  if (auto status = decode_numbers(layout->places, changes_declared->vertices, places.all); !status)
    return status.error();

  out.reset(head.boundaries, head.lines, head.step_bits, head.twice);
  const std::vector<std::uint8_t> changes = spread_changes(places, out);
  if (changes.empty()) return kDamaged;
  const std::vector<std::uint8_t> there = find_places(changes, out);
  if (!fill_cells(changes, there, out) || joins_halves(out)) return kDamaged;
  if (out.vertices != vertices || out.triangles != triangles)
    return Error{"grid holds " + std::to_string(out.vertices) + " vertices and " +
                 std::to_string(out.triangles) + " triangles, but the frame declares " +
                 std::to_string(vertices) + " and " + std::to_string(triangles)};
  VertexLists lists(head.has_sigmas, head.has_interpolated);
  if (auto status = decode_numbers(layout->vertices, vertices, lists.lists()); !status) return status.error();
  if (head.has_sigmas) out.sigmas.assign(out.columns.size(), 0);
  if (head.has_interpolated) out.interpolated.assign(out.columns.size(), 0);
  if (!place_vertices(lists, head.model, there, out)) return kDamaged;
  choose_diagonals(out, head.model.spacing);
  return head;
}

}  // namespace relievo
