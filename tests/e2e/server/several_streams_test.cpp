// SPDX-License-Identifier: Apache-2.0
// One server with several streams: each its own, and what they are changed while they run.
#include <gmock/gmock.h>
#include <signal.h>
#include <sys/resource.h>

#include <mutex>

#include "idl/transport.h"
#include "tests/e2e/server/web_server.h"
#include "tests/support/metric.h"

namespace relievo::test {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;
using Json = nlohmann::json;

/// What a reader sees of a stream.
class Reader {
 public:
  explicit Reader(const std::string& stream) {
    Subscriber::Callbacks callbacks;
    callbacks.info = [this](const StreamInfo& info) {
      const std::lock_guard lock(mutex_);
      started_.push_back(info.started_ns);
    };
    callbacks.gone = [this](const std::string&) {
      const std::lock_guard lock(mutex_);
      ++gone_;
    };
    callbacks.frame = [this](const std::string&, const FrameMessage& frame) {
      const std::lock_guard lock(mutex_);
      if (!frames_.empty() && frame.sequence != frames_.back() + 1) ++gaps_;
      frames_.push_back(frame.sequence);
    };
    auto subscriber = Subscriber::create({own_domain(), "lo"}, stream, callbacks);
    EXPECT_TRUE(subscriber);
    if (subscriber) subscriber_ = *std::move(subscriber);
  }
  std::size_t frames() const {
    const std::lock_guard lock(mutex_);
    return frames_.size();
  }
  std::uint64_t gaps() const {  // starting again is one
    const std::lock_guard lock(mutex_);
    return gaps_;
  }
  int gone() const {
    const std::lock_guard lock(mutex_);
    return gone_;
  }
  std::set<std::int64_t> starts() const {
    const std::lock_guard lock(mutex_);
    return {started_.begin(), started_.end()};
  }
  bool gets(std::size_t more) const {
    const std::size_t until = frames() + more;
    return eventually([&] { return frames() >= until; });
  }

 private:
  mutable std::mutex mutex_;
  std::vector<std::int64_t> started_;
  std::vector<std::uint64_t> frames_;
  std::uint64_t gaps_ = 0;
  int gone_ = 0;
  std::unique_ptr<Subscriber> subscriber_;
};

/// Whether SIGHUP would not end it: it has the thread that reads its configuration again.
bool takes_hangup(const Process& process) {
  std::error_code ended;
  for (const auto& thread :
       std::filesystem::directory_iterator("/proc/" + std::to_string(process.pid()) + "/task", ended))
    if (read_text(thread.path() / "comm") == "on-reload\n") return true;
  return false;
}

/// Two takes of 5 frames a second: a reader on a busy machine has time.
class SeveralStreams : public ::testing::Test {
 protected:
  void SetUp() override {
    StripedScene scene = striped_scene();
    scene.rig.frame_rate = 5;
    for (const char* name : {"one", "two"}) ASSERT_TRUE(write_striped_take(scene, folder_ / name, 6));
    write(table("left", "one") + table("right", "two"));
  }
  std::string table(const std::string& name, const std::string& take, const std::string& more = {}) const {
    return "[[stream]]\nname = \"" + name + "\"\nsource = \"take:" + (folder_ / take).string() + "\"\n" +
           more;
  }
  void write(const std::string& tables, const std::string& server = {}) const {
    const fs::path next = folder_ / "next";
    std::ofstream(next) << "loop = true\ninterface = \"lo\"\nweb = \"127.0.0.1:0\"\ndomain = " << own_domain()
                        << "\n"
                        << server << tables;
    fs::rename(next, config_);
  }
  std::vector<std::string> command() const { return server({"serve", "--config", config_.string()}); }
  static bool reloaded(WebServer& server, const std::string& says) {
    const std::size_t before = server.process().err().size();
    server.process().signal(SIGHUP);
    return eventually([&] { return server.process().err().find(says, before) != std::string::npos; });
  }

  const TempFolder folder_;
  const fs::path config_ = folder_ / "server.toml";
};

TEST_F(SeveralStreams, RunSideBySideAndStopTogether) {
  WebServer server(command());
  ASSERT_NE(server.port(), 0) << server.process().err();
  EXPECT_THAT(server.process().out(), HasSubstr("stream left on DDS domain"));
  EXPECT_THAT(server.process().out(), HasSubstr("stream right on DDS domain"));
  const Reader left("left"), right("right");
  EXPECT_TRUE(left.gets(5));
  EXPECT_TRUE(right.gets(5));
  EXPECT_TRUE(server.goes_on("left", 3));
  EXPECT_TRUE(server.goes_on("right", 3));
  server.process().signal(SIGTERM);
  EXPECT_EQ(server.process().wait(), 0) << server.process().err();
  EXPECT_THAT(server.process().err(), HasSubstr("left: "));
  EXPECT_THAT(server.process().err(), HasSubstr("right: "));
}

TEST_F(SeveralStreams, OneThatFailsIsTriedAgainAndTheOtherLosesNothing) {
  const fs::path file = folder_ / "right.mcap";
  write(table("left", "one") + table("right", "two", "record = \"" + file.string() + "\"\n"));
  fs::rename(folder_ / "two", folder_ / "away");
  WebServer server(command());
  ASSERT_TRUE(server.process().wait_for_text("it is tried again")) << server.process().err();
  const Reader left("left");
  EXPECT_TRUE(left.gets(5));
  EXPECT_TRUE(server.stream("right").is_null());
  fs::rename(folder_ / "away", folder_ / "two");
  EXPECT_TRUE(server.goes_on("right", 3)) << server.process().err();
  fs::rename(folder_ / "two", folder_ / "away");  // while it runs
  EXPECT_TRUE(eventually([&] { return server.stream("right").is_null(); }));
  fs::rename(folder_ / "away", folder_ / "two");
  EXPECT_TRUE(server.goes_on("right", 3)) << server.process().err();
  EXPECT_TRUE(fs::exists(file) && fs::exists(folder_ / "right-2.mcap")) << "nothing is written over";
  EXPECT_TRUE(left.gets(5));
  EXPECT_EQ(left.gaps(), 0U);
  server.process().signal(SIGTERM);
  EXPECT_EQ(server.process().wait(), 0) << server.process().err();
}

// As after a crash or a reboot: nobody is there to give a service another name.
TEST_F(SeveralStreams, WhatTheConfigurationRecordsToMayBeThereFromBefore) {
  const fs::path file = folder_ / "left.mcap";
  const std::string record = "record = \"" + file.string() + "\"\n";
  const auto serves = [&](const fs::path& into, const std::string& label) {
    WebServer server(command());
    EXPECT_TRUE(server.goes_on("left", 2)) << server.process().err();
    EXPECT_TRUE(eventually([&] { return fs::exists(into); })) << into << server.process().err();
    EXPECT_THAT(server.process().err(), HasSubstr(label + "recorded to " + into.string() + ": " +
                                                  file.string() + " is there already"));
    server.process().signal(SIGTERM);
    EXPECT_EQ(server.process().wait(), 0) << server.process().err();
  };
  std::ofstream(file) << "a recording of before";
  write(record + "stream = \"left\"\nsource = \"take:" + (folder_ / "one").string() + "\"\n");
  serves(folder_ / "left-2.mcap", "");
  std::vector<std::string> by_hand = command();
  by_hand.insert(by_hand.end(), {"--record", file.string()});
  expect_one_error(run(by_hand), "exists already");
  write(table("left", "one", record) + table("right", "two"));
  serves(folder_ / "left-3.mcap", "left: ");
  EXPECT_EQ(read_text(file), "a recording of before");
}

TEST_F(SeveralStreams, AReloadChangesWhatChangedAndNothingElse) {
  WebServer server(command());
  ASSERT_TRUE(server.goes_on("right", 2)) << server.process().err();
  const Reader left("left"), right("right");
  ASSERT_TRUE(left.gets(3));
  ASSERT_TRUE(right.gets(3));
  write(table("left", "one") + table("right", "two", "texture_quality = 50\n") + table("third", "two"));
  ASSERT_TRUE(reloaded(server, "was read again")) << server.process().err();
  EXPECT_TRUE(server.goes_on("third", 2)) << server.process().err();
  EXPECT_TRUE(eventually([&] { return right.starts().size() == 2; })) << "it was started again";
  write(table("left", "one") + table("third", "two"));
  ASSERT_TRUE(reloaded(server, "was read again")) << server.process().err();
  EXPECT_TRUE(eventually([&] { return server.stream("right").is_null(); }));
  EXPECT_TRUE(left.gets(3));
  EXPECT_EQ(left.starts().size(), 1U) << "it went on untouched";
  EXPECT_EQ(left.gaps(), 0U);
  server.process().signal(SIGTERM);
  EXPECT_EQ(server.process().wait(), 0) << server.process().err();
}

// Cyclone lets the liveliness of all other writers of a server run out when those of one stream are deleted.
TEST_F(SeveralStreams, WatchersOfTheOthersAreNotToldThatTheyAreGone) {
  WebServer server(command());
  const Reader left("left");
  for (int round = 0; round < 3; ++round) {
    const Reader right("right");
    ASSERT_TRUE(left.gets(2) && right.gets(2)) << server.process().err();
    write(table("left", "one"));
    ASSERT_TRUE(reloaded(server, "was read again")) << server.process().err();
    EXPECT_TRUE(eventually([&] { return right.gone() == 1; })) << "its end is told";
    EXPECT_TRUE(left.gets(2));
    EXPECT_EQ(left.gone(), 0) << "it goes on";
    write(table("left", "one") + table("right", "two"));
    ASSERT_TRUE(reloaded(server, "was read again")) << server.process().err();
  }
  EXPECT_EQ(left.starts().size(), 1U);
  EXPECT_EQ(left.gaps(), 0U);
  server.process().signal(SIGKILL);
  EXPECT_TRUE(eventually([&] { return left.gone() == 1; })) << "a crash is told";
}

// A camera that is not there is tried again, and each stream that begins says so anew.
TEST_F(SeveralStreams, AReloadNoticesAChangedRigUnderUnchangedSettings) {
  const fs::path rig = folder_ / "rig.yaml", pattern = folder_ / "pattern.yaml";
  fs::copy_file(folder_ / "one" / "rig.yaml", rig);
  fs::copy_file(folder_ / "one" / "pattern.yaml", pattern);
  write(table("left", "one") + "[[stream]]\nname = \"camera\"\nsource = \"v4l2:/dev/no-such-camera\"\n" +
        "[stream.camera]\nrig = \"" + rig.string() + "\"\n");
  WebServer server(command());
  const Reader left("left");
  const auto begun = [&] {
    const std::string err = server.process().err();
    std::size_t count = 0;
    for (auto at = err.find("it is tried again"); at != std::string::npos;
         at = err.find("it is tried again", at + 1))
      ++count;
    return count;
  };
  ASSERT_TRUE(eventually([&] { return begun() == 1; })) << server.process().err();
  ASSERT_TRUE(left.gets(2));
  ASSERT_TRUE(reloaded(server, "was read again")) << server.process().err();
  ASSERT_TRUE(left.gets(5));
  EXPECT_EQ(begun(), 1U) << "nothing changed";
  for (const fs::path& changed : {rig, pattern}) {
    const std::size_t before = begun();
    std::ofstream(changed, std::ios::app) << "# measured anew\n";
    ASSERT_TRUE(reloaded(server, "was read again")) << server.process().err();
    EXPECT_TRUE(eventually([&] { return begun() == before + 1; })) << changed << server.process().err();
  }
  EXPECT_EQ(left.starts().size(), 1U);
  EXPECT_EQ(left.gaps(), 0U);
}

TEST_F(SeveralStreams, MetricsSayWhatEachStageTakes) {
  WebServer server(command());
  ASSERT_TRUE(server.goes_on("left", 3)) << server.process().err();
  ASSERT_TRUE(server.goes_on("right", 3)) << server.process().err();
  const std::string metrics = request(server.port(), "GET", "/metrics").body;
  const auto value = [&](const std::string& name) { return metric_in(metrics, name); };
  for (const std::string stream : {"left", "right"}) {
    for (const std::string stage : {"reconstruct", "encode_geometry", "encode_texture", "publish"}) {
      const std::string labels = "{stream=\"" + stream + "\",stage=\"" + stage + "\"}";
      EXPECT_GE(value("relievo_stage_seconds_count" + labels), 3) << labels;
      EXPECT_GT(value("relievo_stage_seconds_sum" + labels), 0) << labels;
    }
    EXPECT_EQ(
        value("relievo_stream_info{stream=\"" + stream + "\",scheme=\"complementary\",decoder=\"ordered\"}"),
        1);
    EXPECT_EQ(value("relievo_stream_line_stride{stream=\"" + stream + "\"}"), 1);
    EXPECT_GE(value("relievo_stage_waiting{stream=\"" + stream + "\",stage=\"encode\"}"), 0);
    EXPECT_EQ(value("relievo_stream_sent_again_bytes_total{stream=\"" + stream + "\"}"), 0);
  }
}

TEST_F(SeveralStreams, MetricsSayWhatItsClientsDecode) {
  WebServer server(command());
  ASSERT_TRUE(server.goes_on("left", 3)) << server.process().err();
  Process client({program("relievo").string(), "stats", "left", "--domain", std::to_string(own_domain()),
                  "--interface", "lo"});
  std::string of;
  std::string metrics;
  const auto value = [&](const std::string& name) { return metric_in(metrics, name); };
  EXPECT_TRUE(eventually([&] {
    metrics = request(server.port(), "GET", "/metrics").body;
    const std::string head = "relievo_client_decode_seconds_count{stream=\"left\",";
    const auto at = metrics.find(head);
    if (at == std::string::npos) return false;
    const auto open = metrics.find('{', at);
    of = metrics.substr(open, metrics.find('}', at) + 1 - open);
    return value("relievo_client_latency_seconds_count" + of) >= 3 &&
           value("relievo_stage_seconds_count{stream=\"left\",stage=\"decode\"}") >= 1;
  })) << metrics;
  EXPECT_THAT(of, HasSubstr(":" + std::to_string(client.pid()) + "\",id="));
  EXPECT_GT(value("relievo_client_decode_seconds_sum" + of), 0);
  EXPECT_LE(value("relievo_client_latency_seconds_count" + of),
            value("relievo_client_decode_seconds_count" + of))
      << "counted once the clocks are compared";
  EXPECT_GT(value("relievo_client_latency_seconds_sum" + of), 0);
  EXPECT_EQ(value("relievo_client_lost_total" + of), 0);
  EXPECT_EQ(value("relievo_stage_seconds_count{stream=\"right\",stage=\"decode\"}"), 0);
}

// As of scripts that start a server and change its configuration: until it served, SIGHUP ended it.
TEST_F(SeveralStreams, AReloadWhileItStartsIsDoneOnceItServes) {
  // Of two streams, not many: each that runs already slows the start of the rest.
  for (int tries = 0; tries < 5; ++tries) {
    Process server(command());
    ASSERT_TRUE(eventually([&] { return takes_hangup(server); })) << server.err();
    if (!server.out().empty()) continue;  // this thread was kept so long that it serves already
    server.signal(SIGHUP);
    EXPECT_TRUE(server.wait_for_text("was read again")) << server.err();
    server.signal(SIGTERM);
    EXPECT_EQ(server.wait(), 0) << server.err();
    return;
  }
  FAIL() << "it takes SIGHUP only once it serves";
}

TEST_F(SeveralStreams, AFileWithAMistakeIsRefusedWhole) {
  WebServer server(command());
  const Reader left("left");
  ASSERT_TRUE(left.gets(2)) << server.process().err();
  write(table("third", "two") + table("left", "one", "texture_quality = 500\n"));
  ASSERT_TRUE(reloaded(server, config_.string() + ":11: texture_quality")) << server.process().err();
  EXPECT_THAT(server.process().err(), HasSubstr("nothing was changed"));
  EXPECT_TRUE(server.goes_on("right", 2));
  EXPECT_TRUE(left.gets(2));
  EXPECT_EQ(left.gaps(), 0U);
  EXPECT_TRUE(server.stream("third").is_null());
}

TEST_F(SeveralStreams, AMistakenSourceIsRefusedAndTakesNothingDown) {
  WebServer server(command());
  const Reader left("left");
  ASSERT_TRUE(left.gets(2)) << server.process().err();
  for (const char* source : {"bogus:x", "sim:nope", "sim:face,stripe=70"}) {
    write(table("right", "two") + "[[stream]]\nname = \"left\"\nsource = \"" + source + "\"\n");
    ASSERT_TRUE(reloaded(server, "nothing was changed: " + config_.string() + ":10: source: stream left: "))
        << server.process().err();
  }
  EXPECT_TRUE(left.gets(2));
  EXPECT_EQ(left.starts().size(), 1U);
  EXPECT_EQ(left.gaps(), 0U);
}

TEST_F(SeveralStreams, AReloadThatEndsARecordingSaysSo) {
  fs::create_directory(folder_ / "recorded");
  const std::string recording = "[recording]\nfolder = \"" + (folder_ / "recorded").string() + "\"\n";
  write(table("left", "one") + table("right", "two"), recording);
  WebServer server(command());
  ASSERT_TRUE(server.goes_on("right", 2)) << server.process().err();
  ASSERT_EQ(server.order("right", "start").status, 200);
  ASSERT_TRUE(eventually([&] { return server.recording("right")["frames"] >= 2; }));
  const std::string file = server.recording("right")["file"];
  write(table("left", "one") + table("right", "two", "texture_quality = 50\n"), recording);
  ASSERT_TRUE(reloaded(server, "was read again")) << server.process().err();
  ASSERT_TRUE(server.goes_on("right", 1)) << server.process().err();
  const Json state = server.recording("right");
  EXPECT_EQ(state["state"], "failed") << "nobody asked for its end";
  EXPECT_EQ(state["file"], file);
  EXPECT_GE(state["frames"], 2);
  EXPECT_THAT(state["message"].get<std::string>(), HasSubstr("it ended with the stream"));
  EXPECT_THAT(server.process().err(), HasSubstr("right: the recording " + file + " ended with the stream"));
  EXPECT_THAT(server.process().err(), HasSubstr("right: streaming from take:")) << "it comes up anew";
  ASSERT_EQ(server.order("right", "start").status, 200);
  EXPECT_NE(server.recording("right")["file"], file);
  EXPECT_EQ(server.recording("right")["message"], "");
}

// A limit on the size of files stands for a disk that fills up in the last moment.
TEST_F(SeveralStreams, AFailureAtTheEndAfterAReloadIsAnErrorAndNoPromise) {
  const std::string stream = "stream = \"left\"\nsource = \"take:" + (folder_ / "one").string() +
                             "\"\nrecord = \"" + (folder_ / "left.mcap").string() + "\"\n";
  write(stream);
  std::string script = "trap '' XFSZ; exec";
  for (const std::string& word : command()) script += " '" + word + "'";
  WebServer server({"/bin/bash", "-c", script});
  ASSERT_TRUE(server.goes_on("left", 2)) << server.process().err();
  write(stream + "texture_quality = 50\n");
  ASSERT_TRUE(reloaded(server, "was read again")) << server.process().err();
  ASSERT_TRUE(server.goes_on("left", 2)) << server.process().err();
  const rlim_t size = std::max<rlim_t>(fs::file_size(folder_ / "left-2.mcap"), 4096);  // its log is shorter
  const rlimit no_more{size, size};
  ASSERT_EQ(prlimit(server.process().pid(), RLIMIT_FSIZE, &no_more, nullptr), 0);
  server.process().signal(SIGTERM);
  EXPECT_EQ(server.process().wait(), 1) << server.process().err();
  EXPECT_EQ(server.process().err().find("tried again"), std::string::npos) << server.process().err();
  EXPECT_EQ(errors(server.process().err()).size(), 1U) << server.process().err();
}

// Where one could be read for ever, the thread that takes signals would be the one that waits.
TEST_F(SeveralStreams, PipesInPlaceOfItsFilesAreRefusedAndItStillStops) {
  const fs::path rig = folder_ / "rig.yaml";
  const std::string camera = "[[stream]]\nname = \"camera\"\nsource = \"v4l2:/dev/no-such-camera\"\n" +
                             ("[stream.camera]\nrig = \"" + rig.string() + "\"\n");
  ASSERT_TRUE(make_pipe(rig));
  write(table("left", "one") + camera);
  WebServer server(command());
  const Reader left("left");
  ASSERT_TRUE(left.gets(2)) << server.process().err();
  EXPECT_THAT(server.process().err(), HasSubstr(rig.string() + ": it is a pipe"));
  ASSERT_TRUE(reloaded(server, "was read again")) << server.process().err();
  ASSERT_TRUE(make_pipe(config_));
  ASSERT_TRUE(reloaded(server, config_.string() + ": it is a pipe")) << server.process().err();
  EXPECT_TRUE(left.gets(2));
  EXPECT_EQ(left.gaps(), 0U);
  server.process().signal(SIGTERM);
  EXPECT_EQ(server.process().wait(), 0) << server.process().err();
}

TEST_F(SeveralStreams, AStormOfReloadsOfABrokenFileCostsNothing) {
  WebServer server(command());
  const Reader left("left");
  ASSERT_TRUE(left.gets(2) && server.goes_on("right", 2)) << server.process().err();
  const auto holds = [&](const char* what) {
    const fs::path folder = "/proc/" + std::to_string(server.process().pid()) + "/" + what;
    return std::distance(fs::directory_iterator(folder), {});
  };
  const auto threads = holds("task"), descriptors = holds("fd");
  write("[[stream]\n");
  for (int i = 0; i < 50; ++i) ASSERT_TRUE(reloaded(server, "nothing was changed")) << server.process().err();
  EXPECT_TRUE(eventually([&] { return holds("task") <= threads && holds("fd") <= descriptors; }));
  write(table("left", "one") + table("third", "two"));
  ASSERT_TRUE(reloaded(server, "was read again")) << server.process().err();
  EXPECT_TRUE(server.goes_on("third", 2)) << server.process().err();
  EXPECT_EQ(left.starts().size(), 1U);
  EXPECT_EQ(left.gaps(), 0U);
}

TEST_F(SeveralStreams, AReloadAppliesTokensAndSaysWhatNeedsARestart) {
  WebServer server(command());
  ASSERT_TRUE(server.goes_on("left", 2)) << server.process().err();
  std::ofstream(folder_ / "tokens") << "0123456789abcdef0123456789abcdef\n";
  const std::string tables = table("left", "one") + table("right", "two");
  write(tables + "[gateway]\ntoken_file = \"" + (folder_ / "tokens").string() + "\"\n", "keys = \"none\"\n");
  ASSERT_TRUE(reloaded(server, "was read again")) << server.process().err();
  EXPECT_THAT(server.process().err(), HasSubstr(", keys needs a restart"));
  EXPECT_TRUE(eventually([&] { return request(server.port(), "GET", "/api/streams").status == 401; }));
  write(tables + "[gateway]\ntoken_file = \"/nowhere\"\n");
  ASSERT_TRUE(reloaded(server, "nothing was changed")) << server.process().err();
  EXPECT_EQ(request(server.port(), "GET", "/api/streams").status, 401);
  write(tables + "[recording]\nfolder = \"" + (folder_ / "elsewhere").string() + "\"\npre_roll = \"1s\"\n");
  ASSERT_TRUE(reloaded(server, "was read again")) << server.process().err();
  EXPECT_THAT(server.process().err(), HasSubstr(", the recordings' folder, pre_roll need a restart"));
  EXPECT_FALSE(fs::exists(folder_ / "elsewhere")) << "nothing is recorded there yet";
  write(tables);
  ASSERT_TRUE(reloaded(server, "was read again")) << server.process().err();
  EXPECT_TRUE(eventually([&] { return request(server.port(), "GET", "/api/streams").status == 200; }));
}

TEST_F(SeveralStreams, TheOnlyStreamIsReloadedToo) {
  const std::string one = "stream = \"left\"\nsource = \"take:" + (folder_ / "one").string() + "\"\n";
  write(one);
  WebServer server(command());
  const Reader left("left");
  ASSERT_TRUE(left.gets(2)) << server.process().err();
  ASSERT_TRUE(reloaded(server, "was read again")) << server.process().err();
  EXPECT_TRUE(left.gets(2));
  EXPECT_EQ(left.starts().size(), 1U) << "nothing changed";
  write(one + "texture_quality = 50\n");
  ASSERT_TRUE(reloaded(server, "was read again")) << server.process().err();
  EXPECT_TRUE(eventually([&] { return left.starts().size() == 2; })) << server.process().err();
  write(table("left", "one"));
  ASSERT_TRUE(reloaded(server, "nothing was changed")) << server.process().err();
  EXPECT_TRUE(left.gets(2));
  server.process().signal(SIGTERM);
  EXPECT_EQ(server.process().wait(), 0) << server.process().err();
}

TEST_F(SeveralStreams, FlagsWinAlsoWhereTheySwitchOff) {
  write("stream = \"left\"\nsource = \"take:" + (folder_ / "one").string() + "\"\nhalf_lines = true\n");
  std::vector<std::string> once = command();
  once.insert(once.end(), {"--loop=false", "--half-lines=false", "--decoder", "auto", "--frames", "30"});
  const Finished done = run(once);
  EXPECT_EQ(done.status, 0) << done.err;
  EXPECT_THAT(done.err, HasSubstr("6 frames captured")) << "all of the take, once";
}

TEST_F(SeveralStreams, FlagsOfOneStreamAreRefused) {
  std::vector<std::string> with_source = command();
  with_source.insert(with_source.end(), {"--source", "sim:face"});
  expect_one_error(run(with_source), "leave out --source");
}

}  // namespace
}  // namespace relievo::test
