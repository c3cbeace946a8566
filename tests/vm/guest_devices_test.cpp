// SPDX-License-Identifier: Apache-2.0
// In the guest: what `relievo-server devices` says of the drivers' cameras.
#include <gtest/gtest.h>

#include <array>
#include <cstdio>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>

namespace relievo {
namespace {

struct Ran {
  std::string out;
  int status = -1;
};

/// The server lies beside this test.
Ran run_server(const std::string& arguments) {
  const auto server = std::filesystem::read_symlink("/proc/self/exe").replace_filename("relievo-server");
  Ran ran;
  FILE* pipe = popen((server.string() + " " + arguments + " 2>&1").c_str(), "r");
  if (pipe == nullptr) return ran;
  std::array<char, 4096> part{};
  for (std::size_t got = 0; (got = fread(part.data(), 1, part.size(), pipe)) > 0;)
    ran.out.append(part.data(), got);
  ran.status = WEXITSTATUS(pclose(pipe));
  return ran;
}

const nlohmann::json* named(const nlohmann::json& list, const char* key, const std::string& value) {
  for (const auto& entry : list) {
    if (entry[key] == value) return &entry;
  }
  return nullptr;
}

TEST(Devices, AreListedWithAllThatCanBeSet) {
  const Ran ran = run_server("devices --json");
  ASSERT_EQ(ran.status, 0) << ran.out;
  const auto report = nlohmann::json::parse(ran.out, nullptr, false);
  ASSERT_TRUE(report.contains("devices")) << ran.out;
  const auto& devices = report["devices"];
  const auto* camera = named(devices, "device", "/dev/video0");
  ASSERT_TRUE(camera) << ran.out;
  EXPECT_EQ((*camera)["driver"], "vivid");
  EXPECT_EQ((*camera)["inputs"].size(), 4u) << "a webcam, a tuner, S-Video and HDMI";
  const auto* s_video = named((*camera)["inputs"], "name", "S-Video 0");
  ASSERT_TRUE(s_video) << ran.out;
  EXPECT_NE((*s_video)["standards"].dump().find("NTSC-M"), std::string::npos);
  const auto* yuyv = named((*camera)["formats"], "name", "YUYV");
  ASSERT_TRUE(yuyv) << ran.out;
  EXPECT_EQ((*yuyv)["readable"], true);
  EXPECT_FALSE((*yuyv)["sizes"].empty());
  const auto* brightness = named((*camera)["controls"], "name", "brightness");
  ASSERT_TRUE(brightness) << ran.out;
  EXPECT_EQ((*brightness)["kind"], "integer");
  EXPECT_EQ((*brightness)["least"], 0);
  EXPECT_EQ((*brightness)["most"], 255);
  const auto* pattern = named((*camera)["controls"], "name", "test_pattern");
  ASSERT_TRUE(pattern) << ran.out;
  EXPECT_GT((*pattern)["menu"].size(), 10u);
  const auto* planar = named(devices, "device", "/dev/video2");
  ASSERT_TRUE(planar) << ran.out;
  EXPECT_EQ((*planar)["multiplanar"], true);
}

TEST(Devices, OneIsDescribedForPeopleAndNoneIsAnError) {
  const Ran one = run_server("devices /dev/video0");
  EXPECT_EQ(one.status, 0) << one.out;
  for (const char* text : {"vivid", "YUYV", "S-Video 0", "brightness"})
    EXPECT_NE(one.out.find(text), std::string::npos) << text << "\n" << one.out;
  const Ran none = run_server("devices /dev/video77");
  EXPECT_EQ(none.status, 1) << none.out;
  EXPECT_NE(none.out.find("/dev/video77"), std::string::npos) << none.out;
}

}  // namespace
}  // namespace relievo
