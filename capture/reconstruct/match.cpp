// SPDX-License-Identifier: Apache-2.0
#include "capture/reconstruct/match.h"

#include <algorithm>
#include <cmath>

namespace relievo {
namespace {

constexpr int kReach = 3;  // 7 x 7 neighbourhood

}  // namespace

TransitionTable::TransitionTable(const Pattern& pattern) : slides_(pattern.slides), table_(64 * 64, -1) {
  for (int i = 0; i < pattern.boundaries(); ++i) {
    const std::size_t first = index(pattern.colour(i, 0), pattern.colour(i + 1, 0));
    const std::size_t second = slides_ == 2 ? index(pattern.colour(i, 1), pattern.colour(i + 1, 1)) : 0;
    table_[first * 64 + second] = static_cast<std::int16_t>(i);
  }
}

void match_boundaries(const Detection& newer, const Detection& older, SlideOrder order,
                      const TransitionTable& table, Match& out) {
  out.boundary.assign(newer.boundaries.size(), -1);
  out.valid = 0;
  const auto decode = [&](const Boundary& p, const Boundary& q) {
    return order == SlideOrder::kNewerIsFirst ? table.boundary(p.left, p.right, q.left, q.right)
                                              : table.boundary(q.left, q.right, p.left, p.right);
  };
  for (int line = 0; line < newer.lines; ++line) {
    const std::uint32_t begin = newer.line_start[static_cast<std::size_t>(line)];
    const std::uint32_t end = newer.line_start[static_cast<std::size_t>(line) + 1];
    // First boundary of each neighbouring line that the current one can reach; it only moves right.
    std::uint32_t cursor[2 * kReach + 1];
    for (int d = -kReach; d <= kReach; ++d) {
      const int other = std::clamp(line + d, 0, older.lines - 1);
      cursor[d + kReach] = older.line_start[static_cast<std::size_t>(other)];
    }
    for (std::uint32_t i = begin; i < end; ++i) {
      const Boundary& p = newer.boundaries[i];
      float best = 1e9F;
      for (int d = -kReach; d <= kReach; ++d) {
        const int other = line + d;
        if (other < 0 || other >= older.lines) continue;
        const std::uint32_t stop = older.line_start[static_cast<std::size_t>(other) + 1];
        std::uint32_t& first = cursor[d + kReach];
        while (first < stop && older.boundaries[first].column_px < p.column_px - kReach) ++first;
        for (std::uint32_t k = first; k < stop && older.boundaries[k].column_px <= p.column_px + kReach;
             ++k) {
          const Boundary& q = older.boundaries[k];
          const float dx = q.column_px - p.column_px;
          const float distance = dx * dx + static_cast<float>(d * d);
          if (distance >= best) continue;
          const int code = decode(p, q);
          if (code < 0) continue;
          best = distance;
          out.boundary[i] = static_cast<std::int16_t>(code);
        }
      }
      out.valid += out.boundary[i] >= 0;
    }
  }
}

void decode_single_slide(const Detection& frame, const TransitionTable& table, Match& out) {
  out.boundary.clear();
  out.valid = 0;
  for (const Boundary& p : frame.boundaries) {
    out.boundary.push_back(static_cast<std::int16_t>(table.boundary(p.left, p.right, 0, 0)));
    out.valid += out.boundary.back() >= 0;
  }
}

}  // namespace relievo
