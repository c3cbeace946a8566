// SPDX-License-Identifier: Apache-2.0
#include "capture/reconstruct/edges.h"

#include <algorithm>
#include <cmath>
#include <cstring>

#include "capture/reconstruct/rows.h"

namespace relievo {
namespace {

constexpr float kNoiseFactor = 4;  // a rise over 3 px must exceed this many standard deviations of a value
constexpr float kLeastRise = 2;    // grey levels, where a picture has no noise
constexpr float kMerge_px = 2;     // crossings of different channels closer than this are one edge
constexpr float kMaxReach_px = 6;  // evidence is gathered up to here
constexpr float kNoiseOfSign = 2;  // standard deviations at which a sign counts half

// Four numbers that are added, multiplied and compared at once wherever the processor can.
using Four = float __attribute__((vector_size(16)));
using FourInts = std::int32_t __attribute__((vector_size(16)));

Four four_at(const float* p) {
  Four out;
  std::memcpy(&out, p, sizeof out);
  return out;
}

/// Sums of the three channels over columns [first, last], the fourth 0.
Four sums(const DifferenceImage& image, int line, int first, int last) {
  const float* red = image.line(line);
  const float* green = red + image.width;
  const float* blue = green + image.width;
  Four r{}, g{}, b{};
  int x = first;
  for (; x + 4 <= image.width && x <= last; x += 4) {
    const int left = last - x + 1;
    const Four none{};
    const FourInts wanted = FourInts{0, 1, 2, 3} < left;
    r += wanted ? four_at(red + x) : none;
    g += wanted ? four_at(green + x) : none;
    b += wanted ? four_at(blue + x) : none;
  }
  for (; x <= last; ++x) {
    r[0] += red[x];
    g[0] += green[x];
    b[0] += blue[x];
  }
  const Four rg = __builtin_shufflevector(r, g, 0, 4, 1, 5) + __builtin_shufflevector(r, g, 2, 6, 3, 7);
  const Four b0 = b + __builtin_shufflevector(b, b, 2, 3, 0, 1);
  const Four b00 = __builtin_shufflevector(b0, Four{}, 0, 4, 1, 5);
  return __builtin_shufflevector(rg, b00, 0, 1, 4, 5) + __builtin_shufflevector(rg, b00, 2, 3, 6, 7);
}

/// Mean of the channels over columns [from, to], scaled so that the strongest channel is about 1 where it
/// stands out.
SideEvidence evidence(const DifferenceImage& image, int line, float from, float to) {
  // Rounds as std::lround does but for what the clamp takes away, at a tenth of its time.
  const int first = std::clamp(static_cast<int>(from + 0.5F), 0, image.width - 1);
  const int last = std::clamp(static_cast<int>(to + 0.5F), first, image.width - 1);
  const Four mean = sums(image, line, first, last) * (1.F / static_cast<float>(last - first + 1));
  const Four size = mean < 0 ? -mean : mean;
  const float strongest = std::max({size[0], size[1], size[2]});
  Four out = mean * (1.F / (0.4F * strongest + kNoiseOfSign * image.noise + 0.5F));
  const Four one{1, 1, 1, 1};
  out = out > one ? one : out;
  out = out < -one ? -one : out;
  return {out[0], out[1], out[2]};
}

}  // namespace

SideEvidence evidence_left(const DifferenceImage& image, int line, float column_px, float reach_px) {
  return evidence(image, line, column_px - reach_px, column_px - 0.5F * reach_px);
}

SideEvidence evidence_right(const DifferenceImage& image, int line, float column_px, float reach_px) {
  return evidence(image, line, column_px + 0.5F * reach_px, column_px + reach_px);
}

void EdgeFinder::edges_of_line(const DifferenceImage& image, int line, Scratch& scratch) {
  const int width = image.width;
  const float threshold = std::max(kLeastRise, kNoiseFactor * image.noise);
  auto& crossings = scratch.crossings;
  crossings.clear();
  scratch.flags.assign(static_cast<std::size_t>(width + 8),
                       0);  // so that the last ones are read at once, too
  row_kernels().crossings(image.line(line), width, threshold, scratch.flags.data());
  for (int x = 0; x < width; ++x) {
    if (x % 8 == 0) {  // most columns have none
      std::uint64_t eight = 0;
      std::memcpy(&eight, scratch.flags.data() + x, sizeof eight);
      if (eight == 0) {
        x += 7;
        continue;
      }
    }
    if (scratch.flags[static_cast<std::size_t>(x)] == 0) continue;
    const std::size_t first_here = crossings.size();
    for (int channel = 0; channel < 3; ++channel) {
      if (!(scratch.flags[static_cast<std::size_t>(x)] >> channel & 1)) continue;
      const float* d = image.line(line) + channel * width;
      const float step = d[x + 1] - d[x];
      const Crossing found{static_cast<float>(x) - d[x] / step, std::fabs(step)};
      std::size_t place = crossings.size();
      crossings.push_back(found);
      for (; place > first_here && found.column_px < crossings[place - 1].column_px; --place)
        crossings[place] = crossings[place - 1];
      crossings[place] = found;
    }
  }

  const std::size_t begin = scratch.edges.size();
  for (std::size_t i = 0; i < crossings.size();) {
    // A crossing's variance goes with 1 / slope^2, which is the weight of the mean.
    float weight = 0;
    float sum = 0;
    const float first = crossings[i].column_px;
    for (; i < crossings.size() && crossings[i].column_px - first < kMerge_px; ++i) {
      const float w = crossings[i].slope * crossings[i].slope;
      weight += w;
      sum += w * (crossings[i].column_px - first);
    }
    Edge edge;
    edge.column_px = first + sum / weight;
    edge.slope = std::sqrt(weight);
    edge.sigma_px = image.noise / edge.slope;
    edge.noise_px = edge.sigma_px;
    scratch.edges.push_back(edge);
  }
  const std::size_t end = scratch.edges.size();
  for (std::size_t i = begin; i < end; ++i) {
    Edge& e = scratch.edges[i];
    const float left_gap = i > begin ? e.column_px - scratch.edges[i - 1].column_px : 2 * kMaxReach_px;
    const float right_gap = i + 1 < end ? scratch.edges[i + 1].column_px - e.column_px : 2 * kMaxReach_px;
    e.left_reach_px = std::clamp(0.55F * left_gap, 1.F, kMaxReach_px);
    e.right_reach_px = std::clamp(0.55F * right_gap, 1.F, kMaxReach_px);
    e.left = evidence_left(image, line, e.column_px, e.left_reach_px);
    e.right = evidence_right(image, line, e.column_px, e.right_reach_px);
  }
  scratch.counts.push_back(static_cast<std::uint32_t>(end - begin));
}

void EdgeFinder::find(const DifferenceImage& image, WorkerPool& pool, EdgeImage& out) {
  scratch_.resize(static_cast<std::size_t>(pool.threads()));
  for (Scratch& s : scratch_) {
    s.edges.clear();
    s.counts.clear();
  }
  pool.for_ranges(image.lines, [&](int begin, int end, int worker) {
    for (int line = begin; line < end; ++line)
      edges_of_line(image, line, scratch_[static_cast<std::size_t>(worker)]);
  });
  out.lines = image.lines;
  out.edges.clear();
  out.line_start.assign(1, 0);
  for (const Scratch& s : scratch_) {
    out.edges.insert(out.edges.end(), s.edges.begin(), s.edges.end());
    for (const std::uint32_t count : s.counts) out.line_start.push_back(out.line_start.back() + count);
  }
}

}  // namespace relievo
