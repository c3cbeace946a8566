// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <optional>

#include "codec/byte_io.h"
#include "codec/grid_coder.h"
#include "codec/grid_fit.h"
#include "codec/grid_head.h"
#include "codec/grid_symbols.h"

namespace relievo {
namespace {

using namespace grid;

/// How often each symbol comes, by its code.
template <std::size_t Tables, std::size_t Symbols = rans::kMostSymbols>
using Counts = std::array<std::uint32_t, Tables * Symbols>;
using ControlCounts = Counts<kControlTables, kControlSymbols>;

/// A stream's symbols, by their codes. Kept from grid to grid with its room, which is not filled anew.
struct Codes {
  std::vector<std::uint16_t> room;
  std::uint16_t* end = nullptr;       // of those that are there
  std::vector<std::uint32_t> starts;  // of rows

  /// Room for so many, of which none is there.
  void start(std::size_t most) {
    if (room.size() < most) room.resize(most);
    end = room.data();
    starts.clear();
  }
  void start_row() { starts.push_back(static_cast<std::uint32_t>(end - room.data())); }
  rans::Rows rows() const { return {{room.data(), end}, starts}; }
};

void put_varint(Bytes& out, std::size_t value) {
  for (; value >= 0x80; value >>= 7) out.push_back(static_cast<std::uint8_t>(value | 0x80));
  out.push_back(static_cast<std::uint8_t>(value));
}

}  // namespace

/// A band of lines on its way to bytes: first its symbols and how often each comes, then, with the tables
/// that all slices share, its streams.
struct GridEncoder::Slice {
  int begin = 0, end = 0;
  Codes control, residuals, sigmas;
  rans::BitWriter raw;
  std::uint32_t vertices = 0, triangles = 0;
  ControlCounts control_counts;
  Counts<kResidualTables> residual_counts;
  Counts<kSigmaTables> sigma_counts;
  std::vector<std::uint8_t> there[2], there_after, key_there, good[2], sizes, contexts, kinds;
  std::vector<std::uint16_t> line_codes;
  std::vector<GridCellBlock> blocks;
  rans::Words words;
  std::vector<std::int32_t> expected, absent;
  Bytes bytes;

  struct Input {
    StripeGrid& grid;
    const StripeGrid* key;
    const GridModel& model;
    std::span<const std::uint8_t> tolerance;
  };

  /// Before any slice of `grid` is read.
  void start(int first, int last, const StripeGrid& grid);
  void read(const Input& in);
  /// `sigma_tables` null: without sigmas.
  void write(const rans::EncoderTables& control_tables, const rans::EncoderTables& residual_tables,
             const rans::EncoderTables* sigma_tables);

 private:
  static void put(int table, int symbol, std::uint16_t*& to) {
    *to++ = rans::code_of(table, symbol, kControlSymbols);
  }
  /// Eight, by their codes from a table's first one on, a byte each.
  static void put_eight(int table, std::uint64_t codes, std::uint16_t* to) {
    using Octets = std::uint8_t __attribute__((vector_size(8)));
    using Codes = std::uint16_t __attribute__((vector_size(16)));
    Octets octets;
    std::memcpy(&octets, &codes, sizeof octets);
    const Codes all = __builtin_convertvector(octets, Codes) + rans::code_of(table, 0, kControlSymbols);
    std::memcpy(to, &all, sizeof all);
  }
  void fill_there(const StripeGrid& grid, int line, std::vector<std::uint8_t>& out) const;
  // Where the control stream goes on, which begins at `to`.
  std::uint16_t* read_places(const Input& in, int line, const std::uint8_t* above, const std::uint8_t* here,
                             std::uint16_t* to);
  std::uint16_t* read_cells(const Input& in, int line, const std::uint8_t* above, const std::uint8_t* below,
                            std::uint16_t* to);
  std::uint16_t* read_marks(const Input& in, int line, const std::uint8_t* here, std::uint16_t* to) const;
  void read_columns(const Input& in, int line);
  void read_alone(const Input& in, int line, const GridRows& rows, int b);
  void read_sigmas(const Input& in, int line);
  const std::int32_t* row(const StripeGrid& grid, int line) const {
    return line < begin ? absent.data() + StripeGrid::kMargin : grid.columns.data() + grid.at(line, 0);
  }
};

void GridEncoder::Slice::start(int first, int last, const StripeGrid& grid) {
  begin = first;
  end = last;
  // Of a line its marks, the places below it and its cells, each with what is said of blocks; of the others
  // one a place.
  const auto places = static_cast<std::size_t>(end - begin + 1) * static_cast<std::size_t>(grid.stride());
  control.start(4 * places);
  control.start_row();
  residuals.start(places);
  sigmas.start(grid.sigmas.empty() ? 0 : places);
  vertices = triangles = 0;
  control_counts.fill(0);
  residual_counts.fill(0);
  sigma_counts.fill(0);
  const auto size = static_cast<std::size_t>(grid.stride());
  for (auto* buffer : {&there[0], &there[1], &there_after, &key_there}) buffer->assign(size, 0);
  // read() of the slice below writes that line's columns.
  if (end < grid.lines) fill_there(grid, end, there_after);
  for (auto& buffer : good) buffer.assign(size, 1);
  sizes.assign(size, kFirstSize);
  contexts.assign(size, 0);
  kinds.assign(size, 0);
  line_codes.assign(size, 0);
  blocks.resize(size / 8);
  expected.assign(size, 0);
  absent.assign(size, StripeGrid::kAbsent);
}

void GridEncoder::Slice::fill_there(const StripeGrid& grid, int line, std::vector<std::uint8_t>& out) const {
  grid_kernels().there(grid.columns.data() + grid.at(line, 0), grid.boundaries,
                       out.data() + StripeGrid::kMargin);
}

std::uint16_t* GridEncoder::Slice::read_places(const Input& in, int line, const std::uint8_t* above,
                                               const std::uint8_t* here, std::uint16_t* to) {
  const std::uint8_t* key = nullptr;
  if (in.key != nullptr) {
    fill_there(*in.key, line, key_there);
    key = key_there.data() + StripeGrid::kMargin;
  }
  const int boundaries = in.grid.boundaries;
  for (int b = 0; b < boundaries; b += 8) {
    const int last = std::min(b + 8, boundaries);
    const int uniform = last - b == 8 ? uniform_places(here, above, key, b) : -1;
    if (uniform >= 0) {
      const bool all = load8(here + b) == static_cast<std::uint64_t>(uniform) * kOnes;
      put(kBlockTable + uniform, all ? 0 : 1, to);
      if (all) continue;
    }
    const std::uint64_t contexts_of = load8(here + b - 1) | place_contexts_around(above, key, b);
    static_assert(kPlaceTables * kControlSymbols <= 256);
    put_eight(0, contexts_of * kControlSymbols + load8(here + b), to);
    to += last - b;
  }
  return to;
}

/// Below `line`.
std::uint16_t* GridEncoder::Slice::read_cells(const Input& in, int line, const std::uint8_t* above,
                                              const std::uint8_t* below, std::uint16_t* to) {
  const std::uint8_t* cells = in.grid.cells.data() + in.grid.at(line, 0);
  const std::uint8_t* good_above = good[0].data() + StripeGrid::kMargin;
  std::uint8_t* good_here = good[1].data() + StripeGrid::kMargin;
  good_here[-1] = 1;
  const int count = in.grid.boundaries - 1;
  GridCellBlock* block = blocks.data();
  std::uint32_t filled = 0;
  for (int b = 0; b < count; b += 8, ++block) {
    const int last = std::min(b + 8, count);
    *block = {};
    if (last - b == 8 && uniform_cells(good_here, good_above, above, below, b)) {
      // All are straight or turned: four bits a byte, every other one.
      const std::uint64_t unlike = load8(cells + b) ^ grid_cell::kTurned * kOnes;
      const bool both = unlike == (unlike & kOnes) * 15;
      block->whole = rans::code_of(kCellBlockTable, both ? 0 : 1, kControlSymbols);
      block->says_whole = 1;
      if (both) {
        filled += 16;
        std::fill_n(good_here + b, 8, std::uint8_t{1});
        continue;
      }
    }
    const std::uint64_t asked = last - b == 8 ? ~std::uint64_t{0} : (std::uint64_t{1} << 8 * (last - b)) - 1;
    const EightCells eight =
        eight_cells(cells + b, above + b, below + b, asked, load8(good_above + b), good_here[b - 1]);
    filled += eight.triangles;
    std::memcpy(good_here + b, &eight.good, sizeof eight.good);
    block->codes = eight.codes;
    block->coded = eight.coded;
  }
  std::swap(good[0], good[1]);
  triangles += filled;
  return grid_kernels().pack_cells(blocks.data(), static_cast<int>(block - blocks.data()),
                                   rans::code_of(kCellTable, 0, kControlSymbols), to);
}

std::uint16_t* GridEncoder::Slice::read_marks(const Input& in, int line, const std::uint8_t* here,
                                              std::uint16_t* to) const {
  const std::uint8_t* marks = in.grid.interpolated.data() + in.grid.at(line, 0);
  const std::uint8_t* above = line > begin ? marks - in.grid.stride() : nullptr;
  for (int b = 0; b < in.grid.boundaries; ++b)
    if (here[b] != 0) put(kMarkTable + (above != nullptr ? above[b] << 1 : 0) + marks[b - 1], marks[b], to);
  return to;
}

void GridEncoder::Slice::read_columns(const Input& in, int line) {
  std::int32_t* here = in.grid.columns.data() + in.grid.at(line, 0);
  const std::uint8_t* tolerance = in.tolerance.empty() ? nullptr : in.tolerance.data() + in.grid.at(line, 0);
  const GridRows rows{.up1 = row(in.grid, line - 1),
                      .up2 = row(in.grid, line - 2),
                      .up3 = row(in.grid, line - 3),
                      .up4 = row(in.grid, line - 4),
                      .key = in.key != nullptr ? in.key->columns.data() + in.key->at(line, 0) : nullptr,
                      .key_up = in.key != nullptr ? row(*in.key, line - 1) : nullptr};
  const int boundaries = in.grid.boundaries;
  std::int32_t* predicted = expected.data() + StripeGrid::kMargin;
  std::uint8_t* size = sizes.data() + StripeGrid::kMargin;
  const GridKernels& kernels = grid_kernels();
  kernels.predict(rows, in.model, boundaries, predicted);
  kernels.contexts(size, rows.up1, boundaries, contexts.data());
  kernels.residuals({.up1 = rows.up1,
                     .expected = predicted,
                     .tolerance = tolerance,
                     .tables = contexts.data(),
                     .columns = here,
                     .sizes = size,
                     .codes = line_codes.data(),
                     .kinds = kinds.data()},
                    boundaries);
  residuals.start_row();
  for (int b = 0; b < boundaries; b += 8) {
    if ((load8(kinds.data() + b) & kByItself * kOnes) == 0) continue;
    for (int i = b; i < b + 8; ++i)  // behind the last boundary there are no vertices
      if (kinds[static_cast<std::size_t>(i)] == kByItself) read_alone(in, line, rows, i);
  }
  std::uint16_t* const row_end = kernels.pack(line_codes.data(), kinds.data(), boundaries, residuals.end);
  vertices += static_cast<std::uint32_t>(row_end - residuals.end);
  residuals.end = row_end;
}

/// A vertex that the kernel leaves.
void GridEncoder::Slice::read_alone(const Input& in, int line, const GridRows& rows, int b) {
  std::int32_t* here = in.grid.columns.data() + in.grid.at(line, 0);
  const auto i = static_cast<std::size_t>(b);
  const int table = contexts[i];
  const auto at = static_cast<std::size_t>(b + StripeGrid::kMargin);
  const std::int32_t p = table == kAloneTable ? expected_alone(here, rows.up1, rows.key, b,
                                                               last_before(here, b), in.model.spacing)
                                              : expected[at];
  std::int32_t d = here[b] - p;
  const std::int32_t tolerance = in.tolerance.empty() ? 0 : in.tolerance[in.grid.at(line, b)];
  if (d <= tolerance && d >= -tolerance) {
    here[b] = p;
    d = 0;
  }
  sizes[at] = static_cast<std::uint8_t>(std::min(d < 0 ? -d : d, kLargestSize));
  const Symbol symbol = symbol_of(zigzag(d));
  if (symbol.count > 0) raw.put(symbol.rest, symbol.count);
  line_codes[i] = rans::code_of(table, symbol.symbol);
  kinds[i] = kDone;
}

void GridEncoder::Slice::read_sigmas(const Input& in, int line) {
  constexpr std::int32_t kAbsent = StripeGrid::kAbsent;
  const std::int32_t* here = row(in.grid, line);
  const std::int32_t* above = row(in.grid, line - 1);
  const std::int32_t* further = row(in.grid, line - 2);
  const std::uint8_t* codes = in.grid.sigmas.data() + in.grid.at(line, 0);
  const std::ptrdiff_t stride = in.grid.stride();
  sigmas.start_row();
  int last = kFirstSigma;
  for (int b = 0; b < in.grid.boundaries; ++b) {
    if (here[b] == kAbsent) continue;
    int table = kSigmaTables - 1;
    int p = last;
    if (above[b] != kAbsent) {
      p = codes[b - stride];
      table = further[b] != kAbsent ? std::min(std::abs(p - codes[b - 2 * stride]), kSigmaTables - 2) : 0;
    }
    last = codes[b];
    const Symbol symbol = symbol_of(zigzag(codes[b] - p));
    if (symbol.count > 0) raw.put(symbol.rest, symbol.count);
    *sigmas.end++ = rans::code_of(table, symbol.symbol);
  }
}

void GridEncoder::Slice::read(const Input& in) {
  // there[0] is the line above; the place at [1] the line itself. Nothing is above a slice.
  fill_there(in.grid, begin, there[1]);
  std::uint16_t* to = read_places(in, begin, there[0].data() + StripeGrid::kMargin,
                                  there[1].data() + StripeGrid::kMargin, control.end);
  for (int line = begin; line < end; ++line) {
    std::swap(there[0], there[1]);
    const std::uint8_t* here = there[0].data() + StripeGrid::kMargin;
    if (!in.grid.interpolated.empty()) to = read_marks(in, line, here, to);
    if (line + 1 < in.grid.lines) {
      // The first line of the slice below, too: where cells have corners.
      if (line + 1 < end) {
        fill_there(in.grid, line + 1, there[1]);
      } else {
        there[1].swap(there_after);
      }
      const std::uint8_t* below = there[1].data() + StripeGrid::kMargin;
      to = read_cells(in, line, here, below, read_places(in, line + 1, here, below, to));
    }
    read_columns(in, line);
    if (!in.grid.sigmas.empty()) read_sigmas(in, line);
  }
  control.end = to;
  rans::count_codes(control.rows().codes, control_counts);
  rans::count_codes(residuals.rows().codes, residual_counts);
  rans::count_codes(sigmas.rows().codes, sigma_counts);
}

void GridEncoder::Slice::write(const rans::EncoderTables& control_tables,
                               const rans::EncoderTables& residual_tables,
                               const rans::EncoderTables* sigma_tables) {
  Bytes streams;
  std::array<std::size_t, 3> ends{};
  ends[0] =
      rans::encode({control.rows(), control_tables}, {residuals.rows(), residual_tables}, words, streams);
  ends[1] = streams.size();
  if (sigma_tables != nullptr) rans::encode({sigmas.rows(), *sigma_tables}, words, streams);
  ends[2] = streams.size();
  const Bytes rest = raw.finish();
  bytes.clear();
  put_varint(bytes, vertices);
  put_varint(bytes, triangles);
  put_varint(bytes, ends[0]);
  put_varint(bytes, ends[1] - ends[0]);
  put_varint(bytes, ends[2] - ends[1]);
  bytes.insert(bytes.end(), streams.begin(), streams.end());
  bytes.insert(bytes.end(), rest.begin(), rest.end());
}

GridEncoder::GridEncoder() = default;
GridEncoder::~GridEncoder() = default;
GridEncoder::GridEncoder(GridEncoder&&) noexcept = default;
GridEncoder& GridEncoder::operator=(GridEncoder&&) noexcept = default;

namespace {

template <std::size_t N>
void add(const std::array<std::uint32_t, N>& from, std::array<std::uint32_t, N>& to) {
  for (std::size_t i = 0; i < N; ++i) to[i] += from[i];
}

template <std::size_t Tables>
rans::EncoderTables make_tables(const Counts<Tables>& counts, rans::BitWriter& bits) {
  rans::EncoderTables tables(Tables);
  const std::vector<rans::Levels> levels = rans::levels_of(counts, rans::kMostSymbols);
  for (std::size_t t = 0; t < Tables; ++t) {
    rans::write_levels(levels[t], bits);
    tables.set(t, levels[t]);
  }
  return tables;
}

rans::EncoderTables make_control_tables(const ControlCounts& counts, rans::BitWriter& bits) {
  rans::EncoderTables tables(kControlTables, kControlSymbols);
  const std::span<const std::uint32_t> all(counts);
  const std::vector<rans::Levels> cells = rans::levels_of(
      all.subspan(kCellTable * kControlSymbols, kCellTables * kControlSymbols), kControlSymbols);
  for (std::size_t t = 0; t < kControlTables; ++t) {
    if (t >= kCellTable && t < kCellTable + kCellTables) {
      const rans::Levels& levels = cells[t - kCellTable];
      rans::write_levels(levels, bits);
      tables.set(t, levels);
    } else {
      const auto of = all.subspan(t * kControlSymbols, kControlSymbols);
      const rans::BinaryLevel level = rans::binary_level_of(of[0], of[1]);
      rans::write_level(level, bits);
      tables.set(t, level);
    }
  }
  return tables;
}

}  // namespace

Bytes GridEncoder::encode(StripeGrid& grid, const GridCalibration& calibration, const GridKey* key,
                          std::span<const std::uint8_t> tolerance, float step_mm, const GridCoding& coding) {
  GridHead head;
  head.is_key = key == nullptr;
  head.has_sigmas = !grid.sigmas.empty();
  head.has_interpolated = !grid.interpolated.empty();
  head.step_bits = grid.step_bits;
  head.boundaries = grid.boundaries;
  head.lines = grid.lines;
  head.twice = grid.twice;
  head.slice_lines = std::min(coding.slice_lines, grid.lines);
  head.model = fit_model(grid, key != nullptr ? &key->grid : nullptr);
  head.step_mm = step_mm;
  head.key = key != nullptr ? key->id : 0;
  head.calibration = calibration;
  const int count = (grid.lines + head.slice_lines - 1) / head.slice_lines;
  slices_.resize(static_cast<std::size_t>(count));

  const auto for_slices = [&](const auto& work) {
    const auto range = [&](int begin, int end, int) {
      for (int s = begin; s < end; ++s) work(s, slices_[static_cast<std::size_t>(s)]);
    };
    if (coding.pool != nullptr && count > 1) {
      coding.pool->for_ranges(count, range);
    } else {
      range(0, count, 0);
    }
  };
  const Slice::Input in{grid, key != nullptr ? &key->grid : nullptr, head.model, tolerance};
  for_slices([&](int s, Slice& slice) {
    slice.start(s * head.slice_lines, std::min((s + 1) * head.slice_lines, grid.lines), grid);
  });
  for_slices([&](int, Slice& slice) { slice.read(in); });

  Slice& total = slices_.front();
  // Tables are of all slices; the first slice's counts become the sums.
  grid.vertices = total.vertices;
  grid.triangles = total.triangles;
  for (std::size_t s = 1; s < slices_.size(); ++s) {
    add(slices_[s].control_counts, total.control_counts);
    add(slices_[s].residual_counts, total.residual_counts);
    add(slices_[s].sigma_counts, total.sigma_counts);
    grid.vertices += slices_[s].vertices;
    grid.triangles += slices_[s].triangles;
  }
  rans::BitWriter bits;
  const rans::EncoderTables control_tables = make_control_tables(total.control_counts, bits);
  const rans::EncoderTables residual_tables = make_tables<kResidualTables>(total.residual_counts, bits);
  std::optional<rans::EncoderTables> sigma_tables;
  if (head.has_sigmas) sigma_tables = make_tables<kSigmaTables>(total.sigma_counts, bits);

  for_slices([&](int, Slice& slice) {
    slice.write(control_tables, residual_tables, sigma_tables ? &*sigma_tables : nullptr);
  });
  Bytes out;
  write_grid_head(head, bits.finish(), out);
  for (const Slice& slice : slices_) append(out, static_cast<std::uint32_t>(slice.bytes.size()));
  for (const Slice& slice : slices_) append_bytes(out, slice.bytes);
  return out;
}

}  // namespace relievo
