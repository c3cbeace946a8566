// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <array>
#include <bit>
#include <cstdlib>
#include <cstring>
#include <string>

#include "codec/grid_coder.h"
#include "codec/grid_head.h"
#include "codec/grid_symbols.h"

namespace relievo {
namespace {

using namespace grid;

const Error kDamaged{"grid is damaged"};

struct Tables {
  std::array<std::uint16_t, kControlTables> first{};  // frequency of the first of two symbols
  std::array<rans::DecoderTable, kCellTables> cells;
  std::array<rans::DecoderTable, kResidualTables> residuals;
  std::array<rans::DecoderTable, kSigmaTables> sigmas;
};

template <std::size_t N>
void read_tables(rans::BitReader& bits, std::array<rans::DecoderTable, N>& tables) {
  for (rans::DecoderTable& table : tables) table.set(rans::read_levels(bits));
}

bool read_tables(std::span<const std::uint8_t> bytes, bool has_sigmas, Tables& out) {
  rans::BitReader bits(bytes);
  for (int t = 0; t < kControlTables; ++t) {
    if (t >= kCellTable && t < kCellTable + kCellTables) {
      out.cells[static_cast<std::size_t>(t - kCellTable)].set(rans::read_levels(bits));
    } else {
      out.first[static_cast<std::size_t>(t)] = rans::first_frequency(rans::read_binary_level(bits));
    }
  }
  read_tables(bits, out.residuals);
  if (has_sigmas) read_tables(bits, out.sigmas);
  return bits.ok() && bits.position() == bytes.size();
}

/// A slice's own head.
struct SliceHead {
  std::uint32_t vertices = 0, triangles = 0;
  std::span<const std::uint8_t> control, residuals, sigmas, raw;
};

bool get_varint(std::span<const std::uint8_t>& in, std::uint32_t& value) {
  std::uint64_t v = 0;
  for (int shift = 0; shift < 35; shift += 7) {
    if (in.empty()) return false;
    const std::uint8_t byte = in.front();
    in = in.subspan(1);
    v |= static_cast<std::uint64_t>(byte & 0x7f) << shift;
    if (byte < 0x80) {
      value = static_cast<std::uint32_t>(v);
      return v <= 0xffffffffU;
    }
  }
  return false;
}

bool read_slice_head(std::span<const std::uint8_t> in, SliceHead& out) {
  std::array<std::uint32_t, 5> n{};
  for (std::uint32_t& value : n)
    if (!get_varint(in, value)) return false;
  out.vertices = n[0];
  out.triangles = n[1];
  for (auto [size, stream] : {std::pair{n[2], &out.control}, {n[3], &out.residuals}, {n[4], &out.sigmas}}) {
    if (size > in.size()) return false;
    *stream = in.first(size);
    in = in.subspan(size);
  }
  out.raw = in;
  return true;
}

}  // namespace

/// A slice on its way to lines of the grid.
struct GridDecoder::Scratch {
  std::vector<std::uint8_t> there, key_there, good[2], sizes, contexts, kinds, tables, symbols, placed;
  std::vector<std::int32_t> expected, absent;
  std::vector<int> places;
  std::uint32_t vertices = 0, triangles = 0;
  bool ok = false;

  struct Input {
    const GridHead& head;
    const Tables& tables;
    const StripeGrid* key;
    StripeGrid& grid;
  };
  /// Lines [begin, end). False where the slice is damaged.
  bool decode(const Input& in, int begin, int end, const SliceHead& slice);

 private:
  void read_places(const Input& in, int line, const std::uint8_t* above, std::uint8_t* here,
                   rans::Decoder& control);
  bool read_cells(const Input& in, int line, const std::uint8_t* above, rans::Decoder& control);
  bool read_marks(const Input& in, int line, bool first, const std::uint8_t* here, rans::Decoder& control);
  bool read_columns(const Input& in, int line, int begin, const std::uint8_t* here, rans::Decoder& residuals,
                    rans::BitReader& raw);
  bool read_sigmas(const Input& in, int line, int begin, rans::Decoder& sigmas, rans::BitReader& raw);
  const std::int32_t* row(const StripeGrid& grid, int line, int begin) const {
    return line < begin ? absent.data() + StripeGrid::kMargin : grid.columns.data() + grid.at(line, 0);
  }
};

void GridDecoder::Scratch::read_places(const Input& in, int line, const std::uint8_t* above,
                                       std::uint8_t* here, rans::Decoder& shared) {
  rans::Decoder control = shared;
  const std::uint8_t* key = nullptr;
  const int boundaries = in.grid.boundaries;
  if (in.key != nullptr) {
    std::uint8_t* there_in_key = key_there.data() + StripeGrid::kMargin;
    grid_kernels().there(in.key->columns.data() + in.key->at(line, 0), boundaries, there_in_key);
    key = there_in_key;
  }
  for (int b = 0; b < boundaries; b += 8) {
    const int last = std::min(b + 8, boundaries);
    const int uniform = last - b == 8 ? uniform_places(here, above, key, b) : -1;
    if (uniform >= 0) {
      if (!control.one(in.tables.first[static_cast<std::size_t>(kBlockTable + uniform)])) {
        std::fill_n(here + b, 8, static_cast<std::uint8_t>(uniform));
        continue;
      }
    }
    std::uint64_t around = place_contexts_around(above, key, b);
    std::uint64_t eight = 0, left = here[b - 1];
    for (int i = 0; i < last - b; ++i, around >>= 8) {
      left = control.one(in.tables.first[around % 256 | left]) ? 1 : 0;
      eight |= left << 8 * i;
    }
    std::memcpy(here + b, &eight, sizeof eight);
  }
  shared = control;
}

bool GridDecoder::Scratch::read_cells(const Input& in, int line, const std::uint8_t* above,
                                      rans::Decoder& shared) {
  rans::Decoder control = shared;
  const std::uint8_t* below = above + in.grid.stride();
  std::uint8_t* cells = in.grid.cells.data() + in.grid.at(line, 0);
  const std::uint8_t* good_above = good[0].data() + StripeGrid::kMargin;
  std::uint8_t* good_here = good[1].data() + StripeGrid::kMargin;
  good_here[-1] = 1;
  const int count = in.grid.boundaries - 1;
  for (int b = 0; b < count; b += 8) {
    const int last = std::min(b + 8, count);
    if (last - b == 8 && uniform_cells(good_here, good_above, above, below, b)) {
      if (!control.one(in.tables.first[kCellBlockTable])) {
        std::fill_n(cells + b, 8, kBoth);
        std::fill_n(good_here + b, 8, std::uint8_t{1});
        triangles += 16;
        continue;
      }
    }
    std::uint8_t left = good_here[b - 1];
    for (int i = b; i < last; ++i) {
      const unsigned there_here = corners_there(above, below, i);
      const int corners = kCornerCounts[there_here];
      if (corners < 3) {
        good_here[i] = left = 0;
        continue;
      }
      const rans::DecoderTable& table =
          in.tables.cells[static_cast<std::size_t>((corners == 4 ? 4 : 0) + 2 * left + good_above[i])];
      if (!table.usable) return false;
      const int symbol = control.one(table);
      if (symbol >= kCellSymbols || (corners == 3 && symbol > 1)) return false;
      good_here[i] = left = symbol == 0;
      triangles += triangles_of(symbol, corners);
      cells[i] = cell_of(symbol, corners, missing_of(there_here));
    }
  }
  std::swap(good[0], good[1]);
  shared = control;
  return true;
}

bool GridDecoder::Scratch::read_marks(const Input& in, int line, bool first, const std::uint8_t* here,
                                      rans::Decoder& control) {
  std::uint8_t* marks = in.grid.interpolated.data() + in.grid.at(line, 0);
  const std::uint8_t* above = first ? nullptr : marks - in.grid.stride();
  for (int b = 0; b < in.grid.boundaries; ++b) {
    if (here[b] == 0) continue;
    const int table = kMarkTable + (above != nullptr ? above[b] << 1 : 0) + marks[b - 1];
    marks[b] = control.one(in.tables.first[static_cast<std::size_t>(table)]);
  }
  return true;
}

bool GridDecoder::Scratch::read_columns(const Input& in, int line, int begin, const std::uint8_t* here,
                                        rans::Decoder& residuals, rans::BitReader& raw) {
  const GridModel& model = in.head.model;
  const GridRows rows{.up1 = row(in.grid, line - 1, begin),
                      .up2 = row(in.grid, line - 2, begin),
                      .up3 = row(in.grid, line - 3, begin),
                      .up4 = row(in.grid, line - 4, begin),
                      .key = in.key != nullptr ? in.key->columns.data() + in.key->at(line, 0) : nullptr,
                      .key_up = in.key != nullptr ? row(*in.key, line - 1, begin) : nullptr};
  const int boundaries = in.grid.boundaries;
  std::int32_t* columns = in.grid.columns.data() + in.grid.at(line, 0);
  std::int32_t* predicted = expected.data() + StripeGrid::kMargin;
  std::uint8_t* size = sizes.data() + StripeGrid::kMargin;
  const GridKernels& kernels = grid_kernels();
  kernels.predict(rows, model, boundaries, predicted);
  kernels.contexts(size, rows.up1, boundaries, contexts.data());
  // The tables of the residuals of those that are there.
  std::size_t count = 0;
  for (int b = 0; b < boundaries; b += 8) {
    if (load8(here + b) == kOnes) {
      std::memcpy(tables.data() + count, contexts.data() + b, 8);
      count += 8;
      continue;
    }
    for (int i = b; i < b + 8; ++i) {  // behind the last boundary there are no vertices
      tables[count] = contexts[static_cast<std::size_t>(i)];
      count += here[i];
    }
  }
  residuals.row(in.tables.residuals, tables.data(), count, symbols.data());
  // Back to their places.
  std::size_t next = 0;
  for (int b = 0; b < boundaries; b += 8) {
    if (load8(here + b) == kOnes) {
      std::memcpy(placed.data() + b, symbols.data() + next, 8);
      next += 8;
      continue;
    }
    for (int i = b; i < b + 8; ++i) {
      placed[static_cast<std::size_t>(i)] = symbols[next];
      next += here[i];
    }
  }
  const std::int32_t most = kMostPixels << in.grid.step_bits;
  if (!kernels.columns({.there = here,
                        .symbols = placed.data(),
                        .tables = contexts.data(),
                        .expected = predicted,
                        .columns = columns,
                        .sizes = size,
                        .kinds = kinds.data()},
                       most, boundaries))
    return false;
  // Those that the kernel leaves, one after the other.
  for (int b = 0; b < boundaries; b += 8) {
    if ((load8(kinds.data() + b) & kByItself * kOnes) == 0) continue;
    for (int i = b; i < b + 8; ++i) {
      const auto at = static_cast<std::size_t>(i);
      if (kinds[at] != kByItself) continue;
      if (placed[at] >= rans::kMostSymbols) return false;  // of a table that is not there
      const std::int32_t d = unzigzag(number_of(placed[at], raw));
      const std::int32_t p =
          contexts[at] == kAloneTable
              ? expected_alone(columns, rows.up1, rows.key, i, last_before(columns, i), model.spacing)
              : predicted[i];
      const std::int32_t column = p + d;
      if (column < -most || column > most) return false;
      columns[i] = column;
      size[i] = static_cast<std::uint8_t>(std::min(d < 0 ? -d : d, kLargestSize));
    }
  }
  vertices += static_cast<std::uint32_t>(count);
  return true;
}

bool GridDecoder::Scratch::read_sigmas(const Input& in, int line, int begin, rans::Decoder& sigmas,
                                       rans::BitReader& raw) {
  constexpr std::int32_t kAbsent = StripeGrid::kAbsent;
  const std::int32_t* here = row(in.grid, line, begin);
  const std::int32_t* above = row(in.grid, line - 1, begin);
  const std::int32_t* further = row(in.grid, line - 2, begin);
  std::uint8_t* codes = in.grid.sigmas.data() + in.grid.at(line, 0);
  const std::ptrdiff_t stride = in.grid.stride();
  std::size_t count = 0;
  for (int b = 0; b < in.grid.boundaries; ++b) {
    if (here[b] == kAbsent) continue;
    int table = kSigmaTables - 1;
    if (above[b] != kAbsent)
      table = further[b] != kAbsent
                  ? std::min(std::abs(codes[b - stride] - codes[b - 2 * stride]), kSigmaTables - 2)
                  : 0;
    if (!in.tables.sigmas[static_cast<std::size_t>(table)].usable) return false;
    places[count] = b;
    tables[count++] = static_cast<std::uint8_t>(table);
  }
  sigmas.row(in.tables.sigmas, tables.data(), count, symbols.data());
  int last = kFirstSigma;
  for (std::size_t i = 0; i < count; ++i) {
    const int b = places[i];
    const std::int32_t code =
        unzigzag(number_of(symbols[i], raw)) + (above[b] != kAbsent ? codes[b - stride] : last);
    if (code < 0 || code > kMostSigma) return false;
    codes[b] = static_cast<std::uint8_t>(code);
    last = code;
  }
  return true;
}

bool GridDecoder::Scratch::decode(const Input& in, int begin, int end, const SliceHead& slice) {
  StripeGrid& grid = in.grid;
  const auto stride = static_cast<std::size_t>(grid.stride());
  vertices = triangles = 0;
  // One line before the slice, where nothing is, and one behind it, where cells have corners.
  there.assign(static_cast<std::size_t>(end - begin + 2) * stride, 0);
  key_there.assign(stride, 0);
  for (auto& buffer : good) buffer.assign(stride, 1);
  sizes.assign(stride, kFirstSize);
  contexts.assign(stride, 0);
  kinds.assign(stride, 0);
  tables.resize(stride);
  symbols.assign(stride, 0);
  placed.assign(stride, 0);
  expected.assign(stride, 0);
  absent.assign(stride, StripeGrid::kAbsent);
  places.resize(stride);
  rans::Decoder control(slice.control, 1);
  rans::Decoder residuals(slice.residuals, rans::kLanes);
  rans::Decoder sigmas(slice.sigmas, rans::kLanes);
  rans::BitReader raw(slice.raw);
  const auto row_there = [&](int line) {
    return there.data() + static_cast<std::size_t>(line - begin + 1) * stride + StripeGrid::kMargin;
  };
  read_places(in, begin, row_there(begin - 1), row_there(begin), control);
  for (int line = begin; line < end; ++line) {
    const std::uint8_t* here = row_there(line);
    if (in.head.has_interpolated && !read_marks(in, line, line == begin, here, control)) return false;
    if (line + 1 < grid.lines) {
      read_places(in, line + 1, here, row_there(line + 1), control);
      if (!read_cells(in, line, here, control)) return false;
    }
    if (!read_columns(in, line, begin, here, residuals, raw)) return false;
    if (in.head.has_sigmas && !read_sigmas(in, line, begin, sigmas, raw)) return false;
    if (vertices > slice.vertices || triangles > slice.triangles) return false;
  }
  return vertices == slice.vertices && triangles == slice.triangles && control.finished() &&
         residuals.finished() && (!in.head.has_sigmas || sigmas.finished()) && raw.ok() &&
         raw.position() == slice.raw.size();
}

GridDecoder::GridDecoder() = default;
GridDecoder::~GridDecoder() = default;
GridDecoder::GridDecoder(GridDecoder&&) noexcept = default;
GridDecoder& GridDecoder::operator=(GridDecoder&&) noexcept = default;

namespace {

/// Triangles on vertices of a lost slice, which is below `line`.
std::uint32_t drop_cells(StripeGrid& grid, int line) {
  std::uint32_t dropped = 0;
  for (int b = 0; b < grid.boundaries; ++b) {
    std::uint8_t& cell = grid.cells[grid.at(line, b)];
    dropped += cell == kBoth ? 2U : static_cast<std::uint32_t>(std::popcount(cell));
    cell = 0;
  }
  return dropped;
}

}  // namespace

void choose_diagonals(StripeGrid& grid, std::int32_t spacing) {
  for (int line = 0; line + 1 < grid.lines; ++line) {
    const std::int32_t* above = grid.columns.data() + grid.at(line, 0);
    grid_kernels().diagonals(above, above + grid.stride(), spacing, grid.boundaries - 1,
                             grid.cells.data() + grid.at(line, 0));
  }
}

Result<GridHead> GridDecoder::decode(std::span<const std::uint8_t> coded, std::uint32_t vertices,
                                     std::uint32_t triangles, const GridKey* key, StripeGrid& out,
                                     WorkerPool* pool) {
  auto layout = read_grid_layout(coded);
  if (!layout) return layout.error();
  const GridHead& head = layout->head;
  if (!head.is_key && (key == nullptr || key->id != head.key))
    return Error{
        "grid builds on a key frame that was not received: the next key frame shows the surface again"};
  const StripeGrid* key_grid = head.is_key ? nullptr : &key->grid;
  if (key_grid != nullptr && (key_grid->boundaries != head.boundaries || key_grid->lines != head.lines ||
                              key_grid->twice != head.twice || key_grid->step_bits != head.step_bits))
    return Error{"grid is of another size than its key frame"};

  // What the slices hold, before memory is spent on them.
  std::vector<SliceHead> slices(layout->slices.size());
  std::uint64_t declared_vertices = 0;
  std::uint64_t declared_triangles = 0;
  bool lost = false;
  for (std::size_t s = 0; s < slices.size(); ++s) {
    if (layout->slices[s].empty()) {
      lost = true;
      continue;
    }
    if (!read_slice_head(layout->slices[s], slices[s])) return kDamaged;
    declared_vertices += slices[s].vertices;
    declared_triangles += slices[s].triangles;
  }
  if (declared_vertices > vertices || declared_triangles > triangles ||
      (!lost && (declared_vertices != vertices || declared_triangles != triangles)))
    return Error{"grid holds " + std::to_string(declared_vertices) + " vertices and " +
                 std::to_string(declared_triangles) + " triangles, but the frame declares " +
                 std::to_string(vertices) + " and " + std::to_string(triangles)};
  const auto places = static_cast<std::uint64_t>(head.boundaries) * static_cast<std::uint64_t>(head.lines);
  if (places > kMostGridPlaces || places > kMostPlacesPerByte * coded.size())
    return Error{"grid has more places than its bytes can tell of"};
  Tables tables;
  if (!read_tables(layout->tables, head.has_sigmas, tables)) return kDamaged;

  out.reset(head.boundaries, head.lines, head.step_bits, head.twice);
  if (head.has_sigmas) out.sigmas.assign(out.columns.size(), 0);
  if (head.has_interpolated) out.interpolated.assign(out.columns.size(), 0);
  scratch_.resize(slices.size());
  const auto work = [&](int begin, int end, int) {
    for (int s = begin; s < end; ++s) {
      Scratch& scratch = scratch_[static_cast<std::size_t>(s)];
      scratch.vertices = scratch.triangles = 0;
      scratch.ok = layout->slices[static_cast<std::size_t>(s)].empty() ||
                   scratch.decode({head, tables, key_grid, out}, s * head.slice_lines,
                                  std::min((s + 1) * head.slice_lines, head.lines),
                                  slices[static_cast<std::size_t>(s)]);
    }
  };
  const auto count = static_cast<int>(slices.size());
  if (pool != nullptr && count > 1) {
    pool->for_ranges(count, work);
  } else {
    work(0, count, 0);
  }
  for (std::size_t s = 0; s < slices.size(); ++s) {
    if (!scratch_[s].ok) return kDamaged;
    out.vertices += scratch_[s].vertices;
    out.triangles += scratch_[s].triangles;
    if (s > 0 && layout->slices[s].empty())
      out.triangles -= drop_cells(out, static_cast<int>(s) * head.slice_lines - 1);
  }
  if (joins_halves(out)) return kDamaged;
  choose_diagonals(out, head.model.spacing);
  return head;
}

}  // namespace relievo
