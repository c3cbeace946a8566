// SPDX-License-Identifier: Apache-2.0
#include "capture/reconstruct/detect.h"

#include <algorithm>
#include <cmath>

namespace relievo {
Detector::Detector(const std::array<double, 9>& colour_matrix, const DetectOptions& options)
    : options_(options), differencer_(colour_matrix) {}

void Detector::boundaries_of_line(int line, float scale, LineScratch& scratch, Detection& detection) const {
  const int width = image_.width;
  const float* planes = image_.line(line);
  Primary* colours =
      detection.colours.data() + static_cast<std::size_t>(width) * static_cast<std::size_t>(line);
  // Thresholds are stated on the normalised scale; dividing them is the same as scaling every pixel.
  const float tc = options_.colour_threshold / scale;
  const float ts = options_.slope_threshold / scale;

  // PC of 5.2.2. (The paper's list prints the two signs exchanged: under the slide a lit channel is the
  // brighter one.)
  for (int x = 0; x < width; ++x) {
    const float r = planes[x];
    const float g = planes[width + x];
    const float b = planes[2 * width + x];
    const int strong = (std::fabs(r) > tc) + (std::fabs(g) > tc) + (std::fabs(b) > tc);
    const int colour = (r > 0 ? 1 : 0) | (g > 0 ? 2 : 0) | (b > 0 ? 4 : 0);
    colours[x] = static_cast<Primary>(strong >= 2 && colour != 7 ? colour : 0);
  }

  // Eq. 4 for each channel, then crossings of different channels at one place become one boundary.
  auto& crossings = scratch.crossings;
  crossings.clear();
  const int delta = options_.delta_px;
  for (int channel = 0; channel < 3; ++channel) {
    const float* d = planes + channel * width;
    for (int x = delta; x + 1 + delta < width; ++x) {
      if ((d[x] > 0) == (d[x + 1] > 0)) continue;
      const float rise = d[x + 1 + delta - 1] - d[x - delta + 1];
      if (std::fabs(rise) < ts || (rise > 0) != (d[x + 1] > d[x])) continue;
      const float step = d[x + 1] - d[x];
      crossings.push_back({static_cast<float>(x) - d[x] / step, std::fabs(step) * scale});
    }
  }
  std::sort(crossings.begin(), crossings.end(),
            [](const Crossing& a, const Crossing& b) { return a.column_px < b.column_px; });

  for (std::size_t i = 0; i < crossings.size();) {
    // The paper has no rule for crossings of several channels at one place: their mean is one boundary.
    const float first = crossings[i].column_px;
    float sum = 0;
    float slope = 0;
    const std::size_t begin = i;
    for (; i < crossings.size() && crossings[i].column_px - first < options_.merge_px; ++i) {
      sum += crossings[i].column_px - first;
      slope += crossings[i].slope;
    }
    Boundary boundary;
    boundary.column_px = first + sum / static_cast<float>(i - begin);
    boundary.slope = slope;
    const int centre = static_cast<int>(std::lround(boundary.column_px));
    for (int d = delta; d <= delta + options_.search_px; ++d) {
      if (centre - d < 0 || centre + d >= width) break;
      const Primary left = colours[centre - d];
      const Primary right = colours[centre + d];
      if (left != 0 && right != 0 && left != right) {
        boundary.left = left;
        boundary.right = right;
        scratch.found.push_back(boundary);
        break;
      }
    }
  }
}

void Detector::detect(const DetectionLines& rows, WorkerPool& pool, Detection& out) {
  out.width = rows.own.width;
  out.lines = rows.own.height;
  const std::size_t pixels = static_cast<std::size_t>(out.width) * static_cast<std::size_t>(out.lines);
  if (rows.own.empty() || rows.other.empty()) {  // an interlaced picture of one row has no complement
    out.line_start.assign(static_cast<std::size_t>(out.lines) + 1, 0);
    out.boundaries.clear();
    out.colours.assign(pixels, 0);
    return;
  }
  differencer_.difference(rows, pool, image_);
  const float scale = 255.F / std::max(differencer_.largest(rows, pool), 1.F);

  scratch_.resize(static_cast<std::size_t>(pool.workers()));
  for (LineScratch& scratch : scratch_) {  // a worker without a line leaves its own as it was
    scratch.found.clear();
    scratch.counts.clear();
  }
  out.colours.resize(pixels);
  pool.for_ranges(out.lines, [&](int begin, int end, int worker) {
    LineScratch& scratch = scratch_[static_cast<std::size_t>(worker)];
    for (int line = begin; line < end; ++line) {
      const std::size_t before = scratch.found.size();
      boundaries_of_line(line, scale, scratch, out);
      scratch.counts.push_back(static_cast<std::uint32_t>(scratch.found.size() - before));
    }
  });
  out.boundaries.clear();
  out.line_start.assign(1, 0);
  for (const LineScratch& scratch : scratch_) {
    out.boundaries.insert(out.boundaries.end(), scratch.found.begin(), scratch.found.end());
    for (const std::uint32_t count : scratch.counts) out.line_start.push_back(out.line_start.back() + count);
  }
}

bool same_slide(const Detection& a, const Detection& b) {
  std::size_t valid = 0;
  std::size_t equal = 0;
  for (std::size_t i = 0; i < a.colours.size() && i < b.colours.size(); ++i) {
    valid += a.colours[i] != 0 && b.colours[i] != 0;
    equal += a.colours[i] != 0 && a.colours[i] == b.colours[i];
  }
  // Two slides share about one colour in b; 60 % leaves room for motion on one side and short sequences on
  // the other.
  return valid > 0 && equal * 10 > valid * 6;
}

}  // namespace relievo
