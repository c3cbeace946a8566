// SPDX-License-Identifier: Apache-2.0
#include "idl/asked_frames.h"

#include <algorithm>

namespace relievo {

namespace {
constexpr std::size_t kMostReaders = 256;  // what a hostile peer can make us remember
}  // namespace

void AskedFrames::ask(std::uint64_t who, std::int64_t now_ns) {
  if (readers_.size() < kMostReaders || readers_.contains(who))
    readers_[who] = {.asked_ns = now_ns, .waits = true};
}

bool AskedFrames::due(std::int64_t now_ns) {
  std::erase_if(readers_, [&](const auto& entry) {
    return !entry.second.waits && now_ns - entry.second.asked_ns > kPatience_ns;
  });
  const bool all_wait =
      std::all_of(readers_.begin(), readers_.end(), [](const auto& entry) { return entry.second.waits; });
  return joined_ || (!readers_.empty() && all_wait);
}

void AskedFrames::sent() {
  joined_ = false;
  for (auto& [who, reader] : readers_) reader.waits = false;
}

}  // namespace relievo
