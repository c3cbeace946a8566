// SPDX-License-Identifier: Apache-2.0
// The whole decoder on a plane drawn exactly.
#include "capture/reconstruct/reconstructor.h"

#include <gtest/gtest.h>

#include <cmath>
#include <map>
#include <optional>
#include <string>
#include <tuple>
#include <utility>

#include "capture/evaluate/score.h"
#include "capture/pattern/repeating.h"
#include "capture/reconstruct/detection_lines.h"
#include "tests/support/striped_scene.h"

namespace relievo {
namespace {

using test::draw_frame;
using test::StripedScene;

std::optional<Frame3D> add(Reconstructor& reconstructor, const CapturedFrame& frame) {
  auto result = reconstructor.add(frame);
  EXPECT_TRUE(result) << result.error().message;
  return result ? *std::move(result) : std::nullopt;
}

/// Boundaries the camera sees, away from the picture's edges.
int visible(const StripedScene& scene) {
  int n = 0;
  for (int b = 0; b < scene.pattern.boundaries(); ++b) {
    const double column = scene.camera_column(b);
    n += column > 8 && column < scene.rig.camera.width - 9;
  }
  return n;
}

void expect_the_plane(const StripedScene& scene, const Frame3D& frame) {
  const int step = scene.rig.scan == Scan::kInterlaced ? 2 : 1;
  const int lines = scene.rig.camera.height / step;
  const Surface& s = frame.surface;
  EXPECT_GE(s.positions.size(), static_cast<std::size_t>(visible(scene) * lines));
  EXPECT_FALSE(s.triangles.empty());
  ASSERT_EQ(s.grid.size(), s.positions.size());
  ASSERT_EQ(s.normals.size(), s.positions.size());
  ASSERT_EQ(s.texture_coordinates.size(), s.positions.size());
  for (std::size_t i = 0; i < s.positions.size(); ++i) {
    const GridPoint& at = s.grid[i];
    ASSERT_NEAR(at.column_px, scene.camera_column(at.boundary), 0.1);
    const Vec3f& p = s.positions[i];
    ASSERT_NEAR(p[2], scene.depth_m + scene.slope * p[0], 0.002);
    ASSERT_NEAR(s.texture_coordinates[i][0], (at.column_px + 0.5) / scene.rig.camera.width, 1e-5);
    ASSERT_NEAR(s.texture_coordinates[i][1], (at.line * step + 0.5) / scene.rig.camera.height, 1e-5);
  }
}

/// Both scans under both decoders.
class ReconstructorTest : public ::testing::TestWithParam<std::tuple<Scan, Decoder>> {
 protected:
  static Scan scan() { return std::get<0>(GetParam()); }
  static Reconstructor make(const StripedScene& scene, ReconstructOptions options = {}) {
    options.decoder = std::get<1>(GetParam());
    auto made = Reconstructor::create(scene.rig, scene.pattern, options);
    EXPECT_TRUE(made) << made.error().message;
    return *std::move(made);
  }
};

TEST_P(ReconstructorTest, EveryFrameAfterTheFirstGivesTheSurface) {
  const StripedScene scene = test::striped_scene(scan());
  ASSERT_GE(visible(scene), 8);
  Reconstructor reconstructor = make(scene);
  for (std::uint64_t n = 0; n < 6; ++n) {
    const auto frame = add(reconstructor, draw_frame(scene, n));
    ASSERT_EQ(frame.has_value(), n > 0) << n;
    EXPECT_FALSE(reconstructor.report().same_slide);
    if (!frame) continue;
    EXPECT_EQ(frame->number, n);
    EXPECT_EQ(frame->time_ns, std::llround(static_cast<double>(n) * 1e9 / 29.97));
    expect_the_plane(scene, *frame);
    EXPECT_EQ(reconstructor.report().matched, reconstructor.report().boundaries);
  }
}

TEST_P(ReconstructorTest, ScoresAsAPerfectPlane) {
  StripedScene scene = test::striped_scene(scan());
  scene.blur_px = 1;  // what a pixel alone does
  Reconstructor reconstructor = make(scene);
  Scorer scorer(scene.rig, scene.pattern);
  add(reconstructor, draw_frame(scene, 0));
  for (std::uint64_t n = 1; n < 4; ++n) {
    const auto frame = add(reconstructor, draw_frame(scene, n));
    ASSERT_TRUE(frame);
    scorer.add(draw_truth(scene), &frame->surface);
  }
  const Score s = scorer.score();
  EXPECT_GT(s.completeness, 0.99);
  EXPECT_DOUBLE_EQ(s.outliers, 0);
  // A pixel is z / (focal length x baseline) = 25 mm of depth a metre for this small rig: a twentieth of one.
  EXPECT_LT(s.median_um_per_m, 1250);
}

TEST_P(ReconstructorTest, TheTextureIsTheSceneInWhiteLight) {
  const StripedScene scene = test::striped_scene(scan());
  Reconstructor reconstructor = make(scene);
  add(reconstructor, draw_frame(scene, 0));
  const auto frame = add(reconstructor, draw_frame(scene, 1));
  ASSERT_TRUE(frame);
  ASSERT_EQ(frame->texture.width(), 160);
  ASSERT_EQ(frame->texture.height(), 120);
  const double white = 2 * scene.ambient + scene.reflected;
  for (int x = 40; x < 120; ++x)
    for (int c = 0; c < 3; ++c) EXPECT_NEAR(frame->texture.row(60)[3 * x + c], white, 1.01);

  Reconstructor bare = make(scene, {.texture = false});
  add(bare, draw_frame(scene, 0));
  EXPECT_TRUE(add(bare, draw_frame(scene, 1))->texture.empty());
}

TEST_P(ReconstructorTest, EitherSlideMayComeFirst) {
  const StripedScene scene = test::striped_scene(scan());
  for (const int first : {0, 1}) {
    Reconstructor reconstructor = make(scene);
    add(reconstructor, draw_frame(scene, 0, first));
    const auto frame = add(reconstructor, draw_frame(scene, 1, 1 - first));
    ASSERT_TRUE(frame);
    EXPECT_EQ(reconstructor.report().slide, 1 - first);
    expect_the_plane(scene, *frame);
  }
}

TEST_P(ReconstructorTest, ADroppedFrameIsSeenAndTheNextDecodes) {
  const StripedScene scene = test::striped_scene(scan());
  Reconstructor reconstructor = make(scene);
  int same = 0;
  for (const std::uint64_t n : {0U, 1U, 2U, 4U, 5U, 6U, 9U, 11U, 12U}) {  // 3, 7, 8 and 10 are missing
    const auto frame = add(reconstructor, draw_frame(scene, n));
    EXPECT_EQ(reconstructor.report().same_slide, n == 4 || n == 11) << n;
    same += reconstructor.report().same_slide;
    ASSERT_EQ(frame.has_value(), n > 0) << n;
    if (frame) expect_the_plane(scene, *frame);
  }
  EXPECT_EQ(same, 2);
}

TEST_P(ReconstructorTest, NothingUntilBothSlidesWereSeen) {
  const StripedScene scene = test::striped_scene(scan());
  Reconstructor reconstructor = make(scene);
  for (std::uint64_t n = 0; n < 3; ++n) EXPECT_FALSE(add(reconstructor, draw_frame(scene, n, 0)));
  EXPECT_TRUE(reconstructor.report().same_slide);
  const auto frame = add(reconstructor, draw_frame(scene, 3, 1));
  ASSERT_TRUE(frame);
  expect_the_plane(scene, *frame);
}

TEST_P(ReconstructorTest, ThreadsGiveTheSameBytes) {
  const StripedScene scene = test::striped_scene(scan());
  Reconstructor serial = make(scene);
  Reconstructor threaded = make(scene, {.threads = 3});
  for (std::uint64_t n = 0; n < 4; ++n) {
    const auto a = add(serial, draw_frame(scene, n));
    const auto b = add(threaded, draw_frame(scene, n));
    ASSERT_EQ(a.has_value(), b.has_value());
    if (!a) continue;
    EXPECT_EQ(a->surface.positions, b->surface.positions);
    EXPECT_EQ(a->surface.normals, b->surface.normals);
    EXPECT_EQ(a->surface.texture_coordinates, b->surface.texture_coordinates);
    EXPECT_EQ(a->surface.triangles, b->surface.triangles);
    EXPECT_TRUE(std::equal(a->texture.data(), a->texture.data() + a->texture.size(), b->texture.data()));
  }
}

TEST_P(ReconstructorTest, ABlackFrameGivesAnEmptySurfaceAndTheNextOnesRecover) {
  const StripedScene scene = test::striped_scene(scan());
  Reconstructor reconstructor = make(scene);
  add(reconstructor, draw_frame(scene, 0));
  CapturedFrame black = draw_frame(scene, 1);
  std::fill_n(black.picture.data(), black.picture.size(), std::uint8_t{0});
  std::fill_n(black.complement.data(), black.complement.size(), std::uint8_t{0});
  const auto empty = add(reconstructor, black);
  ASSERT_TRUE(empty);
  EXPECT_TRUE(empty->surface.positions.empty());
  EXPECT_TRUE(empty->surface.triangles.empty());
  for (std::uint64_t n = 2; n < 6; ++n) {
    const auto frame = add(reconstructor, draw_frame(scene, n));
    ASSERT_TRUE(frame);
    if (n > 2) expect_the_plane(scene, *frame);  // 2 has only the black one to be decoded with
  }
}

TEST_P(ReconstructorTest, OneSlideDecodesEveryFrame) {
  StripedScene scene = test::striped_scene(scan());
  scene.pattern = *make_pattern(6, 1, 0, 16);
  Reconstructor reconstructor = make(scene);
  for (std::uint64_t n = 0; n < 3; ++n) {
    const auto frame = add(reconstructor, draw_frame(scene, n, 0));
    ASSERT_TRUE(frame) << n;
    expect_the_plane(scene, *frame);
    EXPECT_FALSE(reconstructor.report().same_slide);
  }
}

TEST_P(ReconstructorTest, AFrameThatDoesNotFitTheRigSaysHow) {
  const StripedScene scene = test::striped_scene(scan());
  Reconstructor reconstructor = make(scene);
  CapturedFrame frame = draw_frame(scene, 7);
  frame.picture = Image8(80, 60, 3);
  auto result = reconstructor.add(frame);
  ASSERT_FALSE(result);
  EXPECT_EQ(result.error().message, "frame 7 is 80x60 but rig.yaml says 160x120");

  frame = draw_frame(scene, 8);
  frame.picture = Image8(160, 120, 1);
  result = reconstructor.add(frame);
  ASSERT_FALSE(result);
  EXPECT_NE(result.error().message.find("channel"), std::string::npos) << result.error().message;

  const StripedScene other =
      test::striped_scene(scan() == Scan::kInterlaced ? Scan::kProgressive : Scan::kInterlaced);
  result = reconstructor.add(draw_frame(other, 9));
  ASSERT_FALSE(result);
  EXPECT_NE(result.error().message.find("progressive"), std::string::npos) << result.error().message;
  EXPECT_NE(result.error().message.find("interlaced"), std::string::npos) << result.error().message;

  if (scan() == Scan::kProgressive) {
    frame = draw_frame(scene, 10);
    frame.complement = Image8(160, 60, 3);
    result = reconstructor.add(frame);
    ASSERT_FALSE(result);
    EXPECT_NE(result.error().message.find("160x60"), std::string::npos) << result.error().message;
  }
  // And it goes on with frames that do.
  add(reconstructor, draw_frame(scene, 11));
  EXPECT_TRUE(add(reconstructor, draw_frame(scene, 12)));
}

// A line's own row alone tells where its vertices are: they lie where those of all lines lie on that row.
TEST_P(ReconstructorTest, HalfOfTheLinesAreEverySecondOneAndAFourthEveryFourth) {
  const StripedScene scene = test::striped_scene(scan());
  for (const int stride : {2, 4}) {
    const std::size_t share = static_cast<std::size_t>(stride);
    Reconstructor whole = make(scene);
    Reconstructor half = make(scene, {.line_stride = stride});
    for (std::uint64_t n = 0; n < 4; ++n) {
      const auto all = add(whole, draw_frame(scene, n));
      const auto some = add(half, draw_frame(scene, n));
      ASSERT_EQ(all.has_value(), some.has_value());
      if (!all) continue;
      std::map<std::pair<int, int>, Vec3f> at;
      for (std::size_t v = 0; v < all->surface.grid.size(); ++v)
        at[{all->surface.grid[v].line, all->surface.grid[v].boundary}] = all->surface.positions[v];
      EXPECT_GT(some->surface.positions.size(), all->surface.positions.size() / share * 4 / 5);
      EXPECT_FALSE(some->surface.triangles.empty());
      for (std::size_t v = 0; v < some->surface.grid.size(); ++v) {
        const GridPoint& p = some->surface.grid[v];
        ASSERT_LT(p.line, line_count(scene.rig, stride));
        const auto there = at.find({stride * p.line, p.boundary});
        if (there == at.end()) continue;
        for (std::size_t i = 0; i < 3; ++i)
          EXPECT_NEAR(some->surface.positions[v][i], there->second[i], 2e-3) << p.line;
      }
      EXPECT_EQ(some->texture.height(), 120);
    }
  }
}

// So few lines that nothing tells a picture's noise.
TEST_P(ReconstructorTest, AFewLinesAreOfThePlane) {
  StripedScene scene = test::striped_scene(scan());
  scene.rig.camera.height = 8;
  scene.rig.camera.matrix[5] = 3.5;
  for (const int stride : {1, 2, 4}) {
    Reconstructor reconstructor = make(scene, {.line_stride = stride});
    for (std::uint64_t n = 0; n < 4; ++n) {
      const auto frame = add(reconstructor, draw_frame(scene, n));
      ASSERT_EQ(frame.has_value(), n > 0);
      if (!frame) continue;
      const Surface& s = frame->surface;
      EXPECT_TRUE(stride > 1 || !s.triangles.empty());
      for (std::size_t i = 0; i < s.positions.size(); ++i) {
        ASSERT_NEAR(s.grid[i].column_px, scene.camera_column(s.grid[i].boundary), 0.2) << stride;
        ASSERT_TRUE(std::isfinite(s.sigmas_m[i])) << stride;
      }
    }
  }
}

TEST(Reconstructor, RefusesPatternsItCannotDecode) {
  StripedScene scene = test::striped_scene();
  scene.pattern = *make_pattern(3, 3, 0, 16);
  auto made = Reconstructor::create(scene.rig, scene.pattern, {});
  ASSERT_FALSE(made);
  EXPECT_NE(made.error().message.find("3 slides"), std::string::npos) << made.error().message;
  scene = test::striped_scene();
  scene.pattern.sequence.resize(1);
  EXPECT_FALSE(Reconstructor::create(scene.rig, scene.pattern, {}));
}

TEST(Reconstructor, RefusesAPatternOfAnotherProjector) {
  StripedScene scene = test::striped_scene();
  scene.pattern = *make_repeating_pattern(6, 0, scene.rig.projector.width + 1);
  const auto made = Reconstructor::create(scene.rig, scene.pattern, {});
  ASSERT_FALSE(made.ok());
  EXPECT_EQ(made.error().message,
            "the pattern has 257 stripes and the rig's projector 256 columns: are they of one rig?");
  scene.pattern = *make_repeating_pattern(6, 0, scene.rig.projector.width);
  EXPECT_TRUE(Reconstructor::create(scene.rig, scene.pattern, {}).ok());
}

INSTANTIATE_TEST_SUITE_P(All, ReconstructorTest,
                         ::testing::Combine(::testing::Values(Scan::kInterlaced, Scan::kProgressive),
                                            ::testing::Values(Decoder::kOrdered, Decoder::kQuick,
                                                              Decoder::kPaper)),
                         [](const auto& p) {
                           return std::string(to_string(std::get<0>(p.param))) + "_" +
                                  std::string(decoder_name(std::get<1>(p.param)));
                         });

}  // namespace
}  // namespace relievo
