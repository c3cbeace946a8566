// SPDX-License-Identifier: Apache-2.0
// `relievo measure` of shapes whose place and size the simulator knows.
#include <gmock/gmock.h>

#include <cmath>
#include <fstream>
#include <nlohmann/json.hpp>
#include <numbers>
#include <opencv2/imgcodecs.hpp>

#include "tests/e2e/server/server_process.h"

namespace relievo::test {
namespace {

using testing::HasSubstr;

class Measure : public testing::Test {
 protected:
  static Finished measure(const std::string& input, const std::vector<std::string>& more) {
    std::vector<std::string> command{program("relievo").string(), "measure", input};
    command.insert(command.end(), more.begin(), more.end());
    return run(command);
  }
  std::string record(const std::string& source, const std::string& frames) {
    const std::string file = in("recorded.mcap");
    const Finished served = run(serve(source, {"--fast", "--frames", frames, "--record", file}));
    EXPECT_EQ(served.status, 0) << served.err;
    return file;
  }
  std::string in(const std::string& name) const { return folder_ / name; }

  TempFolder folder_;
};

TEST_F(Measure, AWallIsWhereTheSimulatorPutIt) {
  const std::string file = record("sim:plane", "8");
  const Finished done = measure(file, {"--json", "--picture", in("wall.png")});
  ASSERT_EQ(done.status, 0) << done.err;
  const auto said = nlohmann::json::parse(done.out);
  EXPECT_EQ(said["region"], nlohmann::json({192, 144, 256, 192}));
  // Through (0, 0, 1 m), its normal (0.2, -0.1, -1).
  EXPECT_NEAR(said["tilt_deg"]["median"], std::acos(1 / std::sqrt(1.05)) * 180 / std::numbers::pi, 0.01);
  EXPECT_NEAR(said["depth_mm"]["median"], 1000, 0.2);
  EXPECT_GT(said["filled"], 0.99);
  EXPECT_LT(said["off"]["median"], 0.002);
  EXPECT_LT(said["rms_mm"]["median"], 0.2);
  EXPECT_GT(said["rms_mm"]["median"], said["noise_mm"]);
  EXPECT_GT(said["expected_mm"]["median"], 0.2 * said["rms_mm"]["median"].get<double>());
  const cv::Mat picture = cv::imread(in("wall.png"));
  EXPECT_EQ(picture.size(), cv::Size(256, 192));
}

TEST_F(Measure, ABallHasItsRadius) {
  // The simulator makes the half of its box's diagonal 150 mm and puts it a metre away.
  std::ofstream ball(in("ball.obj"));
  constexpr int kAround = 180, kDown = 90;
  for (int i = 0; i <= kDown; ++i) {
    for (int j = 0; j < kAround; ++j) {
      const double polar = std::numbers::pi * i / kDown, turn = 2 * std::numbers::pi * j / kAround;
      ball << "v " << std::sin(polar) * std::cos(turn) << ' ' << std::cos(polar) << ' '
           << std::sin(polar) * std::sin(turn) << '\n';
    }
  }
  for (int i = 0; i < kDown; ++i) {
    for (int j = 0; j < kAround; ++j) {
      const int a = i * kAround + j + 1, b = i * kAround + (j + 1) % kAround + 1;
      ball << "f " << a << ' ' << a + kAround << ' ' << b + kAround << ' ' << b << '\n';
    }
  }
  ball.close();
  const std::string file = record("sim:mesh:" + in("ball.obj"), "5");
  const Finished done = measure(file, {"--shape", "sphere", "--region", "250,170,140,140", "--json"});
  ASSERT_EQ(done.status, 0) << done.err;
  const auto said = nlohmann::json::parse(done.out);
  EXPECT_NEAR(said["radius_mm"]["median"], 150 / std::sqrt(3.0), 0.1);
  EXPECT_NEAR(said["centre_mm"][0]["median"], 0, 0.1);
  EXPECT_NEAR(said["centre_mm"][1]["median"], 0, 0.1);
  EXPECT_NEAR(said["centre_mm"][2]["median"], 1000, 0.2);
  // The part that faces the camera tells the radius less well, and what draws boundaries on it the better.
  const Finished part = measure(file, {"--shape", "sphere", "--region", "280,200,80,80", "--json"});
  ASSERT_EQ(part.status, 0) << part.err;
  EXPECT_NEAR(nlohmann::json::parse(part.out)["radius_mm"]["median"], 150 / std::sqrt(3.0), 0.2);
  const Finished flat = measure(file, {"--region", "250,170,140,140"});
  EXPECT_EQ(flat.status, 0);
  EXPECT_THAT(flat.out, HasSubstr("plane"));
}

TEST_F(Measure, ALiveStreamIsMeasuredToo) {
  Process serving(serve("sim:plane", {"--stream", "wall"}));
  ASSERT_TRUE(serving.wait_for_text("stream wall"));
  const Finished done = measure("wall", {"--domain", std::to_string(own_domain()), "--interface", "lo",
                                         "--wait", "60", "--seconds", "0.2", "--json"});
  ASSERT_EQ(done.status, 0) << done.err;
  EXPECT_NEAR(nlohmann::json::parse(done.out)["depth_mm"]["median"], 1000, 0.5);
}

TEST_F(Measure, WhatCannotBeMeasuredIsSaid) {
  const std::string file = record("sim:object", "3");
  const auto expect_refused = [&](const std::vector<std::string>& options, const std::string& what,
                                  int status) {
    const Finished done = measure(file, options);
    EXPECT_EQ(done.status, status) << done.err;
    EXPECT_EQ(done.out, "");
    ASSERT_FALSE(lines(done.err).empty());
    EXPECT_THAT(lines(done.err).back(), HasSubstr(what));
  };
  expect_refused({"--region", "600,0,100,100"}, "not within the camera's picture of 640x480", 1);
  expect_refused({"--region", "0,0,3,3"}, "no plane in the region", 1);
  std::filesystem::create_symlink(file, in("recorded.png"));
  expect_refused({"--picture", in("recorded.png")}, "is the recording itself", 1);
  expect_refused({"--picture", in("wall.jpg")}, "must end in .png", 2);
  expect_refused({"--picture", in("none") + "/wall.png"}, "wall.png", 1);
  for (const std::string wrong : {"1,2,3", "0,0,0,5", "-1,0,5,5", "1,2,3,4x", "1e3,0,1,1", ""})
    expect_refused({"--region", wrong}, "COLUMN,ROW,WIDTH,HEIGHT", 2);
  expect_refused({"--shape", "cube"}, "plane", 2);
}

}  // namespace
}  // namespace relievo::test
