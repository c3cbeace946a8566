// SPDX-License-Identifier: Apache-2.0
#include "base/lateness.h"

#include <algorithm>

namespace relievo {

std::int64_t Lateness::add(std::int64_t now_ns, std::int64_t way_ns) {
  if (shortest_ns_ == kNone || now_ns - since_ns_ >= kRemembered_ns) {
    before_ns_ = shortest_ns_;
    shortest_ns_ = kNone;
    since_ns_ = now_ns;
  }
  shortest_ns_ = std::min(shortest_ns_, way_ns);
  std::int64_t waited_ns = 0;
  // A hostile peer's stamps may be anything.
  if (__builtin_sub_overflow(way_ns, std::min(shortest_ns_, before_ns_), &waited_ns)) return 0;
  return waited_ns;
}

}  // namespace relievo
