// SPDX-License-Identifier: Apache-2.0
// `relievo shot`: pictures of a recording, read by OpenCV.
#include <gmock/gmock.h>
#include <signal.h>

#include <nlohmann/json.hpp>
#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>

#include "tests/e2e/server/server_process.h"

namespace relievo::test {
namespace {

using testing::HasSubstr;

/// Made once: three frames of the simulated face, whose texture is lossless.
class Shot : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    folder_ = new TempFolder;
    const Finished served =
        run(serve("sim:face", {"--fast", "--frames", "4", "--texture", "png", "--record", file()}));
    ASSERT_EQ(served.status, 0) << served.err;
  }
  static void TearDownTestSuite() {
    delete folder_;
    folder_ = nullptr;
  }

  static std::string file() { return *folder_ / "face.mcap"; }
  static std::string in(const std::string& name) { return *folder_ / name; }
  static Finished shot(const std::vector<std::string>& more) {
    std::vector<std::string> command{program("relievo").string(), "shot", file()};
    command.insert(command.end(), more.begin(), more.end());
    return run(command);
  }

  static TempFolder* folder_;
};

TempFolder* Shot::folder_ = nullptr;

TEST_F(Shot, TheRigsViewOfTheTextureIsTheTexture) {
  const Finished drawn =
      shot({"--out", in("rig.png"), "--view", "rig", "--size", "640x480", "--background", "transparent"});
  ASSERT_EQ(drawn.status, 0) << drawn.err;
  EXPECT_THAT(drawn.out, HasSubstr("rig.png"));
  const Finished exported = run({program("relievo").string(), "export", file(), "--format", "png", "--frames",
                                 "0", "--out", in("texture")});
  ASSERT_EQ(exported.status, 0) << exported.err;
  cv::Mat texture;
  for (const auto& entry : std::filesystem::directory_iterator(in("texture")))
    texture = cv::imread(entry.path().string());
  const cv::Mat picture = cv::imread(in("rig.png"), cv::IMREAD_UNCHANGED);
  ASSERT_EQ(picture.size(), cv::Size(640, 480));
  ASSERT_EQ(picture.channels(), 4);
  ASSERT_EQ(texture.size(), picture.size());
  int covered = 0;
  double sum = 0;
  for (int y = 0; y < picture.rows; ++y) {
    for (int x = 0; x < picture.cols; ++x) {
      const auto seen = picture.at<cv::Vec4b>(y, x);
      if (seen[3] != 255) continue;
      ++covered;
      for (int c = 0; c < 3; ++c) sum += std::abs(seen[c] - texture.at<cv::Vec3b>(y, x)[c]);
    }
  }
  EXPECT_GT(covered, 640 * 480 / 2);
  EXPECT_LT(sum / (3.0 * covered), 1.5);  // a vertex drawn a pixel off gives 4
}

TEST_F(Shot, SeveralFramesAreAFolderOfPictures) {
  const Finished drawn =
      shot({"--out", in("frames"), "--mode", "depth", "--size", "160x120", "--json", "--quiet"});
  ASSERT_EQ(drawn.status, 0) << drawn.err;
  const auto said = nlohmann::json::parse(drawn.out);
  EXPECT_EQ(said["pictures"], 3);
  EXPECT_LT(said["depth_m"][0], said["depth_m"][1]);
  int pictures = 0;
  for (const auto& entry : std::filesystem::directory_iterator(in("frames"))) {
    EXPECT_EQ(cv::imread(entry.path().string()).size(), cv::Size(160, 120));
    ++pictures;
  }
  EXPECT_EQ(pictures, 3);
}

TEST_F(Shot, ALiveStreamIsDrawnToo) {
  Process serving(serve("sim:face", {"--stream", "alive"}));
  ASSERT_TRUE(serving.wait_for_text("stream alive"));
  const Finished drawn =
      run({program("relievo").string(), "shot", "alive", "--domain", std::to_string(own_domain()),
           "--interface", "lo", "--wait", "60", "--out", in("live.png"), "--size", "320x240"});
  ASSERT_EQ(drawn.status, 0) << drawn.err;
  EXPECT_EQ(cv::imread(in("live.png")).size(), cv::Size(320, 240));
}

TEST_F(Shot, WhatIsOfTheOtherKindOfInputIsWrongUsage) {
  const auto refused = [&](const std::string& input, const std::vector<std::string>& options) {
    std::vector<std::string> command{
        program("relievo").string(),  "shot",        input, "--out", in("refused.png"), "--domain",
        std::to_string(own_domain()), "--interface", "lo"};
    command.insert(command.end(), options.begin(), options.end());
    const Finished done = run(command);
    EXPECT_EQ(done.status, 2) << options.front() << done.err;
    EXPECT_EQ(lines(done.err).size(), 1U) << done.err;
    EXPECT_THAT(done.err, HasSubstr(options.front() + ": "));
  };
  refused("alive", {"--from", "3"});
  refused("alive", {"--to", "3"});
  refused("alive", {"--frames", "0:1"});
  refused("alive", {"--stream", "other"});
  refused(file(), {"--seconds", "3"});
  EXPECT_FALSE(std::filesystem::exists(in("refused.png")));
}

TEST_F(Shot, WhoStopsItIsToldHowMuchIsThere) {
  Process serving(serve("sim:face", {"--stream", "endless"}));
  ASSERT_TRUE(serving.wait_for_text("stream endless"));
  Process drawing({program("relievo").string(), "shot", "endless", "--domain", std::to_string(own_domain()),
                   "--interface", "lo", "--seconds", "100000", "--out", in("stopped"), "--size", "160x120"});
  ASSERT_TRUE(eventually([&] { return std::filesystem::exists(in("stopped")); })) << drawing.err();
  drawing.signal(SIGINT);
  EXPECT_EQ(drawing.wait(), 1);
  EXPECT_EQ(drawing.out(), "");
  EXPECT_THAT(drawing.err(), HasSubstr("stopped early: "));
  EXPECT_THAT(drawing.err(), testing::ContainsRegex("picture(s are| is) in " + in("stopped")));
}

#ifdef RELIEVO_VIDEO

/// What ffprobe says of a file's only stream: "WIDTH,HEIGHT,FRAMES".
std::string probe(const std::string& video) {
  const Finished probed =
      run({"/usr/bin/ffprobe", "-v", "error", "-count_frames", "-select_streams", "v", "-show_entries",
           "stream=width,height,nb_read_frames", "-of", "csv=p=0", video});
  EXPECT_EQ(probed.status, 0) << probed.err;
  return probed.out;
}

TEST_F(Shot, SeveralFramesAreAVideoToo) {
  const Finished drawn = shot({"--out", in("turned.mp4"), "--azimuth", "30", "--size", "320x240"});
  ASSERT_EQ(drawn.status, 0) << drawn.err;
  EXPECT_EQ(probe(in("turned.mp4")), "320,240,3\n");
}

TEST_F(Shot, ALiveStreamIsFilmed) {
  Process serving(serve("sim:face", {"--stream", "filmed"}));
  ASSERT_TRUE(serving.wait_for_text("stream filmed"));
  const Finished drawn = run({program("relievo").string(), "shot", "filmed", "--domain",
                              std::to_string(own_domain()), "--interface", "lo", "--wait", "60", "--seconds",
                              "0.5", "--out", in("live.mkv"), "--size", "160x120", "--json"});
  ASSERT_EQ(drawn.status, 0) << drawn.err;
  const int pictures = nlohmann::json::parse(drawn.out)["pictures"];
  EXPECT_GE(pictures, 1);
  EXPECT_EQ(probe(in("live.mkv")), "160,120," + std::to_string(pictures) + "\n");
}

#endif

TEST_F(Shot, WhatCannotBeDrawnIsSaidInOneLine) {
  const auto fails = [](const std::vector<std::string>& arguments, int status, const std::string& why) {
    std::vector<std::string> command{program("relievo").string(), "shot"};
    command.insert(command.end(), arguments.begin(), arguments.end());
    const Finished done = run(command);
    EXPECT_EQ(done.status, status) << done.err;
    EXPECT_EQ(lines(done.err).size(), 1U) << done.err;
    EXPECT_THAT(done.err, HasSubstr(why));
  };
  fails({in("none.mcap"), "--out", in("a.png")}, 1, "no file");
  fails({"nobody", "--domain", std::to_string(own_domain()), "--interface", "lo", "--wait", "0.2", "--out",
         in("a.png")},
        1, "nobody");
#ifdef RELIEVO_VIDEO
  fails({file(), "--out", in("a.mp4"), "--background", "transparent"}, 1, "transparency");
#endif
  fails({file(), "--out", in("a.png"), "--frames", "7"}, 1, "frames");
  fails({file(), "--out", in("a.png"), "--mode", "pretty"}, 2, "textured");
  fails({file(), "--out", in("a.png"), "--background", "#12345"}, 2, "#RRGGBB");
  fails({file(), "--out", in("no/such/folder/a.png")}, 1, "folder");
  EXPECT_FALSE(std::filesystem::exists(in("a.png")));
  EXPECT_FALSE(std::filesystem::exists(in("a.mp4")));
}

}  // namespace
}  // namespace relievo::test
