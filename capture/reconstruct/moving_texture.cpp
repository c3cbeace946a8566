// SPDX-License-Identifier: Apache-2.0
#include "capture/reconstruct/moving_texture.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <utility>

namespace relievo {
namespace {

constexpr float kWidest_px = 40;      // of a stripe
constexpr float kNarrowest_px = 1;    // the same
constexpr int kMoves = 4;             // boundaries around that were elsewhere
constexpr float kPure_px = 2;         // from a boundary on
constexpr int kReach = 4;             // stripes to each side that are asked for a primary
constexpr float kDepthStep = 0.012F;  // of the depth, from boundary to boundary: another surface
constexpr float kWider = 1.5F;        // than the stripe before: the same
constexpr float kLeft = 0.08F;        // of white light's, more than what a surface differs by
constexpr float kLeftLevels = 4;      // and grey levels more
constexpr float kLeastDetail = 10;    // grey levels that tell it,
constexpr float kMostDetail = 2;      // and how much brighter or darker it is
constexpr float kAmbient = 0.2F;      // of what a lit stripe shows, without its light
constexpr float kUnlike = 0.5F;       // of what the complement should show,
constexpr float kUnlikeLevels = 6;    // and grey levels more: something else

bool has(Primary colour, std::size_t channel) {
  return (colour >> channel & 1) != 0;
}

/// A matrix, by its columns, times three numbers.
template <class Three>
Four times(const std::array<Four, 3>& columns, const Three& v) {
  return columns[0] * static_cast<float>(v[0]) + columns[1] * static_cast<float>(v[1]) +
         columns[2] * static_cast<float>(v[2]);
}

}  // namespace

/// The sum of two rows each, of which both may be the same.
struct MovingTexture::Exposures {
  struct Rows {
    const std::uint8_t *above, *below;
  };
  Rows slide, complement;
};

MovingTexture::MovingTexture(const std::array<double, 9>& colour_matrix, const CameraResponse& response,
                             int line_stride)
    : response_(response), line_stride_(line_stride) {
  using Matrix = Eigen::Matrix<double, 3, 3, Eigen::RowMajor>;
  const Matrix matrix = Eigen::Map<const Matrix>(colour_matrix.data());
  const auto columns_of = [](const Eigen::Matrix3f& m, std::array<Four, 3>& out) {
    for (int i = 0; i < 3; ++i) out[static_cast<std::size_t>(i)] = Four{m(0, i), m(1, i), m(2, i), 0};
  };
  columns_of(matrix.cast<float>(), matrix_);
  columns_of(matrix.inverse().cast<float>(), inverse_);
}

/// Of an exposure between two columns, on average.
MovingTexture::Light MovingTexture::mean_light(const std::uint8_t* above, const std::uint8_t* below,
                                               const Stripe& s) const {
  std::array<int, 3> sums{};
  for (int i = 3 * s.first; i < 3 * (s.last + 1); i += 3)
    for (std::size_t c = 0; c < 3; ++c) {
      const std::size_t at = static_cast<std::size_t>(i) + c;
      sums[c] += above[at] + below[at];
    }
  return times(matrix_, sums) / static_cast<float>(2 * (s.last - s.first + 1));
}

void MovingTexture::mend_line(const DetectionLines& rows, const ShownStripes& shown, const Light& gains,
                              int line, Scratch& scratch, Image8& texture) {
  Columns& touched = touched_[static_cast<std::size_t>(line)];
  touched = {width_, 0};
  if (line >= rows.own.height) return;
  const float* column_px = shown.grid.column_px(line);
  const float* depth = shown.grid.z(line);
  const std::uint8_t* own = rows.own.row(line);
  const std::uint8_t* above = rows.other_above(line);
  const std::uint8_t* below = rows.other_below(line);
  const Exposures exposures =
      rows.shows_slide ? Exposures{{own, own}, {above, below}} : Exposures{{above, below}, {own, own}};
  const auto moves = [&](int b) {
    return shown.moving.around(line, 0.5F * (column_px[b] + column_px[b + 1])) >= kMoves;
  };
  // Whether there is a stripe of one surface between a boundary and the next.
  const auto is_stripe = [&](int b) {
    const float width = column_px[b + 1] - column_px[b];
    return width > kNarrowest_px && width < kWidest_px && column_px[b] >= 1 &&
           column_px[b + 1] + 1 <= static_cast<float>(width_ - 1) &&
           std::fabs(depth[b + 1] - depth[b]) < kDepthStep * depth[b];
  };
  // Whether two that follow each other are of one.
  const auto go_on = [&](int b) {
    const float width = column_px[b + 1] - column_px[b];
    const float next = column_px[b + 2] - column_px[b + 1];
    return next <= kWider * width && width <= kWider * next;
  };
  std::vector<Stripe>& stripes = scratch.stripes;
  const int count = shown.grid.boundaries() - 1;
  for (int b = 0; b < count; ++b) {
    if (!is_stripe(b) || !moves(b)) continue;
    int first = b;
    while (first > 0 && b - first < kReach && is_stripe(first - 1) && go_on(first - 1)) --first;
    // As far as it moves, and so much beyond.
    int last = b;
    int still = 0;
    while (last + 1 < count && still < kReach && is_stripe(last + 1) && go_on(last)) {
      ++last;
      still = moves(last) ? 0 : still + 1;
    }
    stripes.clear();
    for (int i = first; i <= last; ++i) {
      Stripe s{.left_px = column_px[i],
               .right_px = column_px[i + 1],
               .colour = shown.colours[static_cast<std::size_t>(i)][1],
               .moves = moves(i)};
      s.first = static_cast<int>(std::ceil(s.left_px + kPure_px));
      s.last = static_cast<int>(std::floor(s.right_px - kPure_px));
      if (s.first > s.last) s.first = s.last = static_cast<int>(0.5F * (s.left_px + s.right_px) + 0.5F);
      stripes.push_back(s);
    }
    b = last - still;
    if (stripes.size() < 2) continue;
    if (touched.begin >= touched.end)
      std::fill_n(mended_.begin() + static_cast<std::ptrdiff_t>(line) * width_, width_, std::uint8_t{0});
    touched.begin = std::min(touched.begin, static_cast<int>(stripes.front().left_px));
    touched.end = std::max(touched.end, static_cast<int>(stripes.back().right_px) + 1);
    mend_surface(exposures, gains, stripes, texture.row(step_ * line),
                 mended_.data() + static_cast<std::ptrdiff_t>(line) * width_);
  }
}

/// What stripes show: on average, and in white light.
void MovingTexture::look(const Exposures& exposures, const Light& gains, std::vector<Stripe>& stripes) const {
  for (Stripe& s : stripes) {
    s.slide = mean_light(exposures.slide.above, exposures.slide.below, s);
    s.complement = mean_light(exposures.complement.above, exposures.complement.below, s);
    s.complement *= gains;
  }
  const int count = static_cast<int>(stripes.size());
  for (int i = 0; i < count; ++i) {
    Stripe& s = stripes[static_cast<std::size_t>(i)];
    // Of each primary: what the nearest stripes on either side show that have it if this one has not, or the
    // other way round. The complement should show that here.
    Light expected{};
    std::array<bool, 3> told{};
    float total = 0;  // of what is told, in white light
    float count_told = 0;
    for (std::size_t c = 0; c < 3; ++c) {
      float sum = 0;
      float weights = 0;
      for (const int side : {-1, 1}) {
        for (int away = 1; away <= kReach; ++away) {
          const int j = i + side * away;
          if (j < 0 || j >= count) break;
          const Stripe& other = stripes[static_cast<std::size_t>(j)];
          if (has(other.colour, c) == has(s.colour, c)) continue;
          const float weight = 1.F / static_cast<float>(away);
          sum += weight * other.slide[c];
          weights += weight;
          break;
        }
      }
      const bool lit = has(s.colour, c);
      told[c] = lit || weights > 0;
      if (!told[c]) continue;
      expected[c] = weights > 0 ? sum / weights : std::min(s.complement[c], kAmbient * s.slide[c]);
      total += s.slide[c] + expected[c];
      ++count_told;
      s.unlike |= std::fabs(s.complement[c] - expected[c]) >
                  kUnlike * (lit ? s.slide[c] : expected[c]) + kUnlikeLevels;
    }
    for (std::size_t c = 0; c < 3; ++c) {
      if (!s.unlike) {
        s.white[c] = s.slide[c] + s.complement[c];
      } else {  // of what nothing on the surface tells, no colour is better than another surface's
        s.white[c] = told[c] ? s.slide[c] + expected[c] : total / count_told;
      }
    }
  }
}

/// From the middle of a stripe to the next one's: what a pixel shows otherwise than both tell, and than a
/// surface does, stripes left of themselves. The surface's own detail is in all channels, stripes in those
/// that the boundary switches.
void MovingTexture::mend_between(const Stripe& a, const Stripe& b, Columns columns, std::uint8_t* texture,
                                 std::uint8_t* mended) const {
  const bool all = a.unlike || b.unlike;
  Four kept{};  // 1 of channels that the boundary does not switch
  for (int c = 0; c < 3; ++c)
    kept[c] =
        has(a.colour, static_cast<std::size_t>(c)) == has(b.colour, static_cast<std::size_t>(c)) ? 1.F : 0.F;
  const Four least = all ? Four{} : kept * 1e9F;  // that is never mended
  const float from = a.middle_px();
  const float length = b.middle_px() - from;
  const Four rise = length > 0 ? (b.white - a.white) / length : Four{};
  for (int x = columns.begin; x < columns.end; ++x) {
    std::uint8_t* rgb = texture + static_cast<std::ptrdiff_t>(3) * x;
    Four seen = times(matrix_, std::array{response_.light_of(rgb[0]), response_.light_of(rgb[1]),
                                          response_.light_of(rgb[2])});
    Four own = a.white + rise * (static_cast<float>(x) - from);
    if (!all) {
      const Four of_seen = seen * kept;
      const Four of_white = own * kept;
      const float white = of_white[0] + of_white[1] + of_white[2];
      const float detail = (of_seen[0] + of_seen[1] + of_seen[2]) / white;
      if (white >= kLeastDetail) own *= std::clamp(detail, 1 / kMostDetail, kMostDetail);
    }
    const Four off = seen > own ? seen - own : own - seen;
    const auto striped = off > kLeft * own + (least + kLeftLevels);
    if ((striped[0] | striped[1] | striped[2]) == 0) continue;
    seen = striped ? own : seen;
    const Four out = times(inverse_, seen);
    for (int c = 0; c < 3; ++c) rgb[c] = response_.value_of(out[c]);
    mended[x] = 1;
  }
}

void MovingTexture::mend_surface(const Exposures& exposures, const Light& gains, std::vector<Stripe>& stripes,
                                 std::uint8_t* texture, std::uint8_t* mended) const {
  look(exposures, gains, stripes);
  for (std::size_t i = 0; i <= stripes.size(); ++i) {
    const Stripe& a = stripes[i > 0 ? i - 1 : 0];
    const Stripe& b = stripes[std::min(i, stripes.size() - 1)];
    // At an end one alone tells, of what the complement does not show there.
    if ((!a.moves && !b.moves) || (&a == &b && !a.unlike)) continue;
    const float from = i > 0 ? a.middle_px() : a.left_px;
    const float to = i < stripes.size() ? b.middle_px() : b.right_px;
    mend_between(a, b, {static_cast<int>(std::ceil(from)), static_cast<int>(std::ceil(to))}, texture, mended);
  }
}

/// Rows from a line to the next one: where either was mended, what lies between them.
void MovingTexture::mend_rows_behind(int line, Image8& texture) const {
  const Columns& of_above = touched_[static_cast<std::size_t>(line)];
  const Columns& of_below = touched_[static_cast<std::size_t>(line) + 1];
  const std::uint8_t* above = texture.row(step_ * line);
  const std::uint8_t* below = texture.row(step_ * (line + 1));
  const std::uint8_t* mended = mended_.data() + static_cast<std::ptrdiff_t>(line) * width_;
  const auto is_mended = [](const Columns& of, const std::uint8_t* row, int x) {
    return x >= of.begin && x < of.end && row[x] != 0;
  };
  for (int x = std::min(of_above.begin, of_below.begin); x < std::max(of_above.end, of_below.end); ++x) {
    if (!is_mended(of_above, mended, x) && !is_mended(of_below, mended + width_, x)) continue;
    for (int i = 1; i < step_; ++i)
      for (int c = 3 * x; c < 3 * x + 3; ++c)
        texture.row(step_ * line + i)[c] =
            static_cast<std::uint8_t>((above[c] * (step_ - i) + below[c] * i + step_ / 2) / step_);
  }
}

void MovingTexture::mend(const CapturedFrame& frame, const ShownStripes& shown,
                         const std::array<float, 3>& gains, WorkerPool& pool, Image8& texture) {
  const DetectionLines rows(frame, line_stride_);
  width_ = texture.width();
  step_ = line_step_px(frame.scan, line_stride_);
  const int lines = shown.grid.lines();
  const Light gains_of{gains[0], gains[1], gains[2], 0};
  mended_.resize(static_cast<std::size_t>(lines) * static_cast<std::size_t>(width_));
  touched_.resize(static_cast<std::size_t>(lines));
  scratch_.resize(static_cast<std::size_t>(pool.workers()));
  pool.for_ranges(lines, [&](int begin, int end, int worker) {
    for (int line = begin; line < end; ++line)
      mend_line(rows, shown, gains_of, line, scratch_[static_cast<std::size_t>(worker)], texture);
  });
  if (step_ == 1) return;
  pool.for_ranges(lines - 1, [&](int begin, int end, int) {
    for (int line = begin; line < end; ++line)
      if (step_ * (line + 1) < texture.height()) mend_rows_behind(line, texture);
  });
}

}  // namespace relievo
