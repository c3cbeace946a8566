// SPDX-License-Identifier: Apache-2.0
// `relievo record` of a live stream: what ends a recording, and what its file then holds. Real processes on
// the loopback.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <signal.h>

#include "tests/e2e/record_play.h"
#include "tests/support/temp_folder.h"

namespace relievo::test {
namespace {

using testing::HasSubstr;

TEST(Record, InterruptedRecorderCompletesItsFile) {
  const TempFolder folder;
  const auto file = folder / "whole.mcap";
  Process server(publish_face(20000));
  Process recorder(on_loopback({"record", "face", "--out", file, "--json"}));
  ASSERT_TRUE(wait_for_size(file, 500'000)) << recorder.err();
  recorder.signal(SIGINT);
  ASSERT_EQ(recorder.wait(), 0) << recorder.err();
  const auto result = nlohmann::json::parse(recorder.out());
  const auto description = info(file);
  EXPECT_EQ(description["recovered"], false);
  EXPECT_EQ(description["frames"], result["frames"]);
  EXPECT_THAT(description["attachments"].dump(),
              HasSubstr(R"(["rig.yaml","pattern.yaml","stream_info.cdr"])"));
  const Arrived there = arrived(recorded_frames(file));
  EXPECT_EQ(result["lost"], there.lost);
  EXPECT_EQ(description["lost"], there.lost);
  EXPECT_NEAR(description["frame_rate"], there.rate, 1e-6 * there.rate);
}

TEST(Record, RecorderKeepsToItsLimitAndSurvivesARestartOfTheServer) {
  const TempFolder folder;
  const auto file = folder / "limit.mcap";
  Process recorder(on_loopback({"record", "face", "--out", file, "--frames", "60", "--json"}));
  {
    Process server(publish_face(20000, 40));
    ASSERT_TRUE(wait_for_size(file, 60'000)) << server.err() << recorder.err();
    ASSERT_TRUE(server.wait_for_text("done")) << server.err();
  }
  Process server(publish_face(20000));
  ASSERT_EQ(recorder.wait(), 0) << recorder.err();
  EXPECT_EQ(nlohmann::json::parse(recorder.out())["frames"], 60);
  EXPECT_EQ(info(file)["frames"], 60);
  std::vector<std::uint64_t> sequence;
  for (const Bytes& cdr : recorded_frames(file)) sequence.push_back(read_frame_cdr(cdr)->sequence);
  EXPECT_EQ(sequence.size(), 60u);
  int restarts = 0;
  for (std::size_t i = 1; i < sequence.size(); ++i) restarts += sequence[i] < sequence[i - 1];
  EXPECT_EQ(restarts, 1) << testing::PrintToString(sequence);
}

TEST(Record, SaysThatAStreamLacksTheQualityAndGoesOnWhereItHasIt) {
  const TempFolder folder;
  const auto file = folder / "reduced.mcap";
  const auto serve = [](const char* ladder) {
    return std::make_unique<Process>(std::vector<std::string>{
        program("relievo-server"), "serve", "--source", "sim:plane,width=160,height=120,stripes=30,rate=10",
        "--stream", "face", "--web", "none", "--domain", kDomain, "--interface", "lo", "--ladder", ladder});
  };
  auto server = serve("none");
  Process recorder(
      on_loopback({"record", "face", "--quality", "reduced", "--frames", "5", "--out", file, "--json"}));
  ASSERT_TRUE(recorder.wait_for_text("has no quality 'reduced'")) << server->err();
  const auto refused = run(
      on_loopback({"record", "face", "--quality", "reduced", "--wait", "1", "--out", folder / "none.mcap"}));
  EXPECT_EQ(refused.status, 1);
  EXPECT_THAT(refused.err, HasSubstr("error: stream 'face' has no quality 'reduced'"));
  server->signal(SIGTERM);
  EXPECT_EQ(server->wait(), 0) << server->err();
  server = serve("reduced");
  ASSERT_EQ(recorder.wait(), 0) << recorder.err();
  EXPECT_EQ(info(file)["frames"], 5);
}

TEST(Record, FullDiskEndsTheRecordingWithAReadableFile) {
  const TempFolder folder;
  const auto file = folder / "full.mcap";
  Process server(publish_face(50000));
  std::string command = "trap '' XFSZ; ulimit -f 3000; exec";  // 3,072,000 bytes
  for (const auto& argument : on_loopback({"record", "face", "--out", file}))
    command += " '" + argument + "'";
  const auto done = run({"/bin/bash", "-c", command});
  EXPECT_EQ(done.status, 1) << done.err;
  const int frames = info(file)["frames"];
  EXPECT_THAT(done.err,
              HasSubstr("error: recording stopped after " + std::to_string(frames) + " frames and missed "))
      << "those are in the file";
  EXPECT_THAT(done.err, HasSubstr(file.string()));
  EXPECT_GT(frames, 20);
}

}  // namespace
}  // namespace relievo::test
