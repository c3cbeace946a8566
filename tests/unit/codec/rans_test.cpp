// SPDX-License-Identifier: Apache-2.0
// Entropy coding: whatever goes in comes out, for likely, unlikely and lone symbols; damage is noticed.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numeric>
#include <optional>
#include <vector>

#include "codec/rans.h"
#include "codec/rans_kernels.h"
#include "tests/support/make_surface.h"

namespace relievo::rans {
namespace {

TEST(Rans, FrequenciesAddUpWhateverTheLevels) {
  test::Random random(1);
  for (int round = 0; round < 300; ++round) {
    Levels levels{};
    const std::uint32_t used = 1 + random.below(kMostSymbols);
    for (std::uint32_t s = 0; s < used; ++s)
      levels[s] = static_cast<std::uint8_t>(random.below(kLargestLevel + 1));
    levels[random.below(used)] = static_cast<std::uint8_t>(1 + random.below(kLargestLevel));
    BitWriter out;
    write_levels(levels, out);
    const Bytes bytes = out.finish();
    BitReader in(bytes);
    ASSERT_EQ(read_levels(in), levels);
    ASSERT_TRUE(in.ok());
    const auto f = frequencies_of(levels);
    ASSERT_EQ(std::accumulate(f.begin(), f.end(), 0U), kScale);
    for (std::size_t s = 0; s < f.size(); ++s) ASSERT_EQ(f[s] > 0, levels[s] > 0);
  }
}

TEST(Rans, SymbolsComeBackFromAnyTables) {
  test::Random random(2);
  Words words;
  for (int round = 0; round < 60; ++round) {
    const int lanes = round % 2 == 0 ? 1 : kLanes;
    EncoderTables encoders(3);
    std::vector<DecoderTable> decoders(3);
    std::vector<std::vector<std::uint8_t>> alphabets(3);
    for (std::size_t t = 0; t < 3; ++t) {
      std::vector<std::uint32_t> counts(kMostSymbols);
      const std::uint32_t kinds = 1 + random.below(t == 0 ? 1 : kMostSymbols);
      for (std::uint32_t i = 0; i < kinds; ++i) {
        const std::uint32_t s = random.below(kMostSymbols);
        counts[s] += 1 + random.below(1U << random.below(16));
        alphabets[t].push_back(static_cast<std::uint8_t>(s));
      }
      encoders.set(t, levels_of(counts));
      ASSERT_TRUE(decoders[t].set(levels_of(counts)));
    }
    std::vector<std::uint16_t> codes;
    std::vector<std::uint32_t> starts;
    std::vector<std::uint8_t> tables, symbols;
    for (std::uint32_t r = 0; r < 20; ++r) {
      starts.push_back(static_cast<std::uint32_t>(symbols.size()));
      for (std::uint32_t i = random.below(40); i > 0; --i) {
        const std::uint32_t t = random.below(3);
        tables.push_back(static_cast<std::uint8_t>(t));
        symbols.push_back(alphabets[t][random.below(static_cast<std::uint32_t>(alphabets[t].size()))]);
        codes.push_back(code_of(tables.back(), symbols.back()));
      }
    }
    Bytes bytes;
    const Rows rows{codes, starts}, none;
    if (lanes == kLanes) {
      encode({rows, encoders}, words, bytes);
    } else {
      bytes.resize(encode({rows, encoders}, {none, encoders}, words, bytes));
    }
    Decoder decoder(bytes, lanes);
    std::vector<std::uint8_t> got(symbols.size() + 1);
    for (std::size_t r = 0; r < rows.starts.size(); ++r) {
      const std::size_t start = rows.starts[r];
      const std::size_t end = r + 1 < rows.starts.size() ? rows.starts[r + 1] : symbols.size();
      decoder.row(decoders, tables.data() + start, end - start, got.data() + start);
    }
    got.pop_back();
    ASSERT_EQ(got, symbols);
    EXPECT_TRUE(decoder.finished());
    if (bytes.size() > 4U * static_cast<unsigned>(lanes)) {
      bytes.pop_back();
      Decoder cut(bytes, lanes);
      for (std::size_t r = 0; r < rows.starts.size(); ++r) {
        const std::size_t start = rows.starts[r];
        const std::size_t end = r + 1 < rows.starts.size() ? rows.starts[r + 1] : symbols.size();
        cut.row(decoders, tables.data() + start, end - start, got.data());
      }
      EXPECT_FALSE(cut.finished());
    }
  }
}

/// Bits of `counts` symbols coded with `levels`, and of the levels.
double bits_of(const std::vector<std::uint32_t>& counts, const Levels& levels) {
  BitWriter table;
  write_levels(levels, table);
  double bits = 8 * static_cast<double>(table.finish().size());
  const auto frequencies = frequencies_of(levels);
  for (std::size_t s = 0; s < counts.size(); ++s)
    if (counts[s] > 0) bits += counts[s] * std::log2(kScale / static_cast<double>(frequencies[s]));
  return bits;
}

TEST(Rans, LevelsCostLessWithTheirSymbolsThanNeighboursOfThem) {
  test::Random random(9);
  for (int round = 0; round < 40; ++round) {
    // Falling counts with gaps at their end, as residuals have.
    std::vector<std::uint32_t> counts(kMostSymbols);
    const double first = std::exp2(2 + random.below(11)), fall = 0.4 + 0.55 * random.unit();
    for (std::size_t s = 0; s < counts.size(); ++s) {
      const double mean = first * std::pow(fall, static_cast<double>(s));
      counts[s] = static_cast<std::uint32_t>(mean * (0.7 + 0.6 * random.unit()) + random.unit() * 0.9);
    }
    if (round == 0) counts.assign(counts.size(), 0);
    if (round == 1) counts.assign(counts.size(), 0), counts[50] = 7;
    const Levels levels = levels_of(counts);
    std::uint32_t total = 0;
    for (std::size_t s = 0; s < counts.size(); ++s) {
      total += counts[s];
      ASSERT_TRUE(counts[s] == 0 || levels[s] > 0) << s;
    }
    if (total == 0) {
      EXPECT_EQ(levels, Levels{});
      continue;
    }
    // Those that fit the counts best, without a look at what they take themselves.
    Levels fitting{};
    for (std::size_t s = 0; s < counts.size(); ++s)
      if (counts[s] > 0)
        fitting[s] = static_cast<std::uint8_t>(std::clamp(
            1 + std::lround(2 * std::log2(std::max(1.0, counts[s] * static_cast<double>(kScale) / total))),
            1L, static_cast<long>(kLargestLevel)));
    const double bits = bits_of(counts, levels);
    EXPECT_LE(bits, 1.001 * bits_of(counts, fitting) + 8) << "and a byte of rounding";
    for (std::size_t s = 0; s < counts.size(); ++s) {
      Levels other = levels;
      if (other[s] == 0 || other[s] == kLargestLevel) continue;
      ++other[s];
      EXPECT_LE(bits, 1.005 * bits_of(counts, other) + 8) << s;
    }
  }
}

TEST(Rans, AlphabetsOfTwoKeepTheirOdds) {
  test::Random random(3);
  for (const auto& [first, second] : std::vector<std::pair<std::uint32_t, std::uint32_t>>{
           {5, 0}, {0, 5}, {1, 1}, {1000, 1}, {1, 4000}, {300, 500}}) {
    const BinaryLevel level = binary_level_of(first, second);
    BitWriter out;
    write_level(level, out);
    const Bytes told = out.finish();
    BitReader in(told);
    ASSERT_EQ(first_frequency(read_binary_level(in)), first_frequency(level));
    EncoderTables table(1);
    table.set(0, level);
    std::vector<std::uint8_t> symbols;
    std::vector<std::uint16_t> codes;
    for (std::uint32_t i = 0; i < first + second; ++i) {
      symbols.push_back(i % 2 == 0 ? (i / 2 < second) : (second > first ? i / 2 < second : 0));
    }
    for (std::uint8_t& s : symbols) {
      s = second == 0 ? 0 : first == 0 ? 1 : s;
      codes.push_back(code_of(0, s));
    }
    Bytes bytes;
    Words words;
    const std::vector<std::uint32_t> starts{0};
    bytes.resize(encode({{codes, starts}, table}, {{}, table}, words, bytes));
    Decoder decoder(bytes, 1);
    for (const std::uint8_t s : symbols) ASSERT_EQ(decoder.one(first_frequency(level)), s != 0);
    EXPECT_TRUE(decoder.finished());
  }
  EXPECT_FALSE(binary_level_of(0, 0).used);
}

TEST(Rans, CodesAreCounted) {
  test::Random random(4);
  std::vector<std::uint16_t> codes;
  std::vector<std::uint32_t> expected(2 * kMostSymbols), counts(2 * kMostSymbols);
  expected[0] = counts[0] = 7;  // they are added
  for (int i = 0; i < 1003; ++i) {
    codes.push_back(code_of(static_cast<int>(random.below(2)), static_cast<int>(random.below(kMostSymbols))));
    ++expected[codes.back()];
  }
  count_codes(codes, counts);
  EXPECT_EQ(counts, expected);
}

/// Counts as residuals have them, or any.
std::vector<std::uint32_t> some_counts(test::Random& random, std::size_t symbols) {
  std::vector<std::uint32_t> counts(symbols);
  const double first = std::exp2(random.below(14)), fall = 0.3 + 0.7 * random.unit();
  for (std::size_t s = 0; s < symbols; ++s)
    counts[s] =
        static_cast<std::uint32_t>(first * std::pow(fall, static_cast<double>(s)) + random.unit() * 0.9);
  return counts;
}

TEST(Rans, LevelsOfAllKernelsAgreeTableByTable) {
  test::Random random(11);
  for (int round = 0; round < 60; ++round) {
    const std::size_t symbols = round % 3 == 0 ? 8 : kMostSymbols;
    std::vector<std::uint32_t> counts;
    for (std::size_t t = 0; t < kTablesAtOnce; ++t) {
      const auto some =
          random.below(5) == 0 ? std::vector<std::uint32_t>(symbols) : some_counts(random, symbols);
      counts.insert(counts.end(), some.begin(), some.end());
    }
    std::array<Levels, kTablesAtOnce> reference, out;
    all_kernels().front().levels(counts.data(), symbols, reference.data());
    for (const Kernels& kernels : all_kernels()) {
      kernels.levels(counts.data(), symbols, out.data());
      ASSERT_EQ(out, reference) << kernels.name;
    }
    const auto all = levels_of(counts, symbols);
    for (std::size_t t = 0; t < kTablesAtOnce; ++t) {
      ASSERT_EQ(all[t], reference[t]);
      ASSERT_EQ(levels_of(std::span(counts).subspan(t * symbols, symbols)), reference[t]) << t;
    }
  }
}

/// So many symbols that their bits fit no 32: the same odds, the same levels.
TEST(Rans, LevelsOfVeryManySymbolsAreThoseOfFewer) {
  std::vector<std::uint32_t> counts{3'000'000, 1'500'000, 700'000, 90'000, 8'000, 512};
  const Levels levels = levels_of(counts);
  for (std::uint32_t& count : counts) count *= 256;
  EXPECT_EQ(levels_of(counts), levels);
  counts.push_back(1);
  EXPECT_EQ(levels_of(counts).at(6), 1) << "the rarest, but it comes";
}

/// Streams of any lengths, the single one's the longer or the shorter; symbols so rare that most fill the
/// state and so common that none does.
TEST(Rans, StreamsOfAllKernelsAgree) {
  test::Random random(12);
  for (int round = 0; round < 200; ++round) {
    EncoderTables tables(2);
    const auto counts = some_counts(random, kMostSymbols);
    std::vector<std::uint8_t> alphabet;
    for (std::size_t s = 0; s < counts.size(); ++s)
      if (counts[s] > 0) alphabet.push_back(static_cast<std::uint8_t>(s));
    if (alphabet.empty()) continue;
    tables.set(0, levels_of(counts));
    tables.set(1, BinaryLevel{true, true, static_cast<std::uint8_t>(1 + random.below(20))});
    const auto fill = [&](std::uint32_t rows, bool binary) {
      std::pair<std::vector<std::uint16_t>, std::vector<std::uint32_t>> out;
      auto& [codes, starts] = out;
      for (std::uint32_t r = 0; r < rows; ++r) {
        starts.push_back(static_cast<std::uint32_t>(codes.size()));
        for (std::uint32_t i = random.below(50); i > 0; --i)
          codes.push_back(
              binary ? code_of(1, random.below(9) == 0)
                     : code_of(0, alphabet[random.below(static_cast<std::uint32_t>(alphabet.size()))]));
      }
      return out;
    };
    const auto [lane_codes, lane_starts] = fill(random.below(20), false);
    const auto [single_codes, single_starts] = fill(random.below(40), true);
    const Rows lanes{lane_codes, lane_starts}, single{single_codes, single_starts};
    std::optional<std::pair<std::vector<std::uint16_t>, std::array<States, 2>>> reference;
    for (const Kernels& kernels : all_kernels()) {
      std::vector<std::uint16_t> a(lanes.codes.size() + 4), b(single.codes.size() + 4);
      const States first{kLow, kLow, kLow, kLow};
      StreamJob of_lanes{lanes, tables.symbols(), a.data() + a.size(), first};
      StreamJob of_single{single, tables.symbols(), b.data() + b.size(), first};
      kernels.encode(of_lanes, of_single);
      std::pair out{std::vector<std::uint16_t>(of_lanes.to, a.data() + a.size()),
                    std::array{of_lanes.states, of_single.states}};
      out.first.insert(out.first.end(), of_single.to, b.data() + b.size());
      if (!reference) reference = out;
      ASSERT_EQ(out, *reference) << kernels.name << ", round " << round;
    }
  }
}

}  // namespace
}  // namespace relievo::rans
