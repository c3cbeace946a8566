// SPDX-License-Identifier: Apache-2.0
#include "capture/reconstruct/consistency.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <utility>

#include "capture/reconstruct/column_grid.h"
#include "capture/reconstruct/consistency_rows.h"
#include "capture/reconstruct/smooth_columns.h"

namespace relievo {
namespace {
constexpr float kAveraged = 0.6F;  // share of noise's variance that smoothing takes away
constexpr float kLeastNoise_px = 0.01F;

// Scatter over lines.
constexpr int kApart = 3;                   // lines whose noise no low-pass shares
constexpr float kMedianOfNormal = 0.6745F;  // of |N(0, 1)|
constexpr float kBendGain = 2.4495F;        // of [1 -2 1], the square root of 6
constexpr float kRough = 2.F;               // times what noise gives: there is speckle
constexpr float kSpeckleTail = 1.5F;        // speckle's tails are longer than noise's

// Where a neighbourhood is no longer taken to be straight.
constexpr float kBendAcross_px = 0.4F;     // second difference over boundaries, and
constexpr float kBendAcrossShare = 0.08F;  // of their spacing more
constexpr float kBendNoise = 2.F;          // standard deviations more, for both
constexpr float kBendAlong_px = 0.25F;     // second difference over lines

// Standard deviations of what neighbours predict, measured on simulated scenes.
constexpr float kPrediction_px = 0.06F;  // from three of them, in line
constexpr float kPredictionBend = 1.4F;  // more for each pixel that the three are out of line
constexpr float kTwoAcross_px = 1.F;     // more, from two only
constexpr float kTwoAlong_px = 0.2F;
constexpr float kTrusted_px = 0.15F;      // neighbours worse than this predict nothing
constexpr float kOwn_px = 0.02F;          // least for a boundary's own place, and more of it
constexpr float kDoubtAlong_px = 0.2F;    // where lines above or below are other surfaces
constexpr float kDoubtAcross_px = 0.05F;  // where boundaries beside it are

// What is settled and what is given up.
constexpr float kSqueezed = 0.75F;        // of the distances beside, two distances that hide a depth step
constexpr float kSqueezedEach = 0.95F;    // and each of the two
constexpr float kSqueezedAlone = 0.6F;    // or one, where the boundary has one neighbour only
constexpr float kStripe_px = 10.5F;       // stripes wider than this allow for as much more than the following
constexpr float kSuspect_px = 0.1F;       // worse than this, a boundary is weighed against its neighbours
constexpr float kAgree = 3.F;             // standard deviations between a boundary and a prediction of it
constexpr float kAlone_px = 0.1F;         // beside a step, without a prediction that agrees
constexpr float kAtStep_px = 0.25F;       // beside a step, after weighing
constexpr float kNoisy = 1.2F;            // or, where noise is strong, this many times its part
constexpr float kGoesOn_px = 0.5F;        // off a line above or below, or the straight through two of them
constexpr float kAtMost_px = 0.3F;        // elsewhere, for instance where texture spoils it, if it moves
constexpr float kAtMostStill_px = 0.5F;   // or holds still
constexpr float kLean_px = 2.5F;          // a boundary hangs together over lines that differ by less
constexpr float kWidest_px = 40.F;        // and with the next one over less
constexpr std::int32_t kLeastPiece = 25;  // boundaries; smaller pieces of surface are wrong codes,
constexpr std::int32_t kFollows = 2;  // which seldom follow each other on a line: one counts for so many more

constexpr float kNone = std::numeric_limits<float>::quiet_NaN();

using Around = Neighbourhood;
constexpr std::uint8_t kDiffers = BoundaryRow::kAboveDiffers | BoundaryRow::kBelowDiffers;

/// Beside a depth step, as far as the neighbours tell: what is doubtful there is given up.
bool beside_step(std::uint8_t state) {
  return (state & Around::kOpenAcross) ||
         ((state & Around::kBentAcross) && (state & (Around::kOpenAlong | Around::kBentAlong)));
}

bool known(float x) {
  return x == x;
}

/// Of a line's columns: whether boundary `b` and the one before are on one surface.
bool hangs_together(const float* columns, int b) {
  return std::fabs(columns[b] - columns[b - 1]) < kWidest_px;
}

/// A depth step that hides the boundary's true place looks squeezed: its two sides show the stripes of a
/// boundary.
constexpr NeighbourhoodLimits kLimits{.across_px = kBendAcross_px,
                                      .across_share = kBendAcrossShare,
                                      .along_px = kBendAlong_px,
                                      .noise = kBendNoise,
                                      .squeezed = kSqueezed,
                                      .squeezed_each = kSqueezedEach,
                                      .squeezed_alone = kSqueezedAlone};

}  // namespace

float* ConsistencyCheck::row(std::vector<float>& grid, int line) const {
  return grid.data() + static_cast<std::size_t>(line + kMargin) * stride_ + kMargin;
}
const float* ConsistencyCheck::row(const std::vector<float>& grid, int line) const {
  return grid.data() + static_cast<std::size_t>(line + kMargin) * stride_ + kMargin;
}
std::uint8_t* ConsistencyCheck::bytes(std::vector<std::uint8_t>& grid, int line) const {
  return grid.data() + static_cast<std::size_t>(line) * (stride_ - 2 * kMargin);
}
const std::uint8_t* ConsistencyCheck::bytes(const std::vector<std::uint8_t>& grid, int line) const {
  return grid.data() + static_cast<std::size_t>(line) * (stride_ - 2 * kMargin);
}

void ConsistencyCheck::reset(int boundaries, int lines, int workers) {
  const std::size_t stride = (static_cast<std::size_t>(boundaries) + 7) / 8 * 8 + 2 * kMargin;
  if (boundaries != boundaries_ || lines != lines_) {
    boundaries_ = boundaries;
    lines_ = lines;
    stride_ = stride;
    // What lies around the lines stays as it is here.
    for (auto* grid : {&measured_, &smooth_, &trusted_, &settled_})
      grid->assign(stride_ * static_cast<std::size_t>(lines_ + 2 * kMargin), kNone);
    for (auto* grid : {&noise_, &sigma_}) grid->assign(measured_.size(), 0);
  }
  const std::size_t cells = static_cast<std::size_t>(lines_) * static_cast<std::size_t>(boundaries_);
  for (auto* grid : {&marks_, &state_})
    grid->resize(static_cast<std::size_t>(lines_) * (stride_ - 2 * kMargin));
  piece_.resize(cells);
  size_.resize(cells);
  seams_.assign(static_cast<std::size_t>(workers), 0);
  counts_.assign(static_cast<std::size_t>(workers), {});
  for (RankedSample* sample : {&sigmas_, &bends_, &gaps_}) sample->reset(workers);
}

void ConsistencyCheck::begin(int boundaries, int lines, WorkerPool& pool, int every) {
  every_ = every;
  reset(boundaries, lines, pool.workers());
}

BoundaryRow ConsistencyCheck::row(int line) {
  return {row(measured_, line), row(sigma_, line), row(noise_, line), bytes(marks_, line)};
}

/// Distances of neighbouring boundaries, of every second line.
void ConsistencyCheck::add_gaps(int line, int worker) {
  if (line % (2 * every_) != 0) return;
  const float* columns = row(measured_, line);
  std::vector<float>& gaps = gaps_.of(worker);
  std::size_t n = gaps.size();
  gaps.resize(n + static_cast<std::size_t>(boundaries_));
  for (int b = 0; b + 1 < boundaries_; ++b) {
    gaps[n] = columns[b + 1] - columns[b];
    n += gaps[n] > 0;
  }
  gaps.resize(n);
}

/// What a line tells of all lines: standard deviations of every fourth boundary, and distances.
void ConsistencyCheck::shown(int line, int worker) {
  if (line % every_ != 0) return;
  const BoundaryRow own = row(line);
  std::vector<float>& sigmas = sigmas_.of(worker);
  for (int b = line % 4; b < boundaries_; b += 4)
    if (known(own.column_px[b])) sigmas.push_back(own.sigma_px[b]);
  add_gaps(line, worker);
}

/// As shown() does, but that of every fourth edge the standard deviation is taken.
void ConsistencyCheck::fill_line(const EdgeImage& edges, const SequenceResult& result, int line, int worker) {
  const BoundaryRow to = row(line);
  std::fill_n(to.column_px, boundaries_, kNone);
  std::fill_n(to.noise_px, boundaries_, 0.F);
  std::vector<float>& sigmas = sigmas_.of(worker);
  for (std::uint32_t e = edges.line_start[static_cast<std::size_t>(line)];
       e < edges.line_start[static_cast<std::size_t>(line) + 1]; ++e) {
    const int b = result.boundary[e];
    if (b < 0) continue;
    const Edge& edge = edges.edges[e];
    to.column_px[b] = edge.column_px;
    to.sigma_px[b] = edge.sigma_px;
    to.noise_px[b] = edge.noise_px;
    to.marks[b] = static_cast<std::uint8_t>((result.still[e] != 0 ? BoundaryRow::kStill : 0) |
                                            (edge.at_step ? BoundaryRow::kAtStep : 0) |
                                            (edge.above_differs ? BoundaryRow::kAboveDiffers : 0) |
                                            (edge.below_differs ? BoundaryRow::kBelowDiffers : 0));
    if (e % 4 == 0) sigmas.push_back(edge.sigma_px);
  }
  add_gaps(line, worker);
}

/// Bends of the columns from one line to others: their standard deviation is that of the columns, speckle
/// included, which no model of noise foretells.
void ConsistencyCheck::bends_of_line(int line, int worker) {
  const float* above = row(measured_, line - kApart);
  const float* here = row(measured_, line);
  const float* below = row(measured_, line + kApart);
  std::vector<float>& bends = bends_.of(worker);
  std::size_t n = bends.size();
  bends.resize(n + static_cast<std::size_t>(boundaries_));
  for (int b = 0; b < boundaries_; ++b) {
    bends[n] = std::fabs(above[b] - 2 * here[b] + below[b]);
    n += known(bends[n]);
  }
  bends.resize(n);
}

/// Where columns fit as well as noise lets them to what their neighbours along the boundary show.
void ConsistencyCheck::smooth_line(int line, float usual_px) {
  std::array<const float*, 7> rows{};
  for (int i = -3; i <= 3; ++i) rows[static_cast<std::size_t>(i + 3)] = row(measured_, line + i);
  // Nothing is settled yet. Beside the row are its margin and its neighbour's, which hold nothing.
  float* scratch = row(settled_, line);
  smoothers().back().smooth(rows, row(noise_, line), boundaries_, usual_px, scratch, row(smooth_, line));
}

void ConsistencyCheck::suspect_line(int line) {
  consistency_kernels().neighbourhoods({row(smooth_, line - 1), row(smooth_, line), row(smooth_, line + 1)},
                                       row(noise_, line), speckle_px_, boundaries_, kLimits,
                                       bytes(state_, line));
}

/// Of a cell in piece_.
std::int32_t ConsistencyCheck::root(std::int32_t i) {
  while (piece_[static_cast<std::size_t>(i)] != i) {
    auto& up = piece_[static_cast<std::size_t>(i)];
    up = piece_[static_cast<std::size_t>(up)];
    i = up;
  }
  return i;
}

void ConsistencyCheck::join(std::int32_t a, std::int32_t b) {
  a = root(a);
  b = root(b);
  if (a == b) return;
  if (a > b) std::swap(a, b);
  piece_[static_cast<std::size_t>(b)] = a;
  size_[static_cast<std::size_t>(a)] += size_[static_cast<std::size_t>(b)];
}

void ConsistencyCheck::join_to_above(int line) {
  const float* here = row(measured_, line);
  const float* above = row(measured_, line - 1);
  const std::int32_t first = line * boundaries_;
  bool joined_before = false;
  for (int b = 0; b < boundaries_; ++b) {
    const bool joined = std::fabs(here[b] - above[b]) < kLean_px;
    // What both lines join to the boundary before is one piece with it already.
    const bool known_as_one = joined_before && std::fabs(here[b] - here[b - 1]) < kWidest_px &&
                              std::fabs(above[b] - above[b - 1]) < kWidest_px;
    if (joined && !known_as_one) join(first + b - boundaries_, first + b);
    joined_before = joined;
  }
}

/// The pieces of surface that lines [begin, end) show: what hangs together along boundaries and lines.
void ConsistencyCheck::measure_pieces(int begin, int end) {
  for (int line = begin; line < end; ++line) {
    const float* here = row(measured_, line);
    std::int32_t* piece =
        piece_.data() + static_cast<std::size_t>(line) * static_cast<std::size_t>(boundaries_);
    std::int32_t* size =
        size_.data() + static_cast<std::size_t>(line) * static_cast<std::size_t>(boundaries_);
    std::int32_t start = 0;  // of what hangs together along the line
    for (int b = 0; b < boundaries_; ++b) {
      if (!hangs_together(here, b)) start = b;
      piece[b] = line * boundaries_ + start;
      size[b] = 1;
      size[start] = b - start + 1 + kFollows * (b - start);
    }
    if (line > begin) join_to_above(line);
  }
}

/// Of a cell in piece_, as kLeastPiece counts.
std::int32_t ConsistencyCheck::piece_size(std::int32_t i) const {
  while (piece_[static_cast<std::size_t>(i)] != i) i = piece_[static_cast<std::size_t>(i)];
  return size_[static_cast<std::size_t>(i)];
}

/// Weighs a suspect boundary's own place against what its neighbours predict. Nothing where it is to be given
/// up.
std::optional<ConsistencyCheck::Estimate> ConsistencyCheck::settle(int line, int boundary, float sigma_px,
                                                                   std::uint8_t marks) const {
  const bool above_differs = marks & BoundaryRow::kAboveDiffers;
  const bool below_differs = marks & BoundaryRow::kBelowDiffers;
  const std::uint8_t state = bytes(state_, line)[boundary];
  const float own = row(smooth_, line)[boundary];
  std::array<Estimate, 4> predictions{};
  std::size_t count = 0;
  // From three, or two, neighbours in one direction.
  const auto predict = [&](const std::array<float, 3>& x, const Foretold& three, float two_px) {
    const auto [a, b, c] = x;
    const float bend = a - 2 * b + c;
    const float straight = 2 * a - b;
    if (known(bend)) {
      predictions[count++] = {three.column_px,
                              kPrediction_px + kPredictionBend * std::fabs(bend) + three.unsure_px};
    } else if (known(straight)) {
      predictions[count++] = {straight, kPrediction_px + two_px};
    } else if (known(b) && known(c)) {
      predictions[count++] = {3 * b - 2 * c, kPrediction_px + 2 * two_px};
    }
  };
  const float* here = row(trusted_, line);
  const float* measured = row(measured_, line);
  const float* noise = row(noise_, line);
  const auto across = [&](int side, bool ends) {
    const std::array<float, 3> x{here[boundary + side], here[boundary + 2 * side], here[boundary + 3 * side]};
    const std::array<float, 3> noise_px{noise[boundary + side], noise[boundary + 2 * side],
                                        noise[boundary + 3 * side]};
    predict(x, ends ? ends_on(x, noise_px) : foretold(x), kTwoAcross_px);
  };
  across(-1, !hangs_together(measured, boundary + 1));
  across(1, !hangs_together(measured, boundary));
  const auto along = [&](int way) {
    const auto at = [&](int i) { return row(trusted_, line + way * i)[boundary]; };
    const std::array<float, 3> x{at(1), at(2), at(3)};
    predict(x, foretold(x), kTwoAlong_px);
  };
  if (!above_differs) along(-1);
  if (!below_differs) along(1);
  float own_variance = sigma_px * sigma_px + kOwn_px * kOwn_px;
  if (state & (Around::kOpenAlong | Around::kBentAlong)) own_variance += kDoubtAlong_px * kDoubtAlong_px;
  if (state & (Around::kOpenAcross | Around::kBentAcross)) own_variance += kDoubtAcross_px * kDoubtAcross_px;
  // Where lines above and below are other surfaces, the line itself may be a mixture of both.
  const auto goes_on = [&](int direction) {
    const float next = row(smooth_, line + direction)[boundary];
    const float second = row(smooth_, line + 2 * direction)[boundary];
    return std::fabs(next - own) < kGoesOn_px || std::fabs(2 * next - second - own) < kGoesOn_px;
  };
  const bool above = !above_differs && goes_on(-1);
  const bool below = !below_differs && goes_on(1);
  // Unless each line differs from the next, as in fine texture, and this one goes straight on.
  const bool textured =
      above_differs && below_differs && !(state & (Around::kOpenAcross | Around::kBentAcross));
  if ((state & (Around::kOpenAlong | Around::kBentAlong)) && !above && !below && !textured)
    return std::nullopt;
  const bool step = beside_step(state);
  const float noise_px = kNoisy * std::max(row(noise_, line)[boundary], speckle_px_);
  const float alone_px = std::max(kAlone_px * scale_, noise_px);
  const float at_step_px = std::max(kAtStep_px * scale_, noise_px);
  const float at_most_px =
      std::max((marks & BoundaryRow::kStill ? kAtMostStill_px : kAtMost_px) * scale_, noise_px);
  const auto by_itself = [&]() -> std::optional<Estimate> {
    if (!(sigma_px < (step ? alone_px : at_most_px))) return std::nullopt;
    return Estimate{own, sigma_px};
  };
  if (count == 0) return by_itself();
  // Predictions that agree are on the boundary's side of the step.
  float weights = 1 / own_variance;
  float sum = weights * own;
  bool agrees = false;
  for (std::size_t i = 0; i < count; ++i) {
    const Estimate& p = predictions[i];
    const float off = p.column_px - own;
    if (off * off > kAgree * kAgree * (p.sigma_px * p.sigma_px + own_variance)) continue;
    const float weight = 1 / (p.sigma_px * p.sigma_px);
    weights += weight;
    sum += weight * p.column_px;
    agrees = true;
  }
  if (!agrees) return by_itself();
  const Estimate weighed{sum / weights, 1 / std::sqrt(weights)};
  if (!(weighed.sigma_px <= (step ? at_step_px : at_most_px))) return std::nullopt;
  return weighed;
}

void ConsistencyCheck::settle_line(int line, ConsistencyCounts& counts) {
  const BoundaryRow own = row(line);
  const float* smooth = row(smooth_, line);
  const std::uint8_t* state = bytes(state_, line);
  float* out = row(settled_, line);
  consistency_kernels().average(own.column_px, smooth, own.noise_px, boundaries_, kAveraged, own.sigma_px);
  bool small = false;  // the piece of surface at hand
  for (int b = 0; b < boundaries_; ++b) {
    out[b] = kNone;
    const float measured = own.column_px[b];
    if (!known(measured)) continue;
    if (!hangs_together(own.column_px, b)) small = piece_size(line * boundaries_ + b) < kLeastPiece;
    const std::uint8_t s = state[b];
    const std::uint8_t marks = own.marks[b];
    if (small || (s & Around::kSqueezed)) {
      ++counts.rejected;
      continue;
    }
    if (s == 0 && !(marks & kDiffers) && own.sigma_px[b] <= kSuspect_px) {
      out[b] = smooth[b];
      continue;
    }
    const bool is_step = (marks & BoundaryRow::kAtStep) && (s & Around::kOpenAcross);
    const auto settled = settle(line, b, own.sigma_px[b], marks);
    if (is_step || !settled) {
      own.marks[b] = marks | BoundaryRow::kDoubted;
      ++counts.rejected;
      continue;
    }
    counts.moved += s != 0;
    out[b] = settled->column_px;
    own.sigma_px[b] = settled->sigma_px;
  }
}

ConsistencyCounts ConsistencyCheck::settle(WorkerPool& pool) {
  pool.for_ranges(lines_, [&](int begin, int end, int worker) {
    seams_[static_cast<std::size_t>(worker)] = begin;
    measure_pieces(begin, end);
    for (int line = std::max(begin, kApart); line < std::min(end, lines_ - kApart); ++line)
      if (line % every_ == 0) bends_of_line(line, worker);
  });
  for (const int line : seams_)
    if (line > 0) join_to_above(line);
  float noise = std::max(kLeastNoise_px, sigmas_.median(kLeastNoise_px));
  const float scattered = bends_.median(0) * (1.F / (kMedianOfNormal * kBendGain));
  scale_ = std::max(1.F, gaps_.median(0) / kStripe_px);
  const bool rough = scattered > kRough * noise;
  if (rough) noise = kSpeckleTail * scattered;
  speckle_px_ = rough ? scattered : 0;
  pool.for_ranges(lines_, [&](int begin, int end, int) {
    for (int line = begin; line < end; ++line) smooth_line(line, noise);
  });
  pool.for_ranges(lines_, [&](int begin, int end, int) {
    for (int line = begin; line < end; ++line) {
      suspect_line(line);
      const float* smooth = row(smooth_, line);
      const float* sigma = row(sigma_, line);
      float* trusted = row(trusted_, line);
      for (int b = 0; b < boundaries_; ++b) trusted[b] = sigma[b] > kTrusted_px ? kNone : smooth[b];
    }
  });
  pool.for_ranges(lines_, [&](int begin, int end, int worker) {
    for (int line = begin; line < end; ++line) settle_line(line, counts_[static_cast<std::size_t>(worker)]);
  });
  ConsistencyCounts total;
  for (const ConsistencyCounts& c : counts_) {
    total.rejected += c.rejected;
    total.moved += c.moved;
  }
  return total;
}

ConsistencyCounts ConsistencyCheck::check(int boundaries, WorkerPool& pool, SequenceResult& result,
                                          EdgeImage& edges) {
  begin(boundaries, edges.lines, pool);
  result.doubted.assign(result.boundary.size(), -1);
  pool.for_shares(edges.line_start, [&](int begin, int end, int worker) {
    for (int line = begin; line < end; ++line) fill_line(edges, result, line, worker);
  });
  ConsistencyCounts total = settle(pool);
  counts_.assign(counts_.size(), {});
  pool.for_shares(edges.line_start, [&](int begin, int end, int worker) {
    for (int line = begin; line < end; ++line) {
      const BoundaryRow own = row(line);
      const float* settled = row(settled_, line);
      for (std::uint32_t e = edges.line_start[static_cast<std::size_t>(line)];
           e < edges.line_start[static_cast<std::size_t>(line) + 1]; ++e) {
        std::int16_t& b = result.boundary[e];
        if (b < 0) continue;
        Edge& edge = edges.edges[e];
        const bool replaced = own.column_px[b] != edge.column_px;
        if (!replaced) edge.sigma_px = own.sigma_px[b];
        if (!replaced && known(settled[b])) {
          edge.column_px = settled[b];
          continue;
        }
        if (replaced) {
          ++counts_[static_cast<std::size_t>(worker)].rejected;
        } else if (own.marks[b] & BoundaryRow::kDoubted) {
          result.doubted[e] = b;
        }
        b = -1;
      }
    }
  });
  for (const ConsistencyCounts& c : counts_) total.rejected += c.rejected;
  return total;
}

}  // namespace relievo
