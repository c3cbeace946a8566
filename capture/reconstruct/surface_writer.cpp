// SPDX-License-Identifier: Apache-2.0
#include "capture/reconstruct/surface_writer.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cstring>
#include <numeric>
#include <utility>

#include "capture/reconstruct/four.h"

namespace relievo {
namespace {

using Word = SurfacePieces::Word;
constexpr int kWordBits = 64;

// Vertices at once, as Four are.
using TwoInts = std::int32_t __attribute__((vector_size(8)));

template <typename Value, typename Vector>
void load(const Value* from, Vector& to) {
  std::memcpy(&to, from, sizeof to);
}

/// [x, y, z] of each place from begin to end.
void interleave(const float* x, const float* y, const float* z, int begin, int end, Vec3f* to) {
  int b = begin;
  for (; b + 4 <= end; b += 4, to += 4) {
    Four vx, vy, vz;
    load(x + b, vx);
    load(y + b, vy);
    load(z + b, vz);
    const Four xy01 = __builtin_shufflevector(vx, vy, 0, 4, 1, 5);
    const Four xy23 = __builtin_shufflevector(vx, vy, 2, 6, 3, 7);
    const Four zx01 = __builtin_shufflevector(vz, vx, 0, 5, 0, 5);
    const Four yz1 = __builtin_shufflevector(vy, vz, 1, 5, 1, 5);
    const Four zx23 = __builtin_shufflevector(vz, vx, 2, 7, 2, 7);
    const Four yz3 = __builtin_shufflevector(vy, vz, 3, 7, 3, 7);
    const Four out[3] = {__builtin_shufflevector(xy01, zx01, 0, 1, 4, 5),
                         __builtin_shufflevector(yz1, xy23, 0, 1, 4, 5),
                         __builtin_shufflevector(zx23, yz3, 0, 1, 4, 5)};
    std::memcpy(to, out, sizeof out);
  }
  for (; b < end; ++b) *to++ = {x[b], y[b], z[b]};
}

/// Calls run(begin, end) for each run of ones.
template <typename Run>
void for_runs(const Word* words, std::size_t count, const Run& run) {
  int begin = -1;  // of the run that reaches to where we are
  for (std::size_t w = 0; w < count; ++w) {
    const int first = static_cast<int>(w) * kWordBits;
    int at = 0;
    while (at < kWordBits) {
      const Word rest = begin >= 0 ? ~(words[w] >> at) : words[w] >> at;
      // Behind what was shifted out there are zeros, which are no end of a run.
      const int same = std::min(rest == 0 ? kWordBits : std::countr_zero(rest), kWordBits - at);
      at += same;
      if (at == kWordBits) break;
      if (begin >= 0) {
        run(begin, first + at);
        begin = -1;
      } else {
        begin = first + at;
      }
    }
  }
  if (begin >= 0) run(begin, static_cast<int>(count) * kWordBits);
}

}  // namespace

void SurfaceWriter::fit(const SurfacePieces& pieces, int lines, const SurfaceOptions& options, Surface& out) {
  const std::size_t vertices = pieces.vertices_before(lines);
  out.positions.resize(vertices);
  out.normals.resize(vertices);
  out.grid.resize(vertices);
  if (options.picture != nullptr) {
    out.texture_coordinates.resize(vertices);
    out.sigmas_m.resize(vertices);
    out.interpolated.resize(vertices);
  }
  out.triangles.resize(pieces.triangles_before(lines));
}

SurfaceWriter::SurfaceWriter(const DecodedGrid& grid, const SurfaceOptions& options,
                             const SurfaceScratch& scratch, SurfaceScratch::Worker& worker, Surface& out)
    : grid_(grid),
      options_(options),
      scratch_(scratch),
      worker_(worker),
      out_(out),
      texture_x_(worker.rows.data()),
      sigma_m_(worker.rows.data() + grid.stride()) {
  worker.index.resize(2 * index_size());
}

void SurfaceWriter::write(int begin, int end) {
  std::int32_t* here = worker_.index.data();
  std::int32_t* below = here + index_size();
  number(begin, here);
  for (int line = begin; line < end; ++line) {
    write_vertices(line);
    if (line + 1 == grid_.lines()) break;  // no cells below
    number(line + 1, below);
    write_triangles(line, here, below);
    std::swap(here, below);
  }
}

/// Of the vertices that stay; the index of any other place is that of the next one.
void SurfaceWriter::number(int line, std::int32_t* index) const {
  const Word* vertex = scratch_.pieces.bits(line, PlaceBits::kVertex);
  auto next = static_cast<std::int32_t>(scratch_.pieces.vertices_before(line));
  for (std::size_t w = 0; w < scratch_.pieces.words(); ++w, index += kWordBits) {
    if (vertex[w] == ~Word{0}) {
      std::iota(index, index + kWordBits, next);
      next += kWordBits;
      continue;
    }
    Word left = vertex[w];
    for (int b = 0; b < kWordBits; ++b, left >>= 1) {
      index[b] = next;
      next += static_cast<std::int32_t>(left & 1U);
    }
  }
}

/// What vertices get for the picture.
void SurfaceWriter::prepare(int line) {
  const SurfacePicture& picture = *options_.picture;
  const auto width = static_cast<float>(picture.width_px);
  const float* column_px = grid_.column_px(line);
  for (int b = 0; b < grid_.boundaries(); ++b) texture_x_[b] = (column_px[b] + 0.5F) / width;
  picture.depth_slope.sigmas_m({grid_.x(line), grid_.y(line), grid_.z(line)}, grid_.sigma_px(line),
                               grid_.boundaries(), sigma_m_);
}

void SurfaceWriter::write_vertices(int line) {
  const bool for_picture = options_.picture != nullptr;
  if (for_picture) prepare(line);
  const float* x = grid_.x(line);
  const float* y = grid_.y(line);
  const float* z = grid_.z(line);
  const float* column_px = grid_.column_px(line);
  const float* sigma_px = grid_.sigma_px(line);
  const std::uint8_t* interpolated = grid_.interpolated(line);
  const std::size_t stride = grid_.stride();
  const float* normal = scratch_.normals.data() + 3 * static_cast<std::size_t>(line) * stride;
  const std::uint16_t* boundaries = options_.boundaries != nullptr
                                        ? options_.boundaries + static_cast<std::size_t>(line) * stride
                                        : nullptr;
  const auto texture_y = for_picture ? (static_cast<float>(line * options_.picture->line_step_px) + 0.5F) /
                                           static_cast<float>(options_.picture->height_px)
                                     : 0.F;
  std::size_t first = scratch_.pieces.vertices_before(line);
  for_runs(scratch_.pieces.bits(line, PlaceBits::kVertex), scratch_.pieces.words(), [&](int begin, int end) {
    GridPoint* at = out_.grid.data() + first;
    interleave(x, y, z, begin, end, out_.positions.data() + first);
    interleave(normal, normal + stride, normal + 2 * stride, begin, end, out_.normals.data() + first);
    for (int b = begin; b < end; ++b) {
      *at++ = {.boundary = boundaries != nullptr ? boundaries[b] : static_cast<std::uint16_t>(b),
               .line = static_cast<std::uint16_t>(line),
               .column_px = column_px[b],
               .sigma_px = sigma_px[b],
               .interpolated = interpolated != nullptr && interpolated[b] != 0};
    }
    if (for_picture) {
      Vec2f* texture = out_.texture_coordinates.data() + first;
      for (int b = begin; b < end; ++b) *texture++ = {texture_x_[b], texture_y};
      std::copy(sigma_m_ + begin, sigma_m_ + end, out_.sigmas_m.data() + first);
      if (interpolated != nullptr) {
        std::copy(interpolated + begin, interpolated + end, out_.interpolated.data() + first);
      } else {
        std::fill_n(out_.interpolated.data() + first, end - begin, std::uint8_t{0});
      }
    }
    first += static_cast<std::size_t>(end - begin);
  });
}

void SurfaceWriter::write_triangles(int line, const std::int32_t* above, const std::int32_t* below) {
  const SurfacePieces& pieces = scratch_.pieces;
  const Word* first = pieces.bits(line, PlaceBits::kFirst);
  const Word* second = pieces.bits(line, PlaceBits::kSecond);
  const Word* turned = pieces.bits(line, PlaceBits::kTurned);
  Triangle* to = out_.triangles.data() + pieces.triangles_before(line);
  // Corners of a cell; the first triangle is 0 1 2, the second one 2 3 0.
  constexpr FourInts kStraight{};
  const FourInts turns[2] = {kStraight, ~kStraight};
  const auto corners = [&](int b, Word turn, FourInts& q) {
    TwoInts upper, lower;
    load(above + b, upper);
    load(below + b, lower);
    const FourInts straight = __builtin_shufflevector(upper, lower, 0, 2, 3, 1);
    const FourInts turned_on = __builtin_shufflevector(upper, lower, 2, 3, 1, 0);
    q = turns[turn & 1U] ? turned_on : straight;
  };
  for (std::size_t w = 0; w < pieces.words(); ++w) {
    const int b = static_cast<int>(w) * kWordBits;
    Word turn = turned[w];
    if ((first[w] & second[w]) == ~Word{0}) {  // as most are: no question is asked of each
      for (int i = b; i < b + kWordBits; ++i, turn >>= 1, to += 2) {
        FourInts q;
        corners(i, turn, q);
        const FourInts one = __builtin_shufflevector(q, q, 0, 1, 2, 2);
        const TwoInts two = __builtin_shufflevector(q, q, 3, 0);
        std::memcpy(to, &one, sizeof one);
        std::memcpy(to[1].data() + 1, &two, sizeof two);
      }
      continue;
    }
    for (Word cells = first[w] | second[w]; cells != 0; cells &= cells - 1) {
      const int i = std::countr_zero(cells);
      FourInts at;
      corners(b + i, turn >> i, at);
      std::array<std::uint32_t, 4> q{};
      std::memcpy(q.data(), &at, sizeof at);
      if (first[w] >> i & 1U) *to++ = {q[0], q[1], q[2]};
      if (second[w] >> i & 1U) *to++ = {q[2], q[3], q[0]};
    }
  }
}

}  // namespace relievo
