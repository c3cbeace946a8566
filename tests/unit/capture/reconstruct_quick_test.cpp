// SPDX-License-Identifier: Apache-2.0
// The quick decoder on scenes whose boundaries are known.
#include <gtest/gtest.h>

#include <cmath>

#include "capture/pattern/bcsl.h"
#include "capture/reconstruct/quick_difference.h"
#include "capture/reconstruct/reconstructor.h"
#include "capture/source/sim/renderer.h"
#include "capture/source/sim/scene.h"
#include "tests/support/striped_scene.h"

namespace relievo {
namespace {

TEST(QuickDecoder, FindsEveryBoundaryWhereItIs) {
  for (const Scan scan : {Scan::kInterlaced, Scan::kProgressive}) {
    const test::StripedScene scene = test::striped_scene(scan);
    auto reconstructor = Reconstructor::create(scene.rig, scene.pattern, {.decoder = Decoder::kQuick});
    ASSERT_TRUE(reconstructor);
    for (std::uint64_t n = 0; n < 4; ++n) {
      auto frame = reconstructor->add(test::draw_frame(scene, n));
      ASSERT_TRUE(frame);
      ASSERT_EQ(frame->has_value(), n > 0);
      if (n == 0) continue;
      const Surface& surface = (*frame)->surface;
      const std::size_t lines = scan == Scan::kInterlaced ? 60 : 120;
      EXPECT_GT(surface.grid.size(), lines * 12);
      for (const GridPoint& p : surface.grid) EXPECT_NEAR(p.column_px, scene.camera_column(p.boundary), 0.1);
    }
  }
}

TEST(QuickDecoder, GivesTheSameForAnyNumberOfThreads) {
  const test::StripedScene scene = test::striped_scene(Scan::kInterlaced);
  std::vector<Surface> surfaces;
  for (const int threads : {1, 2, 5}) {
    auto reconstructor =
        Reconstructor::create(scene.rig, scene.pattern, {.decoder = Decoder::kQuick, .threads = threads});
    ASSERT_TRUE(reconstructor);
    for (std::uint64_t n = 0; n < 3; ++n) {
      auto frame = reconstructor->add(test::draw_frame(scene, n));
      ASSERT_TRUE(frame);
      if (n == 2) surfaces.push_back((*frame)->surface);
    }
  }
  for (const Surface& s : surfaces) {
    EXPECT_FALSE(s.positions.empty());
    EXPECT_EQ(s.positions, surfaces[0].positions);
    EXPECT_EQ(s.triangles, surfaces[0].triangles);
  }
}

// What the scenes above lack: contrast, where luma is asked for the place, also beside the picture's sides.
TEST(QuickDecoder, DecodesWhatHasContrast) {
  const auto options = sim::parse_sim_options("object,width=320,height=240,stripes=45");
  ASSERT_TRUE(options);
  const auto scene = sim::make_scene(options->scene);
  ASSERT_TRUE(scene);
  const Rig rig = sim::make_rig(*options, (*scene)->view());
  const auto pattern = make_pattern(options->base, options->slides, options->first, options->stripes);
  ASSERT_TRUE(pattern);
  const sim::Renderer renderer(*options, rig, *pattern, *scene);
  auto reconstructor = Reconstructor::create(rig, *pattern, {.decoder = Decoder::kQuick, .texture = false});
  ASSERT_TRUE(reconstructor);
  for (std::uint64_t n = 0; n < 3; ++n) {
    CapturedFrame frame;
    frame.number = n;
    frame.time_ns = static_cast<std::int64_t>(n) * 33'366'667;
    frame.scan = rig.scan;
    frame.picture = renderer.render(n, false).picture;
    const auto out = reconstructor->add(frame);
    ASSERT_TRUE(out) << out.error().message;
    if (n > 0) {
      EXPECT_GT((*out)->surface.grid.size(), 2000U);
    }
  }
}

TEST(QuickDifference, TellsSlidesApart) {
  const test::StripedScene scene = test::striped_scene();
  WorkerPool pool(1);
  std::array<QuickImage, 3> images;
  QuickDifferencer differencer(scene.rig.colour_matrix);
  int lines = 0;
  for (std::uint64_t n = 0; n < 3; ++n)
    differencer.difference(test::draw_frame(scene, n), pool, images[n],
                           [&](int begin, int end, int) { lines += end - begin; });
  EXPECT_EQ(lines, 3 * 60);
  EXPECT_TRUE(same_slide(images[0], images[2]));
  EXPECT_FALSE(same_slide(images[0], images[1]));
}

}  // namespace
}  // namespace relievo
