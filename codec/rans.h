// SPDX-License-Identifier: Apache-2.0
// Entropy coding of the stripe grid: asymmetric numeral systems (rANS) over small static alphabets whose
// frequencies are told in half octaves (codec/FORMAT.md, "Symbols"). States are 31 bits wide, words 16.
#pragma once

#include <array>
#include <cstdint>
#include <cstring>
#include <span>
#include <vector>

#include "base/stream.h"

namespace relievo::rans {

inline constexpr int kScaleBits = 11;
inline constexpr std::uint32_t kScale = 1U << kScaleBits;
inline constexpr std::uint32_t kLow = 1U << 15;  // states are kLow .. 2^31 - 1
inline constexpr int kLanes = 4;                 // states that take turns along a row
inline constexpr int kMostSymbols = 72;          // of an alphabet
inline constexpr int kLargestLevel = 23;

/// Least significant bit first.
class BitWriter {
 public:
  /// `count` at most 32.
  void put(std::uint32_t value, int count);
  void put_unary(std::uint32_t value);  // that many ones, then a zero
  /// Zero bits fill the last byte. The writer is empty again.
  Bytes finish();

 private:
  Bytes out_;
  std::uint64_t bits_ = 0;
  int held_ = 0;
};

/// Of any bytes: behind their end it reads zeros and is no longer ok().
class BitReader {
 public:
  explicit BitReader(std::span<const std::uint8_t> bytes) : bytes_(bytes) {}
  std::uint32_t get(int count);                 // at most 32
  std::uint32_t get_unary(std::uint32_t most);  // not ok() above `most`
  bool ok() const { return ok_; }
  /// The bytes begun so far.
  std::size_t position() const { return at_; }

 private:
  std::span<const std::uint8_t> bytes_;
  std::size_t at_ = 0;
  std::uint64_t bits_ = 0;
  int held_ = 0;
  bool ok_ = true;
};

/// How often each symbol of an alphabet comes, in half octaves; 0: never.
using Levels = std::array<std::uint8_t, kMostSymbols>;

/// Levels of counted symbols; of several tables with so many symbols each.
Levels levels_of(std::span<const std::uint32_t> counts);
std::vector<Levels> levels_of(std::span<const std::uint32_t> counts, std::size_t symbols);
void write_levels(const Levels& levels, BitWriter& out);
/// Check the reader's ok().
Levels read_levels(BitReader& in);
/// Frequencies with the sum kScale; all 0 where no symbol has a level.
std::array<std::uint16_t, kMostSymbols> frequencies_of(const Levels& levels);

/// Of an alphabet of two: how often the second symbol comes, in half octaves of the rarer of the two.
struct BinaryLevel {
  bool used = false;
  bool second_is_rare = true;
  std::uint8_t level = 0;  // 0: the rarer one never comes
};
BinaryLevel binary_level_of(std::uint32_t first, std::uint32_t second);
void write_level(const BinaryLevel& level, BitWriter& out);
BinaryLevel read_binary_level(BitReader& in);
/// Of the first symbol, of kScale; 0 where the alphabet is not used.
std::uint16_t first_frequency(const BinaryLevel& level);

/// One symbol as an encoder needs it; see put() in rans_kernels.cpp.
struct EncoderSymbol {
  std::uint32_t limit = 0;
  std::uint32_t reciprocal = 0, bias = 0;
  std::uint16_t complement = 0;
  std::uint8_t wide_shift = 32, shift = 0;  // of the whole product with the reciprocal, and of its upper half
};

/// All tables of a stream, with alphabets of up to so many symbols. A symbol of a table is one number, its
/// code: see code_of().
class EncoderTables {
 public:
  explicit EncoderTables(std::size_t tables, std::size_t alphabet = kMostSymbols)
      : alphabet_(alphabet), symbols_(tables * alphabet) {}
  void set(std::size_t table, const Levels& levels);
  void set(std::size_t table, const BinaryLevel& level);
  const EncoderSymbol* symbols() const { return symbols_.data(); }

 private:
  std::size_t alphabet_;
  std::vector<EncoderSymbol> symbols_;
};

inline std::uint16_t code_of(int table, int symbol, int alphabet = kMostSymbols) {
  return static_cast<std::uint16_t>(table * alphabet + symbol);
}

/// What rows decode to where their table is not usable.
inline constexpr std::uint8_t kNoSymbol = 255;

struct DecoderTable {
  /// False where no symbol has a level: it decodes to kNoSymbol.
  bool set(const Levels& levels);
  bool usable = false;
  // Low to high: 8 bits of symbol, 12 of its frequency, 12 of the place among the symbol's own.
  std::array<std::uint32_t, kScale> slots;
};

/// Rows of symbols' codes, which whoever made them keeps. The lanes take turns from a row's first symbol on.
struct Rows {
  std::span<const std::uint16_t> codes;
  std::span<const std::uint32_t> starts;  // of each row, rising
};

/// Adds to `counts`, one for each code.
void count_codes(std::span<const std::uint16_t> codes, std::span<std::uint32_t> counts);

struct Stream {
  Rows rows;
  const EncoderTables& tables;
};

/// Scratch memory of encode().
struct Words {
  std::vector<std::uint16_t> single, lanes;
};

/// Appends the coded rows of kLanes.
void encode(const Stream& lanes, Words& words, Bytes& out);
/// Appends a stream of one lane, whose rows mean nothing, and behind it one of kLanes: quicker than one after
/// the other. Where in `out` the second one begins.
std::size_t encode(const Stream& single, const Stream& lanes, Words& words, Bytes& out);

/// Any bytes: behind their end zeros are read, and finished() is false.
class Decoder {
 public:
  /// The stream must outlive the decoder.
  Decoder(std::span<const std::uint8_t> stream, int lanes);

  /// One row of `count` symbols.
  void row(std::span<const DecoderTable> tables, const std::uint8_t* table, std::size_t count,
           std::uint8_t* symbols);
  /// The next symbol of a stream with one lane. Inline, as is the next one, so that whoever reads many from a
  /// copy of the decoder keeps its state in registers: each symbol waits for the one before.
  std::uint8_t one(const DecoderTable& table) {
    std::uint32_t& x = states_[0];
    const std::uint32_t slot = table.slots[x & (kScale - 1)];
    x = (slot >> 8 & 0xfffU) * (x >> kScaleBits) + (slot >> 20);
    if (x < kLow) x = refill(x);
    return static_cast<std::uint8_t>(slot);
  }
  /// The same of an alphabet of two.
  bool one(std::uint16_t first_frequency) {
    std::uint32_t& x = states_[0];
    const std::uint32_t slot = x & (kScale - 1);
    const bool second = slot >= first_frequency;
    const std::uint32_t f = second ? kScale - first_frequency : first_frequency;
    x = f * (x >> kScaleBits) + slot - (second ? first_frequency : 0U);
    if (x < kLow) x = refill(x);
    return second;
  }
  /// All was read, and read rightly: the states are back where the encoder began.
  bool finished() const;

 private:
  std::uint32_t refill(std::uint32_t state) {
    std::uint16_t word = 0;
    if (words_.size() - at_ >= 2) {
      std::memcpy(&word, words_.data() + at_, 2);
      at_ += 2;
    } else {
      ok_ = false;
    }
    return state << 16 | word;
  }
  std::span<const std::uint8_t> words_;
  std::size_t at_ = 0;
  bool ok_ = true;
  int lanes_;
  std::array<std::uint32_t, kLanes> states_{};
};

}  // namespace relievo::rans
