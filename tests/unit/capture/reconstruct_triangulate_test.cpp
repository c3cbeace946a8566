// SPDX-License-Identifier: Apache-2.0
// Triangulation against OpenCV's camera model, which shares no code with ours.
#include "capture/reconstruct/triangulate.h"

#include <gtest/gtest.h>

#include <bit>
#include <cmath>
#include <opencv2/calib3d.hpp>
#include <opencv2/imgproc.hpp>
#include <random>
#include <vector>

#include "capture/pattern/bcsl.h"

namespace relievo {
namespace {

/// The rig of a real scan: long lenses, strong and decentred distortion in both.
Rig shell_rig() {
  Rig rig;
  rig.scan = Scan::kProgressive;
  rig.frame_rate = 30;
  rig.camera = {1280,
                1040,
                {2821.3854678520406, 0, 1206.7630790244727, 0, 2818.929639941908, 712.2506617197882, 0, 0, 1},
                {-0.2313950835590059, 0.147269825123663, -0.0008846905517822152, 0.0012803348512495708,
                 -0.03211108610566239}};
  rig.projector = {
      1280,
      800,
      {1653.192676365003, 0, 622.4440586827484, 0, 1719.2298865347213, 363.4568831100737, 0, 0, 1},
      {-0.04856144278178414, 1.42342837448657, -0.0075128236685432425, -0.001977504601733591,
       -7.364555484521607}};
  rig.projector_from_camera_rotation = {0.9125581445027039,   -0.11363892767441594,  0.3928407145635378,
                                        0.08664452802903627,  0.9925340458097323,    0.0858422604035445,
                                        -0.39966280620594113, -0.044298555569829395, 0.9155912184539665};
  rig.projector_from_camera_translation = {-0.1832642735635932, -0.023676857865407654, -0.06066353376211154};
  rig.colour_matrix = {1, 0, 0, 0, 1, 0, 0, 0, 1};
  return rig;
}

Rig without_distortion(Rig rig) {
  rig.camera.distortion = {};
  rig.projector.distortion = {};
  return rig;
}

/// Camera and projector side by side, looking the same way.
Rig parallel_rig() {
  Rig rig;
  rig.camera = {160, 120, {200, 0, 79.5, 0, 200, 59.5, 0, 0, 1}, {}};
  rig.projector = {160, 120, {200, 0, 79.5, 0, 200, 59.5, 0, 0, 1}, {}};
  rig.projector_from_camera_rotation = {1, 0, 0, 0, 1, 0, 0, 0, 1};
  rig.projector_from_camera_translation = {-0.2, 0, 0};
  return rig;
}

cv::Matx33d matrix(const PinholeModel& model) {
  return cv::Matx33d(model.matrix.data());
}
cv::Vec<double, 5> distortion(const PinholeModel& model) {
  return cv::Vec<double, 5>(model.distortion.data());
}

cv::Point2d cv_project(const PinholeModel& model, const cv::Matx33d& rotation, const cv::Vec3d& translation,
                       const cv::Point3d& point) {
  cv::Vec3d rotation_vector;
  cv::Rodrigues(rotation, rotation_vector);
  std::vector<cv::Point2d> out;
  cv::projectPoints(std::vector<cv::Point3d>{point}, rotation_vector, translation, matrix(model),
                    distortion(model), out);
  return out[0];
}

cv::Point2d cv_undistort(const PinholeModel& model, double column, double row) {
  std::vector<cv::Point2d> out;
  cv::undistortPoints(std::vector<cv::Point2d>{{column, row}}, out, matrix(model), distortion(model),
                      cv::noArray(), cv::noArray(),
                      cv::TermCriteria(cv::TermCriteria::COUNT | cv::TermCriteria::EPS, 200, 1e-14));
  return out[0];
}

TEST(Distortion, AgreesWithOpenCvBothWays) {
  const Rig rig = shell_rig();
  for (const PinholeModel* model : {&rig.camera, &rig.projector}) {
    for (int row = 0; row < model->height; row += 37) {
      for (int column = 0; column < model->width; column += 41) {
        const cv::Point2d expected = cv_undistort(*model, column, row);
        const auto got = undistort(*model, column, row);
        ASSERT_TRUE(got) << column << ", " << row;
        EXPECT_NEAR((*got)[0], expected.x, 1e-9) << column << ", " << row;
        EXPECT_NEAR((*got)[1], expected.y, 1e-9) << column << ", " << row;
        const cv::Point2d pixel = cv_project(*model, cv::Matx33d::eye(), {}, {(*got)[0], (*got)[1], 1});
        EXPECT_NEAR(pixel.x, column, 1e-6);
        EXPECT_NEAR(pixel.y, row, 1e-6);
        const auto back = distort(*model, (*got)[0], (*got)[1]);
        EXPECT_NEAR(back[0], column, 1e-6);
        EXPECT_NEAR(back[1], row, 1e-6);
      }
    }
  }
}

/// Barrel distortion: images lie within 0.47 of the centre (normalised), up to the ray at 0.78; beyond that
/// the polynomial folds over, and beyond 1.14 it rises again, to places that no lens images.
PinholeModel folding_model() {
  return {2000, 2000, {1000, 0, 1000, 0, 1000, 1000, 0, 0, 1}, {-0.8, 0.25, 0, 0, 0}};
}

TEST(Distortion, NothingBeyondTheFold) {
  const PinholeModel model = folding_model();
  int inside = 0;
  int outside = 0;
  for (int step = 0; step < 1000; ++step) {
    const double angle = 0.37 * step;
    const double radius = 0.001 * step;  // distorted, normalised
    const auto ray =
        undistort(model, 1000 + 1000 * radius * std::cos(angle), 1000 + 1000 * radius * std::sin(angle));
    if (radius < 0.47) {
      ASSERT_TRUE(ray) << radius;
      EXPECT_LT(std::hypot((*ray)[0], (*ray)[1]), 0.79) << radius;
      ++inside;
    } else if (radius > 0.475) {
      EXPECT_FALSE(ray) << "distorted radius " << radius << " gave " << std::hypot((*ray)[0], (*ray)[1]);
      ++outside;
    }
  }
  EXPECT_GT(inside, 400);
  EXPECT_GT(outside, 500);
}

/// Boundaries of `rig` seen by the camera: for pixels over the picture, the depth at which OpenCV's projector
/// model puts the pixel's ray on a boundary; our point must be that one.
void expect_points_come_back(const Rig& rig) {
  const Pattern pattern = *make_pattern(6, 2, 0, 111);
  const int step = rig.scan == Scan::kInterlaced ? 2 : 1;
  const int lines = (rig.camera.height + step - 1) / step;
  const Triangulator triangulator(rig, pattern, lines, step);
  const cv::Matx33d rotation(rig.projector_from_camera_rotation.data());
  const cv::Vec3d translation(rig.projector_from_camera_translation.data());
  int tried = 0;
  double worst = 0;
  for (int line = 3; line < lines; line += 67) {
    for (double column = 10.25; column < rig.camera.width - 10; column += 93.7) {
      const cv::Point2d ray = cv_undistort(rig.camera, column, line * step);
      const auto seen = [&](double z) {
        return cv_project(rig.projector, rotation, translation, {ray.x * z, ray.y * z, z});
      };
      for (int boundary = 5; boundary < pattern.boundaries(); boundary += 13) {
        const double target = pattern.boundary_column_px(boundary, rig.projector.width);
        double low = 0.3;  // metres
        double high = 1.2;
        const bool rising = seen(high).x > seen(low).x;
        if ((seen(low).x < target) == (seen(high).x < target)) continue;
        for (int i = 0; i < 50; ++i) {
          const double middle = 0.5 * (low + high);
          ((seen(middle).x < target) == rising ? low : high) = middle;
        }
        const cv::Point2d at = seen(low);
        ASSERT_NEAR(at.x, target, 1e-6);
        if (at.y < 0 || at.y > rig.projector.height - 1) continue;  // the projector does not light it
        const auto point = triangulator.point(boundary, line, static_cast<float>(column));
        ASSERT_TRUE(point) << boundary << ", " << line << ", " << column;
        const cv::Vec3d got((*point)[0], (*point)[1], (*point)[2]);
        const cv::Vec3d expected(ray.x * low, ray.y * low, low);
        const double error = cv::norm(got - expected) / cv::norm(expected);
        worst = std::max(worst, error);
        EXPECT_LT(error, 1e-4) << boundary << ", " << line << ", " << column << ", depth " << low;
        ++tried;
      }
    }
  }
  EXPECT_GT(tried, 100);
  ::testing::Test::RecordProperty("worst_relative_error_1e9", static_cast<int>(worst * 1e9));
}

TEST(Triangulator, GivesBackPointsProjectedByOpenCv) {
  expect_points_come_back(shell_rig());
}

TEST(Triangulator, GivesBackPointsWithoutDistortion) {
  expect_points_come_back(without_distortion(shell_rig()));
}

TEST(Triangulator, LinesOfAnInterlacedFrameAreTwoRowsApart) {
  Rig rig = shell_rig();
  rig.scan = Scan::kInterlaced;
  expect_points_come_back(rig);
}

TEST(Triangulator, NothingWhereRayAndSheetAreParallel) {
  const Rig rig = parallel_rig();
  const Pattern pattern = *make_pattern(6, 2, 0, 16);  // boundary 7: column 79.5, straight ahead
  const Triangulator triangulator(rig, pattern, 120, 1);
  EXPECT_FALSE(triangulator.point(7, 60, 79.5F));
  // A little to the right the ray crosses the sheet, far away: x / z = 8 / 200 = 0.2 / z.
  const auto point = triangulator.point(7, 60, 87.5F);
  ASSERT_TRUE(point);
  EXPECT_NEAR((*point)[2], 5, 1e-4);
}

TEST(Triangulator, NothingBehindTheCamera) {
  const Rig rig = parallel_rig();
  const Triangulator triangulator(rig, *make_pattern(6, 2, 0, 16), 120, 1);
  EXPECT_FALSE(triangulator.point(7, 60, 71.5F));  // diverging: they would meet at z = -5 m
}

TEST(Triangulator, NothingBehindTheProjector) {
  Rig rig = parallel_rig();
  rig.projector_from_camera_translation = {-0.2, 0, -1};  // one metre in front of the camera
  const Triangulator triangulator(rig, *make_pattern(6, 2, 0, 16), 120, 1);
  EXPECT_FALSE(triangulator.point(7, 60, 139.5F));  // x / z = 0.3: meets x = 0.2 at z = 0.67 m
  EXPECT_TRUE(triangulator.point(7, 60, 99.5F));    // x / z = 0.1: at z = 2 m
}

TEST(Triangulator, NothingWhereTheCameraModelFoldsOver) {
  Rig rig = parallel_rig();
  rig.camera = folding_model();
  const Triangulator triangulator(rig, *make_pattern(6, 2, 0, 16), 2000, 1);
  const float beyond = 1000 + 600;
  EXPECT_FALSE(triangulator.point(7, 1000, beyond));
  EXPECT_TRUE(triangulator.point(7, 1000, 1000 + 300));
}

TEST(Triangulator, NothingWhereTheProjectorModelFoldsOver) {
  Rig rig = parallel_rig();
  rig.projector = folding_model();
  const Triangulator triangulator(rig, *make_pattern(6, 2, 0, 16), 120, 1);
  for (const int boundary : {0, 1, 13, 14})  // columns over 600 px off the centre
    for (float column = 0; column < 160; column += 8)
      EXPECT_FALSE(triangulator.point(boundary, 60, column)) << boundary << " at " << column;
  EXPECT_TRUE(triangulator.point(7, 60, 99.5F));
}

/// Whole lines of boundaries, some nowhere, some where nothing is seen.
DecodedGrid scattered(const Rig& rig, const Pattern& pattern, int lines) {
  std::mt19937 random(7);
  std::uniform_real_distribution<float> column(-40.F, static_cast<float>(rig.camera.width) + 40.F);
  DecodedGrid out;
  out.reset(pattern.boundaries(), lines);
  for (int line = 0; line < lines; ++line) {
    for (int b = 0; b < pattern.boundaries(); ++b) {
      if (random() % 5 == 0) continue;
      const float extreme[] = {0.F,    -0.F,       1e30F,
                               -1e30F, 7.9999995F, static_cast<float>(rig.camera.width - 1)};
      out.put(line, b, random() % 20 == 0 ? extreme[random() % 6] : column(random), 0, 1);
    }
  }
  return out;
}

/// Also of counts that are no multiple of what a kernel takes at once.
TEST(Triangulator, ALineAtOnceIsAsOneByOne) {
  for (const bool straight : {true, false}) {
    for (const int stripes : {2, 3, 9, 16, 60, 111}) {
      const Rig rig = straight ? without_distortion(shell_rig()) : shell_rig();
      Pattern pattern;
      pattern.sequence.assign(static_cast<std::size_t>(stripes), 0);
      constexpr int kLines = 40;
      const Triangulator triangulator(rig, pattern, kLines, 23);
      const DecodedGrid columns = scattered(rig, pattern, kLines);
      DecodedGrid grid = columns;
      std::size_t points = 0;
      for (int line = 0; line < kLines; ++line) {
        const PointCounts counts = triangulator.place_line(line, grid);
        PointCounts expected;
        for (int b = 0; b < pattern.boundaries(); ++b) {
          const float column_px = columns.column_px(line)[b];
          if (std::fabs(column_px) > 1e6F) continue;  // beyond what one by one is for
          const auto point = std::isnan(column_px) ? std::nullopt : triangulator.point(b, line, column_px);
          expected.points += point.has_value();
          expected.no_point += !std::isnan(column_px) && !point;
          ASSERT_EQ(std::isnan(grid.column_px(line)[b]), !point) << line << ", " << b << ", " << column_px;
          const PointRow at = grid.points(line);
          if (point) {
            ASSERT_EQ(*point, (Vec3f{at.x[b], at.y[b], at.z[b]})) << line << ", " << b;
            ASSERT_EQ(grid.column_px(line)[b], column_px);
          } else {
            ASSERT_TRUE(std::isnan(at.x[b]) && std::isnan(at.y[b]) && std::isnan(at.z[b]));
          }
        }
        EXPECT_GE(counts.points, expected.points);
        EXPECT_GE(counts.no_point, expected.no_point);
        points += counts.points;
      }
      EXPECT_GT(points, 20U) << stripes;
    }
  }
}

TEST(Triangulator, AllKernelsMakeTheSamePoints) {
  const Rig rig = without_distortion(shell_rig());
  const Pattern pattern = *make_pattern(6, 2, 0, 111);
  DecodedGrid columns = scattered(rig, pattern, 64);
  std::mt19937 random(9);
  std::uniform_real_distribution<float> ray(-0.6F, 0.6F);
  std::vector<float> rays(2 * 162), sheets(static_cast<std::size_t>(pattern.boundaries()) + 8, kNoColumn);
  for (int round = 0; round < 64; ++round) {
    for (float& r : rays) r = ray(random);
    for (int b = 0; b < pattern.boundaries(); ++b) sheets[static_cast<std::size_t>(b)] = ray(random);
    if (round % 8 == 1) rays[static_cast<std::size_t>(round)] = kNoColumn;
    if (round % 8 == 2) rays[static_cast<std::size_t>(round)] = 1e30F;
    if (round % 8 == 3) sheets[static_cast<std::size_t>(round)] = -1e30F;
    const StraightSheets seen{
        .rays = rays.data(),
        .ray_samples = 162,
        .sheets = sheets.data(),
        .across = {rig.projector_from_camera_rotation[0], rig.projector_from_camera_rotation[1],
                   rig.projector_from_camera_rotation[2]},
        .forward = {rig.projector_from_camera_rotation[6], rig.projector_from_camera_rotation[7],
                    rig.projector_from_camera_rotation[8]},
        .translation_x = rig.projector_from_camera_translation[0],
        .translation_z = round % 8 == 4 ? 0 : rig.projector_from_camera_translation[2]};
    const auto made = [&](const TriangulateKernels& kernels) {
      DecodedGrid grid = columns;
      const PointCounts counts =
          kernels.straight(seen, pattern.boundaries(), grid.column_px(round), grid.points(round));
      std::vector<std::uint32_t> bits{static_cast<std::uint32_t>(counts.points),
                                      static_cast<std::uint32_t>(counts.no_point)};
      const PointRow at = grid.points(round);
      for (const float* plane :
           {static_cast<const float*>(grid.column_px(round)), static_cast<const float*>(at.x),
            static_cast<const float*>(at.y), static_cast<const float*>(at.z)})
        for (int b = 0; b < pattern.boundaries(); ++b)
          bits.push_back(std::isnan(plane[b]) ? 0x7fc00000U : std::bit_cast<std::uint32_t>(plane[b]));
      return bits;
    };
    const auto reference = made(all_triangulate_kernels().front());
    EXPECT_GT(reference[0], 0U);
    for (const TriangulateKernels& kernels : all_triangulate_kernels())
      ASSERT_EQ(made(kernels), reference) << kernels.name << ", " << round;
  }
}

}  // namespace
}  // namespace relievo
