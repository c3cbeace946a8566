// SPDX-License-Identifier: Apache-2.0
#include "capture/reconstruct/ranked_sample.h"

#include <algorithm>
#include <bit>

namespace relievo {
namespace {

constexpr std::uint32_t kBuckets = 1024;

/// Whole numbers in the order of the values.
std::int32_t key_of(float value) {
  const auto bits = std::bit_cast<std::int32_t>(value);
  return bits ^ ((bits >> 31) & 0x7fffffff);
}

float value_of(std::int32_t key) {
  return std::bit_cast<float>(key ^ ((key >> 31) & 0x7fffffff));
}

}  // namespace

std::size_t RankedSample::size() const {
  std::size_t out = 0;
  for (const auto& part : parts_) out += part.size();
  return out;
}

float RankedSample::at(std::size_t rank) {
  keys_.resize(size());
  std::int32_t least = INT32_MAX;
  std::int32_t most = INT32_MIN;
  std::int32_t* to = keys_.data();
  for (const auto& part : parts_) {
    const float* from = part.data();
    const std::size_t count = part.size();
    for (std::size_t i = 0; i < count; ++i) {
      const std::int32_t key = key_of(from[i]);
      to[i] = key;
      least = key < least ? key : least;
      most = key > most ? key : most;
    }
    to += count;
  }
  // Keys grow with the logarithm of values, so that a few that are far off do not crowd the others.
  const std::uint32_t range = static_cast<std::uint32_t>(most) - static_cast<std::uint32_t>(least);
  const int shift =
      std::max(0, static_cast<int>(std::bit_width(range)) - static_cast<int>(std::bit_width(kBuckets - 1)));
  const std::size_t count = keys_.size();
  bucket_of_.resize(count);
  for (std::size_t i = 0; i < count; ++i) {
    bucket_of_[i] = static_cast<std::uint16_t>(
        (static_cast<std::uint32_t>(keys_[i]) - static_cast<std::uint32_t>(least)) >> shift);
  }
  // Two sets of counts, since values next to each other are often alike and one count would wait for itself.
  counts_.assign(2 * kBuckets, 0);
  std::uint32_t* counts = counts_.data();
  const std::uint16_t* bucket_of = bucket_of_.data();
  for (std::size_t i = 0; i + 1 < count; i += 2) {
    ++counts[bucket_of[i]];
    ++counts[kBuckets + bucket_of[i + 1]];
  }
  if (count % 2 != 0) ++counts[bucket_of[count - 1]];
  std::uint32_t wanted = 0;
  for (std::uint32_t here = counts[0] + counts[kBuckets]; rank >= here;
       here = counts[wanted] + counts[kBuckets + wanted]) {
    rank -= here;
    ++wanted;
  }
  // The wanted bucket's keys move to the front.
  std::size_t n = 0;
  for (std::size_t i = 0; i < count; ++i) {
    keys_[n] = keys_[i];
    n += bucket_of[i] == wanted;
  }
  const auto at_rank = keys_.begin() + static_cast<std::ptrdiff_t>(rank);
  std::nth_element(keys_.begin(), at_rank, keys_.begin() + static_cast<std::ptrdiff_t>(n));
  return value_of(*at_rank);
}

}  // namespace relievo
