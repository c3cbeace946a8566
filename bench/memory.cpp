// SPDX-License-Identifier: Apache-2.0
#include "bench/memory.h"

#include <unistd.h>

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>

#include "base/parallel.h"
#include "base/time.h"

namespace relievo::bench {
namespace {

constexpr int kReadings = 7;
constexpr int kChunk = 1 << 20;  // bytes

std::size_t buffer_bytes() {
  const auto read = [](int name) { return static_cast<std::size_t>(std::max(0L, sysconf(name))); };
  const std::size_t cache = read(_SC_LEVEL3_CACHE_SIZE);
  const std::size_t free = read(_SC_AVPHYS_PAGES) * read(_SC_PAGESIZE);
  const std::size_t wanted = std::max<std::size_t>(cache + cache / 2, 64U << 20);
  return std::max<std::size_t>(std::min(wanted, free / 4), kChunk) / kChunk * kChunk;
}

/// Eight sums, so that no addition waits for the one before it.
std::uint64_t sum(const std::uint64_t* words, std::size_t count) {
  std::array<std::uint64_t, 8> sums{};
  for (std::size_t i = 0; i + 8 <= count; i += 8)
    for (std::size_t k = 0; k < 8; ++k) sums[k] += words[i + k];
  std::uint64_t total = 0;
  for (const std::uint64_t s : sums) total += s;
  return total;
}

}  // namespace

Spread measure_read_bandwidth(int threads) {
  const std::size_t bytes = buffer_bytes();
  std::vector<std::uint64_t> buffer(bytes / sizeof(std::uint64_t));
  // Pages of zeros would all be one page: write them.
  for (std::size_t i = 0; i < buffer.size(); ++i) buffer[i] = i;
  WorkerPool pool(threads);
  std::vector<std::uint64_t> sums(static_cast<std::size_t>(pool.workers()));
  std::vector<double> rates;
  volatile std::uint64_t kept = 0;  // so that nothing is optimised away
  const int chunks = static_cast<int>(bytes / kChunk);
  constexpr std::size_t kWords = kChunk / sizeof(std::uint64_t);
  for (int reading = 0; reading < kReadings; ++reading) {
    const std::int64_t begin = steady_now_ns();
    pool.for_ranges(chunks, [&](int first, int last, int worker) {
      sums[static_cast<std::size_t>(worker)] += sum(buffer.data() + static_cast<std::size_t>(first) * kWords,
                                                    static_cast<std::size_t>(last - first) * kWords);
    });
    const double elapsed_s = seconds(steady_now_ns() - begin);
    for (const std::uint64_t s : sums) kept = kept + s;
    rates.push_back(static_cast<double>(bytes) / elapsed_s);
  }
  return spread_of(std::move(rates));
}

}  // namespace relievo::bench
