// SPDX-License-Identifier: Apache-2.0
#include "capture/reconstruct/edges.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>

#include "capture/reconstruct/crossing.h"
#include "capture/reconstruct/four.h"
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

/// What tells how doubtful evidence is on a line.
class Doubts {
 public:
  Doubts(const DifferenceImage& image, int line)
      : signal_(image.cells == 0
                    ? nullptr
                    : image.signal.data() + static_cast<std::size_t>(line / DifferenceImage::kCellLines) *
                                                static_cast<std::size_t>(image.cells)),
        doubts_{} {
    for (const Signal s : {Signal::kNone, Signal::kWeak, Signal::kFading, Signal::kStrong})
      doubts_[static_cast<std::size_t>(s)] = kNoiseOfSign * image.noise_of(s) + 0.5F;
  }
  float at(int x) const {
    const Signal signal = signal_ == nullptr ? Signal::kStrong : signal_[x / DifferenceImage::kCellWidth];
    return doubts_[static_cast<std::size_t>(signal)];
  }

 private:
  const Signal* signal_;
  std::array<float, 4> doubts_;  // by signal
};

SideWindows windows_beside(const Doubts& doubts, int width, const Edge& edge, float column_px) {
  const float l = edge.left_reach_px;
  const float r = edge.right_reach_px;
  const auto [left_first, left_last] = columns(width, column_px - l, column_px - 0.5F * l);
  const auto [right_first, right_last] = columns(width, column_px + 0.5F * r, column_px + r);
  return {left_first, left_last, right_first, right_last, doubts.at(left_first), doubts.at(right_first)};
}

/// The memory as it is: three floats one by one would wait for what was written as eight.
void copy_three(const std::array<float, 4>& from, SideEvidence& to) {
  std::memcpy(to.data(), from.data(), sizeof to);
}

}  // namespace

EvidenceBeside evidence_beside(const DifferenceImage& image, int line, const Edge& edge, float column_px) {
  const SideWindows windows = windows_beside(Doubts(image, line), image.width, edge, column_px);
  Sides out;
  row_kernels().side_evidence(image.line(line), image.width, &windows, 1, &out);
  EvidenceBeside beside;
  copy_three(out.left, beside.left);
  copy_three(out.right, beside.right);
  return beside;
}

void EdgeSides::look(const DifferenceImage& image, int line, const Edge* edges, std::size_t count) {
  windows_.resize(count);
  sides_.resize(count);
  const Doubts doubts(image, line);
  for (std::size_t i = 0; i < count; ++i)
    windows_[i] = windows_beside(doubts, image.width, edges[i], edges[i].column_px);
  row_kernels().side_evidence(image.line(line), image.width, windows_.data(), static_cast<int>(count),
                              sides_.data());
}

void EdgeSides::look_again(const DifferenceImage& image, int line, const Edge* edges, const float* off_px) {
  const Doubts doubts(image, line);
  for (std::size_t i = 0; i < windows_.size(); ++i) {
    SideWindows& w = windows_[i];
    if (off_px[i] != 0) {
      w = windows_beside(doubts, image.width, edges[i], edges[i].column_px + off_px[i]);
    } else {
      w.left_doubt = doubts.at(w.left_first);
      w.right_doubt = doubts.at(w.right_first);
    }
  }
  row_kernels().side_evidence(image.line(line), image.width, windows_.data(),
                              static_cast<int>(windows_.size()), sides_.data());
}

/// Puts what lies close together into one edge, weighed by the slopes, as crossings come from left to right.
class EdgeFinder::Gatherer {
 public:
  Gatherer(const DifferenceImage& image, int line, Found* found)
      : image_(image), line_(line), begin_(found), next_(found) {}

  void take(float column_px, float slope) {
    const float off = column_px - first_;
    if (!(off < kMerge_px)) {
      finish();
      first_ = column_px;
    }
    // A crossing's variance goes with 1 / slope^2, which is the weight of the mean.
    const float w = slope * slope;
    weight_ += w;
    sum_ += w * (column_px - first_);
  }
  /// Of edges.
  std::uint32_t finish() {
    if (weight_ > 0) {
      *next_++ = {first_ + sum_ / weight_, std::sqrt(weight_),
                  image_.noise_at(line_, static_cast<int>(first_))};
    }
    weight_ = sum_ = 0;
    return static_cast<std::uint32_t>(next_ - begin_);
  }

 private:
  const DifferenceImage& image_;
  int line_;
  Found *begin_, *next_;
  float first_ = -2 * kMerge_px;  // of the edge's crossings
  float weight_ = 0, sum_ = 0;
};

std::uint32_t EdgeFinder::crossings_of_line(const DifferenceImage& image, int line, Scratch& scratch,
                                            Found* found) {
  const int width = image.width;
  const float weak_threshold = std::max(kLeastRise, kNoiseFactor * image.weak_noise);
  scratch.flags.resize(static_cast<std::size_t>(width + 8));
  std::fill(scratch.flags.end() - 8, scratch.flags.end(), std::uint8_t{0});  // the last ones are read at once
  row_kernels().crossings(image.line(line), width, weak_threshold, scratch.flags.data());
  const float* planes = image.line(line);
  Gatherer gatherer(image, line, found);
  const auto take = [&](int x, unsigned flags) {
    const float least = std::max(weak_threshold, kNoiseFactor * image.noise_at(line, x));
    std::array<float, 3> column, slope;
    std::size_t count = 0;
    // All channels at once; what does not cross is not asked for.
    const auto off = [&](int by) {
      const float* d = planes + x + by;
      return Four{d[0], d[width], d[2 * width], 1};
    };
    Four behind;
    crossing_of(off(-1), off(0), off(1), off(2), behind);
    for (; flags != 0; flags &= flags - 1) {
      const int channel = std::countr_zero(flags);
      const float* d = planes + channel * width + x;
      if (std::fabs(d[2] - d[-1]) < least) continue;
      const float step = d[1] - d[0];
      const float here = static_cast<float>(x) + behind[channel];
      std::size_t place = count++;
      for (; place > 0 && here < column[place - 1]; --place) {
        column[place] = column[place - 1];
        slope[place] = slope[place - 1];
      }
      column[place] = here;
      slope[place] = std::fabs(step);
    }
    for (std::size_t i = 0; i < count; ++i) gatherer.take(column[i], slope[i]);
  };
  for (int x = 0; x < width; x += 8) {  // most columns have none
    std::uint64_t eight = 0;
    std::memcpy(&eight, scratch.flags.data() + x, sizeof eight);
    while (eight != 0) {
      const int k = std::countr_zero(eight) / 8;
      take(x + k, static_cast<unsigned>(eight >> (8 * k)) & 0xff);
      eight &= ~(std::uint64_t{0xff} << (8 * k));
    }
  }
  return gatherer.finish();
}

void EdgeFinder::make_edges(const DifferenceImage& image, int line, const Found* found, std::size_t count,
                            EdgeSides& sides, Edge* edges) {
  for (std::size_t i = 0; i < count; ++i) {
    const Found& f = found[i];
    Edge e;
    e.column_px = f.column_px;
    e.slope = f.slope;
    e.sigma_px = f.noise / f.slope;
    e.noise_px = e.sigma_px;
    const float left_gap = i > 0 ? f.column_px - found[i - 1].column_px : 2 * kMaxReach_px;
    const float right_gap = i + 1 < count ? found[i + 1].column_px - f.column_px : 2 * kMaxReach_px;
    e.left_reach_px = std::clamp(0.55F * left_gap, 1.F, kMaxReach_px);
    e.right_reach_px = std::clamp(0.55F * right_gap, 1.F, kMaxReach_px);
    edges[i] = e;
  }
  sides.look(image, line, edges, count);
  for (std::size_t i = 0; i < count; ++i) {
    copy_three(sides[i].left, edges[i].left);
    copy_three(sides[i].right, edges[i].right);
  }
}

void EdgeFinder::find(const DifferenceImage& image, WorkerPool& pool, EdgeImage& out) {
  scratch_.resize(static_cast<std::size_t>(pool.workers()));
  // Crossings that lie closer together are one edge.
  most_on_line_ = static_cast<std::size_t>(image.width) / static_cast<std::size_t>(kMerge_px) + 2;
  found_.resize(most_on_line_ * static_cast<std::size_t>(image.lines));
  out.lines = image.lines;
  out.line_start.resize(static_cast<std::size_t>(image.lines) + 1);
  out.line_start[0] = 0;
  pool.for_ranges(image.lines, [&](int begin, int end, int worker) {
    for (int line = begin; line < end; ++line) {
      out.line_start[static_cast<std::size_t>(line) + 1] =
          crossings_of_line(image, line, scratch_[static_cast<std::size_t>(worker)], found_on(line));
    }
  });
  for (std::size_t line = 0; line < static_cast<std::size_t>(image.lines); ++line)
    out.line_start[line + 1] += out.line_start[line];
  out.edges.resize(out.line_start.back());
  pool.for_shares(out.line_start, [&](int begin, int end, int worker) {
    for (int line = begin; line < end; ++line) {
      const std::uint32_t first = out.line_start[static_cast<std::size_t>(line)];
      make_edges(image, line, found_on(line), out.line_start[static_cast<std::size_t>(line) + 1] - first,
                 scratch_[static_cast<std::size_t>(worker)].sides, out.edges.data() + first);
    }
  });
}

}  // namespace relievo
