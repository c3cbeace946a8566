// SPDX-License-Identifier: Apache-2.0
#include "capture/reconstruct/place_scatter.h"

#include <algorithm>
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

void PlaceScatter::settle_plain() {
  const auto variance = [](RankedSample& squares) { return squares.median(0) * kVarianceOfMedian; };
  const float colour_noise = noise_.colour.median(0);
  const float luma_noise = noise_.luma.median(0);
  const float both = std::max(0.F, variance(plain_.apart) - colour_noise - luma_noise);
  const float more = variance(plain_.luma) - luma_noise - (variance(plain_.colour) - colour_noise);
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

PlaceScatter::Errors PlaceScatter::errors() {
  const ColourAndLumaErrors still = of_still();
  if (apart_moving_.size() * kFewMove < contrasty_.apart.size()) return {still, still};
  return {still, {{colour_px_, drawn_by_contrast_px(apart_moving_.median(0))}, {luma_px_, 0}}};
}

ColourAndLumaErrors PlaceScatter::of_still() {
  const float both = std::max(0.F, contrasty_.apart.median(0));
  const float of_luma = contrasty_.luma.size() < kLeastSeen
                            ? both
                            : part_of_luma(both, contrasty_.luma.median(0) - contrasty_.colour.median(0));
  return {{colour_px_, drawn_by_contrast_px(both - of_luma)},
          {luma_px_, std::min(kMostLuma_px, std::sqrt(of_luma * kVarianceOfMedian))}};
}

}  // namespace relievo
