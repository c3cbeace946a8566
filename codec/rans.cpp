// SPDX-License-Identifier: Apache-2.0
#include "codec/rans.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>
#include <utility>

#include "codec/byte_io.h"
#include "codec/rans_kernels.h"

namespace relievo::rans {

void BitWriter::put(std::uint32_t value, int count) {
  bits_ |= static_cast<std::uint64_t>(value) << held_;
  held_ += count;
  if (held_ < 32) return;
  const auto* whole = reinterpret_cast<const std::uint8_t*>(&bits_);
  out_.insert(out_.end(), whole, whole + 4);
  bits_ >>= 32;
  held_ -= 32;
}

void BitWriter::put_unary(std::uint32_t value) {
  for (; value >= 16; value -= 16) put(0xffffU, 16);
  put((1U << value) - 1, static_cast<int>(value) + 1);
}

Bytes BitWriter::finish() {
  for (; held_ > 0; held_ -= 8, bits_ >>= 8) out_.push_back(static_cast<std::uint8_t>(bits_));
  bits_ = 0;
  held_ = 0;
  return std::exchange(out_, {});
}

std::uint32_t BitReader::get(int count) {
  while (held_ < count) {
    std::uint64_t next = 0;
    if (at_ < bytes_.size()) {
      next = bytes_[at_++];
    } else {
      ok_ = false;
    }
    bits_ |= next << held_;
    held_ += 8;
  }
  const auto value = static_cast<std::uint32_t>(bits_ & ((std::uint64_t{1} << count) - 1));
  bits_ >>= count;
  held_ -= count;
  return value;
}

std::uint32_t BitReader::get_unary(std::uint32_t most) {
  std::uint32_t value = 0;
  while (get(1) != 0 && ok_) {
    if (++value > most) {
      ok_ = false;
      return 0;
    }
  }
  return value;
}

Levels levels_of(std::span<const std::uint32_t> counts) {
  std::array<std::uint32_t, kTablesAtOnce * kMostSymbols> all{};
  std::copy(counts.begin(), counts.end(), all.begin());
  std::array<Levels, kTablesAtOnce> out;
  kernels().levels(all.data(), counts.size(), out.data());
  return out.front();
}

std::vector<Levels> levels_of(std::span<const std::uint32_t> counts, std::size_t symbols) {
  const std::size_t tables = counts.size() / symbols;
  std::vector<Levels> out((tables + kTablesAtOnce - 1) / kTablesAtOnce * kTablesAtOnce);
  std::vector<std::uint32_t> all(counts.begin(), counts.end());
  all.resize(out.size() * symbols);
  for (std::size_t t = 0; t < tables; t += kTablesAtOnce)
    kernels().levels(all.data() + t * symbols, symbols, out.data() + t);
  out.resize(tables);
  return out;
}

void write_levels(const Levels& levels, BitWriter& out) {
  int count = kMostSymbols;
  while (count > 0 && levels[static_cast<std::size_t>(count - 1)] == 0) --count;
  out.put(static_cast<std::uint32_t>(count), 7);
  int previous = 0;
  for (int s = 0; s < count; ++s) {
    const int level = levels[static_cast<std::size_t>(s)];
    if (s == 0) {
      out.put(static_cast<std::uint32_t>(level), 5);
    } else {
      const int d = level - previous;
      out.put_unary(static_cast<std::uint32_t>(d >= 0 ? 2 * d : -2 * d - 1));
    }
    previous = level;
  }
}

Levels read_levels(BitReader& in) {
  Levels levels{};
  const auto count = std::min(in.get(7), static_cast<std::uint32_t>(kMostSymbols));
  int level = 0;
  for (std::uint32_t s = 0; s < count && in.ok(); ++s) {
    if (s == 0) {
      level = static_cast<int>(in.get(5));
    } else {
      const auto folded = static_cast<int>(in.get_unary(2 * kLargestLevel));
      level += (folded & 1) != 0 ? -(folded + 1) / 2 : folded / 2;
    }
    levels[s] = static_cast<std::uint8_t>(std::clamp(level, 0, kLargestLevel));
    level = levels[s];
  }
  return levels;
}

std::array<std::uint16_t, kMostSymbols> frequencies_of(const Levels& levels) {
  std::array<std::uint32_t, kMostSymbols> weights{};
  std::uint32_t sum = 0;
  std::size_t used = levels.size();
  while (used > 0 && levels[used - 1] == 0) --used;
  for (std::size_t s = 0; s < used; ++s) {
    if (levels[s] == 0) continue;
    weights[s] = ((levels[s] & 1) != 0 ? 16U : 23U) << ((levels[s] - 1) / 2);
    sum += weights[s];
  }
  std::array<std::uint16_t, kMostSymbols> frequencies{};
  if (sum == 0) return frequencies;
  int left = kScale;
  for (std::size_t s = 0; s < used; ++s) {
    if (weights[s] == 0) continue;
    // 72 weights of at most 2^15 times 2^11 stay below 2^32.
    frequencies[s] = static_cast<std::uint16_t>(std::max(weights[s] * kScale / sum, 1U));
    left -= frequencies[s];
  }
  // What rounding left over or took too much goes to or comes from the most frequent, the first of equals.
  while (left != 0) {
    auto& most =
        *std::max_element(frequencies.begin(), frequencies.begin() + static_cast<std::ptrdiff_t>(used));
    const int change = left > 0 ? left : -std::min(-left, most / 2);
    most = static_cast<std::uint16_t>(most + change);
    left -= change;
  }
  return frequencies;
}

BinaryLevel binary_level_of(std::uint32_t first, std::uint32_t second) {
  BinaryLevel out;
  out.used = first + second > 0;
  out.second_is_rare = second <= first;
  const std::uint32_t rare = std::min(first, second);
  if (rare == 0) return out;
  const double frequency = static_cast<double>(rare) * kScale / (static_cast<double>(first) + second);
  out.level = static_cast<std::uint8_t>(
      std::clamp(1 + static_cast<int>(std::lround(2 * std::log2(std::max(frequency, 1.0)))), 1, 21));
  return out;
}

void write_level(const BinaryLevel& level, BitWriter& out) {
  out.put(level.used ? 1 : 0, 1);
  if (!level.used) return;
  out.put(level.second_is_rare ? 1 : 0, 1);
  out.put(level.level, 5);
}

BinaryLevel read_binary_level(BitReader& in) {
  BinaryLevel out;
  out.used = in.get(1) != 0;
  if (!out.used) return out;
  out.second_is_rare = in.get(1) != 0;
  out.level = static_cast<std::uint8_t>(std::min(in.get(5), 21U));
  return out;
}

std::uint16_t first_frequency(const BinaryLevel& level) {
  if (!level.used) return 0;
  const std::uint32_t rare =
      level.level == 0 ? 0 : (((level.level & 1) != 0 ? 16U : 23U) << ((level.level - 1) / 2)) / 16;
  return static_cast<std::uint16_t>(level.second_is_rare ? kScale - rare : rare);
}

namespace {

// The reciprocal turns division by the frequency into a multiplication (Alverson): exact, since states stay
// below 2^31.
EncoderSymbol encoder_symbol(std::uint32_t start, std::uint32_t f) {
  EncoderSymbol e;
  e.limit = f << (31 - kScaleBits);
  e.complement = static_cast<std::uint16_t>(kScale - f);
  if (f < 2) {
    // x / 1 would need a reciprocal of 2^32: floor(x (2^32 - 1) / 2^32) is x - 1, and the bias mends it.
    e.reciprocal = ~0U;
    e.bias = start + kScale - 1;
  } else {
    const int shift = std::bit_width(f - 1);
    e.reciprocal = static_cast<std::uint32_t>(((std::uint64_t{1} << (shift + 31)) + f - 1) / f);
    e.shift = static_cast<std::uint8_t>(shift - 1);
    e.bias = start;
  }
  e.wide_shift = static_cast<std::uint8_t>(32 + e.shift);
  return e;
}

}  // namespace

void EncoderTables::set(std::size_t table, const Levels& levels) {
  const auto frequencies = frequencies_of(levels);
  EncoderSymbol* symbols = symbols_.data() + table * alphabet_;
  std::uint32_t start = 0;
  for (std::size_t s = 0; s < alphabet_; ++s) {
    if (frequencies[s] == 0) continue;
    symbols[s] = encoder_symbol(start, frequencies[s]);
    start += frequencies[s];
  }
}

void EncoderTables::set(std::size_t table, const BinaryLevel& level) {
  EncoderSymbol* symbols = symbols_.data() + table * alphabet_;
  const std::uint32_t first = first_frequency(level);
  if (first > 0) symbols[0] = encoder_symbol(0, first);
  if (first < kScale) symbols[1] = encoder_symbol(first, kScale - first);
}

bool DecoderTable::set(const Levels& levels) {
  const auto frequencies = frequencies_of(levels);
  std::uint32_t* slot = slots.data();
  for (std::size_t s = 0; s < frequencies.size(); ++s) {
    const std::uint32_t f = frequencies[s];
    const std::uint32_t first = static_cast<std::uint32_t>(s) | f << 8;
    for (std::uint32_t i = 0; i < f; ++i) slot[i] = first | i << 20;
    slot += f;
  }
  usable = slot == slots.data() + slots.size();
  if (!usable) slots.fill(kNoSymbol);
  return usable;
}

void count_codes(std::span<const std::uint16_t> codes, std::span<std::uint32_t> counts) {
  if (codes.empty()) return;
  // In turns, since the same code often comes again before its count is written.
  constexpr std::size_t kTurns = 4;
  std::vector<std::uint32_t> turns(kTurns * counts.size());
  std::size_t i = 0;
  for (; i + kTurns <= codes.size(); i += kTurns)
    for (std::size_t t = 0; t < kTurns; ++t) ++turns[t * counts.size() + codes[i + t]];
  for (; i < codes.size(); ++i) ++turns[codes[i]];
  for (std::size_t t = 0; t < kTurns; ++t)
    for (std::size_t c = 0; c < counts.size(); ++c) counts[c] += turns[t * counts.size() + c];
}

namespace {

/// Behind the last word there is none; what is before the first may be written, see StreamJob.
constexpr std::size_t kSpareWords = 4;

std::uint16_t* end_of_words(const Rows& rows, std::vector<std::uint16_t>& words) {
  // Each symbol writes one word at most.
  if (words.size() < rows.codes.size() + kSpareWords) words.resize(rows.codes.size() + kSpareWords);
  return words.data() + words.size();
}

void append_stream(const StreamJob& job, std::size_t lanes, const std::vector<std::uint16_t>& words,
                   Bytes& out) {
  const auto* states = reinterpret_cast<const std::uint8_t*>(job.states.data());
  out.insert(out.end(), states, states + lanes * sizeof job.states[0]);
  const auto* first = reinterpret_cast<const std::uint8_t*>(job.to);
  out.insert(out.end(), first, reinterpret_cast<const std::uint8_t*>(words.data() + words.size()));
}

constexpr States kFirstStates{kLow, kLow, kLow, kLow};

}  // namespace

void encode(const Stream& lanes, Words& words, Bytes& out) {
  StreamJob job{lanes.rows, lanes.tables.symbols(), end_of_words(lanes.rows, words.lanes), kFirstStates};
  StreamJob single{{}, nullptr, nullptr, kFirstStates};
  kernels().encode(job, single);
  append_stream(job, kLanes, words.lanes, out);
}

std::size_t encode(const Stream& single, const Stream& lanes, Words& words, Bytes& out) {
  StreamJob one{single.rows, single.tables.symbols(), end_of_words(single.rows, words.single), kFirstStates};
  StreamJob several{lanes.rows, lanes.tables.symbols(), end_of_words(lanes.rows, words.lanes), kFirstStates};
  kernels().encode(several, one);
  append_stream(one, 1, words.single, out);
  const std::size_t end = out.size();
  append_stream(several, kLanes, words.lanes, out);
  return end;
}

Decoder::Decoder(std::span<const std::uint8_t> stream, int lanes) : lanes_(lanes) {
  ByteReader reader(stream);
  for (int lane = 0; lane < lanes; ++lane)
    states_[static_cast<std::size_t>(lane)] = reader.read<std::uint32_t>();
  ok_ = reader.ok();
  if (ok_) words_ = stream.subspan(reader.position());
}

void Decoder::row(std::span<const DecoderTable> tables, const std::uint8_t* table, std::size_t count,
                  std::uint8_t* symbols) {
  auto states = states_;
  if (words_.size() - at_ < 2 * count) {
    for (std::size_t i = 0; i < count; ++i) {
      std::uint32_t& x = states[i & static_cast<std::size_t>(lanes_ - 1)];
      const std::uint32_t slot = tables[table[i]].slots[x & (kScale - 1)];
      x = (slot >> 8 & 0xfffU) * (x >> kScaleBits) + (slot >> 20);
      if (x < kLow) x = refill(x);
      symbols[i] = static_cast<std::uint8_t>(slot);
    }
    states_ = states;
    return;
  }
  // Words enough for the row, whatever it holds: nothing to check.
  const std::uint8_t* from = words_.data() + at_;
  const auto step = [&](std::uint32_t & x, std::size_t i) __attribute__((always_inline)) {
    const std::uint32_t slot = tables[table[i]].slots[x & (kScale - 1)];
    x = (slot >> 8 & 0xfffU) * (x >> kScaleBits) + (slot >> 20);
    std::uint16_t word;
    std::memcpy(&word, from, 2);
    const bool low = x < kLow;
    x = low ? x << 16 | word : x;
    from += low ? 2 : 0;
    symbols[i] = static_cast<std::uint8_t>(slot);
  };
  std::size_t i = 0;
  if (lanes_ == kLanes) {
    std::uint32_t a = states[0], b = states[1], c = states[2], d = states[3];
    for (; i + kLanes < count; i += kLanes) {
      step(a, i);
      step(b, i + 1);
      step(c, i + 2);
      step(d, i + 3);
    }
    states = {a, b, c, d};
  }
  for (; i < count; ++i) step(states[i & static_cast<std::size_t>(lanes_ - 1)], i);
  at_ = static_cast<std::size_t>(from - words_.data());
  states_ = states;
}

bool Decoder::finished() const {
  if (!ok_ || at_ != words_.size()) return false;
  for (int lane = 0; lane < lanes_; ++lane)
    if (states_[static_cast<std::size_t>(lane)] != kLow) return false;
  return true;
}

}  // namespace relievo::rans
