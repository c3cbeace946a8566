// SPDX-License-Identifier: Apache-2.0
// Proves: relievo ros2 gives a live stream to a node of ROS 2, under another DDS implementation, by ROS's
// names and definitions.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <csignal>
#include <nlohmann/json.hpp>

#include "tests/e2e/record_play.h"
#include "tests/support/temp_folder.h"

namespace relievo::test {
namespace {

using nlohmann::json;
using testing::HasSubstr;

const std::vector<std::pair<std::string, std::string>> kTopics{
    {"/face/points", "sensor_msgs/msg/PointCloud2"},
    {"/face/image/compressed", "sensor_msgs/msg/CompressedImage"},
    {"/face/camera_info", "sensor_msgs/msg/CameraInfo"}};

TEST(Ros2, ANodeReadsPointsPictureAndCamera) {
  const std::filesystem::path js = RELIEVO_MCAP_JS;
  if (!std::filesystem::exists(js / "node_modules/@foxglove/rosmsg2-serialization"))
    GTEST_SKIP() << "npm packages are missing: run npm ci --prefix tests/e2e/mcap_js";
  const TempFolder folder;
  std::vector<std::string> command{program("fastdds_ros_reader"), kDomain, folder.path().string()};
  for (const auto& [topic, type] : kTopics) command.insert(command.end(), {topic, type});
  Process node(command);
  ASSERT_TRUE(node.wait_for_text("reading")) << node.err();
  Process bridge(on_loopback({"ros2", "face", "--json"}));
  Process server(publish_face(0));
  ASSERT_EQ(node.wait(), 0) << node.err() << bridge.err();
  bridge.signal(SIGINT);
  ASSERT_EQ(bridge.wait(), 0) << bridge.err();
  const json sent = json::parse(bridge.out());
  EXPECT_GE(sent["frames"], 1);
  EXPECT_EQ(sent["messages"]["/tf"], 0) << "nobody listens, and nobody said where it stands";

  std::vector<json> messages;
  for (std::size_t i = 0; i < kTopics.size(); ++i) {
    EXPECT_GE(sent["messages"][kTopics[i].first], 1);
    const Finished read = run({"/usr/bin/env", "node", js / "check_ros.mjs", kTopics[i].second,
                               folder.path() / (std::to_string(i) + ".cdr")});
    ASSERT_EQ(read.status, 0) << read.err;
    messages.push_back(json::parse(read.out));
    EXPECT_EQ(messages[i]["header"]["frame_id"], "face");
  }
  EXPECT_GT(messages[0]["width"], 200);
  EXPECT_GT(messages[0]["data"]["z"], 0.1);
  EXPECT_EQ(messages[1]["data"][0], 0xff) << "a JPEG";
  EXPECT_EQ(messages[2]["width"], 64) << "as the texture is";
}

/// What is encrypted does not go on without that unasked.
TEST(Ros2, AnEncryptedStreamIsNotGivenOnInPlainUnasked) {
  const TempFolder folder;
  const auto keys = folder / "keys";
  ASSERT_EQ(run({program("relievo"), "keys", "init", "--keys", keys}).status, 0);
  const Finished refused = run(on_loopback({"ros2", "face", "--keys", keys}));
  EXPECT_EQ(refused.status, 1);
  EXPECT_THAT(refused.err, HasSubstr("--in-plain"));
}

}  // namespace
}  // namespace relievo::test
