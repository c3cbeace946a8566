// SPDX-License-Identifier: Apache-2.0
#include "codec/message_cdr.h"

#include <algorithm>

#include "base/time.h"

namespace relievo {

void MessageCdr::text(std::string_view text) {
  put(static_cast<std::uint32_t>(text.size() + 1));
  bytes_.insert(bytes_.end(), text.begin(), text.end());
  bytes_.push_back(0);
}

void MessageCdr::octets(std::span<const std::uint8_t> octets) {
  put(static_cast<std::uint32_t>(octets.size()));
  append_bytes(bytes_, octets);
}

void MessageCdr::time(std::int64_t ns) {
  ns = std::max<std::int64_t>(ns, 0);
  put(static_cast<std::uint32_t>(ns / kNanosecondsPerSecond));
  put(static_cast<std::uint32_t>(ns % kNanosecondsPerSecond));
}

}  // namespace relievo
