// SPDX-License-Identifier: Apache-2.0
#include "capture/source/sim/stripe_light.h"

#include <algorithm>
#include <cmath>

namespace relievo::sim {
namespace {

constexpr int kNodesPerPixel = 16;
constexpr int kMargin = 64;  // projector pixels on both sides that the nodes cover

/// Integral of the normal distribution function from -infinity to x, sigma 1.
double integrated_edge(double x) {
  const double phi = std::exp(-0.5 * x * x) * 0.3989422804014327;
  return x * 0.5 * std::erfc(-x * 0.7071067811865476) + phi;
}

}  // namespace

StripeLight::StripeLight(const Pattern& pattern, int slide, int projector_width, double defocus_px)
    : width_(projector_width), sigma_(defocus_px) {
  const int n = pattern.stripes();
  for (int i = 0; i < n; ++i) {
    const Primary c = pattern.colour(i, slide);
    colours_.push_back(
        {static_cast<float>(c & 1), static_cast<float>(c >> 1 & 1), static_cast<float>(c >> 2 & 1)});
    if (i + 1 < n) edges_.push_back(pattern.boundary_column_px(i, projector_width));
  }
  prefix_.resize(static_cast<std::size_t>(n));
  for (std::size_t i = 1; i < prefix_.size(); ++i) {
    const double left = i == 1 ? -0.5 : edges_[i - 2];
    for (std::size_t c = 0; c < 3; ++c) {
      prefix_[i][c] = prefix_[i - 1][c] + (colours_[i - 1][c] - 0.5) * (edges_[i - 1] - left);
    }
  }
  if (sigma_ <= 0) return;
  nodes_.resize(static_cast<std::size_t>((width_ + 2 * kMargin) * kNodesPerPixel + 1));
  for (std::size_t i = 0; i < nodes_.size(); ++i) {
    const double u = static_cast<double>(i) / kNodesPerPixel - kMargin - 0.5;
    const double h = 0.01;
    for (int c = 0; c < 3; ++c) {
      nodes_[i].integral[c] = static_cast<float>(exact(u, c));
      nodes_[i].value[c] = static_cast<float>((exact(u + h, c) - exact(u - h, c)) / (2 * h));
    }
  }
}

double StripeLight::exact(double u, int channel) const {
  const auto c = static_cast<std::size_t>(channel);
  const auto stripe =
      static_cast<std::size_t>(std::upper_bound(edges_.begin(), edges_.end(), u) - edges_.begin());
  const double left = stripe == 0 ? -0.5 : edges_[stripe - 1];
  double sum = prefix_[stripe][c] + (colours_[stripe][c] - 0.5) * (u - left);
  if (sigma_ <= 0) return sum;
  // A blurred edge adds sigma * G(-|x| / sigma) times its step, to either side alike: G(x) - max(x, 0) is
  // even.
  const double reach = 7 * sigma_;
  const auto first = std::lower_bound(edges_.begin(), edges_.end(), u - reach) - edges_.begin();
  for (auto e = static_cast<std::size_t>(first); e < edges_.size() && edges_[e] < u + reach; ++e) {
    const double step = static_cast<double>(colours_[e + 1][c]) - static_cast<double>(colours_[e][c]);
    if (step != 0) sum += step * sigma_ * integrated_edge(-std::abs(u - edges_[e]) / sigma_);
  }
  return sum;
}

Vec3 StripeLight::integral(float u) const {
  if (nodes_.empty()) {
    const auto at = [&](int c) { return static_cast<float>(exact(static_cast<double>(u), c)); };
    return {at(0), at(1), at(2)};
  }
  const float x = (u + kMargin + 0.5f) * kNodesPerPixel;
  const float last = static_cast<float>(nodes_.size() - 2);
  const int floor = static_cast<int>(x < 0 ? 0 : x > last ? last : x);
  const Node* n = &nodes_[static_cast<std::size_t>(floor)];
  const float t = x - static_cast<float>(floor);
  const float h = 1.0f / kNodesPerPixel;
  // Cubic Hermite between nodes; in the flat margins it is the straight line that it should be.
  const float t2 = t * t, t3 = t2 * t;
  const float w1 = 3 * t2 - 2 * t3, w0 = 1 - w1, d0 = (t3 - 2 * t2 + t) * h, d1 = (t3 - t2) * h;
  const auto at = [&](int c) {
    return w0 * n[0].integral[c] + w1 * n[1].integral[c] + d0 * n[0].value[c] + d1 * n[1].value[c];
  };
  return {at(0), at(1), at(2)};
}

Vec3 StripeLight::mean(float u0, float u1) const {
  if (u1 < u0) std::swap(u0, u1);
  constexpr float kLeast = 0.02f;  // an interval of no length is widened: differences need some
  if (u1 - u0 < kLeast) {
    const float middle = 0.5f * (u0 + u1);
    u0 = middle - 0.5f * kLeast;
    u1 = middle + 0.5f * kLeast;
  }
  const Vec3 sum = (integral(u1) - integral(u0)) * (1 / (u1 - u0));
  return {clamp01(sum.x + 0.5f), clamp01(sum.y + 0.5f), clamp01(sum.z + 0.5f)};
}

}  // namespace relievo::sim
