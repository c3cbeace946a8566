// SPDX-License-Identifier: Apache-2.0
// The quick decoder on scenes whose boundaries are known.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <utility>
#include <vector>

#include "capture/reconstruct/quick_difference.h"
#include "capture/reconstruct/reconstructor.h"
#include "tests/support/simulated.h"
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
  for (const int threads : {1, 2, 5, 64}) {  // of 64 most have no line
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

Reconstructor quick_of(const test::Simulated& simulated) {
  return *Reconstructor::create(simulated.rig, simulated.pattern,
                                {.decoder = Decoder::kQuick, .texture = false});
}

// What the scenes above lack: contrast, where luma is asked for the place, also beside the picture's sides.
TEST(QuickDecoder, DecodesWhatHasContrast) {
  const test::Simulated object("object,width=320,height=240,stripes=45");
  Reconstructor reconstructor = quick_of(object);
  for (std::uint64_t n = 0; n < 3; ++n) {
    const auto out = reconstructor.add(object.frame(n));
    ASSERT_TRUE(out) << out.error().message;
    if (n > 0) {
      EXPECT_GT((*out)->surface.grid.size(), 2000U);
    }
  }
}

// As calibration makes it of a camera that sees little.
TEST(QuickDecoder, AMatrixOfLargeNumbersTellsTheSamePlaces) {
  test::Simulated object("object,width=320,height=240,stripes=45");
  using Places = std::map<std::pair<int, int>, float>;
  const auto places = [&] {
    Reconstructor reconstructor = quick_of(object);
    Places out;
    for (std::uint64_t n = 0; n < 3; ++n) {
      const auto frame = reconstructor.add(object.frame(n));
      if (n < 2) continue;
      for (const GridPoint& p : (*frame)->surface.grid) out[{p.line, p.boundary}] = p.column_px;
    }
    return out;
  };
  const Places expected = places();
  for (double& m : object.rig.colour_matrix) m *= 8;
  std::size_t same = 0;
  for (const auto& [at, column_px] : places()) {
    const auto there = expected.find(at);
    same += there != expected.end() && std::fabs(there->second - column_px) < 0.02;
  }
  EXPECT_GT(same, expected.size() * 98 / 100);
}

// Where frames are dropped: a person who walks at 1 m/s has gone 0.3 m since the other slide was seen, or 33
// mm where the frame before was observed.
TEST(QuickDecoder, AnObservedFrameIsTheNextOnesOther) {
  const test::Simulated walk("walk,width=320,height=240,stripes=45");
  constexpr std::uint64_t kFirst = 17, kBefore = 20,
                          kAfter = 29;  // an odd number of frames later, and an even one
  std::vector<CapturedFrame> film;
  for (std::uint64_t n = kFirst; n <= kAfter + 1; ++n) film.push_back(walk.frame(n));
  using Places = std::map<std::pair<int, int>, float>;
  enum class Between { kEach, kNone, kLast };
  const auto places = [&](Between between, std::uint64_t last) {
    Reconstructor reconstructor = quick_of(walk);
    Places out;
    for (std::uint64_t n = kFirst; n <= last; ++n) {
      const CapturedFrame& shown = film[n - kFirst];
      if (n > kBefore && n < last && between != Between::kEach) {
        if (between == Between::kLast && n == last - 1) {
          EXPECT_TRUE(reconstructor.observe(shown));
        }
        continue;
      }
      const auto frame = reconstructor.add(shown);
      EXPECT_TRUE(frame);
      if (n < last) continue;
      for (const GridPoint& p : (*frame)->surface.grid) out[{p.line, p.boundary}] = p.column_px;
    }
    return out;
  };
  for (const std::uint64_t last : {kAfter, kAfter + 1}) {
    const Places all = places(Between::kEach, last);
    const auto found = [&](const Places& some) {
      return std::count_if(some.begin(), some.end(), [&](const auto& place) {
        const auto same = all.find(place.first);
        return same != all.end() && std::abs(same->second - place.second) < 1;
      });
    };
    const Places direct = places(Between::kNone, last), observed = places(Between::kLast, last);
    const auto elsewhere = [&](const Places& some) {
      return static_cast<std::ptrdiff_t>(some.size()) - found(some);
    };
    EXPECT_GT(static_cast<double>(found(observed)), 0.97 * static_cast<double>(all.size()));
    EXPECT_GT(found(observed), found(direct));
    EXPECT_LT(elsewhere(observed), elsewhere(direct));
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
