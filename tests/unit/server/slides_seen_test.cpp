// SPDX-License-Identifier: Apache-2.0
// Proves: of a camera that is too fast, no frames are kept that the other slide is missing for.
#include "server/slides_seen.h"

#include <gtest/gtest.h>

namespace relievo {
namespace {

constexpr std::int64_t kFrame_ns = 33'000'000;

struct Camera {
  SlidesSeen seen;
  explicit Camera(std::int64_t every_ns) : frame_ns(every_ns) {}

  void takes(std::uint64_t number) { seen.add(number, time_ns(number)); }
  bool alone(std::uint64_t number) const { return seen.other_is_old(number, time_ns(number)); }
  std::int64_t time_ns(std::uint64_t number) const { return static_cast<std::int64_t>(number) * frame_ns; }

  std::int64_t frame_ns;
};

TEST(SlidesSeen, WhereNothingIsDroppedEveryFrameHasTheOther) {
  Camera camera(kFrame_ns);
  for (std::uint64_t number = 0; number < 6; ++number) {
    EXPECT_FALSE(camera.alone(number)) << number;
    camera.takes(number);
  }
}

TEST(SlidesSeen, EverySecondFrameShowsOneSlideAlone) {
  Camera camera(kFrame_ns);
  camera.takes(0);
  EXPECT_TRUE(camera.alone(2));  // the other was never seen,
  camera.takes(1);
  camera.takes(2);
  EXPECT_TRUE(camera.alone(4));  // or 99 ms ago
  EXPECT_TRUE(camera.alone(5));  // as the last frame was of this one
}

TEST(SlidesSeen, AFastCameraMayLeaveAFrameOut) {
  Camera camera(kFrame_ns / 2);
  camera.takes(0);
  camera.takes(1);
  EXPECT_FALSE(camera.alone(3));  // the other 49.5 ms ago
  EXPECT_FALSE(camera.alone(4));  // or the last of it, 49.5
  EXPECT_TRUE(camera.alone(5));   // 82.5
}

}  // namespace
}  // namespace relievo
