// SPDX-License-Identifier: Apache-2.0
#include "capture/reconstruct/place_scatter.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "capture/reconstruct/consistency.h"
#include "capture/reconstruct/place_rules.h"

namespace relievo {

using namespace place_rules;

namespace {

constexpr float kCubic = 34.F / 36;     // variance of a cubic through four places, of one's
constexpr int kEvery = 3;               // lines that are asked about cubics
constexpr std::size_t kLeastSeen = 40;  // places with contrast that tell colour from luma
constexpr float kMostLuma_px = 4;
constexpr std::size_t kFewMove = 4;  // times as many with contrast hold still

/// Luma's part of the variance of both, of which luma's is so much more than colour's.
float part_of_luma(float both, float more) {
  return std::clamp(0.5F * (both + more), 0.F, both);
}

/// 0 of a sample that is empty.
template <std::size_t kCount>
std::array<float, kCount> medians(const std::array<RankedSample*, kCount>& samples, WorkerPool& pool) {
  std::array<float, kCount> out;
  pool.for_ranges(static_cast<int>(kCount), [&](int begin, int end, int) {
    for (auto i = static_cast<std::size_t>(begin); i < static_cast<std::size_t>(end); ++i)
      out[i] = samples[i]->median(0);
  });
  return out;
}

}  // namespace

void PlaceScatter::begin(int workers) {
  for (Squares* squares : {&plain_, &contrasty_}) {
    squares->apart.reset(workers);
    squares->colour.reset(workers);
    squares->luma.reset(workers);
  }
  noise_.colour.reset(workers);
  noise_.luma.reset(workers);
  apart_moving_.reset(workers);
}

void PlaceScatter::line(const EdgeImage& edges, const SequenceResult& result,
                        const std::vector<LumaSeen>& seen, int line, int worker) {
  if (line % kEvery != 0) return;
  const std::uint32_t begin = edges.line_start[static_cast<std::size_t>(line)];
  const std::uint32_t end = edges.line_start[static_cast<std::size_t>(line) + 1];
  for (std::uint32_t e = begin + 2; e + 2 < end; ++e) {
    const Edge& edge = edges.edges[e];
    const LumaSeen& luma = seen[e];
    const bool contrasty = edge.contrast > kContrasty && luma.steep && result.still[e] != 0;
    const int b = result.boundary[e];
    if (b < 0 || !luma.found || (edge.contrast > BoundaryRow::kPlainContrast && !contrasty)) continue;
    if (result.boundary[e - 2] != b - 2 || result.boundary[e - 1] != b - 1 ||
        result.boundary[e + 1] != b + 1 || result.boundary[e + 2] != b + 2)
      continue;
    const auto column = [&](std::uint32_t i) { return edges.edges[i].column_px; };
    const float cubic = (4 * (column(e - 1) + column(e + 1)) - column(e - 2) - column(e + 2)) * (1.F / 6);
    const float colour_off = squared(edge.column_px - cubic);
    const float luma_off = squared(luma.column_px - cubic);
    const float colour_noise = squared(edge.sigma_px);
    const float luma_noise = squared(luma.sigma_px);
    if (contrasty) {
      const float unit = 1 / squared(edge.contrast);
      contrasty_.colour.of(worker).push_back((colour_off - (1 + kCubic) * colour_noise) * unit);
      contrasty_.luma.of(worker).push_back((luma_off - kCubic * colour_noise - luma_noise) * unit);
    } else {
      plain_.apart.of(worker).push_back(squared(luma.column_px - edge.column_px));
      plain_.colour.of(worker).push_back(colour_off);
      plain_.luma.of(worker).push_back(luma_off);
      noise_.colour.of(worker).push_back(colour_noise);
      noise_.luma.of(worker).push_back(luma_noise);
    }
  }
}

void PlaceScatter::settle_plain(WorkerPool& pool) {
  const auto [apart, colour, luma, colour_noise, luma_noise] =
      medians(std::array{&plain_.apart, &plain_.colour, &plain_.luma, &noise_.colour, &noise_.luma}, pool);
  const float both = std::max(0.F, apart * kVarianceOfMedian - colour_noise - luma_noise);
  const float more = luma * kVarianceOfMedian - luma_noise - (colour * kVarianceOfMedian - colour_noise);
  const float of_luma = part_of_luma(both, more);
  luma_px_ = std::sqrt(of_luma);
  colour_px_ = std::sqrt(both - of_luma);
}

void PlaceScatter::apart(const Edge& edge, const LumaSeen& luma, bool still, int worker) {
  if (!luma.found || !luma.steep || edge.contrast <= kContrasty) return;
  const float known =
      squared(luma.sigma_px) + squared(luma.level_px) + squared(luma_px_) + squared(edge.sigma_px);
  (still ? contrasty_.apart : apart_moving_)
      .of(worker)
      .push_back((squared(luma.column_px - edge.column_px) - known) / squared(edge.contrast));
}

PlaceScatter::Errors PlaceScatter::errors(WorkerPool& pool) {
  const auto [apart, colour, luma, apart_moving] =
      medians(std::array{&contrasty_.apart, &contrasty_.colour, &contrasty_.luma, &apart_moving_}, pool);
  const float both = std::max(0.F, apart);
  const float of_luma = contrasty_.luma.size() < kLeastSeen ? both : part_of_luma(both, luma - colour);
  const ColourAndLumaErrors still{{colour_px_, drawn_by_contrast_px(both - of_luma)},
                                  {luma_px_, std::min(kMostLuma_px, std::sqrt(of_luma * kVarianceOfMedian))}};
  if (apart_moving_.size() * kFewMove < contrasty_.apart.size()) return {still, still};
  return {still, {{colour_px_, drawn_by_contrast_px(apart_moving)}, {luma_px_, 0}}};
}

}  // namespace relievo
