// SPDX-License-Identifier: Apache-2.0
#include "capture/calibrate/stripe_decode.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>
#include <utility>

#include "capture/camera_response.h"
#include "capture/reconstruct/edges.h"
#include "capture/reconstruct/field_difference.h"
#include "capture/reconstruct/refine.h"
#include "capture/reconstruct/sequence.h"
#include "capture/upright.h"

namespace relievo {
namespace {

constexpr std::size_t kLeastEdges = 200;
constexpr float kMaxSigma_px = 0.5F;

Image8 turned(const Image8& picture) {
  Image8 out(picture.height(), picture.width(), 3);
  for (int y = 0; y < picture.height(); ++y) {
    const std::uint8_t* from = picture.row(y);
    for (int x = 0; x < picture.width(); ++x) std::copy_n(from + 3 * x, 3, out.row(x) + 3 * y);
  }
  return out;
}

/// A boundary on the picture that was decoded.
struct Found {
  float column_px;
  int line;
  int boundary;
};

/// One axis, as columns.
class AxisDecoder {
 public:
  AxisDecoder(const Pattern& pattern, const CameraColours& colours, WorkerPool& pool)
      : pattern_(pattern),
        response_(colours.gamma),
        differencer_(colours.matrix),
        refiner_(colours.matrix),
        sequences_{SequenceDecoder(pattern), SequenceDecoder(reversed(pattern))},
        pool_(pool) {}

  void add(const Image8& lit, const Image8& complement) {
    CapturedFrame frame;
    frame.scan = Scan::kProgressive;
    frame.picture = response_.straightened(lit);
    frame.complement = response_.straightened(complement);
    differencer_.difference(frame, pool_, images_.emplace_back());
    edge_finder_.find(images_.back(), pool_, edges_.emplace_back());
    lit_.push_back(std::move(frame.picture));
  }

  std::vector<Found> decode() {
    // Whether the projector is the other way up, and in which order its slides were taken: what explains the
    // pictures best.
    std::vector<Found> out;
    std::vector<SequenceResult> best;
    bool backwards = false;
    for (const bool swapped : {false, true}) {
      if (swapped && images_.size() == 1) break;
      for (const bool backward : {false, true}) {
        std::vector<SequenceResult> results = run(swapped, backward);
        if (!best.empty() && score(results) <= score(best)) continue;
        best = std::move(results);
        swapped_ = swapped;
        backwards = backward;
      }
    }
    for (std::size_t frame = 0; frame < images_.size(); ++frame)
      take(frame, order_of(frame, swapped_), backwards, best[frame], out);
    return out;
  }

  /// Whether the slides came second before first, as decode() found.
  bool swapped() const { return swapped_; }

 private:
  static SlideOrder order_of(std::size_t frame, bool swapped) {
    return (frame == 0) != swapped ? SlideOrder::kNewerIsFirst : SlideOrder::kNewerIsSecond;
  }
  static double score(const std::vector<SequenceResult>& results) {
    return std::accumulate(results.begin(), results.end(), 0.,
                           [](double sum, const SequenceResult& r) { return sum + r.score; });
  }

  std::vector<SequenceResult> run(bool swapped, bool backwards) {
    std::vector<SequenceResult> out(images_.size());
    for (std::size_t frame = 0; frame < images_.size(); ++frame) {
      const DifferenceImage* const other = images_.size() > 1 ? &images_[1 - frame] : nullptr;
      sequences_[backwards].decode(edges_[frame], {.order = order_of(frame, swapped), .other = other}, pool_,
                                   out[frame]);
    }
    return out;
  }

  void take(std::size_t frame, SlideOrder order, bool backwards, const SequenceResult& result,
            std::vector<Found>& out) {
    EdgeImage& edges = edges_[frame];
    refiner_.refine(images_[frame], lit_[frame].view(), result, sequences_[backwards].shown_colours(order),
                    pool_, edges);
    for (int line = 0; line < edges.lines; ++line) {
      const auto l = static_cast<std::size_t>(line);
      for (std::uint32_t e = edges.line_start[l]; e < edges.line_start[l + 1]; ++e) {
        const Edge& edge = edges.edges[e];
        if (result.boundary[e] < 0 || edge.at_step || edge.sigma_px > kMaxSigma_px) continue;
        const int boundary = result.boundary[e];
        out.push_back({edge.column_px, line, backwards ? pattern_.boundaries() - 1 - boundary : boundary});
      }
    }
  }

  const Pattern& pattern_;
  CameraResponse response_;
  Differencer differencer_;
  EdgeFinder edge_finder_;
  Refiner refiner_;
  std::array<SequenceDecoder, 2> sequences_;  // of the pattern, and of it from right to left
  WorkerPool& pool_;
  std::vector<Image8> lit_;
  std::vector<DifferenceImage> images_;  // of them and their complements
  std::vector<EdgeImage> edges_;
  bool swapped_ = false;
};

/// Whether stripes lie along rows: the difference of the pictures then changes down the picture. The board's
/// own squares change it alike in both directions.
bool along_rows(const StripePair& pair) {
  constexpr int kApart = 3;
  double across = 0, down = 0;
  const auto difference = [&](int x, int y) {
    const std::uint8_t *l = pair.lit.row(y) + 3 * x, *c = pair.complement.row(y) + 3 * x;
    return std::array{l[0] - c[0], l[1] - c[1], l[2] - c[2]};
  };
  for (int y = 0; y + kApart < pair.lit.height(); y += 2) {
    for (int x = 0; x + kApart < pair.lit.width(); x += 2) {
      const auto here = difference(x, y), right = difference(x + kApart, y),
                 below = difference(x, y + kApart);
      for (std::size_t c = 0; c < 3; ++c) {
        across += std::abs(right[c] - here[c]);
        down += std::abs(below[c] - here[c]);
      }
    }
  }
  return down > across;
}

/// By pixel, as GrayEdges are.
GrayEdges sorted(std::vector<GrayEdge> edges, int width, int height) {
  const auto pixel = [&](const GrayEdge& e) {
    const int x = std::clamp(static_cast<int>(e.x), 0, width - 1);
    const int y = std::clamp(static_cast<int>(e.y), 0, height - 1);
    return static_cast<std::size_t>(y) * static_cast<std::size_t>(width) + static_cast<std::size_t>(x);
  };
  std::stable_sort(edges.begin(), edges.end(),
                   [&](const GrayEdge& a, const GrayEdge& b) { return pixel(a) < pixel(b); });
  GrayEdges out;
  out.first.assign(static_cast<std::size_t>(width) * static_cast<std::size_t>(height) + 1, 0);
  for (const GrayEdge& e : edges) ++out.first[pixel(e) + 1];
  for (std::size_t i = 1; i < out.first.size(); ++i) out.first[i] += out.first[i - 1];
  out.edges = std::move(edges);
  return out;
}

Status check(const StripeStack& stack) {
  const auto slides = static_cast<std::size_t>(stack.pattern.slides);
  if (slides < 1 || slides > 2)
    return Error{"stripes on 1 or 2 slides can be decoded, not on " + std::to_string(slides)};
  if (stack.columns.size() != slides || stack.rows.size() != slides) {
    return Error{"there must be " + std::to_string(slides) + " slides along columns and as many along rows"};
  }
  for (const auto* pairs : {&stack.columns, &stack.rows}) {
    for (const StripePair& pair : *pairs) {
      for (const Image8* picture : {&pair.lit, &pair.complement}) {
        if (picture->width() != stack.width() || picture->height() != stack.height() ||
            picture->channels() != 3)
          return Error{"the pictures differ in size"};
      }
    }
  }
  return {};
}

}  // namespace

Pattern row_pattern(const Pattern& pattern, int projector_width, int projector_height) {
  Pattern out = pattern;
  const auto stripes = static_cast<int>(
      std::lround(static_cast<double>(pattern.stripes()) * projector_height / projector_width));
  out.sequence.resize(static_cast<std::size_t>(std::clamp(stripes, 2, pattern.stripes())));
  return out;
}

Result<StripeStack> sort_stripes(std::vector<StripePair> pairs, const Pattern& pattern, int projector_width,
                                 int projector_height, const CameraColours& colours, WorkerPool& pool) {
  StripeStack out{projector_width, projector_height, pattern, {}, {}};
  for (StripePair& pair : pairs) (along_rows(pair) ? out.rows : out.columns).push_back(std::move(pair));
  if (const Status checked = check(out); !checked) {
    return Error{std::to_string(out.columns.size()) + " slides along columns and " +
                 std::to_string(out.rows.size()) +
                 " along rows are seen; does the projector show those of pattern --both-axes? (" +
                 checked.error().message + ")"};
  }
  const Pattern rows = row_pattern(pattern, projector_width, projector_height);
  for (const bool turn : {false, true}) {
    auto& slides = turn ? out.rows : out.columns;
    AxisDecoder decoder(turn ? rows : pattern, colours, pool);
    for (const StripePair& pair : slides) {
      if (turn) {
        decoder.add(turned(pair.lit), turned(pair.complement));
      } else {
        decoder.add(pair.lit, pair.complement);
      }
    }
    decoder.decode();
    if (decoder.swapped()) std::swap(slides[0], slides[1]);
  }
  return out;
}

Result<ProjectorEdges> decode_stripes(const StripeStack& stack, const CameraColours& colours,
                                      WorkerPool& pool) {
  if (const Status checked = check(stack); !checked) return checked.error();
  const int width = stack.width(), height = stack.height();
  ProjectorEdges out{.width = width, .height = height, .columns = {}, .rows = {}};
  const Pattern rows = row_pattern(stack.pattern, stack.projector_width, stack.projector_height);
  AxisDecoder along_columns(stack.pattern, colours, pool), along_rows(rows, colours, pool);
  for (const StripePair& pair : stack.columns) along_columns.add(pair.lit, pair.complement);
  for (const StripePair& pair : stack.rows) along_rows.add(turned(pair.lit), turned(pair.complement));
  std::vector<GrayEdge> edges;
  for (const Found& f : along_columns.decode()) {
    edges.push_back(
        {f.column_px, static_cast<float>(f.line),
         static_cast<float>(stack.pattern.boundary_column_px(f.boundary, stack.projector_width))});
  }
  const std::size_t column_edges = edges.size();
  out.columns = sorted(std::exchange(edges, {}), width, height);
  for (const Found& f : along_rows.decode()) {
    edges.push_back({static_cast<float>(f.line), f.column_px,
                     static_cast<float>(rows.boundary_column_px(f.boundary, stack.projector_height))});
  }
  const std::size_t row_edges = edges.size();
  out.rows = sorted(std::move(edges), width, height);
  if (column_edges < kLeastEdges || row_edges < kLeastEdges) {
    return Error{"hardly any stripe along " + std::string(column_edges < kLeastEdges ? "columns" : "rows") +
                 " could be decoded; are pattern and exposure right?"};
  }
  return out;
}

}  // namespace relievo
