// SPDX-License-Identifier: Apache-2.0
// Projectors that are turned about their axis: the same light seen upright, and surfaces of it.
#include "capture/upright.h"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <numbers>
#include <opencv2/calib3d.hpp>
#include <string>
#include <tuple>
#include <vector>

#include "capture/evaluate/score.h"
#include "capture/reconstruct/reconstructor.h"
#include "capture/rig_file.h"
#include "tests/support/simulated.h"

namespace relievo {
namespace {

using test::Simulated;

/// Where the projector has a point of the camera's frame, by OpenCV.
cv::Point2d projected(const Rig& rig, const cv::Point3d& point) {
  const auto matrix = [](const std::array<double, 9>& m) {
    return cv::Mat(3, 3, CV_64F, const_cast<double*>(m.data())).clone();
  };
  cv::Mat turn;
  cv::Rodrigues(matrix(rig.projector_from_camera_rotation), turn);
  const auto& t = rig.projector_from_camera_translation;
  std::vector<cv::Point2d> out;
  cv::projectPoints(std::vector<cv::Point3d>{point}, turn, cv::Vec3d(t[0], t[1], t[2]),
                    matrix(rig.projector.matrix), rig.projector.distortion, out);
  return out[0];
}

TEST(Upright, IsTheSameLight) {
  for (const std::string roll : {"180", "-180", "171", "-140"}) {
    Simulated filmed("object,distortion=1,stripes=90,roll=" + roll);
    filmed.rig.projector.matrix[5] += 150;  // as projectors that throw upwards have it
    const auto seen = upright(filmed.rig, filmed.pattern);
    ASSERT_TRUE(seen) << seen.error().message;
    EXPECT_GT(seen->rig.projector_from_camera_rotation[0], 0);
    EXPECT_TRUE(check_rig(seen->rig));
    for (const cv::Point3d point :
         {cv::Point3d(0.1, -0.05, 0.9), cv::Point3d(-0.2, 0.15, 1.2), cv::Point3d(0, 0, 1)}) {
      const cv::Point2d was = projected(filmed.rig, point), is = projected(seen->rig, point);
      EXPECT_NEAR(is.x, filmed.rig.projector.width - 1 - was.x, 1e-6);
      EXPECT_NEAR(is.y, filmed.rig.projector.height - 1 - was.y, 1e-6);
    }
    const int last = filmed.pattern.boundaries() - 1, width = filmed.rig.projector.width;
    for (const int b : {0, 17, last}) {
      EXPECT_NEAR(seen->pattern.boundary_column_px(b, width),
                  width - 1 - filmed.pattern.boundary_column_px(last - b, width), 1e-9);
      EXPECT_EQ(seen->pattern.sequence[static_cast<std::size_t>(b)],
                filmed.pattern.sequence[static_cast<std::size_t>(last + 1 - b)]);
    }
  }
}

TEST(Upright, LeavesOtherRigsAsTheyAre) {
  for (const std::string roll : {"0", "20", "-40"}) {
    const Simulated filmed("object,distortion=1,roll=" + roll);
    const auto seen = upright(filmed.rig, filmed.pattern);
    ASSERT_TRUE(seen) << seen.error().message;
    EXPECT_EQ(to_yaml(seen->rig), to_yaml(filmed.rig));
    EXPECT_EQ(to_yaml(seen->pattern), to_yaml(filmed.pattern));
  }
}

TEST(Upright, RefusesStripesAlongLines) {
  for (const std::string roll : {"90", "-90", "60", "-120"}) {
    const Simulated filmed("object,roll=" + roll);
    const auto made = Reconstructor::create(filmed.rig, filmed.pattern, {});
    ASSERT_FALSE(made);
    EXPECT_NE(made.error().message.find("stripes run along the camera's lines"), std::string::npos)
        << made.error().message;
  }
}

TEST(Upright, RefusesStripesAlongTheBaseline) {
  const Simulated filmed("object");
  const auto at = [&](double degrees) {  // around the camera's axis, which the projector looks along
    Rig rig = filmed.rig;
    const double a = degrees * std::numbers::pi / 180;
    rig.projector_from_camera_rotation = {1, 0, 0, 0, 1, 0, 0, 0, 1};
    rig.projector_from_camera_translation = {-0.2 * std::cos(a), -0.2 * std::sin(a), 0};
    return upright(rig, filmed.pattern);
  };
  for (const double degrees : {0., 45., 80., 180.}) EXPECT_TRUE(at(degrees)) << degrees;
  for (const double degrees : {90., -89., 270.}) {
    const auto seen = at(degrees);
    ASSERT_FALSE(seen);
    EXPECT_NE(seen.error().message.find("put it beside the camera"), std::string::npos)
        << seen.error().message;
  }
}

class Turned : public testing::TestWithParam<std::tuple<std::string, Decoder>> {};

TEST_P(Turned, SurfacesAreWhereTheyAre) {
  const auto& [spec, decoder] = GetParam();
  const Simulated filmed(spec);
  auto reconstructor =
      Reconstructor::create(filmed.rig, filmed.pattern, {.decoder = decoder, .texture = false});
  ASSERT_TRUE(reconstructor) << reconstructor.error().message;
  Scorer scorer(reconstructor->rig(), reconstructor->pattern());
  for (std::uint64_t n = 0; n < 4; ++n) {
    ImageF truth;
    const auto made = reconstructor->add(filmed.frame(n, &truth));
    ASSERT_TRUE(made) << made.error().message;
    if (n > 1) scorer.add(truth, *made ? &(*made)->surface : nullptr);
  }
  EXPECT_GT(scorer.score().completeness, decoder == Decoder::kPaper ? 0.97 : 0.98);
  EXPECT_LT(scorer.score().outliers, decoder == Decoder::kPaper ? 0.005 : 0.001);
}

INSTANTIATE_TEST_SUITE_P(
    , Turned,
    testing::Combine(testing::Values("object,roll=180,distortion=1", "face,roll=-174", "object,baseline=-1",
                                     "object,roll=-8,baseline=0.5"),
                     testing::Values(Decoder::kOrdered, Decoder::kQuick, Decoder::kPaper)));

}  // namespace
}  // namespace relievo
