// SPDX-License-Identifier: Apache-2.0
// Recordings, also of killed recorders and damaged ones, played by `relievo play` and `web`: every process
// real, the network the loopback.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <signal.h>

#include <condition_variable>
#include <fstream>
#include <future>
#include <map>
#include <mutex>
#include <set>

#include "base/time.h"
#include "idl/transport.h"

#include "tests/e2e/record_play.h"
#include "tests/support/patience.h"
#include "tests/support/socket_client.h"
#include "tests/support/temp_folder.h"

namespace relievo::test {
namespace {

using testing::HasSubstr;

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

TEST(Play, RestampedFramesAreOfNowAndAsFarApartAsTheyWere) {
  const TempFolder folder;
  const auto file = folder / "then.mcap";
  ASSERT_NO_FATAL_FAILURE(record_face(file, 20000, 40));
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
    const auto subscriber = Subscriber::create({own_domain(), "lo"}, "face", callbacks);
    ASSERT_TRUE(subscriber.ok());
    const auto done = run(on_loopback({"play", file, "--wait-readers", "1", "--restamp", "--speed", "2"}));
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

TEST(Play, KilledRecorderLeavesAFileThatPlaysByteForByte) {
  const TempFolder folder;
  const auto file = folder / "cut.mcap";
  {
    Process server(publish_face(20000));
    Process recorder(on_loopback({"record", "face", "--out", file}));
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
  const auto subscriber = Subscriber::create({own_domain(), "lo"}, "face", callbacks);
  ASSERT_TRUE(subscriber.ok());
  int runs = 0;
  const auto all_came = [&] {
    std::set<std::string> different;
    for (const Bytes& cdr : played) different.insert(text_of(cdr));
    return different.size() == frames.size();
  };
  for (bool complete = false; !complete && runs < 20;) {
    Process player(on_loopback({"play", file, "--wait-readers", "1", "--speed", "2", "--json"}));
    ++runs;
    ASSERT_EQ(player.wait(), 0) << player.err();
    EXPECT_EQ(nlohmann::json::parse(player.out())["frames"], frames.size());
    EXPECT_THAT(player.err(), HasSubstr("was cut short or damaged: this is of what is whole in it"));
    std::unique_lock lock(mutex);
    complete = changed.wait_for(lock, 1s, all_came);
  }
  std::lock_guard lock(mutex);
  EXPECT_TRUE(all_came());
  expect_copies(played, frames, runs);
  ASSERT_FALSE(infos.empty());
  for (const StreamInfo& i : infos) EXPECT_EQ(i.stream, "face");
}

TEST(Play, FollowsAFileThatIsBeingWrittenUntilItIsFinished) {
  const TempFolder folder;
  const auto whole = folder / "whole.mcap";
  const auto growing = folder / "growing.mcap";
  ASSERT_NO_FATAL_FAILURE(record_face(whole, 20000, 200));
  const std::size_t frames = recorded_frames(whole).size();
  std::ifstream in(whole, std::ios::binary);
  const std::string bytes{std::istreambuf_iterator<char>(in), {}};
  const auto write_to = [&](std::size_t size) {
    std::ofstream(growing, std::ios::binary | std::ios::app)
        << bytes.substr(std::filesystem::file_size(growing), size - std::filesystem::file_size(growing));
  };
  std::ofstream(growing, std::ios::binary) << bytes.substr(0, bytes.size() / 3);
  const auto cut = run(on_loopback({"play", growing, "--wait-readers", "0", "--speed", "20", "--json"}));
  ASSERT_EQ(cut.status, 0) << cut.err;
  EXPECT_LT(nlohmann::json::parse(cut.out)["frames"], frames);

  Process player(
      on_loopback({"play", growing, "--wait-readers", "0", "--speed", "20", "--json", "--follow"}));
  EXPECT_FALSE(player.wait(1s)) << "it ended where the file ends for now";
  for (std::size_t part = 4; part <= 10; ++part) {
    write_to(bytes.size() * part / 10);
    EXPECT_FALSE(part < 10 && player.wait(100ms)) << part;
  }
  ASSERT_EQ(player.wait(), 0) << player.err();
  EXPECT_EQ(nlohmann::json::parse(player.out())["frames"], frames) << "each once";
  EXPECT_EQ(nlohmann::json::parse(player.out())["damaged"], 0);
}

TEST(Play, ServerToKilledRecorderToPlayerToSecondRecorder) {
  const TempFolder folder;
  const auto cut = folder / "cut.mcap";
  const auto again = folder / "again.mcap";
  {
    Process server({program("relievo-server"), "serve", "--source", "sim:plane,period=8,noise=2", "--web",
                    "none", "--domain", kDomain, "--interface", "lo"});
    Process recorder(on_loopback({"record", "plane", "--out", cut}));
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

  Process second(
      on_loopback({"record", "plane", "--out", again, "--frames", std::to_string(frames.size()), "--json"}));
  int runs = 0;
  while (!second.wait(1s) && runs < 20) {
    Process player(on_loopback({"play", cut, "--wait-readers", "1"}));
    ++runs;
    EXPECT_TRUE(eventually([&] { return player.wait(0ms) || second.wait(0ms); })) << player.err();
    player.signal(SIGINT);
    EXPECT_EQ(player.wait(), 0) << player.err();
  }
  EXPECT_EQ(second.wait(), 0) << second.err();
  const std::vector<Bytes> copies = recorded_frames(again);
  EXPECT_EQ(copies.size(), frames.size());
  expect_copies(copies, frames, runs);
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

TEST(Play, DescriptionSurvivesADamagedFirstChunk) {
  const TempFolder folder;
  const auto file = folder / "damaged.mcap";
  {
    Process server(publish_face(20000));
    Process recorder(on_loopback({"record", "face", "--out", file}));
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
  const auto subscriber = Subscriber::create({own_domain(), "lo"}, "face", callbacks);
  ASSERT_TRUE(subscriber.ok());
  Process player(on_loopback({"play", file, "--loop"}));
  auto played = told.get_future();
  ASSERT_EQ(played.wait_for(kPatience), std::future_status::ready) << player.err();
  EXPECT_EQ(played.get().pattern.stripes(), 7);
  player.signal(SIGINT);
  EXPECT_EQ(player.wait(), 0) << player.err();

  Process web({program("relievo"), "web", file, "--listen", "127.0.0.1:0"});
  const std::uint16_t port = viewer_port(web);
  ASSERT_NE(port, 0) << web.err();
  EXPECT_THAT(request(port, "GET", "/api/streams").body, HasSubstr("\"stripes\":7"));
}

TEST(Play, QualitiesThatWereThereAtTheTimeAreNotOffered) {
  const TempFolder folder;
  const auto file = folder / "face.mcap";
  const auto served =
      run({program("relievo-server"), "serve", "--source",
           "sim:plane,width=160,height=120,stripes=30,rate=20", "--stream", "face", "--web", "none",
           "--domain", kDomain, "--interface", "lo", "--frames", "50", "--record", file});
  ASSERT_EQ(served.status, 0) << served.err;
  {
    Process web({program("relievo"), "web", file, "--listen", "127.0.0.1:0"});
    const std::uint16_t port = viewer_port(web);
    ASSERT_NE(port, 0) << web.err();
    WsClient client(port, "face");
    const auto status = client.next_of("status");
    ASSERT_TRUE(status);
    EXPECT_EQ(nlohmann::json::parse(status->data)["rungs"], nlohmann::json::array()) << status->data;
  }
  std::promise<ServerStatus> told;
  std::once_flag once;
  Subscriber::Callbacks callbacks;
  callbacks.status = [&](const ServerStatus& s) {
    if (s.frames_published > 0) std::call_once(once, [&] { told.set_value(s); });
  };
  const auto subscriber = Subscriber::create({own_domain(), "lo"}, "face", callbacks);
  ASSERT_TRUE(subscriber.ok());
  Process player(on_loopback({"play", file, "--loop"}));
  auto played = told.get_future();
  ASSERT_EQ(played.wait_for(kPatience), std::future_status::ready) << player.err();
  EXPECT_TRUE(played.get().rungs.empty());
}

TEST(Play, WebServesARecordingInALoop) {
  const TempFolder folder;
  const auto file = folder / "loop.mcap";
  ASSERT_NO_FATAL_FAILURE(record_face(file, 3000, 20));
  Process web({program("relievo"), "web", file, "--listen", "127.0.0.1:0"});
  const std::uint16_t port = viewer_port(web);
  ASSERT_NE(port, 0) << web.err();
  const auto streams = request(port, "GET", "/api/streams");
  EXPECT_EQ(streams.status, 200);
  EXPECT_THAT(streams.body, HasSubstr("\"face\""));
  WsClient client(port, "face");
  ASSERT_EQ(client.status(), 101);
  for (int i = 0; i < 30; ++i) {  // more frames than the file has
    ASSERT_TRUE(client.credit(1));
    ASSERT_TRUE(client.next_of("frame")) << "frame " << i;
  }
  const auto taken = run({program("relievo"), "web", file, "--listen", "127.0.0.1:" + std::to_string(port)});
  EXPECT_EQ(taken.status, 1);
  EXPECT_THAT(taken.err, HasSubstr(std::to_string(port)));
  web.signal(SIGTERM);
  EXPECT_EQ(web.wait(), 0) << web.err();
}

}  // namespace
}  // namespace relievo::test
