// SPDX-License-Identifier: Apache-2.0
#include "capture/evaluate/rig_check.h"

#include <algorithm>
#include <cmath>

#include "capture/reconstruct/detect.h"
#include "capture/reconstruct/field_difference.h"

namespace relievo {
namespace {

constexpr float kLitNoises = 5;     // standard deviations of noise that no light explains
constexpr float kLitLevels = 4;     // or as many grey levels, where a picture has no noise
constexpr int kLitGap_px = 8;       // all channels cross zero at some boundaries: less than this is lit too
constexpr float kLow = 0.05F;       // the quantile that is called low
constexpr float kNeighbours = 2.F;  // times the usual distance of boundaries: farther ones are no neighbours

/// The frame's difference image, with the scale of its margins.
struct Difference {
  DifferenceImage image;
  float scale = 1;  // times this: levels of the normalised scale

  Difference(const CapturedFrame& frame, const Rig& rig, WorkerPool& pool) {
    Differencer differencer(rig.colour_matrix);
    differencer.difference(frame, pool, image);
    scale = 255.F / std::max(differencer.largest(frame, pool), 1.F);
  }
  /// The least that any channel is on the side that `colour` has it.
  float margin(int line, int x, Primary colour) const {
    const float* d = image.line(line);
    float least = 1e9F;
    for (int channel = 0; channel < 3; ++channel) {
      const float value = d[channel * image.width + x];
      least = std::min(least, (colour >> channel & 1) != 0 ? value : -value);
    }
    return scale * least;
  }
};

/// Decoded boundaries by line, from left to right.
std::vector<std::vector<GridPoint>> by_line(const std::vector<GridPoint>& grid, int lines) {
  std::vector<std::vector<GridPoint>> out(static_cast<std::size_t>(lines));
  // Without what a line shows a second time, which is out of its order.
  for (const GridPoint& at : grid)
    if (!at.interpolated && at.line < lines) out[at.line].push_back(at);
  for (auto& line : out)
    std::sort(line.begin(), line.end(),
              [](const GridPoint& a, const GridPoint& b) { return a.column_px < b.column_px; });
  return out;
}

template <typename T>
T quantile(std::vector<T>& values, float at) {
  if (values.empty()) return {};
  const auto place = values.begin() + static_cast<std::ptrdiff_t>(at * static_cast<float>(values.size() - 1));
  std::nth_element(values.begin(), place, values.end());
  return *place;
}

/// Calls use(stripe, line, middle column) for each piece of a stripe between two boundaries that were both
/// decoded.
template <typename Use>
void each_stripe(const std::vector<std::vector<GridPoint>>& lines, const Use& use) {
  for (const auto& line : lines) {
    for (std::size_t i = 1; i < line.size(); ++i) {
      if (line[i].boundary != line[i - 1].boundary + 1) continue;
      const float middle = 0.5F * (line[i].column_px + line[i - 1].column_px);
      use(line[i].boundary, line[i].line, static_cast<int>(std::lround(middle)));
    }
  }
}

std::optional<int> find_slide(const Difference& difference, const std::vector<std::vector<GridPoint>>& lines,
                              const Pattern& pattern) {
  std::vector<std::size_t> right(static_cast<std::size_t>(pattern.slides));
  std::size_t all = 0;
  each_stripe(lines, [&](int stripe, int line, int x) {
    ++all;
    for (int slide = 0; slide < pattern.slides; ++slide)
      right[static_cast<std::size_t>(slide)] +=
          difference.margin(line, x, pattern.colour(stripe, slide)) > 0 ? 1U : 0U;
  });
  if (all == 0) return std::nullopt;
  return static_cast<int>(std::max_element(right.begin(), right.end()) - right.begin());
}

std::vector<ColourMargin> margins_of(const Difference& difference,
                                     const std::vector<std::vector<GridPoint>>& lines, const Pattern& pattern,
                                     int slide) {
  std::vector<std::vector<float>> found(8);  // by colour
  each_stripe(lines, [&](int stripe, int line, int x) {
    const Primary colour = pattern.colour(stripe, slide);
    found[colour].push_back(difference.margin(line, x, colour));
  });
  std::vector<ColourMargin> out;
  for (const Primary colour : pattern.palette) {
    std::vector<float>& values = found[colour];
    const auto wrong = std::count_if(values.begin(), values.end(), [](float v) { return v < 0; });
    const double share = static_cast<double>(wrong) / std::max<double>(1, static_cast<double>(values.size()));
    out.push_back({colour, values.size(), quantile(values, 0.5F), quantile(values, kLow), share});
  }
  return out;
}

/// The usual distance between neighbouring boundaries, pixels.
float usual_pitch(const std::vector<std::vector<GridPoint>>& lines) {
  std::vector<float> gaps;
  for (const auto& line : lines)
    for (std::size_t i = 1; i < line.size(); ++i)
      if (line[i].boundary == line[i - 1].boundary + 1)
        gaps.push_back(line[i].column_px - line[i - 1].column_px);
  return quantile(gaps, 0.5F);
}

void mark_lit(const Difference& difference, RigCheck& out) {
  const DifferenceImage& image = difference.image;
  const float least = std::max(kLitLevels, kLitNoises * image.noise);
  out.cover = Image8(image.width, image.lines, 1);
  for (int line = 0; line < image.lines; ++line) {
    const float* d = image.line(line);
    std::uint8_t* cover = out.cover.row(line);
    int last = -kLitGap_px - 1;
    for (int x = 0; x < image.width; ++x) {
      const float most =
          std::max({std::fabs(d[x]), std::fabs(d[image.width + x]), std::fabs(d[2 * image.width + x])});
      if (most < least) continue;
      if (x - last <= kLitGap_px) std::fill(cover + last, cover + x, std::uint8_t{1});
      cover[x] = 1;
      last = x;
    }
  }
}

/// A boundary covers half a stripe on both sides.
void mark_covered(const std::vector<std::vector<GridPoint>>& lines, RigCheck& out) {
  const float usual = usual_pitch(lines);
  for (std::size_t l = 0; l < lines.size(); ++l) {
    const auto& line = lines[l];
    std::uint8_t* cover = out.cover.row(static_cast<int>(l));
    for (std::size_t i = 0; i < line.size(); ++i) {
      const bool after = i > 0 && line[i].boundary == line[i - 1].boundary + 1;
      const bool before = i + 1 < line.size() && line[i + 1].boundary == line[i].boundary + 1;
      const float left = after ? line[i].column_px - line[i - 1].column_px : usual;
      const float right = before ? line[i + 1].column_px - line[i].column_px : usual;
      const int from = std::max(0, static_cast<int>(std::floor(line[i].column_px - 0.5F * left)));
      const int to =
          std::min(out.cover.width() - 1, static_cast<int>(std::ceil(line[i].column_px + 0.5F * right)));
      for (int x = from; x <= to; ++x)
        if (cover[x] == 1) cover[x] = 2;
    }
  }
  for (std::size_t i = 0; i < out.cover.size(); ++i) {
    out.lit_px += out.cover.data()[i] > 0 ? 1U : 0U;
    out.covered_px += out.cover.data()[i] == 2 ? 1U : 0U;
  }
}

/// By the boundaries as they are seen, before any decoding: what is on the right of one must be on the left
/// of the next.
void find_order_errors(const CapturedFrame& frame, const Rig& rig, WorkerPool& pool, RigCheck& out) {
  Detector detector(rig.colour_matrix, {});
  Detection seen;
  detector.detect(frame, pool, seen);
  out.boundaries = seen.boundaries.size();
  std::vector<float> gaps;
  const auto each_pair = [&](const auto& use) {
    for (int line = 0; line < seen.lines; ++line) {
      const auto l = static_cast<std::size_t>(line);
      for (std::size_t i = seen.line_start[l] + 1U; i < seen.line_start[l + 1]; ++i)
        use(line, seen.boundaries[i - 1], seen.boundaries[i]);
    }
  };
  each_pair([&](int, const Boundary& a, const Boundary& b) { gaps.push_back(b.column_px - a.column_px); });
  const float most = kNeighbours * quantile(gaps, 0.5F);
  each_pair([&](int line, const Boundary& a, const Boundary& b) {
    if (b.column_px - a.column_px > most) return;
    ++out.neighbours;
    if (a.right != b.left) out.order_errors.push_back({line, 0.5F * (a.column_px + b.column_px)});
  });
}

}  // namespace

ExposureCheck check_exposure(const CapturedFrame& frame) {
  ExposureCheck out;
  const View8 slide = frame.slide_field(), complement = frame.complement_field();
  const int lines = std::min(slide.height, complement.height);
  std::uint64_t clipped = 0, dark = 0;
  for (int line = 0; line < lines; ++line) {
    const std::uint8_t* a = slide.row(line);
    const std::uint8_t* b = complement.row(line);
    for (int x = 0; x < slide.width; ++x) {
      int most = 0;
      for (std::size_t c = 0; c < 3; ++c) {
        const int i = 3 * x + static_cast<int>(c);
        ++out.histogram[c][a[i] * kExposureBins / 256U];
        ++out.histogram[c][b[i] * kExposureBins / 256U];
        most = std::max({most, static_cast<int>(a[i]), static_cast<int>(b[i])});
      }
      clipped += most >= kClippedLevel ? 1U : 0U;
      dark += most < kDarkLevel ? 1U : 0U;
    }
  }
  const double pixels = std::max(1.0, static_cast<double>(lines) * slide.width);
  out.clipped = static_cast<double>(clipped) / pixels;
  out.dark = static_cast<double>(dark) / pixels;
  return out;
}

RigCheck check_rig(const CapturedFrame& captured, const CapturedFrame& decoded,
                   const std::vector<GridPoint>& grid, const Rig& rig, const Pattern& pattern) {
  WorkerPool pool(1);
  RigCheck out;
  out.exposure = check_exposure(captured);
  if (decoded.slide_field().empty() || decoded.complement_field().empty()) return out;
  const Difference difference(decoded, rig, pool);
  const auto lines = by_line(grid, difference.image.lines);
  out.noise = difference.scale * difference.image.noise;
  out.slide = find_slide(difference, lines, pattern);
  out.margins = margins_of(difference, lines, pattern, out.slide.value_or(0));
  mark_lit(difference, out);
  mark_covered(lines, out);
  find_order_errors(decoded, rig, pool, out);
  return out;
}

}  // namespace relievo
