// SPDX-License-Identifier: Apache-2.0
// From a server's process through a recorder's into a file, and from the file through a player's process to a
// reader: every process real, the network the loopback.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <signal.h>

#include <condition_variable>
#include <fstream>
#include <future>
#include <map>
#include <mutex>
#include <nlohmann/json.hpp>
#include <set>

#include "base/time.h"
#include "codec/recording.h"
#include "idl/cdr.h"
#include "idl/transport.h"
#include "tests/support/own_domain.h"
#include "tests/support/patience.h"
#include "tests/support/process.h"
#include "tests/support/socket_client.h"
#include "tests/support/temp_folder.h"

namespace relievo {
namespace {

using namespace std::chrono_literals;
using test::program;
using test::wait_for_size;
using testing::HasSubstr;

const int kDomainNumber = test::own_domain();
const std::string kDomain = std::to_string(kDomainNumber);

std::vector<std::string> on_loopback(std::vector<std::string> command) {
  command.insert(command.begin(), program("relievo"));
  command.insert(command.end(), {"--domain", kDomain, "--interface", "lo"});
  return command;
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

// Live frames go to readers that may be starved of processor time, so how many of them arrive is no promise;
// what arrives, in which order, and that what does not is counted, is.
struct Arrived {
  std::uint64_t lost = 0;  // gaps in the sequence
  double rate = 0;
};
Arrived arrived(const std::vector<Bytes>& frames) {
  Arrived found;
  std::uint64_t last = 0;
  std::int64_t first_ns = 0, last_ns = 0;
  for (const Bytes& cdr : frames) {
    const auto frame = read_frame_cdr(cdr);
    if (!frame) {
      ADD_FAILURE() << frame.error().message;
      continue;
    }
    if (first_ns == 0) first_ns = frame->publish_time_ns;
    if (last_ns != 0) found.lost += frame->sequence - last - 1;
    last = frame->sequence;
    last_ns = frame->publish_time_ns;
  }
  found.rate = static_cast<double>(frames.size() - 1) * 1e9 / static_cast<double>(last_ns - first_ns);
  return found;
}

// As a key: g++ 12 sees an overflow in comparing vectors of bytes.
std::string text_of(const Bytes& bytes) {
  return {bytes.begin(), bytes.end()};
}

// Each is one of the originals, byte for byte, and in their order but where one of `runs` runs ended.
void expect_copies(const std::vector<Bytes>& copies, const std::vector<Bytes>& originals, int runs) {
  std::map<std::string, std::size_t> positions;
  for (std::size_t i = 0; i < originals.size(); ++i) positions[text_of(originals[i])] = i;
  ASSERT_EQ(positions.size(), originals.size()) << "two frames are alike";
  std::size_t last = 0;
  int steps_back = 0;
  for (const Bytes& copy : copies) {
    const auto at = positions.find(text_of(copy));
    ASSERT_NE(at, positions.end()) << "a frame that is none of those recorded";
    steps_back += &copy != copies.data() && at->second <= last;
    last = at->second;
  }
  EXPECT_LT(steps_back, runs) << "frames are out of order";
}

nlohmann::json info(const std::filesystem::path& file) {
  const auto done = test::run({program("relievo"), "info", file, "--json"});
  EXPECT_EQ(done.status, 0) << done.err;
  return nlohmann::json::parse(done.out, nullptr, false);
}

TEST(RecordPlay, RestampedFramesAreOfNowAndAsFarApartAsTheyWere) {
  const test::TempFolder folder;
  const auto file = folder / "then.mcap";
  {
    test::Process server({program("test_publisher"), "face", kDomain, "20000", "60", "10000", "1"});
    const auto done = test::run(on_loopback({"record", "face", "--out", file, "--frames", "40"}));
    ASSERT_EQ(done.status, 0) << done.err;
  }
  std::map<std::uint64_t, std::pair<std::int64_t, std::string>> then, now;  // by sequence
  const auto keep = [](auto& into, const Bytes& cdr) {
    const auto frame = read_frame_cdr(cdr);
    if (frame) into[frame->sequence] = {frame->capture_time_ns, {frame->data.begin(), frame->data.end()}};
  };
  for (const Bytes& cdr : recorded_frames(file)) keep(then, cdr);
  const std::int64_t before_ns = utc_now_ns();
  {
    Subscriber::Callbacks callbacks;
    callbacks.raw = [&](const RawSample& sample) {
      if (sample.topic == Topic::kFrame) keep(now, sample.cdr);
    };
    const auto subscriber = Subscriber::create({kDomainNumber, "lo"}, "face", callbacks);
    ASSERT_TRUE(subscriber.ok());
    const auto done =
        test::run(on_loopback({"play", file, "--wait-readers", "1", "--restamp", "--speed", "2"}));
    ASSERT_EQ(done.status, 0) << done.err;
  }
  ASSERT_GT(now.size(), 1U);
  const auto& [first, first_now] = *now.begin();
  EXPECT_GT(first_now.first, before_ns);
  for (const auto& [sequence, frame] : now) {
    ASSERT_TRUE(then.contains(sequence));
    EXPECT_EQ(frame.second, then[sequence].second) << "the frame itself is as it was";
    const std::int64_t apart_ns = (then[sequence].first - then[first].first) / 2;
    EXPECT_NEAR(static_cast<double>(frame.first - first_now.first), static_cast<double>(apart_ns), 200);
  }
}

TEST(RecordPlay, KilledRecorderLeavesAFileThatPlaysByteForByte) {
  const test::TempFolder folder;
  const auto file = folder / "cut.mcap";
  {
    test::Process server({program("test_publisher"), "face", kDomain, "20000", "60", "100000", "1"});
    test::Process recorder(on_loopback({"record", "face", "--out", file}));
    ASSERT_TRUE(wait_for_size(file, 1'500'000)) << recorder.err();
    recorder.signal(SIGKILL);
    EXPECT_EQ(recorder.wait(), 128 + SIGKILL);
  }
  const auto description = info(file);
  EXPECT_EQ(description["recovered"], true);
  EXPECT_EQ(description["stream"], "face");
  EXPECT_EQ(description["info"]["pattern"]["stripes"], 7);
  const std::vector<Bytes> frames = recorded_frames(file);
  EXPECT_EQ(description["frames"], frames.size());
  EXPECT_EQ(description["lost"], arrived(frames).lost);
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
  int runs = 0;
  const auto all_came = [&] {
    std::set<std::string> different;
    for (const Bytes& cdr : played) different.insert(text_of(cdr));
    return different.size() == frames.size();
  };
  for (bool complete = false; !complete && runs < 20;) {
    test::Process player(on_loopback({"play", file, "--wait-readers", "1", "--speed", "2", "--json"}));
    ++runs;
    ASSERT_EQ(player.wait(), 0) << player.err();
    EXPECT_EQ(nlohmann::json::parse(player.out())["frames"], frames.size());
    std::unique_lock lock(mutex);
    complete = changed.wait_for(lock, 1s, all_came);
  }
  std::lock_guard lock(mutex);
  EXPECT_TRUE(all_came());
  expect_copies(played, frames, runs);
  ASSERT_FALSE(infos.empty());
  for (const StreamInfo& i : infos) EXPECT_EQ(i.stream, "face");
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
    EXPECT_EQ(recorder.wait(), 128 + SIGKILL);
    server.signal(SIGINT);
    EXPECT_EQ(server.wait(), 0) << server.err();
  }
  const auto description = info(cut);
  EXPECT_EQ(description["recovered"], true);
  EXPECT_EQ(description["stream"], "plane");
  const std::vector<Bytes> frames = recorded_frames(cut);
  ASSERT_GT(frames.size(), 5u);

  test::Process second(
      on_loopback({"record", "plane", "--out", again, "--frames", std::to_string(frames.size()), "--json"}));
  int runs = 0;
  while (!second.wait(1s) && runs < 20) {
    test::Process player(on_loopback({"play", cut, "--wait-readers", "1"}));
    ++runs;
    EXPECT_TRUE(test::eventually([&] { return player.wait(0ms) || second.wait(0ms); })) << player.err();
    player.signal(SIGINT);
    EXPECT_EQ(player.wait(), 0) << player.err();
  }
  EXPECT_EQ(second.wait(), 0) << second.err();
  const std::vector<Bytes> copies = recorded_frames(again);
  EXPECT_EQ(copies.size(), frames.size());
  expect_copies(copies, frames, runs);
}

TEST(RecordPlay, InterruptedRecorderCompletesItsFile) {
  const test::TempFolder folder;
  const auto file = folder / "whole.mcap";
  test::Process server({program("test_publisher"), "face", kDomain, "20000", "60", "100000", "1"});
  test::Process recorder(on_loopback({"record", "face", "--out", file, "--json"}));
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

TEST(RecordPlay, RecorderKeepsToItsLimitAndSurvivesARestartOfTheServer) {
  const test::TempFolder folder;
  const auto file = folder / "limit.mcap";
  test::Process recorder(on_loopback({"record", "face", "--out", file, "--frames", "60", "--json"}));
  {
    test::Process server({program("test_publisher"), "face", kDomain, "20000", "60", "40", "1"});
    ASSERT_TRUE(wait_for_size(file, 60'000)) << server.err() << recorder.err();
    ASSERT_TRUE(server.wait_for_text("done")) << server.err();
  }
  test::Process server({program("test_publisher"), "face", kDomain, "20000", "60", "100000", "1"});
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

TEST(RecordPlay, FullDiskEndsTheRecordingWithAReadableFile) {
  const test::TempFolder folder;
  const auto file = folder / "full.mcap";
  test::Process server({program("test_publisher"), "face", kDomain, "50000", "60", "100000", "1"});
  std::string command = "trap '' XFSZ; ulimit -f 3000; exec";  // 3,072,000 bytes
  for (const auto& argument : on_loopback({"record", "face", "--out", file}))
    command += " '" + argument + "'";
  const auto done = test::run({"/bin/bash", "-c", command});
  EXPECT_EQ(done.status, 1) << done.err;
  const int frames = info(file)["frames"];
  EXPECT_THAT(done.err,
              HasSubstr("error: recording stopped after " + std::to_string(frames) + " frames and missed "))
      << "those are in the file";
  EXPECT_THAT(done.err, HasSubstr(file.string()));
  EXPECT_GT(frames, 20);
}

TEST(RecordPlay, FramesAreDescribedAndExported) {
  const test::TempFolder folder;
  const auto file = folder / "real.mcap";
  {
    test::Process server({program("test_publisher"), "face", kDomain, "0", "60", "100000", "1"});
    const auto done = test::run(on_loopback({"record", "face", "--out", file, "--frames", "12"}));
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

  std::vector<std::string> numbers;  // of the camera's frames, which files are named after
  const std::vector<Bytes> frames = recorded_frames(file);
  ASSERT_EQ(frames.size(), 12u);
  for (int i = 2; i <= 4; ++i) {
    const std::string number = std::to_string(read_frame_cdr(frames[static_cast<std::size_t>(i)])->number);
    numbers.push_back(std::string(6 - number.size(), '0') + number);
  }
  const std::vector<std::pair<std::string, std::string>> magic = {
      {"ply", "ply\n"}, {"glb", "glTF"}, {"obj", ""}, {"png", "\x89PNG"}};
  for (const auto& [format, start] : magic) {
    const auto out = folder / format;
    const auto done = test::run(
        {program("relievo"), "export", file, "--out", out, "--format", format, "--frames", "2:4", "--json"});
    ASSERT_EQ(done.status, 0) << done.err;
    EXPECT_EQ(nlohmann::json::parse(done.out)["frames"], 3);
    for (const std::string& number : numbers) {
      std::ifstream exported(out / (number + "." + format), std::ios::binary);
      std::string head(start.size(), '\0');
      EXPECT_TRUE(exported.read(head.data(), static_cast<std::streamsize>(head.size()))) << format << number;
      EXPECT_EQ(head, start);
    }
  }
  const auto played = test::run(on_loopback({"play", file, "--frames", "2:4", "--speed", "10", "--json"}));
  ASSERT_EQ(played.status, 0) << played.err;
  EXPECT_EQ(nlohmann::json::parse(played.out)["frames"], 3);
  const auto later = test::run(on_loopback({"play", file, "--from", "2030-01-01T00:00:00Z"}));
  EXPECT_EQ(later.status, 1);
  EXPECT_THAT(later.err, HasSubstr("it holds 12 frames in"));
  const auto late = test::run({program("relievo"), "export", file, "--out", folder / "x", "--from", "99"});
  EXPECT_EQ(late.status, 1);
  EXPECT_THAT(late.err, HasSubstr("no frame in that range"));
}

// Damages the description among the recorded samples, and with it the chunk that holds it.
void damage_description(const std::filesystem::path& file) {
  std::ifstream in(file, std::ios::binary);
  std::string bytes{std::istreambuf_iterator<char>(in), {}};
  std::string description;
  {
    auto reader = RecordingReader::open(file);
    ASSERT_TRUE(reader.ok());
    for (const auto& attachment : (*reader)->summary().attachments)
      if (attachment.name == "stream_info.cdr") description = text_of(attachment.data);
  }
  ASSERT_FALSE(description.empty());
  for (auto at = bytes.find(description); at != std::string::npos; at = bytes.find(description, at + 1)) {
    std::string damaged = bytes;
    damaged[at + description.size() / 2] ^= 0x55;
    std::ofstream(file, std::ios::binary) << damaged;
    auto reader = RecordingReader::open(file);
    ASSERT_TRUE(reader.ok());
    if ((*reader)->summary().damage.empty()) return;  // not the attachment, which is the other place
  }
  FAIL() << "no description among the samples";
}

TEST(RecordPlay, DescriptionSurvivesADamagedFirstChunk) {
  const test::TempFolder folder;
  const auto file = folder / "damaged.mcap";
  {
    test::Process server({program("test_publisher"), "face", kDomain, "20000", "60", "100000", "1"});
    test::Process recorder(on_loopback({"record", "face", "--out", file}));
    ASSERT_TRUE(wait_for_size(file, 2'000'000)) << recorder.err();
    recorder.signal(SIGINT);
    ASSERT_EQ(recorder.wait(), 0) << recorder.err();
  }
  damage_description(file);
  const auto description = info(file);
  EXPECT_EQ(description["damaged_parts"], 1);
  EXPECT_EQ(description["info"]["pattern"]["stripes"], 7);
  EXPECT_GT(description["frames"], 0);

  std::promise<StreamInfo> told;
  std::once_flag once;
  Subscriber::Callbacks callbacks;
  callbacks.info = [&](const StreamInfo& i) { std::call_once(once, [&] { told.set_value(i); }); };
  const auto subscriber = Subscriber::create({kDomainNumber, "lo"}, "face", callbacks);
  ASSERT_TRUE(subscriber.ok());
  test::Process player(on_loopback({"play", file, "--loop"}));
  auto played = told.get_future();
  ASSERT_EQ(played.wait_for(test::kPatience), std::future_status::ready) << player.err();
  EXPECT_EQ(played.get().pattern.stripes(), 7);
  player.signal(SIGINT);
  EXPECT_EQ(player.wait(), 0) << player.err();

  test::Process web({program("relievo"), "web", file, "--listen", "127.0.0.1:0"});
  ASSERT_TRUE(web.wait_for_text("viewer http://127.0.0.1:")) << web.err();
  const std::string out = web.out();
  const auto port = static_cast<std::uint16_t>(std::stoi(out.substr(out.rfind(':') + 1)));
  EXPECT_THAT(test::request(port, "GET", "/api/streams").body, HasSubstr("\"stripes\":7"));
}

TEST(RecordPlay, WebServesARecordingInALoop) {
  const test::TempFolder folder;
  const auto file = folder / "loop.mcap";
  {
    test::Process server({program("test_publisher"), "face", kDomain, "3000", "60", "100000", "1"});
    const auto done = test::run(on_loopback({"record", "face", "--out", file, "--frames", "20"}));
    ASSERT_EQ(done.status, 0) << done.err;
  }
  test::Process web({program("relievo"), "web", file, "--listen", "127.0.0.1:0"});
  ASSERT_TRUE(web.wait_for_text("viewer http://127.0.0.1:")) << web.err();
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
      test::run({program("relievo"), "web", file, "--listen", "127.0.0.1:" + std::to_string(port)});
  EXPECT_EQ(taken.status, 1);
  EXPECT_THAT(taken.err, HasSubstr(std::to_string(port)));
  web.signal(SIGTERM);
  EXPECT_EQ(web.wait(), 0) << web.err();
}

TEST(RecordPlay, ARecordingIsCodedAnew) {
  const test::TempFolder folder;
  const std::string original = folder / "fine.mcap";
  const auto served = test::run(
      {program("relievo-server"), "serve", "--source", "sim:plane,width=160,height=120,stripes=30", "--web",
       "none", "--domain", kDomain, "--interface", "lo", "--fast", "--frames", "12", "--record", original});
  ASSERT_EQ(served.status, 0) << served.err;
  const auto frames = info(original)["frames"].get<int>();
  ASSERT_GT(frames, 8);
  const auto convert = [&](const std::string& from, const std::string& to, std::vector<std::string> more) {
    more.insert(more.begin(), {program("relievo"), "convert", from, "--out", folder / to, "--json"});
    return test::run(more);
  };
  const auto coarse =
      convert(original, "coarse.mcap", {"--step-bits", "2", "--key-interval", "4", "--from", "0"});
  ASSERT_EQ(coarse.status, 0) << coarse.err;
  const auto result = nlohmann::json::parse(coarse.out);
  EXPECT_EQ(result["frames"], frames);
  EXPECT_LT(result["bytes_after"], result["bytes_before"]);
  EXPECT_EQ(info(folder / "coarse.mcap")["geometry_codecs"], nlohmann::json({"grid"}));
  EXPECT_EQ(info(folder / "coarse.mcap")["mean_vertices"], info(original)["mean_vertices"]);
  const auto exported = test::run({program("relievo"), "export", folder / "coarse.mcap", "--out",
                                   folder / "ply", "--frames", "6:7", "--json"});
  ASSERT_EQ(exported.status, 0) << exported.err;
  EXPECT_EQ(nlohmann::json::parse(exported.out)["frames"], 2);

  const auto in_draco = convert(original, "draco.mcap", {"--geometry", "draco-grid", "--step-bits", "4"});
  ASSERT_EQ(in_draco.status, 0) << in_draco.err;
  EXPECT_EQ(info(folder / "draco.mcap")["geometry_codecs"], nlohmann::json({"draco-grid"}));
  EXPECT_EQ(info(folder / "draco.mcap")["mean_vertices"], info(original)["mean_vertices"]);
  const auto grid = convert(folder / "draco.mcap", "grid.mcap", {"--geometry", "grid", "--step-bits", "4"});
  EXPECT_EQ(grid.status, 0) << "it has the places: " << grid.err;

  // Textures stay what they are, unless another codec is wanted.
  EXPECT_EQ(info(folder / "coarse.mcap")["texture_codecs"], nlohmann::json({"jpeg"}));
  const auto lossless = convert(original, "png.mcap", {"--texture", "png"});
  ASSERT_EQ(lossless.status, 0) << lossless.err;
  EXPECT_EQ(info(folder / "png.mcap")["texture_codecs"], nlohmann::json({"png"}));
  const auto again = convert(folder / "png.mcap", "bound.mcap", {"--geometry", "visual", "--bound", "2"});
  ASSERT_EQ(again.status, 0) << again.err;
  EXPECT_EQ(info(folder / "bound.mcap")["texture_codecs"], nlohmann::json({"png"}));
  const auto exact = convert(folder / "png.mcap", "exact.mcap", {"--geometry", "visual", "--bound", "0.1"});
  ASSERT_EQ(exact.status, 0) << exact.err;
  const auto geometry_bytes = [&](const char* file) {
    return info(folder / file)["bytes"]["geometry"].get<int>();
  };
  EXPECT_LT(geometry_bytes("bound.mcap"), 0.8 * geometry_bytes("exact.mcap"));
  const auto unknown = convert(original, "gif.mcap", {"--texture", "gif"});
  EXPECT_EQ(unknown.status, 2);
  EXPECT_THAT(unknown.err, HasSubstr("give jpeg, webp, png or h264"));

  const auto mesh = convert(original, "mesh.mcap", {"--geometry", "draco-mesh"});
  ASSERT_EQ(mesh.status, 0) << mesh.err;
  EXPECT_EQ(info(folder / "mesh.mcap")["geometry_codecs"], nlohmann::json({"draco-mesh"}));
  const auto back = convert(folder / "mesh.mcap", "back.mcap", {"--geometry", "grid"});
  EXPECT_EQ(back.status, 1);
  EXPECT_THAT(back.err, HasSubstr("can only be coded as draco-mesh"));
  EXPECT_FALSE(std::filesystem::exists(folder / "back.mcap"));
}

/// From the live stream, and from a recording of it.
TEST(RecordPlay, ChannelsForGenericViewersAreWhatTheirSchemasSay) {
  const std::filesystem::path js = RELIEVO_MCAP_JS;
  if (!std::filesystem::exists(js / "node_modules/@foxglove/schemas")) {
    GTEST_SKIP() << "npm packages are missing: run npm ci --prefix tests/e2e/mcap_js";
  }
  const test::TempFolder folder;
  {
    test::Process server({program("test_publisher"), "face", kDomain, "0", "60", "100000", "1"});
    const auto done = test::run(
        on_loopback({"record", "face", "--out", folder / "live.mcap", "--frames", "9", "--foxglove"}));
    ASSERT_EQ(done.status, 0) << done.err;
  }
  const auto done = test::run({program("relievo"), "convert", folder / "live.mcap", "--out",
                               folder / "part.mcap", "--frames", "3:6", "--foxglove", "--json"});
  ASSERT_EQ(done.status, 0) << done.err;
  EXPECT_EQ(nlohmann::json::parse(done.out)["frames"], 4);
  const auto live = recorded_frames(folder / "live.mcap");
  const auto part = recorded_frames(folder / "part.mcap");
  ASSERT_EQ(live.size(), 9u);
  EXPECT_EQ(part, (std::vector<Bytes>{live.begin() + 3, live.begin() + 7})) << "as they were";
  for (const auto& [file, count] : {std::pair{"live.mcap", 9}, std::pair{"part.mcap", 4}}) {
    const auto checked =
        test::run({"/usr/bin/env", "node", js / "check_foxglove.mjs", folder / file, folder.path().string()});
    ASSERT_EQ(checked.status, 0) << checked.err;
    const auto counts = nlohmann::json::parse(checked.out);
    EXPECT_EQ(counts["foxglove::CompressedImage"], count);
    EXPECT_EQ(counts["foxglove::SceneUpdate"], count);
    const auto glb = test::run({"/usr/bin/env", "node", js / "validate_glb.mjs", folder / "last.glb"});
    EXPECT_EQ(glb.status, 0) << glb.err;
    const auto whole = test::run({"/usr/bin/env", "node", js / "validate.mjs", folder / file});
    EXPECT_EQ(whole.status, 0) << whole.err;
  }
}

TEST(RecordPlay, OtherMcapReadersDecodeEverySample) {
  const std::filesystem::path js = RELIEVO_MCAP_JS;
  if (!std::filesystem::exists(js / "node_modules/@mcap/core")) {
    GTEST_SKIP() << "npm packages are missing: run npm ci --prefix tests/e2e/mcap_js";
  }
  const test::TempFolder folder;
  const auto file = folder / "a.mcap";
  {
    test::Process server({program("test_publisher"), "face", kDomain, "3000", "60", "100000", "1"});
    const auto done = test::run(on_loopback({"record", "face", "--out", file, "--frames", "20"}));
    ASSERT_EQ(done.status, 0) << done.err;
  }
  const auto done = test::run({"/usr/bin/env", "node", js / "validate.mjs", file});
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
