// SPDX-License-Identifier: Apache-2.0
// Every projection scheme, scan and field order on a plane drawn exactly: what comes out, when, and how
// exact.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <string>
#include <tuple>
#include <vector>

#include "capture/evaluate/score.h"
#include "capture/pattern/repeating.h"
#include "capture/reconstruct/reconstructor.h"
#include "tests/support/striped_scene.h"

namespace relievo {
namespace {

using test::draw_scheme_frame;
using test::StripedScene;

constexpr double kFrame_ns = 1e9 / 29.97;

StripedScene scene_of(Scheme scheme, Scan scan, FieldOrder order) {
  StripedScene scene = test::striped_scene(scan);
  scene.rig.field_order = order;
  if (scheme == Scheme::kOneSlide) scene.pattern = *make_repeating_pattern(6, 3, 32);
  scene.pattern.scheme = scheme;
  return scene;
}

Reconstructor make(const StripedScene& scene, const ReconstructOptions& options = {}) {
  auto made = Reconstructor::create(scene.rig, scene.pattern, options);
  EXPECT_TRUE(made) << made.error().message;
  return *std::move(made);
}

/// All that one camera frame completes.
std::vector<Frame3D> add(Reconstructor& reconstructor, const CapturedFrame& frame) {
  std::vector<Frame3D> out;
  auto result = reconstructor.add(frame);
  EXPECT_TRUE(result) << result.error().message;
  if (!result) return out;
  for (std::optional<Frame3D> made = *std::move(result); made; made = reconstructor.next())
    out.push_back(*std::move(made));
  return out;
}

void expect_the_plane(const StripedScene& scene, const Frame3D& frame) {
  for (const GridPoint& at : frame.surface.grid)
    ASSERT_NEAR(at.column_px, scene.camera_column(at.boundary), 0.2) << at.boundary << " line " << at.line;
  Scorer scorer(scene.rig, scene.pattern);
  scorer.add(draw_truth(scene), &frame.surface);
  EXPECT_GT(scorer.score().completeness, 0.98);
  EXPECT_EQ(scorer.score().outliers, 0);
}

class SchemesTest : public ::testing::TestWithParam<std::tuple<Scheme, Scan, FieldOrder>> {
 protected:
  static Scheme scheme() { return std::get<0>(GetParam()); }
  static StripedScene scene() { return scene_of(scheme(), std::get<1>(GetParam()), std::get<2>(GetParam())); }
};

TEST_P(SchemesTest, GivesTheSurfacesAndTexturesOfItsRates) {
  const StripedScene plane = scene();
  Reconstructor reconstructor = make(plane);
  std::vector<Frame3D> surfaces;
  for (std::uint64_t n = 0; n < 13; ++n) {
    for (Frame3D& made : add(reconstructor, draw_scheme_frame(plane, n))) {
      EXPECT_EQ(made.number, n);
      expect_the_plane(plane, made);
      surfaces.push_back(std::move(made));
    }
    EXPECT_EQ(reconstructor.report().white, scheme() == Scheme::kWhiteFrame && n % 3 == 2) << n;
    EXPECT_FALSE(reconstructor.report().same_slide) << n;
  }
  // The first surface takes both slides; the first half-way one a surface before it.
  const std::size_t expected = scheme() == Scheme::kOneSlide     ? 13
                               : scheme() == Scheme::kWhiteField ? 23
                               : scheme() == Scheme::kWhiteFrame ? 8
                                                                 : 12;
  ASSERT_EQ(surfaces.size(), expected);
  EXPECT_EQ(reconstructor.textures(), scheme() == Scheme::kWhiteFrame ? 4U : 13U);
  for (std::size_t i = 1; i < surfaces.size(); ++i) {
    const auto apart = static_cast<double>(surfaces[i].time_ns - surfaces[i - 1].time_ns);
    if (scheme() == Scheme::kWhiteField) {
      EXPECT_EQ(surfaces[i].between, i % 2 == 1);
      EXPECT_NEAR(apart, 0.5 * kFrame_ns, 2);
    } else {
      EXPECT_FALSE(surfaces[i].between);
      EXPECT_NEAR(apart / kFrame_ns, std::round(apart / kFrame_ns), 1e-3);
    }
  }
}

TEST_P(SchemesTest, TheTextureIsTheSceneInWhiteLightAndSaysWhen) {
  const StripedScene plane = scene();
  Reconstructor reconstructor = make(plane);
  std::vector<Frame3D> surfaces;
  for (std::uint64_t n = 0; n < 6; ++n)
    for (Frame3D& made : add(reconstructor, draw_scheme_frame(plane, n))) surfaces.push_back(std::move(made));
  ASSERT_GT(surfaces.size(), 2U);
  for (const Frame3D& s : surfaces) {
    const double frame = static_cast<double>(s.texture_time_ns) / kFrame_ns;
    const bool white_frame = scheme() == Scheme::kWhiteFrame && s.number > 2;
    if (white_frame) {
      EXPECT_NEAR(frame, std::floor((static_cast<double>(s.number) + 1) / 3) * 3 - 1, 1e-3);
    } else if (scheme() == Scheme::kWhiteField) {  // the white field nearest, never one before the slide's
      EXPECT_NEAR(frame, static_cast<double>(s.number) + (s.between ? -0.5 : 0.5), 1e-3);
    } else {
      EXPECT_NEAR(frame, static_cast<double>(s.number), 1e-3);
    }
    const bool clean = white_frame || scheme() == Scheme::kWhiteField;
    const double ambient = clean ? plane.ambient : 2 * plane.ambient;  // two fields added have it twice
    ASSERT_EQ(s.texture.width(), plane.rig.camera.width);
    for (int y = 2; y < s.texture.height() - 2; y += 7)
      for (int x = 3 * 40; x < 3 * 120; ++x)
        ASSERT_NEAR(s.texture.row(y)[x], ambient + plane.reflected, 1.5) << x << " " << y;
  }
}

TEST_P(SchemesTest, LostFramesCostNoMoreThanThemselves) {
  const StripedScene plane = scene();
  for (std::uint64_t lost = 3; lost < 6; ++lost) {
    Reconstructor reconstructor = make(plane);
    std::size_t after = 0;
    for (std::uint64_t n = 0; n < 12; ++n) {
      if (n == lost) continue;
      for (const Frame3D& made : add(reconstructor, draw_scheme_frame(plane, n))) {
        EXPECT_FALSE(made.between && n == lost + 1) << "half way over a lost frame";
        if (n > 1) expect_the_plane(plane, made);
        after += n > lost;
      }
    }
    EXPECT_GE(after, scheme() == Scheme::kWhiteFrame ? 3U : 6U) << lost;
  }
}

TEST_P(SchemesTest, IsTheSameForAnyNumberOfThreads) {
  const StripedScene plane = scene();
  Reconstructor one = make(plane, {.threads = 1});
  Reconstructor three = make(plane, {.threads = 3});
  for (std::uint64_t n = 0; n < 5; ++n) {
    const auto a = add(one, draw_scheme_frame(plane, n));
    const auto b = add(three, draw_scheme_frame(plane, n));
    ASSERT_EQ(a.size(), b.size());
    for (std::size_t i = 0; i < a.size(); ++i) {
      EXPECT_EQ(a[i].surface.positions, b[i].surface.positions);
      EXPECT_EQ(a[i].surface.triangles, b[i].surface.triangles);
      const Image8& t = a[i].texture;
      EXPECT_TRUE(std::equal(t.data(), t.data() + t.size(), b[i].texture.data()));
    }
  }
}

INSTANTIATE_TEST_SUITE_P(
    , SchemesTest,
    ::testing::Values(std::tuple(Scheme::kComplementary, Scan::kInterlaced, FieldOrder::kTop),
                      std::tuple(Scheme::kComplementary, Scan::kInterlaced, FieldOrder::kBottom),
                      std::tuple(Scheme::kComplementary, Scan::kProgressive, FieldOrder::kTop),
                      std::tuple(Scheme::kWhiteField, Scan::kInterlaced, FieldOrder::kTop),
                      std::tuple(Scheme::kWhiteField, Scan::kInterlaced, FieldOrder::kBottom),
                      std::tuple(Scheme::kWhiteField, Scan::kProgressive, FieldOrder::kTop),
                      std::tuple(Scheme::kWhiteFrame, Scan::kInterlaced, FieldOrder::kTop),
                      std::tuple(Scheme::kWhiteFrame, Scan::kInterlaced, FieldOrder::kBottom),
                      std::tuple(Scheme::kWhiteFrame, Scan::kProgressive, FieldOrder::kTop),
                      std::tuple(Scheme::kOneSlide, Scan::kInterlaced, FieldOrder::kTop),
                      std::tuple(Scheme::kOneSlide, Scan::kInterlaced, FieldOrder::kBottom),
                      std::tuple(Scheme::kOneSlide, Scan::kProgressive, FieldOrder::kTop)),
    [](const auto& p) {
      std::string name = std::string(to_string(std::get<0>(p.param))) + "_" +
                         std::string(to_string(std::get<1>(p.param))) + "_" +
                         std::string(to_string(std::get<2>(p.param)));
      for (char& c : name)
        if (c == '-') c = '_';
      return name;
    });

TEST(Schemes, WhiteFieldGoesOnBehindABlackFrame) {
  const StripedScene plane = scene_of(Scheme::kWhiteField, Scan::kInterlaced, FieldOrder::kTop);
  Reconstructor reconstructor = make(plane);
  add(reconstructor, draw_scheme_frame(plane, 0));
  CapturedFrame black = draw_scheme_frame(plane, 1);
  std::fill_n(black.picture.data(), black.picture.size(), std::uint8_t{0});
  for (const Frame3D& made : add(reconstructor, black)) EXPECT_TRUE(made.surface.positions.empty());
  std::vector<Frame3D> made;
  for (std::uint64_t n = 2; n < 6; ++n) made = add(reconstructor, draw_scheme_frame(plane, n));
  ASSERT_FALSE(made.empty());
  for (const Frame3D& frame : made) expect_the_plane(plane, frame);
}

TEST(Schemes, WhiteFieldTakesAmbientLightOffTheSlides) {
  // As bright as a fourth of the projector's light: zero crossings would lie a tenth of a stripe off.
  StripedScene plane = scene_of(Scheme::kWhiteField, Scan::kInterlaced, FieldOrder::kTop);
  plane.reflected = 160;
  plane.ambient = 40;
  Reconstructor reconstructor = make(plane);
  for (std::uint64_t n = 0; n < 4; ++n) {
    for (const Frame3D& made : add(reconstructor, draw_scheme_frame(plane, n))) {
      double sum = 0;
      for (const GridPoint& at : made.surface.grid)
        sum += std::fabs(at.column_px - plane.camera_column(at.boundary));
      ASSERT_FALSE(made.surface.grid.empty());
      EXPECT_LT(sum / static_cast<double>(made.surface.grid.size()), 0.05);
    }
  }
}

TEST(Schemes, ThePapersDecoderRefusesCodesThatRepeat) {
  const StripedScene plane = scene_of(Scheme::kOneSlide, Scan::kInterlaced, FieldOrder::kTop);
  const auto made = Reconstructor::create(plane.rig, plane.pattern, {.decoder = Decoder::kPaper});
  ASSERT_FALSE(made);
  EXPECT_NE(made.error().message.find("use the decoder ordered"), std::string::npos);
}

TEST(Schemes, RefusesAFrameOfTheOtherFieldOrder) {
  StripedScene plane = scene_of(Scheme::kComplementary, Scan::kInterlaced, FieldOrder::kTop);
  Reconstructor reconstructor = make(plane);
  plane.rig.field_order = FieldOrder::kBottom;
  const auto result = reconstructor.add(draw_scheme_frame(plane, 0));
  ASSERT_FALSE(result);
  EXPECT_EQ(result.error().message, "frame 0 is bottom field first but rig.yaml says field_order: top");
}

}  // namespace
}  // namespace relievo
