// SPDX-License-Identifier: Apache-2.0
#include "capture/reconstruct/surface_pieces.h"

#include <algorithm>
#include <atomic>
#include <bit>
#include <cstring>
#include <numeric>
#include <utility>

#include "capture/reconstruct/surface_cells.h"

namespace relievo {
namespace {

using Word = SurfacePieces::Word;
constexpr int kWordBits = 64;

/// Of eight bytes, the first the lowest: byte i's bit k to byte k's bit i.
Word transpose(Word x) {
  Word t = (x ^ (x >> 7)) & 0x00aa00aa00aa00aaU;
  x ^= t ^ (t << 7);
  t = (x ^ (x >> 14)) & 0x0000cccc0000ccccU;
  x ^= t ^ (t << 14);
  t = (x ^ (x >> 28)) & 0x00000000f0f0f0f0U;
  return x ^ t ^ (t << 28);
}

/// Which plane of PlaceBits each bit of a cell is.
constexpr std::size_t plane_of(std::uint8_t bit) {
  PlaceBits out{};
  if (bit == cell::kTurned) out = PlaceBits::kTurned;
  if (bit == cell::kFirst) out = PlaceBits::kFirst;
  if (bit == cell::kSecond) out = PlaceBits::kSecond;
  if (bit == cell::kFirstJoins) out = PlaceBits::kFirstJoins;
  if (bit == cell::kSecondJoins) out = PlaceBits::kSecondJoins;
  if (bit == cell::kCorner) out = PlaceBits::kVertex;
  if (bit == cell::kSureDown) out = PlaceBits::kSureDown;
  return static_cast<std::size_t>(out);
}

int count_ones(const Word* words, std::size_t count) {
  int out = 0;
  for (std::size_t w = 0; w < count; ++w) out += std::popcount(words[w]);
  return out;
}

/// How many ones there are up to a bit, itself included.
int rank_of(const Word* words, std::size_t word, int bit) {
  return count_ones(words, word) + std::popcount(words[word] << (kWordBits - 1 - bit));
}

}  // namespace

void SurfacePieces::reset(int width, int lines) {
  lines_ = lines;
  words_ = (static_cast<std::size_t>(width) + kWordBits - 1) / kWordBits;
  bits_.resize(static_cast<std::size_t>(lines) * static_cast<std::size_t>(PlaceBits::kOfLines) * words_);
}

void SurfacePieces::read_cells(const std::uint8_t* cells, Cells& out) const {
  out.words.resize(static_cast<std::size_t>(PlaceBits::kAll) * words_);
  Word* words = out.words.data();
  for (std::size_t w = 0; w < words_; ++w) {
    Word planes[8] = {};
    for (int i = 0; i < 8; ++i) {
      Word eight = 0;
      std::memcpy(&eight, cells + 64 * w + 8 * static_cast<std::size_t>(i), sizeof eight);
      const Word turned = transpose(eight);
      for (int k = 0; k < 7; ++k) planes[k] |= (turned >> (8 * k) & 0xffU) << (8 * i);
    }
    for (int k = 0; k < 7; ++k) words[plane_of(static_cast<std::uint8_t>(1U << k)) * words_ + w] = planes[k];
  }
}

void SurfacePieces::read_line(int line, const Cells& above, const Cells& below) {
  const auto of = [&](const Cells& cells, PlaceBits which) {
    return cells.words.data() + static_cast<std::size_t>(which) * words_;
  };
  Word on_before = 0;     // the last place of the word before is joined to the next one
  Word right_before = 0;  // its cell above joins its right corners
  for (std::size_t w = 0; w < words_; ++w) {
    const auto here = [&](PlaceBits which) { return of(below, which)[w]; };
    const auto over = [&](PlaceBits which) { return of(above, which)[w]; };
    const Word vertex = here(PlaceBits::kVertex);
    // The lower side of a cell is its first triangle's, the upper one its second's; see surface_cells.h.
    const Word on = here(PlaceBits::kSecondJoins) | over(PlaceBits::kFirstJoins);
    const Word turned = over(PlaceBits::kTurned);
    const Word first = over(PlaceBits::kFirstJoins);
    const Word second = over(PlaceBits::kSecondJoins);
    const Word left = (turned & second) | (~turned & first);
    const Word right = (turned & first) | (~turned & second);
    // A boundary that goes on from line to line is a surface, even one too narrow for triangles.
    const Word goes_on = over(PlaceBits::kSureDown) & over(PlaceBits::kVertex) & vertex;
    const auto put = [&](PlaceBits which, Word word) { bits_of(line, which)[w] = word; };
    put(PlaceBits::kVertex, vertex);
    put(PlaceBits::kStart, vertex & ~(on << 1 | on_before));
    put(PlaceBits::kUp, left | (right << 1 | right_before) | goes_on);
    put(PlaceBits::kFirst, here(PlaceBits::kFirst));
    put(PlaceBits::kSecond, here(PlaceBits::kSecond));
    put(PlaceBits::kTurned, here(PlaceBits::kTurned));
    on_before = on >> (kWordBits - 1);
    right_before = right >> (kWordBits - 1);
  }
}

std::int32_t SurfacePieces::root(std::int32_t run) {
  while (parent_[static_cast<std::size_t>(run)] != run) {
    auto& up = parent_[static_cast<std::size_t>(run)];
    up = parent_[static_cast<std::size_t>(up)];  // halves the path
    run = up;
  }
  return run;
}

void SurfacePieces::join(std::int32_t a, std::int32_t b) {
  a = root(a);
  b = root(b);
  if (a == b) return;
  parent_[static_cast<std::size_t>(std::max(a, b))] = std::min(a, b);
  size_[static_cast<std::size_t>(std::min(a, b))] += size_[static_cast<std::size_t>(std::max(a, b))];
}

/// Sizes are twice the vertices, but of those that no triangle joins to the next on the line.
void SurfacePieces::find_runs() {
  runs_before_.resize(static_cast<std::size_t>(lines_) + 1);
  size_.clear();
  for (int line = 0; line < lines_; ++line) {
    runs_before_[static_cast<std::size_t>(line)] = static_cast<std::int32_t>(size_.size());
    const Word* vertex = bits(line, PlaceBits::kVertex);
    const Word* start = bits(line, PlaceBits::kStart);
    std::int32_t length = 0;  // of the run that is not over yet
    const auto end_run = [&] {
      if (length > 0) size_.push_back(length > 1 ? 2 * length : 1);
    };
    for (std::size_t w = 0; w < words_; ++w) {
      Word left = vertex[w];
      for (Word starts = start[w]; starts != 0; starts &= starts - 1) {
        const Word before = (starts & -starts) - 1;  // places before this start
        length += std::popcount(left & before);
        end_run();
        length = 0;
        left &= ~before;
      }
      length += std::popcount(left);
    }
    end_run();
  }
  runs_before_[static_cast<std::size_t>(lines_)] = static_cast<std::int32_t>(size_.size());
  parent_.resize(size_.size());
  std::iota(parent_.begin(), parent_.end(), 0);
}

void SurfacePieces::join_runs() {
  for (int line = 1; line < lines_; ++line) {
    const Word* up = bits(line, PlaceBits::kUp);
    const Word* start = bits(line, PlaceBits::kStart);
    const Word* start_above = bits(line - 1, PlaceBits::kStart);
    Word up_before = 0;
    for (std::size_t w = 0; w < words_; ++w) {
      // Those beside one that joins the same two runs say nothing new.
      const Word told = (up[w] << 1 | up_before) & ~start[w] & ~start_above[w];
      up_before = up[w] >> (kWordBits - 1);
      for (Word joins = up[w] & ~told; joins != 0; joins &= joins - 1) {
        const int bit = std::countr_zero(joins);
        join(runs_before_[static_cast<std::size_t>(line)] + rank_of(start, w, bit) - 1,
             runs_before_[static_cast<std::size_t>(line) - 1] + rank_of(start_above, w, bit) - 1);
      }
    }
  }
}

/// Takes a line's small pieces away. Returns how many vertices they had; how many vertices and triangles stay
/// goes to where the counts before the line will be.
std::size_t SurfacePieces::keep_line(int line) {
  Word* vertex = bits_of(line, PlaceBits::kVertex);
  const Word* start = bits(line, PlaceBits::kStart);
  const int before = count_ones(vertex, words_);
  auto run = static_cast<std::size_t>(runs_before_[static_cast<std::size_t>(line)]);
  bool kept = true;  // what the run that is not over yet is
  for (std::size_t w = 0; w < words_ && !all_kept_; ++w) {
    Word from = 0;  // places before the last start
    Word gone = 0;
    for (Word starts = start[w]; starts != 0; starts &= starts - 1) {
      const Word to = (starts & -starts) - 1;
      if (!kept) gone |= to & ~from;
      from = to;
      kept = kept_[run++] != 0;
    }
    if (!kept) gone |= ~from;
    vertex[w] &= ~gone;
  }
  const int stay = count_ones(vertex, words_);
  Word* first = bits_of(line, PlaceBits::kFirst);
  Word* second = bits_of(line, PlaceBits::kSecond);
  const Word* turned = bits(line, PlaceBits::kTurned);
  for (std::size_t w = 0; w < words_ && !all_kept_; ++w) {
    // All of a cell's triangles have the upper corner of the diagonal.
    const Word next = vertex[w] >> 1 | (w + 1 < words_ ? vertex[w + 1] << (kWordBits - 1) : 0);
    const Word cell_stays = (turned[w] & next) | (~turned[w] & vertex[w]);
    first[w] &= cell_stays;
    second[w] &= cell_stays;
  }
  vertices_before_[static_cast<std::size_t>(line)] = static_cast<std::uint32_t>(stay);
  triangles_before_[static_cast<std::size_t>(line)] =
      static_cast<std::uint32_t>(count_ones(first, words_) + count_ones(second, words_));
  return static_cast<std::size_t>(before - stay);
}

std::size_t SurfacePieces::keep(int least_component, WorkerPool* pool) {
  find_runs();
  join_runs();
  kept_.resize(size_.size());
  all_kept_ = true;
  for (std::size_t r = 0; r < kept_.size(); ++r) {
    kept_[r] = size_[static_cast<std::size_t>(root(static_cast<std::int32_t>(r)))] + 1 >= 2 * least_component;
    all_kept_ = all_kept_ && kept_[r] != 0;
  }
  vertices_before_.resize(static_cast<std::size_t>(lines_) + 1);
  triangles_before_.resize(static_cast<std::size_t>(lines_) + 1);
  std::atomic<std::size_t> small{0};
  const auto keep_lines = [&](int begin, int end, int) {
    std::size_t own = 0;
    for (int line = begin; line < end; ++line) own += keep_line(line);
    small += own;
  };
  if (pool != nullptr) {
    pool->for_ranges(lines_, keep_lines);
  } else {
    keep_lines(0, lines_, 0);
  }
  vertices_before_.back() = triangles_before_.back() = 0;
  for (auto* counts : {&vertices_before_, &triangles_before_}) {
    std::uint32_t before = 0;
    for (std::uint32_t& count : *counts) before += std::exchange(count, before);
  }
  return small;
}

}  // namespace relievo
