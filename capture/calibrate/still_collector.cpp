// SPDX-License-Identifier: Apache-2.0
#include "capture/calibrate/still_collector.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <utility>

#include "capture/calibrate/stripe_stack.h"

namespace relievo {
namespace {

constexpr int kBlock = 4;
constexpr double kMovedShare = 0.002;  // of the blocks that differ
// Grey levels by which a block differs: above six sigmas of the noise, within limits. A third of a pixel of
// motion changes a block on a stripe's edge by some 5.
constexpr float kLeastLevels = 3, kMostLevels = 8;

void add_blocks(const View8& field, std::vector<float>& out) {
  for (int y = 0; y + kBlock <= field.height; y += kBlock) {
    for (int x = 0; x + kBlock <= field.width; x += kBlock) {
      int sum[3] = {};
      for (int dy = 0; dy < kBlock; ++dy) {
        const std::uint8_t* p = field.row(y + dy) + 3 * x;
        for (int i = 0; i < 3 * kBlock; ++i) sum[i % 3] += p[i];
      }
      for (const int s : sum) out.push_back(static_cast<float>(s) / (kBlock * kBlock));
    }
  }
}

std::vector<float> blocks_of(const CapturedFrame& frame) {
  std::vector<float> out;
  add_blocks(frame.slide_field(), out);
  add_blocks(frame.complement_field(), out);
  return out;
}

bool alike(const std::vector<float>& a, const std::vector<float>& b) {
  if (a.size() != b.size() || a.empty()) return false;
  std::vector<float> off(a.size());
  for (std::size_t i = 0; i < a.size(); ++i) off[i] = std::fabs(a[i] - b[i]);
  std::vector<float> sorted = off;
  const auto middle = sorted.begin() + static_cast<std::ptrdiff_t>(sorted.size() / 2);
  std::nth_element(sorted.begin(), middle, sorted.end());
  const float limit = std::clamp(6 * 1.4826F * *middle, kLeastLevels, kMostLevels);
  const auto beyond = std::count_if(off.begin(), off.end(), [limit](float o) { return o > limit; });
  return static_cast<double>(beyond) <= kMovedShare * static_cast<double>(off.size());
}

void add_pixels(const Image8& picture, std::vector<std::uint32_t>& sum) {
  sum.resize(picture.size());
  for (std::size_t i = 0; i < sum.size(); ++i) sum[i] += picture.data()[i];
}

Image8 mean_of(const std::vector<std::uint32_t>& sum, std::uint32_t count, int width, int height) {
  Image8 out(width, height, 3);
  for (std::size_t i = 0; i < sum.size(); ++i)
    out.data()[i] = static_cast<std::uint8_t>((sum[i] + count / 2) / count);
  return out;
}

}  // namespace

void StillCollector::accumulate(const CapturedFrame& frame, Shown& shown) {
  shown.width = frame.picture.width();
  shown.height = frame.picture.height();
  shown.scan = frame.scan;
  shown.slide_row = frame.slide_field().data == frame.picture.data() ? 0 : 1;
  add_pixels(frame.picture, shown.sums[0]);
  if (frame.scan == Scan::kProgressive) add_pixels(frame.complement, shown.sums[1]);
  ++shown.count;
}

bool StillCollector::add(const CapturedFrame& frame) {
  ++added_;
  std::vector<float> blocks = blocks_of(frame);
  const auto found =
      std::find_if(shown_.begin(), shown_.end(), [&](const Shown& s) { return alike(s.blocks, blocks); });
  Shown* seen = nullptr;
  if (found != shown_.end()) {
    seen = &*found;
  } else {
    taken_ = false;
    if (shown_.size() == cycle_) shown_.erase(shown_.begin());
    seen = &shown_.emplace_back();
    seen->blocks = std::move(blocks);
  }
  accumulate(frame, *seen);
  seen->last = added_;
  if (taken_ || at_rest() < cycle_) return false;
  taken_ = true;
  return true;
}

std::vector<Image8> StillCollector::pictures() const {
  std::vector<Image8> out;
  for (StripePair& pair : pairs()) {
    out.push_back(std::move(pair.lit));
    out.push_back(std::move(pair.complement));
  }
  return out;
}

std::size_t StillCollector::at_rest() const {
  // What was not seen for two cycles is of before something moved.
  return static_cast<std::size_t>(std::count_if(shown_.begin(), shown_.end(), [&](const Shown& s) {
    return s.count >= 2 && added_ - s.last < 2 * cycle_;
  }));
}

std::vector<StripePair> StillCollector::pairs() const {
  std::vector<StripePair> out;
  for (const Shown& s : shown_) {
    Image8 first = mean_of(s.sums[0], s.count, s.width, s.height);
    if (s.scan == Scan::kInterlaced) {
      out.push_back(deinterlaced(first, s.slide_row));
    } else {
      out.push_back({std::move(first), mean_of(s.sums[1], s.count, s.width, s.height)});
    }
  }
  return out;
}

}  // namespace relievo
