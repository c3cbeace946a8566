// SPDX-License-Identifier: Apache-2.0
// serve --texture NAME --record, then info and export of what was recorded, every program real.
#include <nlohmann/json.hpp>

#include "tests/e2e/server/server_process.h"

namespace relievo::test {
namespace {

using nlohmann::json;

class ServerTextures : public TakeTest, public testing::WithParamInterface<std::string> {
 protected:
  Finished client(const std::vector<std::string>& arguments) {
    std::vector<std::string> command{program("relievo").string()};
    command.insert(command.end(), arguments.begin(), arguments.end());
    return run(command);
  }

  const std::string file_ = (folder_.path() / "out.mcap").string();
};

TEST_P(ServerTextures, AreRecordedDescribedAndExported) {
  const Finished served =
      run(serve(source_, {"--loop", "--frames", "40", "--texture", GetParam(), "--texture-quality", "90",
                          "--key-interval", "6", "--record", file_}));
  if (served.err.find("this build has no H.264") != std::string::npos) GTEST_SKIP() << served.err;
  ASSERT_EQ(served.status, 0) << served.err;
  const Finished described = client({"info", file_, "--json"});
  ASSERT_EQ(described.status, 0) << described.err;
  const json told = json::parse(described.out);
  EXPECT_EQ(told["texture_codecs"], json({GetParam()}));
  EXPECT_EQ(told["unreadable"], 0);
  const int frames = told["frames"];
  ASSERT_GT(frames, 12);
  for (const std::string format : {"png", "glb", "obj"}) {
    const std::string out = (folder_.path() / format).string();
    // From the middle on: what those build on is not asked for.
    const Finished exported =
        client({"export", file_, "--out", out, "--format", format, "--frames", "9:", "--json"});
    ASSERT_EQ(exported.status, 0) << exported.err;
    // All of them, unless the recorder lost one on the way and the others waited for the next key frame.
    EXPECT_GE(json::parse(exported.out)["frames"].get<int>(), told["lost"] == 0 ? frames - 9 : 1)
        << exported.err;
  }
}

INSTANTIATE_TEST_SUITE_P(Codecs, ServerTextures, testing::Values("jpeg", "webp", "png", "h264"),
                         [](const auto& test) { return test.param; });

/// On any machine: whoever runs it knows whether the hardware does the work.
TEST_F(TakeTest, ItIsSaidWhoMakesH264) {
  const Finished served = run(serve(source_, {"--frames", "2", "--fast", "--texture", "h264"}));
  if (served.err.find("this build has no H.264") != std::string::npos) GTEST_SKIP() << served.err;
  ASSERT_EQ(served.status, 0) << served.err;
  EXPECT_NE(served.err.find("H.264 by "), std::string::npos) << served.err;
  if (served.err.find("H.264 by x264") != std::string::npos) {
    EXPECT_NE(served.err.find("no hardware encoder"), std::string::npos) << served.err;
    for (const std::string name : {"nvenc", "vaapi", "v4l2m2m"}) {
      EXPECT_NE(served.err.find("h264_" + name), std::string::npos) << served.err;
      const Finished forced =
          run(serve(source_, {"--frames", "2", "--texture", "h264", "--texture-encoder", name}));
      EXPECT_EQ(forced.status, 1) << forced.err;
      EXPECT_NE(forced.err.find("h264_" + name), std::string::npos) << forced.err;
      EXPECT_NE(forced.err.find("--texture-encoder"), std::string::npos) << forced.err;
    }
  }
}

#ifdef RELIEVO_FLAKY_H264
/// The hardware's encoder opens, makes some pictures and fails (tests/support/flaky_h264.cpp): the stream
/// goes on, and one line says so.
TEST_F(TakeTest, AHardwareEncoderThatFailsIsReplaced) {
  const std::string file = (folder_.path() / "replaced.mcap").string();
  const Finished served =
      run(serve(source_, {"--loop", "--frames", "20", "--texture", "h264", "--record", file}), kPatience,
          {"LD_PRELOAD=" RELIEVO_FLAKY_H264, "FLAKY_H264_PICTURES=10"});
  ASSERT_EQ(served.status, 0) << served.err;
  EXPECT_NE(served.err.find("H.264 by v4l2m2m"), std::string::npos) << served.err;
  int said = 0;
  for (const std::string& line : lines(served.err))
    said += line.find("x264 from now on") == std::string::npos ? 0 : 1;
  EXPECT_EQ(said, 1) << served.err;
  EXPECT_TRUE(errors(served.err).empty()) << served.err;
  const Finished described = run({program("relievo").string(), "info", file, "--json"});
  ASSERT_EQ(described.status, 0) << described.err;
  const json told = json::parse(described.out);
  EXPECT_EQ(told["lost"], 0) << described.out;
  EXPECT_EQ(told["unreadable"], 0) << described.out;
  const Finished exported = run({program("relievo").string(), "export", file, "--out",
                                 (folder_.path() / "pictures").string(), "--format", "png", "--json"});
  ASSERT_EQ(exported.status, 0) << exported.err;
  EXPECT_EQ(json::parse(exported.out)["frames"], told["frames"]) << exported.err;
}
#endif

TEST_F(TakeTest, ABitRateIsKept) {
  const std::string file = (folder_.path() / "rate.mcap").string();
  const Finished served = run(serve(source_, {"--loop", "--frames", "120", "--fast", "--texture-quality",
                                              "95", "--bitrate", "500k", "--record", file}));
  ASSERT_EQ(served.status, 0) << served.err;
  const Finished described = run({program("relievo").string(), "info", file, "--json"});
  ASSERT_EQ(described.status, 0) << described.err;
  const json told = json::parse(described.out);
  const double bytes = told["bytes"]["geometry"].get<double>() + told["bytes"]["texture"].get<double>() +
                       told["bytes"]["other"].get<double>();
  const double frame_rate = 29.97;
  // The first frames, before the controller knows the scene, are among them.
  EXPECT_LT(8 * bytes / told["frames"].get<double>() * frame_rate, 1.3 * 500e3) << described.out;
}

}  // namespace
}  // namespace relievo::test
