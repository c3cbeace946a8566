// SPDX-License-Identifier: Apache-2.0
// serve --record-dir: recordings started and stopped over HTTP, read by `relievo info` and the reader.
#include <gmock/gmock.h>
#include <signal.h>

#include <algorithm>
#include <fstream>

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
  /// What /api/recordings says of a file.
  static Json listed(WebServer& server, const std::string& name) {
    const Json all = Json::parse(request(server.port(), "GET", "/api/recordings").body);
    for (const Json& one : all["recordings"])
      if (one["file"] == name) return one;
    return {{"recording", nullptr}};
  }
  /// The numbers of the frames in a sound file.
  static std::vector<std::uint64_t> frames_in(const fs::path& file) {
    std::vector<std::uint64_t> out;
    auto reader = RecordingReader::open(file);
    EXPECT_TRUE(reader && !(*reader)->summary().recovered) << file;
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
  ASSERT_EQ(server.order("take", "stop").status, 200);
  ASSERT_TRUE(eventually([&] { return listed(server, name)["recording"] == false; }));
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

TEST_F(RecordingOnRequest, IsReadWhileItIsWritten) {
  WebServer server(command());
  ASSERT_TRUE(server.goes_on("take", 20)) << server.process().err();
  ASSERT_EQ(server.order("take", "start").status, 200);
  const std::string name = server.recording("take")["file"];
  const std::string at = "/recordings/" + name;
  ASSERT_TRUE(eventually([&] { return listed(server, name)["recording"] == true; }));
  const auto read_now = [&](const std::string& into, const std::string& headers = {}) {
    const Response got = request(server.port(), "GET", at, headers);
    EXPECT_EQ(got.status, 200);
    std::ofstream(out_ / into, std::ios::binary) << got.body;
    return got;
  };
  const Response first = read_now("first.mcap");
  const auto early = frames_in(out_ / "first.mcap");
  ASSERT_FALSE(early.empty());
  EXPECT_LT(early.front(), 20U) << "what came before it was asked for can be gone back to";
  const std::string etag = first.headers.at("etag");
  // What it grows by need not be a frame yet.
  std::vector<std::uint64_t> frames;
  ASSERT_TRUE(eventually([&] {
    const std::string if_changed = "If-None-Match: " + etag + "\r\n";
    if (request(server.port(), "HEAD", at, if_changed).status != 200) return false;
    read_now("later.mcap", if_changed);
    frames = frames_in(out_ / "later.mcap");
    return frames.size() > early.size();
  })) << "it grows";
  EXPECT_TRUE(std::equal(early.begin(), early.end(), frames.begin()));
  EXPECT_EQ(frames.back() - frames.front() + 1, frames.size()) << "without gaps";
  for (const std::string& file : {(out_ / "later.mcap").string(), (out_ / name).string()}) {
    const Finished info = run({program("relievo").string(), "info", file, "--json"});
    EXPECT_EQ(info.status, 0) << info.err;
    EXPECT_EQ(info.err, "");
    const Json said = Json::parse(info.out);
    EXPECT_GE(said["frames"], frames.size()) << file;
    EXPECT_EQ(said["damaged_parts"], 0) << file;
    EXPECT_EQ(said["info"]["pattern"]["stripes"], 16) << file;
  }

  // A page that has the first one open reads on in it, also when the recording has ended.
  ASSERT_EQ(server.order("take", "stop").status, 200);
  ASSERT_TRUE(eventually([&] { return listed(server, name)["recording"] == false; }));
  const Response part = request(server.port(), "GET", at, "Range: bytes=100-\r\nIf-Range: " + etag + "\r\n");
  EXPECT_EQ(part.status, 206);
  EXPECT_TRUE(part.body == first.body.substr(100));
  EXPECT_GT(frames_in(out_ / name).size(), frames.size());
}

// Proves: who plays a recording that is still being written is told when there is more, and reads that alone.
TEST_F(RecordingOnRequest, GrowsForWhoPlaysIt) {
  WebServer server(command());
  ASSERT_TRUE(server.goes_on("take", 20)) << server.process().err();
  WsClient client(server.port(), "take");
  ASSERT_EQ(client.status(), 101);
  ASSERT_EQ(server.order("take", "start").status, 200);
  std::string have, name, etag;
  const auto end_of_data = [&] { return u64_at(have, have.size() - 8 - 20) - 13; };  // MCAP: footer, data end
  const auto read_on = [&] {
    std::string headers;
    if (!have.empty()) {
      headers = "Range: bytes=" + std::to_string(end_of_data()) + "-\r\nIf-None-Match: " + etag + "\r\n";
      have.resize(end_of_data());
    }
    const Response got = request(server.port(), "GET", "/recordings/" + name, headers);
    EXPECT_EQ(got.status, headers.empty() ? 200 : 206);
    have += got.body;
    etag = got.headers.at("etag");
    std::ofstream(out_ / "have.mcap", std::ios::binary) << have;
    return frames_in(out_ / "have.mcap");
  };
  std::vector<std::uint64_t> frames;
  for (int growths = 0; growths < 3;) {
    const auto message = client.next_of("recording");
    ASSERT_TRUE(message);
    const Json said = Json::parse(message->data);
    ASSERT_EQ(said["state"], "recording");
    name = said["file"];
    if (said["whole_bytes"] <= (have.empty() ? 0 : end_of_data())) continue;
    const auto now = read_on();
    EXPECT_GT(now.size(), frames.size());
    frames = now;
    ++growths;
  }
  ASSERT_EQ(server.order("take", "stop").status, 200);
  for (Json said; said["state"] != "off" || said["message"] != "";) {
    const auto message = client.next_of("recording");
    ASSERT_TRUE(message);
    said = Json::parse(message->data);
  }
  frames = read_on();
  EXPECT_EQ(frames, frames_in(out_ / name)) << "to its end";
  EXPECT_EQ(frames.back() - frames.front() + 1, frames.size()) << "without gaps";
}

// Proves: what the server records from its start, into the same folder, is no finished file either.
TEST_F(RecordingOnRequest, WhatIsRecordedFromTheStartGrowsToo) {
  std::vector<std::string> all = command();
  all.insert(all.end(), {"--record", out_ / "all.mcap"});
  WebServer server(all);
  ASSERT_TRUE(server.goes_on("take", 20)) << server.process().err();
  ASSERT_TRUE(eventually([&] { return listed(server, "all.mcap")["recording"] == true; }));
  const Response growing = request(server.port(), "GET", "/recordings/all.mcap");
  ASSERT_EQ(growing.status, 200);
  EXPECT_EQ(growing.headers.at("cache-control"), "no-cache");
  EXPECT_THAT(growing.headers.at("etag"), HasSubstr("growing"));
  std::ofstream(out_ / "first.mcap", std::ios::binary) << growing.body;
  EXPECT_FALSE(frames_in(out_ / "first.mcap").empty()) << "it is whole as it was sent";
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

TEST_F(RecordingOnRequest, WhatAKilledServerLeftIsListedAsCutUntilItIsMended) {
  std::string name;
  {
    WebServer server(command());
    ASSERT_TRUE(server.goes_on("take", 5)) << server.process().err();
    ASSERT_EQ(server.order("take", "start").status, 200);
    ASSERT_TRUE(eventually([&] {
      name = server.recording("take")["file"];
      return server.recording("take")["whole_bytes"] > 0 && listed(server, name)["recording"] == true;
    }));
    EXPECT_EQ(listed(server, name)["cut"], false);
    server.process().signal(SIGKILL);
    EXPECT_EQ(server.process().wait(), 128 + SIGKILL);
  }
  WebServer server(command());
  ASSERT_NE(server.port(), 0) << server.process().err();
  EXPECT_EQ(listed(server, name)["cut"], true);
  const Response got = request(server.port(), "GET", "/recordings/" + name);
  EXPECT_EQ(got.status, 200);
  EXPECT_EQ(got.headers.at("cache-control"), "no-cache");
  const Finished mended = run({program("relievo"), "recover", out_ / name, "--out", out_ / "mended.mcap"});
  EXPECT_EQ(mended.status, 0) << mended.err;
  EXPECT_EQ(listed(server, "mended.mcap")["cut"], false);
  EXPECT_FALSE(frames_in(out_ / "mended.mcap").empty());
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

TEST_F(RecordingOnRequest, OfWhichNothingFitsIsNotOffered) {
  std::string script = "trap '' XFSZ; ulimit -f 1; exec";
  for (const std::string& word : command()) script += " '" + word + "'";
  WebServer server({"/bin/bash", "-c", script});
  ASSERT_TRUE(server.goes_on("take", 5)) << server.process().err();
  ASSERT_EQ(server.order("take", "start").status, 200);
  ASSERT_TRUE(eventually([&] { return server.recording("take")["state"] == "failed"; }));
  EXPECT_EQ(server.recording("take")["frames"], 0);
  EXPECT_TRUE(names_in(out_).empty());
}

TEST_F(RecordingOnRequest, ThatIsRenamedHasFailedAndKeepsWhatItHas) {
  WebServer server(command());
  ASSERT_TRUE(server.goes_on("take", 5)) << server.process().err();
  ASSERT_EQ(server.order("take", "start").status, 200);
  ASSERT_TRUE(eventually([&] { return server.recording("take")["whole_bytes"] > 0; }));
  const std::string name = server.recording("take")["file"];
  fs::rename(out_ / name, out_ / "mine.mcap");
  ASSERT_TRUE(eventually([&] { return server.recording("take")["state"] == "failed"; }));
  EXPECT_THAT(server.recording("take")["message"].get<std::string>(), HasSubstr("it was renamed"));
  EXPECT_FALSE(frames_in(out_ / "mine.mcap").empty());
  EXPECT_EQ(server.order("take", "start").status, 200);
}

TEST_F(RecordingOnRequest, TheFolderIsMadeAlsoAnewByAReload) {
  const fs::path config = folder_ / "server.toml", takes = out_ / "takes";
  std::ofstream(config) << "loop = true\n[recording]\nfolder = \"" << takes.string() << "/\"\n";
  WebServer server(serve(source_, {"--web", "127.0.0.1:0", "--config", config}));
  ASSERT_TRUE(server.goes_on("take", 2)) << server.process().err();
  EXPECT_TRUE(fs::is_directory(takes));
  fs::remove(takes);
  server.process().signal(SIGHUP);
  ASSERT_TRUE(server.process().wait_for_text("was read again")) << server.process().err();
  ASSERT_EQ(server.order("take", "start").status, 200);
  EXPECT_TRUE(eventually([&] { return names_in(takes).size() == 1; })) << "begun with the next frame";
}

// What was captured through a curve cannot be told from the colour matrix alone.
TEST_F(RecordingOnRequest, ARecordingKeepsItsCamerasGamma) {
  const fs::path file = folder_ / "g.mcap";
  const Finished done = run(serve("sim:plane,gamma=2.2,width=160,height=120,stripes=30,frames=12",
                                  {"--web", "none", "--fast", "--frames", "12", "--record", file}));
  ASSERT_EQ(done.status, 0) << done.err;
  auto reader = RecordingReader::open(file);
  ASSERT_TRUE(reader) << reader.error().message;
  std::string rig;
  for (const RecordingAttachment& a : (*reader)->summary().attachments)
    if (a.name == "rig.yaml") rig.assign(a.data.begin(), a.data.end());
  EXPECT_THAT(rig, HasSubstr("\ncamera_gamma: 2.2"));
  for (;;) {
    const auto message = (*reader)->next();
    ASSERT_TRUE(message && *message) << "no description";
    if ((*reader)->summary().channels[(**message).channel].topic != "relievo/info") continue;
    const auto info = read_info_cdr((**message).data);
    ASSERT_TRUE(info) << info.error().message;
    EXPECT_EQ(info->rig.camera_gamma, 2.2);
    return;
  }
}

TEST_F(RecordingOnRequest, AFolderThatIsClosedIsToldAtTheStart) {
  // Modes hold for root, too, then.
  const auto closed = [&](std::vector<std::string> command) {
    if (::geteuid() == 0)
      command.insert(command.begin(), {"/usr/bin/setpriv", "--bounding-set=-all", "--inh-caps=-all"});
    return run(command);
  };
  if (closed({program("relievo-server"), "--version"}).status != 0)
    GTEST_SKIP() << "root may not give up its rights here";
  fs::permissions(out_, fs::perms::owner_read | fs::perms::owner_exec);
  const std::string what = "cannot record in the folder " + out_.string() + ": Permission denied";
  expect_one_error(closed(serve(source_, {"--web", "none", "--record", out_ / "a.mcap"})), what);
  const Finished served =
      closed(serve(source_, {"--web", "127.0.0.1:0", "--fast", "--frames", "4", "--record-dir", out_}));
  EXPECT_EQ(served.status, 0) << "it can be watched";
  EXPECT_THAT(served.err, HasSubstr("no recording can be started: " + what));
  fs::permissions(out_, fs::perms::owner_all);
}

TEST_F(RecordingOnRequest, WhatCannotWorkIsSaidAtTheStart) {
  expect_one_error(run(serve(source_, {"--web", "127.0.0.1:0", "--record-dir", out_ / "none/takes"})),
                   "there is no folder " + (out_ / "none").string());
  expect_one_error(run(serve(source_, {"--web", "127.0.0.1:0", "--record-dir", take_ / "rig.yaml"})),
                   "it is no folder");
  expect_one_error(run(serve(source_, {"--web", "none", "--record-dir", out_})), "--web none");
  const Finished wrong = run(serve(source_, {"--record-dir", out_, "--pre-roll", "long"}));
  EXPECT_EQ(wrong.status, 2);
  EXPECT_THAT(wrong.err, HasSubstr("10s"));
  const Finished alone = run(serve(source_, {"--record", out_ / "a.mcap", "--keep-size", "1GB"}));
  EXPECT_EQ(alone.status, 2);
  EXPECT_THAT(alone.err, HasSubstr("--split-size or --split-every"));
}

}  // namespace
}  // namespace relievo::test
