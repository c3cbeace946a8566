// SPDX-License-Identifier: Apache-2.0
// Times by how long they are, as Prometheus wants them. Plain data.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>

namespace relievo {

struct Histogram {
  static constexpr std::array kBounds_s{0.001, 0.002, 0.005, 0.01, 0.02, 0.03, 0.04,
                                        0.06,  0.1,   0.2,   0.5,  1.0,  2.0,  5.0};
  std::array<std::uint64_t, kBounds_s.size() + 1>
      counts{};  // up to each bound and above the one before; the rest
  double sum_s = 0;

  /// Below 0, as where clocks differ, counts as 0.
  void add(double time_s) {
    const double positive_s = time_s > 0 ? time_s : 0;
    std::size_t i = 0;
    while (i < kBounds_s.size() && positive_s > kBounds_s[i]) ++i;
    ++counts[i];
    sum_s += positive_s;
  }
  /// What was added to `before` to make this; nothing where that cannot have been.
  std::optional<Histogram> since(const Histogram& before) const {
    Histogram out;
    for (std::size_t i = 0; i < counts.size(); ++i) {
      if (counts[i] < before.counts[i]) return {};
      out.counts[i] = counts[i] - before.counts[i];
    }
    if (!(sum_s >= before.sum_s)) return {};
    out.sum_s = sum_s - before.sum_s;
    return out;
  }
  Histogram& operator+=(const Histogram& more) {
    for (std::size_t i = 0; i < counts.size(); ++i) counts[i] += more.counts[i];
    sum_s += more.sum_s;
    return *this;
  }
};

}  // namespace relievo
