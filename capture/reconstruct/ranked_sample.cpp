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

}  // namespace

std::size_t RankedSample::size() const {
  std::size_t out = 0;
  for (const auto& part : parts_) out += part.size();
  return out;
}

float RankedSample::at(std::size_t rank) {
  std::int32_t least = INT32_MAX;
  std::int32_t most = INT32_MIN;
  for (const auto& part : parts_) {
    for (const float value : part) {
      const std::int32_t key = key_of(value);
      least = key < least ? key : least;
      most = key > most ? key : most;
    }
  }
  // Keys grow with the logarithm of values, so that a few that are far off do not crowd the others.
  const std::uint32_t range = static_cast<std::uint32_t>(most) - static_cast<std::uint32_t>(least);
  const int shift =
      std::max(0, static_cast<int>(std::bit_width(range)) - static_cast<int>(std::bit_width(kBuckets - 1)));
  const auto bucket_of = [&](float value) {
    return (static_cast<std::uint32_t>(key_of(value)) - static_cast<std::uint32_t>(least)) >> shift;
  };
  // Four sets of counts, since values next to each other are often alike and one count would wait for itself.
  counts_.assign(4 * kBuckets, 0);
  std::uint32_t* counts = counts_.data();
  for (const auto& part : parts_) {
    std::size_t i = 0;
    for (; i + 4 <= part.size(); i += 4) {
      ++counts[bucket_of(part[i])];
      ++counts[kBuckets + bucket_of(part[i + 1])];
      ++counts[2 * kBuckets + bucket_of(part[i + 2])];
      ++counts[3 * kBuckets + bucket_of(part[i + 3])];
    }
    for (; i < part.size(); ++i) ++counts[bucket_of(part[i])];
  }
  const auto in_bucket = [&](std::uint32_t b) {
    return counts[b] + counts[kBuckets + b] + counts[2 * kBuckets + b] + counts[3 * kBuckets + b];
  };
  std::uint32_t wanted = 0;
  for (std::uint32_t here = in_bucket(0); rank >= here; here = in_bucket(++wanted)) rank -= here;
  bucket_.resize(size() + 1);
  std::size_t n = 0;
  for (const auto& part : parts_) {
    for (const float value : part) {
      bucket_[n] = value;
      n += bucket_of(value) == wanted;
    }
  }
  bucket_.resize(n);
  const auto at_rank = bucket_.begin() + static_cast<std::ptrdiff_t>(rank);
  std::nth_element(bucket_.begin(), at_rank, bucket_.end());
  return *at_rank;
}

}  // namespace relievo
