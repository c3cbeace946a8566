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

/// Columns [from, to] of a row, at least one.
std::array<int, 2> columns(int width, float from, float to) {
  // Rounds as std::lround does but for what the clamp takes away, at a tenth of its time.
  const int first = std::clamp(static_cast<int>(from + 0.5F), 0, width - 1);
  return {first, std::clamp(static_cast<int>(to + 0.5F), first, width - 1)};
}

}  // namespace

EvidenceBeside evidence_beside(const DifferenceImage& image, int line, const Edge& edge, float column_px) {
  const float l = edge.left_reach_px;
  const float r = edge.right_reach_px;
  const auto [left_first, left_last] = columns(image.width, column_px - l, column_px - 0.5F * l);
  const auto [right_first, right_last] = columns(image.width, column_px + 0.5F * r, column_px + r);
  const auto doubt = [&](int x) { return kNoiseOfSign * image.noise_at(line, x) + 0.5F; };
  Sides out;
  row_kernels().side_evidence(
      image.line(line), image.width,
      {left_first, left_last, right_first, right_last, doubt(left_first), doubt(right_first)}, out);
  return {{out.left[0], out.left[1], out.left[2]}, {out.right[0], out.right[1], out.right[2]}};
}

void EdgeFinder::edges_of_line(const DifferenceImage& image, int line, Scratch& scratch) {
  const int width = image.width;
  const float threshold = std::max(kLeastRise, kNoiseFactor * image.noise);
  const float weak_threshold = std::max(kLeastRise, kNoiseFactor * image.weak_noise);
  auto& crossings = scratch.crossings;
  crossings.clear();
  scratch.flags.assign(static_cast<std::size_t>(width + 8),
                       0);  // so that the last ones are read at once, too
  row_kernels().crossings(image.line(line), width, weak_threshold, scratch.flags.data());
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
      if (image.signal_at(line, x) != Signal::kWeak && std::fabs(d[x + 2] - d[x - 1]) < threshold) continue;
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
    edge.sigma_px = image.noise_at(line, static_cast<int>(first)) / edge.slope;
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
    const EvidenceBeside beside = evidence_beside(image, line, e, e.column_px);
    e.left = beside.left;
    e.right = beside.right;
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
