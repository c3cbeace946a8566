// SPDX-License-Identifier: Apache-2.0
// Recordings as bags of ROS 2, read by a reader and definitions that are not ours.
#include <gmock/gmock.h>

#include <cmath>
#include <nlohmann/json.hpp>

#include "tests/e2e/server/server_process.h"

namespace relievo::test {
namespace {

using nlohmann::json;
using testing::HasSubstr;

class Ros : public TakeTest {
 protected:
  void SetUp() override {
    if (!std::filesystem::exists(js_ / "node_modules/@foxglove/rosmsg2-serialization"))
      GTEST_SKIP() << "npm packages are missing: run npm ci --prefix tests/e2e/mcap_js";
    ASSERT_NO_FATAL_FAILURE(TakeTest::SetUp());
  }
  std::string record(const std::string& stream, const std::string& name) {
    const std::string file = (folder_.path() / name).string();
    const Finished served =
        run(serve(source_, {"--stream", stream, "--fast", "--record", file, "--step-bits", "8"}));
    EXPECT_EQ(served.status, 0) << served.err;
    return file;
  }
  Finished exported(const std::string& file, const std::string& format, const std::filesystem::path& out,
                    const std::vector<std::string>& more = {}) {
    std::vector<std::string> command{
        program("relievo").string(), "export", file, "--format", format, "--out", out.string()};
    command.insert(command.end(), more.begin(), more.end());
    return run(command);
  }
  json read(const std::filesystem::path& bag) {
    const Finished checked = run({"/usr/bin/env", "node", (js_ / "check_ros.mjs").string(), bag.string()});
    EXPECT_EQ(checked.status, 0) << checked.err;
    return checked.status == 0 ? json::parse(checked.out) : json();
  }

  const std::filesystem::path js_ = RELIEVO_MCAP_JS;
  const std::filesystem::path bag_ = folder_.path() / "ros.mcap";
};

/// Coordinates and colour of a PLY's first vertex, as write_ply() has them.
struct FirstVertex {
  float position[3] = {};
  std::uint8_t rgb[3] = {};
};
FirstVertex first_vertex(const std::filesystem::path& ply) {
  const std::string text = read_text(ply);
  const std::string end = "end_header\n";
  const std::size_t at = text.find(end) + end.size();
  FirstVertex out;
  std::memcpy(out.position, text.data() + at, sizeof out.position);
  std::memcpy(out.rgb, text.data() + at + 6 * sizeof(float), sizeof out.rgb);
  return out;
}

TEST_F(Ros, ABagHasThePointsThePictureTheCameraAndWhereItStands) {
  // Turned by 90 degrees about z, a metre to the right.
  std::ofstream(take_ / "rig.yaml", std::ios::app)
      << "world_from_camera_rotation: !!opencv-matrix\n   rows: 3\n   cols: 3\n   dt: d\n"
         "   data: [ 0., -1., 0., 1., 0., 0., 0., 0., 1. ]\n"
         "world_from_camera_translation: !!opencv-matrix\n   rows: 3\n   cols: 1\n   dt: d\n"
         "   data: [ 1., 0., 0. ]\n";
  const std::string file = record("my-stream", "a.mcap");
  const Finished done = exported(file, "ros2", bag_, {"--json"});
  ASSERT_EQ(done.status, 0) << done.err;
  const json said = json::parse(done.out);
  EXPECT_EQ(said["file"], bag_.string());
  ASSERT_EQ(exported(file, "ply", folder_.path() / "ply").status, 0);
  const std::set<std::string> surfaces = names_in(folder_.path() / "ply");
  ASSERT_EQ(said["frames"], surfaces.size());

  const json bag = read(bag_);
  EXPECT_EQ(bag["profile"], "ros2");
  const std::map<std::string, std::string> types{
      {"/my_stream/points", "sensor_msgs/msg/PointCloud2"},
      {"/my_stream/image/compressed", "sensor_msgs/msg/CompressedImage"},
      {"/my_stream/camera_info", "sensor_msgs/msg/CameraInfo"},
      {"/tf", "tf2_msgs/msg/TFMessage"}};
  ASSERT_EQ(bag["topics"].size(), types.size());
  for (const auto& [topic, type] : types) {
    EXPECT_EQ(bag["topics"][topic]["type"], type);
    EXPECT_EQ(bag["topics"][topic]["count"], said["frames"]) << topic;
    EXPECT_EQ(bag["topics"][topic]["times"], bag["topics"]["/tf"]["times"]) << "what belongs together";
  }
  const json points = bag["topics"]["/my_stream/points"]["first"];
  EXPECT_EQ(points["header"]["frame_id"], "my_stream");
  EXPECT_EQ(points["point_step"].get<int>() % 4, 0);
  const FirstVertex vertex = first_vertex(folder_.path() / "ply" / *surfaces.begin());
  for (int i = 0; i < 3; ++i) {
    EXPECT_EQ(points["data"][std::string(1, "xyz"[i])].get<float>(), vertex.position[i]);
    EXPECT_EQ(points["data"]["rgb"][static_cast<std::size_t>(i)], vertex.rgb[i]);
  }
  EXPECT_GT(points["data"]["sigma"], 0);
  const std::int64_t stamp = points["header"]["stamp"]["sec"].get<std::int64_t>() * 1'000'000'000 +
                             points["header"]["stamp"]["nanosec"].get<std::int64_t>();
  EXPECT_EQ(std::to_string(stamp), bag["topics"]["/tf"]["times"][0]);

  const json image = bag["topics"]["/my_stream/image/compressed"]["first"];
  EXPECT_EQ(image["format"], "jpeg");
  EXPECT_EQ(image["data"][0], 0xff);
  EXPECT_EQ(image["data"][1], 0xd8);
  const Rig rig = striped_scene().rig;
  const json camera = bag["topics"]["/my_stream/camera_info"]["first"];
  EXPECT_EQ(camera["k"], json(rig.camera.matrix));
  EXPECT_EQ(camera["d"], json(rig.camera.distortion));
  EXPECT_EQ(camera["width"], rig.camera.width);
  EXPECT_EQ(camera["height"], rig.camera.height);
  const json transform = bag["topics"]["/tf"]["first"]["transforms"][0];
  EXPECT_EQ(transform["header"]["frame_id"], "world");
  EXPECT_EQ(transform["child_frame_id"], "my_stream");
  EXPECT_EQ(transform["transform"]["translation"], json({{"x", 1.0}, {"y", 0.0}, {"z", 0.0}}));
  EXPECT_NEAR(transform["transform"]["rotation"]["z"], std::sqrt(0.5), 1e-12);
  EXPECT_NEAR(transform["transform"]["rotation"]["w"], std::sqrt(0.5), 1e-12);
}

/// A lower quality's texture is the same camera's, whose pixels are larger.
TEST_F(Ros, TheCameraIsThatOfTheTexture) {
  Process serving(serve(source_, {"--stream", "s", "--loop"}));
  const std::string file = (folder_.path() / "a.mcap").string();
  const Finished recorded =
      run({program("relievo").string(), "record", "s", "--quality", "reduced", "--frames", "2", "--out", file,
           "--wait", "60", "--domain", std::to_string(own_domain()), "--interface", "lo"});
  ASSERT_EQ(recorded.status, 0) << recorded.err;
  ASSERT_EQ(exported(file, "ros2", bag_).status, 0);
  const json bag = read(bag_);
  EXPECT_FALSE(bag["topics"].contains("/tf")) << "nobody said where it stands";
  const json camera = bag["topics"]["/s/camera_info"]["first"];
  const Rig rig = striped_scene().rig;
  ASSERT_LT(camera["width"], rig.camera.width);
  const double scale = camera["width"].get<double>() / rig.camera.width;
  const std::vector<double> k = camera["k"];
  EXPECT_NEAR(k[0], scale * rig.camera.fx(), 1e-9);
  EXPECT_NEAR(k[2] + 0.5, scale * (rig.camera.cx() + 0.5), 1e-9) << "the picture's edge is at -.5";
  EXPECT_EQ(camera["p"], json({k[0], k[1], k[2], 0, k[3], k[4], k[5], 0, k[6], k[7], k[8], 0}));
}

TEST_F(Ros, ABagAppearsWholeOrNotAtAll) {
  const std::string file = record("s", "a.mcap");
  EXPECT_EQ(exported(file, "ros2", folder_.path() / "a.bag").status, 2) << "as rosbag2 would not open it";
  std::filesystem::create_directories(bag_);
  const Finished folder = exported(file, "ros2", bag_);
  EXPECT_EQ(folder.status, 1);
  EXPECT_THAT(folder.err, HasSubstr("is a folder"));
  std::filesystem::remove(bag_);
  EXPECT_EQ(exported(file, "ros2", bag_, {"--from", "99"}).status, 1);
  const Finished nowhere = exported(file, "ros2", folder_.path() / "none" / "bag.mcap");
  EXPECT_EQ(nowhere.status, 1);
  EXPECT_THAT(nowhere.err, HasSubstr("none/bag.mcap: there is no such folder"));
  const Finished onto = exported(file, "ros2", file);
  EXPECT_EQ(onto.status, 1);
  EXPECT_EQ(names_in(folder_.path()), (std::set<std::string>{"a.mcap", "take"})) << "nothing half-written";
}

}  // namespace
}  // namespace relievo::test
