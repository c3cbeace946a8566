// SPDX-License-Identifier: Apache-2.0
// Proves: what is said of a rig's frame is what was drawn into it.
#include "capture/evaluate/rig_check.h"

#include <gtest/gtest.h>

#include <numeric>

#include "capture/reconstruct/reconstructor.h"
#include "tests/support/striped_scene.h"

namespace relievo {
namespace {

using namespace test;

/// The second frame of two, with its surface.
struct Seen {
  CapturedFrame captured;
  CapturedFrame decoded;
  std::vector<GridPoint> grid;
};

Seen see(const StripedScene& scene) {
  auto reconstructor = Reconstructor::create(scene.rig, scene.pattern, {});
  EXPECT_TRUE(reconstructor);
  Seen out;
  for (std::uint64_t n = 0; n < 2; ++n) {
    out.captured = draw_scheme_frame(scene, n);
    auto made = reconstructor->add(out.captured);
    EXPECT_TRUE(made);
    if (reconstructor->decoded() != nullptr) out.decoded = reconstructor->decoded()->clone();
    if (*made) out.grid = (**made).surface.grid;
  }
  EXPECT_FALSE(out.grid.empty());
  return out;
}

RigCheck check(const StripedScene& scene, const Seen& seen) {
  return check_rig(seen.captured, seen.decoded, seen.grid, scene.rig, scene.pattern);
}

class RigCheckTest : public testing::TestWithParam<Scan> {
 protected:
  StripedScene scene = striped_scene(GetParam());
};
INSTANTIATE_TEST_SUITE_P(Scans, RigCheckTest, testing::Values(Scan::kInterlaced, Scan::kProgressive),
                         [](const auto& of) { return std::string(to_string(of.param)); });

TEST_P(RigCheckTest, APlaneIsCoveredInOrderAndItsColoursAreTold) {
  const RigCheck found = check(scene, see(scene));
  EXPECT_EQ(found.slide, 1);
  EXPECT_GT(found.coverage(), 0.95);
  EXPECT_GT(found.neighbours, 100U);
  EXPECT_TRUE(found.order_errors.empty());
  std::size_t pieces = 0;
  for (const ColourMargin& margin : found.margins) {
    pieces += margin.stripes;
    if (margin.stripes == 0) continue;
    EXPECT_GT(margin.low, 100) << int(margin.colour);
    EXPECT_EQ(margin.wrong, 0) << int(margin.colour);
  }
  EXPECT_GT(pieces, 100U);
  EXPECT_EQ(found.exposure.clipped, 0);
}

TEST_P(RigCheckTest, MarginsGoDownWithTheLight) {
  const RigCheck bright = check(scene, see(scene));
  scene.ambient = 120;
  scene.reflected = 60;
  const RigCheck washed = check(scene, see(scene));
  ASSERT_EQ(bright.margins.size(), washed.margins.size());
  for (std::size_t i = 0; i < bright.margins.size(); ++i) {
    if (bright.margins[i].stripes == 0) continue;
    // 60 of 180 levels are stripes, instead of 190 of 200.
    EXPECT_NEAR(washed.margins[i].median / bright.margins[i].median, (60. / 180) / (190. / 200), 0.06);
  }
}

TEST_P(RigCheckTest, ClippedAndDarkPixelsAreCounted) {
  scene.reflected = 400;
  const double over = check(scene, see(scene)).exposure.clipped;
  EXPECT_GT(over, 0.9);
  CapturedFrame black = draw_scheme_frame(scene, 0);
  std::fill_n(black.picture.data(), black.picture.size(), std::uint8_t{3});
  if (!black.complement.empty())
    std::fill_n(black.complement.data(), black.complement.size(), std::uint8_t{3});
  const ExposureCheck none = check_exposure(black);
  EXPECT_EQ(none.dark, 1);
  EXPECT_EQ(none.clipped, 0);
  const auto& red = none.histogram[0];
  EXPECT_EQ(red[0], std::accumulate(red.begin(), red.end(), std::uint64_t{0}));
}

TEST_P(RigCheckTest, WhatIsNotDecodedIsNotCovered) {
  Seen seen = see(scene);
  const RigCheck all = check(scene, seen);
  std::erase_if(seen.grid, [&](const GridPoint& at) { return at.line * 2 < all.cover.height(); });
  const RigCheck half = check(scene, seen);
  EXPECT_EQ(half.lit_px, all.lit_px);
  EXPECT_NEAR(half.coverage(), 0.5 * all.coverage(), 0.02);
  const Image8 picture = draw_coverage(seen.decoded, half);
  const std::uint8_t* above = picture.row(10) + 3 * 80;
  const std::uint8_t* below = picture.row(picture.height() - 10) + 3 * 80;
  EXPECT_GT(above[0], above[1]) << "lit and not decoded is red";
  EXPECT_GT(below[1], below[0]) << "decoded is green";
}

TEST_P(RigCheckTest, StripesTooFineForTheFocusDoNotFitTogether) {
  // Stripes of two to three pixels; of boundaries that flip few channels, as the clear path has none.
  scene.pattern = *make_pattern(6, 2, 3, 48, CodePath::kPaper);
  scene.blur_px = 10;
  const CapturedFrame frame = draw_scheme_frame(scene, 0);
  const RigCheck found = check_rig(frame, frame, {}, scene.rig, scene.pattern);
  ASSERT_GT(found.neighbours, 100U);
  EXPECT_GT(found.order_errors.size() * 10, found.neighbours);
  for (const OrderError& error : found.order_errors) {
    EXPECT_LT(error.line, found.cover.height());
    EXPECT_LT(error.column_px, 160);
  }
}

TEST(RigCheck, AFrameWithoutStripesIsNotLit) {
  const StripedScene scene = striped_scene();
  CapturedFrame grey = draw_scheme_frame(scene, 0);
  std::fill_n(grey.picture.data(), grey.picture.size(), std::uint8_t{90});
  const RigCheck found = check_rig(grey, grey, {}, scene.rig, scene.pattern);
  EXPECT_EQ(found.lit_px, 0U);
  EXPECT_EQ(found.coverage(), 0);
  EXPECT_FALSE(found.slide);
  ASSERT_EQ(found.margins.size(), scene.pattern.palette.size());
  for (const ColourMargin& margin : found.margins) EXPECT_EQ(margin.stripes, 0U);
}

}  // namespace
}  // namespace relievo
