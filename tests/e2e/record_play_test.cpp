// SPDX-License-Identifier: Apache-2.0
// From a server's process through a recorder's into a file, and from the file through a player's process to a
// reader: every process real, the network the loopback.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <signal.h>

#include <condition_variable>
#include <fstream>
#include <mutex>
#include <nlohmann/json.hpp>
#include <thread>

#include "codec/recording.h"
#include "idl/transport.h"
#include "tests/support/process.h"
#include "tests/support/socket_client.h"
#include "tests/support/streams.h"
#include "tests/support/temp_folder.h"

namespace relievo {
namespace {

using namespace std::chrono_literals;
using test::program;
using testing::HasSubstr;

const int kDomainNumber = test::own_domain();
const std::string kDomain = std::to_string(kDomainNumber);

std::vector<std::string> on_loopback(std::vector<std::string> command) {
  command.insert(command.begin(), program("relievo"));
  command.insert(command.end(), {"--domain", kDomain, "--interface", "lo"});
  return command;
}

bool wait_for_size(const std::filesystem::path& file, std::uintmax_t bytes) {
  std::error_code error;
  for (int i = 0; i < 2000; ++i) {
    const auto size = std::filesystem::file_size(file, error);
    if (!error && size >= bytes) return true;
    std::this_thread::sleep_for(5ms);
  }
  return false;
}

std::vector<Bytes> recorded_frames(const std::filesystem::path& file) {
  std::vector<Bytes> frames;
  auto reader = RecordingReader::open(file);
  if (!reader) {
    ADD_FAILURE() << reader.error().message;
    return frames;
  }
  for (;;) {
    auto message = (*reader)->next();
    if (!message || !*message) return frames;
    if ((*reader)->summary().channels[(*message)->channel].topic == "relievo/frame") {
      frames.push_back(std::move((*message)->data));
    }
  }
}

nlohmann::json info(const std::filesystem::path& file) {
  const auto done = test::run({program("relievo"), "info", file, "--json"}, 20s);
  EXPECT_EQ(done.status, 0) << done.err;
  return nlohmann::json::parse(done.out, nullptr, false);
}

TEST(RecordPlay, KilledRecorderLeavesAFileThatPlaysByteForByte) {
  const test::TempFolder folder;
  const auto file = folder / "cut.mcap";
  {
    test::Process server({program("test_publisher"), "face", kDomain, "20000", "60", "3000", "1"});
    test::Process recorder(on_loopback({"record", "face", "--out", file}));
    ASSERT_TRUE(wait_for_size(file, 1'500'000)) << recorder.err();
    recorder.signal(SIGKILL);
    EXPECT_EQ(recorder.wait(5s), 128 + SIGKILL);
  }
  const auto description = info(file);
  EXPECT_EQ(description["recovered"], true);
  EXPECT_EQ(description["stream"], "face");
  EXPECT_EQ(description["lost"], 0);
  EXPECT_EQ(description["info"]["pattern"]["stripes"], 7);
  const std::vector<Bytes> frames = recorded_frames(file);
  EXPECT_EQ(description["frames"], frames.size());
  ASSERT_GT(frames.size(), 50u);

  std::mutex mutex;
  std::condition_variable changed;
  std::vector<Bytes> played;
  std::vector<StreamInfo> infos;
  Subscriber::Callbacks callbacks;
  callbacks.raw = [&](const RawSample& sample) {
    std::lock_guard lock(mutex);
    if (sample.topic == Topic::kFrame) played.push_back(sample.cdr);
    changed.notify_all();
  };
  callbacks.info = [&](const StreamInfo& i) {
    std::lock_guard lock(mutex);
    infos.push_back(i);
  };
  const auto subscriber = Subscriber::create({kDomainNumber, "lo"}, "face", callbacks);
  ASSERT_TRUE(subscriber.ok());
  test::Process player(on_loopback({"play", file, "--wait-readers", "1", "--speed", "2", "--json"}));
  std::unique_lock lock(mutex);
  EXPECT_TRUE(changed.wait_for(lock, 30s, [&] { return played.size() >= frames.size(); })) << player.err();
  EXPECT_EQ(played, frames) << "the frames played are not the frames recorded";
  // Once, or again where a loaded machine let the player's liveliness lapse for a moment.
  ASSERT_FALSE(infos.empty());
  for (const StreamInfo& i : infos) EXPECT_EQ(i.stream, "face");
  lock.unlock();
  EXPECT_EQ(player.wait(10s), 0);
  EXPECT_EQ(nlohmann::json::parse(player.out())["frames"], frames.size());
}

TEST(RecordPlay, ServerToKilledRecorderToPlayerToSecondRecorder) {
  const test::TempFolder folder;
  const auto cut = folder / "cut.mcap";
  const auto again = folder / "again.mcap";
  {
    test::Process server({program("relievo-server"), "serve", "--source", "sim:plane,period=8,noise=2",
                          "--web", "none", "--domain", kDomain, "--interface", "lo"});
    test::Process recorder(on_loopback({"record", "plane", "--out", cut}));
    ASSERT_TRUE(wait_for_size(cut, 1'000'000)) << server.err() << recorder.err();
    recorder.signal(SIGKILL);
    EXPECT_EQ(recorder.wait(5s), 128 + SIGKILL);
    server.signal(SIGINT);
    EXPECT_EQ(server.wait(10s), 0) << server.err();
  }
  const auto description = info(cut);
  EXPECT_EQ(description["recovered"], true);
  EXPECT_EQ(description["stream"], "plane");
  const std::vector<Bytes> frames = recorded_frames(cut);
  ASSERT_GT(frames.size(), 5u);

  test::Process second(
      on_loopback({"record", "plane", "--out", again, "--frames", std::to_string(frames.size()), "--json"}));
  test::Process player(on_loopback({"play", cut, "--wait-readers", "1"}));
  EXPECT_EQ(player.wait(60s), 0) << player.err();
  EXPECT_EQ(second.wait(20s), 0) << second.err();
  EXPECT_EQ(recorded_frames(again), frames) << "the second client's frames are not those that were recorded";
}

TEST(RecordPlay, InterruptedRecorderCompletesItsFile) {
  const test::TempFolder folder;
  const auto file = folder / "whole.mcap";
  test::Process server({program("test_publisher"), "face", kDomain, "20000", "60", "3000", "1"});
  test::Process recorder(on_loopback({"record", "face", "--out", file, "--json"}));
  ASSERT_TRUE(wait_for_size(file, 500'000)) << recorder.err();
  recorder.signal(SIGINT);
  ASSERT_EQ(recorder.wait(10s), 0) << recorder.err();
  const auto result = nlohmann::json::parse(recorder.out());
  EXPECT_EQ(result["lost"], 0);
  const auto description = info(file);
  EXPECT_EQ(description["recovered"], false);
  EXPECT_EQ(description["frames"], result["frames"]);
  EXPECT_THAT(description["attachments"].dump(), HasSubstr(R"(["rig.yaml","pattern.yaml"])"));
  EXPECT_NEAR(description["frame_rate"], 60, 12);
}

TEST(RecordPlay, RecorderKeepsToItsLimitAndSurvivesARestartOfTheServer) {
  const test::TempFolder folder;
  const auto file = folder / "limit.mcap";
  test::Process recorder(on_loopback({"record", "face", "--out", file, "--frames", "60", "--json"}));
  for (int run = 0; run < 2; ++run) {
    test::Process server({program("test_publisher"), "face", kDomain, "1000", "60", "40", "1"});
    ASSERT_TRUE(server.wait_for_text("done", 15s));
    if (run == 0) std::this_thread::sleep_for(100ms);
  }
  ASSERT_EQ(recorder.wait(10s), 0) << recorder.err();
  const auto result = nlohmann::json::parse(recorder.out());
  EXPECT_EQ(result["frames"], 60);
  EXPECT_EQ(result["lost"], 0);
  EXPECT_EQ(info(file)["frames"], 60);
}

TEST(RecordPlay, FullDiskEndsTheRecordingWithAReadableFile) {
  const test::TempFolder folder;
  const auto file = folder / "full.mcap";
  test::Process server({program("test_publisher"), "face", kDomain, "50000", "60", "3000", "1"});
  std::string command = "trap '' XFSZ; ulimit -f 3000; exec";  // 3,072,000 bytes
  for (const auto& argument : on_loopback({"record", "face", "--out", file}))
    command += " '" + argument + "'";
  const auto done = test::run({"/bin/bash", "-c", command}, 20s);
  EXPECT_EQ(done.status, 1) << done.err;
  EXPECT_THAT(done.err, HasSubstr("error: recording stopped after "));
  EXPECT_THAT(done.err, HasSubstr(file.string()));
  EXPECT_GT(info(file)["frames"], 20);
}

TEST(RecordPlay, FramesAreDescribedAndExported) {
  const test::TempFolder folder;
  const auto file = folder / "real.mcap";
  {
    test::Process server({program("test_publisher"), "face", kDomain, "0", "60", "12", "1"});
    const auto done = test::run(on_loopback({"record", "face", "--out", file, "--frames", "12"}), 20s);
    ASSERT_EQ(done.status, 0) << done.err;
  }
  const auto description = info(file);
  EXPECT_EQ(description["geometry_codecs"], nlohmann::json({"draco-mesh"}));
  EXPECT_EQ(description["texture_codecs"], nlohmann::json({"jpeg"}));
  EXPECT_EQ(description["texture_size"], nlohmann::json({64, 48}));
  EXPECT_GT(description["mean_vertices"], 200);
  EXPECT_EQ(description["unreadable"], 0);
  EXPECT_GT(description["bytes"]["geometry"], 0);
  EXPECT_GT(description["bytes"]["texture"], 0);

  const std::vector<std::pair<std::string, std::string>> magic = {
      {"ply", "ply\n"}, {"glb", "glTF"}, {"obj", ""}, {"png", "\x89PNG"}};
  for (const auto& [format, start] : magic) {
    const auto out = folder / format;
    const auto done = test::run(
        {program("relievo"), "export", file, "--out", out, "--format", format, "--frames", "2:4", "--json"},
        20s);
    ASSERT_EQ(done.status, 0) << done.err;
    EXPECT_EQ(nlohmann::json::parse(done.out)["frames"], 3);
    for (const std::string number : {"000005", "000007", "000009"}) {  // camera frame 2 n + 1
      std::ifstream exported(out / (number + "." + format), std::ios::binary);
      std::string head(start.size(), '\0');
      EXPECT_TRUE(exported.read(head.data(), static_cast<std::streamsize>(head.size()))) << format << number;
      EXPECT_EQ(head, start);
    }
  }
  const auto late =
      test::run({program("relievo"), "export", file, "--out", folder / "x", "--from", "99"}, 20s);
  EXPECT_EQ(late.status, 1);
  EXPECT_THAT(late.err, HasSubstr("no frame in that range"));
}

TEST(RecordPlay, WebServesARecordingInALoop) {
  const test::TempFolder folder;
  const auto file = folder / "loop.mcap";
  {
    test::Process server({program("test_publisher"), "face", kDomain, "3000", "60", "20", "1"});
    const auto done = test::run(on_loopback({"record", "face", "--out", file, "--frames", "20"}), 20s);
    ASSERT_EQ(done.status, 0) << done.err;
  }
  test::Process web({program("relievo"), "web", file, "--listen", "127.0.0.1:0"});
  ASSERT_TRUE(web.wait_for_text("viewer http://127.0.0.1:", 10s)) << web.err();
  const std::string out = web.out();
  const auto port = static_cast<std::uint16_t>(std::stoi(out.substr(out.rfind(':') + 1)));
  const auto streams = test::request(port, "GET", "/api/streams");
  EXPECT_EQ(streams.status, 200);
  EXPECT_THAT(streams.body, HasSubstr("\"face\""));
  test::WsClient client(port, "face");
  ASSERT_EQ(client.status(), 101);
  for (int i = 0; i < 30; ++i) {  // more frames than the file has
    ASSERT_TRUE(client.credit(1));
    ASSERT_TRUE(client.next_of("frame")) << "frame " << i;
  }
  const auto taken =
      test::run({program("relievo"), "web", file, "--listen", "127.0.0.1:" + std::to_string(port)}, 10s);
  EXPECT_EQ(taken.status, 1);
  EXPECT_THAT(taken.err, HasSubstr(std::to_string(port)));
  web.signal(SIGTERM);
  EXPECT_EQ(web.wait(5s), 0) << web.err();
}

TEST(RecordPlay, OtherMcapReadersDecodeEverySample) {
  const std::filesystem::path js = RELIEVO_MCAP_JS;
  if (!std::filesystem::exists(js / "node_modules/@mcap/core")) {
    GTEST_SKIP() << "npm packages are missing: run npm ci --prefix tests/e2e/mcap_js";
  }
  const test::TempFolder folder;
  const auto file = folder / "a.mcap";
  {
    test::Process server({program("test_publisher"), "face", kDomain, "3000", "60", "20", "1"});
    const auto done = test::run(on_loopback({"record", "face", "--out", file, "--frames", "20"}), 20s);
    ASSERT_EQ(done.status, 0) << done.err;
  }
  const auto done = test::run({"/usr/bin/env", "node", js / "validate.mjs", file}, 30s);
  ASSERT_EQ(done.status, 0) << done.err;
  const auto json = nlohmann::json::parse(done.out);
  for (const auto& topic : json["topics"]) {
    const auto& first = topic["first"]["message"];
    EXPECT_EQ(first["stream"], "face");
    if (topic["topic"] == "relievo/frame") {
      EXPECT_EQ(topic["count"], 20);
      EXPECT_EQ(first["frame_number"],
                std::to_string(2 * std::stoull(first["sequence_number"].get<std::string>()) + 1));
      EXPECT_EQ(first["data"]["bytes"], 3000);
    }
    if (topic["topic"] == "relievo/info") {
      EXPECT_EQ(first["source"], "test");
      EXPECT_EQ(first["rig"]["camera"]["width"], 640);
      EXPECT_EQ(first["pattern"]["colours"], 6);
    }
  }
  EXPECT_EQ(json["topics"].size(), 3u);
}

}  // namespace
}  // namespace relievo
