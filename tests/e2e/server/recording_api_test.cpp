// SPDX-License-Identifier: Apache-2.0
// serve --record-dir: recordings started and stopped over HTTP, read by `relievo info` and the reader.
#include <gmock/gmock.h>
#include <signal.h>

#include "codec/recording.h"
#include "idl/cdr.h"
#include "tests/e2e/server/web_server.h"

namespace relievo::test {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;
using Json = nlohmann::json;

class RecordingOnRequest : public TakeTest {
 protected:
  void SetUp() override {
    TakeTest::SetUp();
    fs::create_directory(out_);
  }
  std::vector<std::string> command() const {
    return serve(source_, {"--loop", "--web", "127.0.0.1:0", "--record-dir", out_, "--pre-roll", "1h"});
  }
  /// The numbers of the frames in a sound file.
  static std::vector<std::uint64_t> frames_in(const fs::path& file) {
    std::vector<std::uint64_t> out;
    auto reader = RecordingReader::open(file);
    EXPECT_TRUE(reader) << file;
    while (reader) {
      const auto message = (*reader)->next();
      EXPECT_TRUE(message) << file;
      if (!message || !*message) break;
      if ((*reader)->summary().channels[(**message).channel].topic != "relievo/frame") continue;
      const auto frame = read_frame_cdr((**message).data);
      if (frame) out.push_back(frame->sequence);
    }
    return out;
  }
};

TEST_F(RecordingOnRequest, HasWhatCameBeforeAndIsOfferedWhenItIsWhole) {
  WebServer server(command());
  ASSERT_NE(server.port(), 0) << server.process().err();
  ASSERT_TRUE(server.goes_on("take", 20)) << server.process().err();
  EXPECT_EQ(server.recording("take")["state"], "off");
  EXPECT_EQ(server.recording("take")["pre_roll_s"], 3600);
  const Response started = server.order("take", "start");
  ASSERT_EQ(started.status, 200) << started.body;
  const std::string name = Json::parse(started.body)["file"];
  EXPECT_EQ(server.order("take", "start").status, 409);
  ASSERT_TRUE(eventually([&] { return server.recording("take")["frames"] >= 40; }));
  EXPECT_EQ(request(server.port(), "GET", "/recordings/" + name).status, 404) << "it is being written";
  ASSERT_EQ(server.order("take", "stop").status, 200);
  ASSERT_TRUE(
      eventually([&] { return request(server.port(), "HEAD", "/recordings/" + name).status == 200; }));
  const Json state = server.recording("take");
  EXPECT_EQ(state["state"], "off");
  EXPECT_EQ(state["lost"], 0);
  EXPECT_EQ(state["message"], "");
  EXPECT_THAT(request(server.port(), "GET", "/api/recordings").body, HasSubstr(name));

  const std::vector<std::uint64_t> frames = frames_in(out_ / name);
  ASSERT_EQ(frames.size(), state["frames"]);
  EXPECT_LT(frames.front(), 20U) << "it began before it was asked for";
  EXPECT_EQ(frames.back() - frames.front() + 1, frames.size()) << "without gaps";
  const Finished info = run({program("relievo").string(), "info", (out_ / name).string()});
  EXPECT_EQ(info.status, 0) << info.err;
  EXPECT_EQ(info.err, "");
  EXPECT_THAT(info.out, HasSubstr("16 stripes"));
}

TEST_F(RecordingOnRequest, IsWholeWhereTheServerIsStopped) {
  WebServer server(command());
  ASSERT_TRUE(server.goes_on("take", 5)) << server.process().err();
  ASSERT_EQ(server.order("take", "start").status, 200);
  ASSERT_TRUE(eventually([&] { return server.recording("take")["frames"] >= 10; }));
  const std::string name = server.recording("take")["file"];
  server.process().signal(SIGTERM);
  EXPECT_EQ(server.process().wait(), 0) << server.process().err();
  EXPECT_GE(frames_in(out_ / name).size(), 10U);
}

TEST_F(RecordingOnRequest, OntoAFullDiskFailsAloneAndLiveGoesOn) {
  // A limit on the size of files stands for a full disk: 64 KiB hold a few frames.
  std::string script = "trap '' XFSZ; ulimit -f 64; exec";
  for (const std::string& word : command()) script += " '" + word + "'";
  WebServer server({"/bin/bash", "-c", script});
  ASSERT_TRUE(server.goes_on("take", 5)) << server.process().err();
  for (int i = 0; i < 2; ++i) {
    ASSERT_EQ(server.order("take", "start").status, 200);
    ASSERT_TRUE(eventually([&] { return server.recording("take")["state"] == "failed"; }));
    const Json state = server.recording("take");
    const std::string file = state["file"];
    EXPECT_THAT(state["message"].get<std::string>(), HasSubstr(file));
    EXPECT_EQ(server.order("take", "stop").status, 409);
    if (fs::exists(out_ / file)) {
      const Finished info = run({program("relievo").string(), "info", (out_ / file).string()});
      EXPECT_EQ(info.status, 0) << info.err;
    }
    EXPECT_TRUE(server.goes_on("take", 10));
  }
  const std::string metrics = request(server.port(), "GET", "/metrics").body;
  EXPECT_THAT(metrics, HasSubstr("relievo_recording_state{stream=\"take\",state=\"failed\"} 1"));
  server.process().signal(SIGTERM);
  EXPECT_EQ(server.process().wait(), 0) << server.process().err();
}

TEST_F(RecordingOnRequest, WhatCannotWorkIsSaidAtTheStart) {
  expect_one_error(run(serve(source_, {"--web", "127.0.0.1:0", "--record-dir", out_ / "none"})),
                   "no such folder");
  expect_one_error(run(serve(source_, {"--web", "none", "--record-dir", out_})), "--web none");
  const Finished wrong = run(serve(source_, {"--record-dir", out_, "--pre-roll", "long"}));
  EXPECT_EQ(wrong.status, 2);
  EXPECT_THAT(wrong.err, HasSubstr("10s"));
}

}  // namespace
}  // namespace relievo::test
