// SPDX-License-Identifier: Apache-2.0
// The projected light: stripes are integrated, not sampled, and land where the rig says.
#include <gtest/gtest.h>

#include <cmath>

#include "capture/pattern/bcsl.h"
#include "capture/source/sim/sim_source.h"
#include "capture/source/sim/stripe_light.h"

namespace relievo::sim {
namespace {

/// Colour of the slide at a column, by definition.
double colour_at(const Pattern& pattern, int slide, int width, double u, int channel) {
  int stripe = static_cast<int>(std::floor((u + 0.5) / width * pattern.stripes()));
  stripe = std::min(std::max(stripe, 0), pattern.stripes() - 1);
  return pattern.colour(stripe, slide) >> channel & 1;
}

double channel_of(Vec3 v, int channel) {
  return static_cast<double>(channel == 0 ? v.x : channel == 1 ? v.y : v.z);
}

/// Mean over [a, b] of the slide blurred by sigma, by brute force.
double brute_mean(const Pattern& pattern, int slide, int width, double a, double b, double sigma,
                  int channel) {
  constexpr int kSteps = 400, kBlur = 200;
  double sum = 0, weights = 0;
  for (int j = -kBlur; j <= kBlur; ++j) {
    const double x = sigma > 0 ? 5.0 * j / kBlur : 0, w = sigma > 0 ? std::exp(-0.5 * x * x) : (j == 0);
    if (w == 0) continue;
    double mean = 0;
    for (int i = 0; i < kSteps; ++i) {
      mean += colour_at(pattern, slide, width, a + (i + 0.5) * (b - a) / kSteps - sigma * x, channel);
    }
    sum += w * mean / kSteps;
    weights += w;
  }
  return sum / weights;
}

TEST(StripeLight, ABoundaryInAPixelGivesItsCoverage) {
  const Pattern pattern{3, 1, {1, 2, 4}, {0, 1, 2, 0}};  // red, green, blue, red; 16 columns each
  const StripeLight light(pattern, 0, 64, 0);
  // Boundary 0 lies at column 15.5; [15, 17] is a quarter red and three quarters green.
  const Vec3 mean = light.mean(15.0f, 17.0f);
  EXPECT_NEAR(channel_of(mean, 0), 0.25, 1e-5);
  EXPECT_NEAR(channel_of(mean, 1), 0.75, 1e-5);
  EXPECT_NEAR(channel_of(mean, 2), 0.00, 1e-5);
  // Over the whole slide: two red stripes of four.
  EXPECT_NEAR(channel_of(light.mean(63.5f, -0.5f), 0), 0.5, 1e-5);
}

TEST(StripeLight, EqualsBruteForceWithAndWithoutDefocus) {
  const Pattern pattern = *make_pattern(6, 2, 40, 90);
  for (const double sigma : {0.0, 0.5, 2.5}) {
    for (const int slide : {0, 1}) {
      const StripeLight light(pattern, slide, 1024, sigma);
      for (int i = 0; i < 40; ++i) {
        const double a = 3.7 + i * 25.31, b = a + 0.3 + 0.17 * i;
        for (int channel = 0; channel < 3; ++channel) {
          EXPECT_NEAR(channel_of(light.mean(static_cast<float>(a), static_cast<float>(b)), channel),
                      brute_mean(pattern, slide, 1024, a, b, sigma, channel), 3e-3)
              << "sigma " << sigma << " at " << a;
        }
      }
    }
  }
}

/// Where the ray of image point (u, v) meets the scene "plane", and the projector column that lights it.
struct Seen {
  double depth, column, facing_over_r2;
};
Seen look(const Rig& rig, double u, double v) {
  double n[3] = {0.2, -0.1, -1.0};
  const double size = std::sqrt(n[0] * n[0] + n[1] * n[1] + n[2] * n[2]);
  const double d[3] = {(u - rig.camera.cx()) / rig.camera.fx(), (v - rig.camera.cy()) / rig.camera.fy(), 1};
  const double depth = n[2] * 1.0 / (n[0] * d[0] + n[1] * d[1] + n[2]);
  double q[3];
  for (std::size_t i = 0; i < 3; ++i) {
    q[i] = rig.projector_from_camera_translation[i];
    for (std::size_t k = 0; k < 3; ++k) q[i] += rig.projector_from_camera_rotation[3 * i + k] * d[k] * depth;
  }
  double nq = 0;  // normal in the projector's frame, against the direction to it
  for (std::size_t i = 0; i < 3; ++i) {
    for (std::size_t k = 0; k < 3; ++k)
      nq -= rig.projector_from_camera_rotation[3 * i + k] * n[k] / size * q[i];
  }
  const double r2 = q[0] * q[0] + q[1] * q[1] + q[2] * q[2];
  return {depth, rig.projector.fx() * q[0] / q[2] + rig.projector.cx(), nq / std::sqrt(r2) / r2};
}

TEST(Simulator, PlanePixelsAreTheAnalyticCoverageOfTheStripes) {
  auto source =
      make_sim("plane,scan=progressive,frames=2,noise=0,chroma=0,defocus=0,ambient=0,crosstalk=0,gloss=0",
               {.truth = true});
  ASSERT_TRUE(source) << source.error().message;
  const Rig& rig = (*source)->info().rig;
  const Pattern& pattern = (*source)->info().pattern;
  for (int slide = 0; slide < 2; ++slide) {
    auto frame = (*source)->next();
    ASSERT_TRUE(frame && *frame);
    int mixed = 0;
    for (int v = 7; v < rig.camera.height; v += 31) {
      for (int u = 60; u < 580; ++u) {
        const Seen centre = look(rig, u, v);
        ASSERT_NEAR(static_cast<double>((*source)->truth().row(v)[u]), centre.depth, 1e-6);
        const double a = look(rig, u - 0.5, v).column, b = look(rig, u + 0.5, v).column;
        if (b > rig.projector.width - 1 || a < 1) continue;
        for (int c = 0; c < 3; ++c) {
          const double coverage = brute_mean(pattern, slide, rig.projector.width, a, b, 0, c);
          mixed += coverage > 0.1 && coverage < 0.9;
          const double full = 230 * 0.8 * centre.facing_over_r2;
          ASSERT_NEAR((*frame)->picture.row(v)[3 * u + c], full * coverage, 1.2) << u << " " << v << " " << c;
          ASSERT_NEAR((*frame)->complement.row(v)[3 * u + c], full * (1 - coverage), 1.2);
        }
      }
    }
    EXPECT_GT(mixed, 500);  // it did look at boundaries
  }
}

}  // namespace
}  // namespace relievo::sim
