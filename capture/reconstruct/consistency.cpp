// SPDX-License-Identifier: Apache-2.0
#include "capture/reconstruct/consistency.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <utility>

#include "capture/reconstruct/smooth_columns.h"

namespace relievo {
namespace {
constexpr float kAveraged = 0.3F;  // share of noise's variance that smoothing takes away
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
constexpr float kBendShare = 0.7F;       // of a bend that is taken to go on
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
constexpr std::int32_t kLeastPiece = 25;  // boundaries; smaller pieces of surface are wrong codes

constexpr float kNone = std::numeric_limits<float>::quiet_NaN();
constexpr int kMargin = 3;

constexpr std::uint8_t kOpenAcross = 1;  // no neighbour on one side in the line
constexpr std::uint8_t kBentAcross = 2;  // both, but not straight
constexpr std::uint8_t kOpenAlong = 4;   // the same over lines
constexpr std::uint8_t kBentAlong = 8;

/// Beside a depth step, as far as the neighbours tell: what is doubtful there is given up.
bool beside_step(std::uint8_t state) {
  return (state & kOpenAcross) || ((state & kBentAcross) && (state & (kOpenAlong | kBentAlong)));
}

bool known(float x) {
  return x == x;
}

/// True where a boundary, at x[0] among those of its line, is closer to its neighbours than these are to
/// theirs. A depth step that hides the boundary's true place looks so: its two sides show the stripes of a
/// boundary.
bool squeezed(const float* x) {
  const float left = x[0] - x[-1];
  const float right = x[1] - x[0];
  const float before = x[-1] - x[-2];
  const float after = x[2] - x[1];
  if (left < 0 || right < 0) return false;  // another surface in front
  if (!known(right)) return left < kSqueezedAlone * before;
  if (!known(left)) return right < kSqueezedAlone * after;
  return left + right < 2 * kSqueezed * std::min(before, after) && left < kSqueezedEach * before &&
         right < kSqueezedEach * after;
}

}  // namespace

float* ConsistencyCheck::row(std::vector<float>& grid, int line) const {
  return grid.data() + static_cast<std::size_t>(line + kMargin) * stride_ + kMargin;
}
const float* ConsistencyCheck::row(const std::vector<float>& grid, int line) const {
  return grid.data() + static_cast<std::size_t>(line + kMargin) * stride_ + kMargin;
}

void ConsistencyCheck::reset(int boundaries, int lines, int workers) {
  const std::size_t stride = (static_cast<std::size_t>(boundaries) + 7) / 8 * 8 + 2 * kMargin;
  if (boundaries != boundaries_ || lines != lines_) {
    boundaries_ = boundaries;
    lines_ = lines;
    stride_ = stride;
    // What lies around the lines stays as it is here.
    for (auto* grid : {&measured_, &smooth_, &trusted_})
      grid->assign(stride_ * static_cast<std::size_t>(lines_ + 2 * kMargin), kNone);
    noise_.assign(measured_.size(), 0);
  }
  const std::size_t cells = static_cast<std::size_t>(lines_) * static_cast<std::size_t>(boundaries_);
  state_.resize(cells);
  piece_.resize(cells);
  size_.resize(cells);
  seams_.assign(static_cast<std::size_t>(workers), 0);
  counts_.assign(static_cast<std::size_t>(workers), {});
  for (RankedSample* sample : {&sigmas_, &bends_, &gaps_}) sample->reset(workers);
}

/// The columns of a line, and what they tell of all lines: standard deviations of every fourth edge, and the
/// distances of neighbouring boundaries.
void ConsistencyCheck::fill_line(const EdgeImage& edges, const SequenceResult& result, int line, int worker) {
  float* columns = row(measured_, line);
  float* noises = row(noise_, line);
  std::fill_n(columns, boundaries_, kNone);
  std::fill_n(noises, boundaries_, 0.F);
  std::vector<float>& sigmas = sigmas_.of(worker);
  for (std::uint32_t e = edges.line_start[static_cast<std::size_t>(line)];
       e < edges.line_start[static_cast<std::size_t>(line) + 1]; ++e) {
    if (result.boundary[e] < 0) continue;
    columns[result.boundary[e]] = edges.edges[e].column_px;
    noises[result.boundary[e]] = edges.edges[e].noise_px;
    if (e % 4 == 0) sigmas.push_back(edges.edges[e].sigma_px);
  }
  if (line % 2 != 0) return;
  std::vector<float>& gaps = gaps_.of(worker);
  std::size_t n = gaps.size();
  gaps.resize(n + static_cast<std::size_t>(boundaries_));
  for (int b = 0; b + 1 < boundaries_; ++b) {
    gaps[n] = columns[b + 1] - columns[b];
    n += gaps[n] > 0;
  }
  gaps.resize(n);
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
  smoothers().back().smooth(rows, row(noise_, line), boundaries_, usual_px, row(smooth_, line));
}

void ConsistencyCheck::suspect_line(int line) {
  const float* above = row(smooth_, line - 1);
  const float* here = row(smooth_, line);
  const float* below = row(smooth_, line + 1);
  const float* noise = row(noise_, line);
  std::uint8_t* state =
      state_.data() + static_cast<std::size_t>(line) * static_cast<std::size_t>(boundaries_);
  for (int b = 0; b < boundaries_; ++b) {
    const float across = here[b - 1] - 2 * here[b] + here[b + 1];
    const float spacing = 0.5F * (here[b + 1] - here[b - 1]);
    const float along = above[b] - 2 * here[b] + below[b];
    std::uint8_t s = 0;
    if (!known(across)) {
      s |= kOpenAcross;
    } else if (std::fabs(across) > kBendAcross_px + kBendAcrossShare * spacing + kBendNoise * noise[b]) {
      s |= kBentAcross;
    }
    if (!known(along)) {
      s |= kOpenAlong;
    } else if (std::fabs(along) > kBendAlong_px + kBendNoise * noise[b]) {
      s |= kBentAlong;
    }
    state[b] = s;
  }
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
      if (!(std::fabs(here[b] - here[b - 1]) < kWidest_px)) start = b;
      piece[b] = line * boundaries_ + start;
      size[b] = 1;
      size[start] = b - start + 1;
    }
    if (line > begin) join_to_above(line);
  }
}

std::int32_t ConsistencyCheck::piece_size(std::size_t cell) const {
  auto i = static_cast<std::int32_t>(cell);
  while (piece_[static_cast<std::size_t>(i)] != i) i = piece_[static_cast<std::size_t>(i)];
  return size_[static_cast<std::size_t>(i)];
}

/// Weighs a suspect boundary's own place against what its neighbours predict. Nothing where it is to be given
/// up.
std::optional<ConsistencyCheck::Estimate> ConsistencyCheck::settle(int line, int boundary, const Edge& edge,
                                                                   bool still) const {
  const float sigma_px = edge.sigma_px;
  const std::uint8_t state = state_[static_cast<std::size_t>(line) * static_cast<std::size_t>(boundaries_) +
                                    static_cast<std::size_t>(boundary)];
  const float own = row(smooth_, line)[boundary];
  std::array<Estimate, 4> predictions{};
  std::size_t count = 0;
  // From three, or two, neighbours in one direction.
  const auto predict = [&](float a, float b, float c, float one) {
    const float bend = a - 2 * b + c;
    const float straight = 2 * a - b;
    if (known(bend)) {
      predictions[count++] = {straight + kBendShare * bend,
                              kPrediction_px + kPredictionBend * std::fabs(bend)};
    } else if (known(straight)) {
      predictions[count++] = {straight, kPrediction_px + one};
    } else if (known(b) && known(c)) {
      predictions[count++] = {3 * b - 2 * c, kPrediction_px + 2 * one};
    }
  };
  const float* here = row(trusted_, line);
  predict(here[boundary - 1], here[boundary - 2], here[boundary - 3], kTwoAcross_px);
  predict(here[boundary + 1], here[boundary + 2], here[boundary + 3], kTwoAcross_px);
  const auto at = [&](int l) { return row(trusted_, line + l)[boundary]; };
  if (!edge.above_differs) predict(at(-1), at(-2), at(-3), kTwoAlong_px);
  if (!edge.below_differs) predict(at(1), at(2), at(3), kTwoAlong_px);
  float own_variance = sigma_px * sigma_px + kOwn_px * kOwn_px;
  if (state & (kOpenAlong | kBentAlong)) own_variance += kDoubtAlong_px * kDoubtAlong_px;
  if (state & (kOpenAcross | kBentAcross)) own_variance += kDoubtAcross_px * kDoubtAcross_px;
  // Where lines above and below are other surfaces, the line itself may be a mixture of both.
  const auto goes_on = [&](int direction) {
    const float next = row(smooth_, line + direction)[boundary];
    const float second = row(smooth_, line + 2 * direction)[boundary];
    return std::fabs(next - own) < kGoesOn_px || std::fabs(2 * next - second - own) < kGoesOn_px;
  };
  const bool above = !edge.above_differs && goes_on(-1);
  const bool below = !edge.below_differs && goes_on(1);
  // Unless each line differs from the next, as in fine texture, and this one goes straight on.
  const bool textured = edge.above_differs && edge.below_differs && !(state & (kOpenAcross | kBentAcross));
  if ((state & (kOpenAlong | kBentAlong)) && !above && !below && !textured) return std::nullopt;
  const bool step = beside_step(state);
  const float noise_px = kNoisy * row(noise_, line)[boundary];
  const float alone_px = std::max(kAlone_px * scale_, noise_px);
  const float at_step_px = std::max(kAtStep_px * scale_, noise_px);
  const float at_most_px = std::max((still ? kAtMostStill_px : kAtMost_px) * scale_, noise_px);
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

ConsistencyCounts ConsistencyCheck::check(int boundaries, WorkerPool& pool, SequenceResult& result,
                                          EdgeImage& edges) {
  reset(boundaries, edges.lines, pool.threads());
  result.doubted.assign(result.boundary.size(), -1);
  pool.for_shares(edges.line_start, [&](int begin, int end, int worker) {
    for (int line = begin; line < end; ++line) fill_line(edges, result, line, worker);
  });
  pool.for_ranges(lines_, [&](int begin, int end, int worker) {
    seams_[static_cast<std::size_t>(worker)] = begin;
    measure_pieces(begin, end);
    for (int line = std::max(begin, kApart); line < std::min(end, lines_ - kApart); ++line)
      bends_of_line(line, worker);
  });
  for (const int line : seams_)
    if (line > 0) join_to_above(line);
  float noise = std::max(kLeastNoise_px, sigmas_.median(kLeastNoise_px));
  const float scattered = bends_.median(0) * (1.F / (kMedianOfNormal * kBendGain));
  scale_ = std::max(1.F, gaps_.median(0) / kStripe_px);
  const bool rough = scattered > kRough * noise;
  if (rough) noise = kSpeckleTail * scattered;
  pool.for_ranges(lines_, [&](int begin, int end, int) {
    for (int line = begin; line < end; ++line) {
      float* noises = row(noise_, line);
      for (int b = 0; rough && b < boundaries_; ++b) noises[b] = std::max(noises[b], scattered);
      smooth_line(line, noise);
    }
  });
  pool.for_shares(edges.line_start, [&](int begin, int end, int) {
    for (int line = begin; line < end; ++line) {
      suspect_line(line);
      float* trusted = row(trusted_, line);
      std::copy_n(row(smooth_, line), boundaries_, trusted);
      for (std::uint32_t e = edges.line_start[static_cast<std::size_t>(line)];
           e < edges.line_start[static_cast<std::size_t>(line) + 1]; ++e) {
        if (result.boundary[e] >= 0 && edges.edges[e].sigma_px > kTrusted_px)
          trusted[result.boundary[e]] = kNone;
      }
    }
  });
  pool.for_shares(edges.line_start, [&](int begin, int end, int worker) {
    ConsistencyCounts& counts = counts_[static_cast<std::size_t>(worker)];
    for (int line = begin; line < end; ++line) {
      for (std::uint32_t e = edges.line_start[static_cast<std::size_t>(line)];
           e < edges.line_start[static_cast<std::size_t>(line) + 1]; ++e) {
        const int b = result.boundary[e];
        if (b < 0) continue;
        Edge& edge = edges.edges[e];
        const auto cell = static_cast<std::size_t>(line * boundaries_ + b);
        const std::uint8_t s = state_[cell];
        if (row(smooth_, line)[b] != edge.column_px) {
          const float averaged = kAveraged * edge.noise_px * edge.noise_px;
          edge.sigma_px = std::sqrt(
              std::max(0.5F * edge.sigma_px * edge.sigma_px, edge.sigma_px * edge.sigma_px - averaged));
        }
        std::optional<Estimate> settled = Estimate{row(smooth_, line)[b], edge.sigma_px};
        const bool replaced = row(measured_, line)[b] != edge.column_px;
        const bool is_step = edge.at_step && (s & kOpenAcross) != 0;
        const bool suspect =
            s != 0 || edge.above_differs || edge.below_differs || edge.sigma_px > kSuspect_px;
        if (replaced || squeezed(row(smooth_, line) + b) || piece_size(cell) < kLeastPiece) {
          result.boundary[e] = -1;
          ++counts.rejected;
          continue;
        }
        if (suspect) settled = settle(line, b, edge, result.still[e] != 0);
        if (is_step || !settled) {
          result.doubted[e] = std::exchange(result.boundary[e], std::int16_t{-1});
          ++counts.rejected;
          continue;
        }
        counts.moved += s != 0;
        edge.column_px = settled->column_px;
        edge.sigma_px = settled->sigma_px;
      }
    }
  });
  ConsistencyCounts total;
  for (const ConsistencyCounts& c : counts_) {
    total.rejected += c.rejected;
    total.moved += c.moved;
  }
  return total;
}

}  // namespace relievo
