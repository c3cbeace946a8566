// SPDX-License-Identifier: Apache-2.0
#include "base/clock_offset.h"

#include <algorithm>

namespace relievo {

void ClockEstimate::add(const ClockExchange& e) {
  // Differences of each clock by itself first: stamps of a hostile peer may be anything.
  std::int64_t there_ns = 0, here_ns = 0, out_ns = 0, back_ns = 0, sum_ns = 0;
  const bool overflow = __builtin_sub_overflow(e.answered_ns, e.heard_ns, &there_ns) ||
                        __builtin_sub_overflow(e.returned_ns, e.asked_ns, &here_ns) ||
                        __builtin_sub_overflow(e.heard_ns, e.asked_ns, &out_ns) ||
                        __builtin_sub_overflow(e.answered_ns, e.returned_ns, &back_ns) ||
                        __builtin_add_overflow(out_ns, back_ns, &sum_ns);
  if (overflow || there_ns < 0 || here_ns < there_ns) return;
  last_[count_++ % kExchanges] = {.offset_ns = sum_ns / 2, .delay_ns = here_ns - there_ns};
}

std::optional<ClockOffset> ClockEstimate::best() const {
  if (count_ == 0) return std::nullopt;
  const auto end = last_.begin() + static_cast<std::ptrdiff_t>(std::min(count_, kExchanges));
  return *std::min_element(last_.begin(), end,
                           [](const auto& a, const auto& b) { return a.delay_ns < b.delay_ns; });
}

}  // namespace relievo
