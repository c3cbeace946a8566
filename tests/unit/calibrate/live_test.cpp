// SPDX-License-Identifier: Apache-2.0
// The parts of a live calibration: waiting for rest, telling slides and colours apart, what is still missing.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cstdint>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "capture/calibrate/board_scene.h"
#include "capture/calibrate/coverage.h"
#include "capture/calibrate/sheet_colours.h"
#include "capture/calibrate/still_collector.h"
#include "capture/pattern/bcsl.h"
#include "capture/source/field_source.h"
#include "tests/unit/calibrate/true_rig.h"

namespace relievo {
namespace {

using testing::HasSubstr;

const std::string kSmall = "width=160,height=120,stripes=30";

std::vector<CapturedFrame> frames_of(const std::string& uri) {
  auto source = open_source(uri, {});
  EXPECT_TRUE(source.ok()) << source.error().message;
  std::vector<CapturedFrame> out;
  while (source.ok()) {
    auto frame = (*source)->next();
    EXPECT_TRUE(frame.ok());
    if (!frame.ok() || !*frame) break;
    out.push_back(*std::move(*frame));
  }
  return out;
}

/// Frames at which the collector had enough.
std::vector<std::size_t> rests(const std::vector<CapturedFrame>& frames, std::size_t cycle) {
  StillCollector collector(cycle);
  std::vector<std::size_t> out;
  for (std::size_t i = 0; i < frames.size(); ++i) {
    if (collector.add(frames[i])) out.push_back(i);
  }
  return out;
}

TEST(StillCollector, EachPoseIsTakenOnceWhileItRests) {
  for (const char* scan : {"interlaced", "progressive"}) {
    // 14 frames at rest, 6 on the way.
    const auto found = rests(frames_of("sim:board,period=60,scan=" + std::string(scan) + "," + kSmall), 4);
    EXPECT_THAT(found, testing::ElementsAre(7, 27, 47)) << scan;
  }
}

TEST(StillCollector, LostFramesDelayButDoNotMislead) {
  const auto found = rests(frames_of("sim:board,period=60,drop=7," + kSmall), 4);
  ASSERT_EQ(found.size(), 3u);
}

TEST(StillCollector, NoisyPicturesAreAtRestToo) {
  EXPECT_EQ(rests(frames_of("sim:board,period=40,noise=4," + kSmall), 4).size(), 2u);
}

TEST(StillCollector, WhatNeverRestsIsNeverTaken) {
  // An object that turns all the time.
  EXPECT_TRUE(rests(frames_of("sim:walk,frames=24,period=24," + kSmall), 2).empty());
}

TEST(StillCollector, MeansAreWholePictures) {
  const auto frames = frames_of("sim:board,frames=12,period=20," + kSmall);
  StillCollector collector(4);
  for (const CapturedFrame& frame : frames) collector.add(frame);
  const auto pairs = collector.pairs();
  ASSERT_EQ(pairs.size(), 4u);
  EXPECT_EQ(collector.at_rest(), 4u);
  for (const StripePair& pair : pairs) {
    EXPECT_EQ(pair.lit.height(), 120);
    EXPECT_EQ(pair.complement.width(), 160);
  }
}

TEST(SortStripes, PairsInAnyOrderBecomeAStack) {
  Rig rig = truth();
  const Board board{9, 7, 0.025};
  const auto pattern = make_pattern(6, 2, 0, 50);
  ASSERT_TRUE(pattern.ok());
  const Pose pose = example_poses(rig, board, 1.0, 1, 1).at(0);
  const StripeStack stack = render_stripe_view(rig, board, pose, *pattern, 0.7, {});
  const auto pair = [](const StripePair& p) { return StripePair{p.lit.clone(), p.complement.clone()}; };
  const auto sort = [&](std::vector<StripePair> pairs) {
    WorkerPool pool(2);
    return sort_stripes(std::move(pairs), *pattern, 800, 600, colours_of(rig), pool);
  };
  std::vector<StripePair> mixed;
  mixed.push_back(pair(stack.rows[1]));
  mixed.push_back(pair(stack.columns[1]));
  mixed.push_back(pair(stack.rows[0]));
  mixed.push_back(pair(stack.columns[0]));
  const auto sorted = sort(std::move(mixed));
  ASSERT_TRUE(sorted.ok()) << sorted.error().message;
  const auto same = [](const Image8& a, const Image8& b) {
    return a.size() == b.size() && std::equal(a.data(), a.data() + a.size(), b.data());
  };
  for (std::size_t i = 0; i < 2; ++i) {
    EXPECT_TRUE(same(sorted->columns[i].lit, stack.columns[i].lit)) << i;
    EXPECT_TRUE(same(sorted->rows[i].complement, stack.rows[i].complement)) << i;
  }

  std::vector<StripePair> one_axis;
  for (int i = 0; i < 4; ++i) one_axis.push_back(pair(stack.columns[static_cast<std::size_t>(i % 2)]));
  EXPECT_THAT(sort(std::move(one_axis)).error().message,
              HasSubstr("4 slides along columns and 0 along rows are seen"));
}

TEST(SheetColours, AreToldApartThroughCrosstalk) {
  std::vector<Image8> pictures;
  for (const CapturedFrame& frame : frames_of("sim:sheet,frames=4,scan=progressive," + kSmall)) {
    pictures.push_back(frame.picture.clone());
    pictures.push_back(frame.complement.clone());
  }
  const auto colours = tell_colours(pictures);
  ASSERT_TRUE(colours.ok()) << colours.error().message;
  EXPECT_THAT(*colours, testing::ElementsAre(0, 7, 1, 6, 2, 5, 4, 3));
  pictures[2] = pictures[4].clone();
  EXPECT_THAT(tell_colours(pictures).error().message, HasSubstr("each of the 8 colours once"));
}

/// A board turned about its middle by `radians` about the camera's y axis (x: about its x axis).
MeasuredView turned_board(double about_x, double about_y, double shift_x_m) {
  const Rig rig = truth();
  const Board board{9, 7, 0.025};
  const Pose turn = {about_x, about_y, 0, 0, 0, 0};
  const auto r = rotation_matrix(turn);
  Pose pose = turn;
  for (std::size_t i = 0; i < 3; ++i) pose[3 + i] = -(r[3 * i] * 0.1 + r[3 * i + 1] * 0.075);
  pose[3] += shift_x_m;
  pose[5] += 1;
  MeasuredView view;
  for (int i = 0; i < board.corners(); ++i)
    view.corners.push_back({board.corner_m(i), project_board(rig.camera, pose, board.corner_m(i)), {}});
  return view;
}

TEST(Coverage, SaysWhichSideIsFartherAndWhatIsMissing) {
  Coverage coverage(truth().camera, truth().projector);
  EXPECT_THAT(coverage.missing(), HasSubstr("top left, top, top right"));
  // About y (down), x turns towards -z: the right side comes nearer, so the left one is farther away.
  const MeasuredView left = turned_board(0, 0.4, 0);
  EXPECT_EQ(coverage.add(left), "63 corners, its left side farther away by 23 degrees");
  EXPECT_TRUE(coverage.repeats(left));
  EXPECT_TRUE(coverage.repeats(turned_board(0, 0.4, 0.005)));
  EXPECT_FALSE(coverage.repeats(turned_board(0, 0.4, 0.05)));
  EXPECT_THAT(coverage.add(turned_board(0.4, 0, -0.2)),
              HasSubstr("63 corners, its lower side farther away by 2"));
  EXPECT_EQ(coverage.add(turned_board(0, 0, 0.2)), "63 corners");
  EXPECT_THAT(coverage.missing(), HasSubstr("its right and upper side farther away"));
}

/// How many pixels are exactly of a colour.
std::size_t count_of(const Image8& picture, std::array<int, 3> rgb) {
  std::size_t count = 0;
  for (std::size_t i = 0; i < static_cast<std::size_t>(picture.width()) * picture.height(); ++i) {
    const std::uint8_t* p = picture.data() + 3 * i;
    count += p[0] == rgb[0] && p[1] == rgb[1] && p[2] == rgb[2];
  }
  return count;
}

TEST(Coverage, ThePictureLosesItsRedWhereCornersWereSeen) {
  constexpr std::array<int, 3> kMissing = {92, 36, 36}, kSeen = {30, 64, 44};
  Coverage coverage(truth().camera, truth().projector);
  const Image8 before = coverage.draw();
  EXPECT_EQ(count_of(before, kSeen), 0u);
  const std::size_t missing = count_of(before, kMissing);
  EXPECT_GT(missing, 200000u);
  coverage.add(turned_board(0, 0, 0));
  const Image8 after = coverage.draw();
  EXPECT_EQ(after.width(), before.width());
  EXPECT_GT(count_of(after, kSeen), 20000u);
  EXPECT_LT(count_of(after, kMissing), missing - 20000);
  // As wide as both devices' pictures at one height.
  EXPECT_EQ(before.width(), 720 * truth().camera.width / truth().camera.height + 8 +
                                720 * truth().projector.width / truth().projector.height);
}

TEST(Coverage, APageGetsThePictureWithoutWordsAndTheTiltsBesideIt) {
  const auto written = [](const Image8& picture) {  // nothing else is as light
    std::size_t count = 0;
    for (std::size_t i = 0; i < picture.size(); i += 3)
      count += *std::min_element(picture.data() + i, picture.data() + i + 3) > 175;
    return count;
  };
  Coverage coverage(truth().camera, truth().projector);
  EXPECT_TRUE(coverage.tilts().empty());
  coverage.add(turned_board(0, 0.4, 0));
  EXPECT_EQ(coverage.tilts().size(), 1u);
  const Image8 seen = coverage.draw_seen();
  EXPECT_EQ(seen.height(), 720);
  EXPECT_EQ(written(seen), 0u);
  EXPECT_GT(written(coverage.draw()), 100u);
}

}  // namespace
}  // namespace relievo
