// SPDX-License-Identifier: Apache-2.0
// Proves, with the real server: clients of different qualities are served together, the full one loses
// nothing, the reduced one sees the same surface in fewer bytes; a client that is slow goes down and comes
// back; a gateway elsewhere relays the quality that its browsers ask for; and who decodes no H.264 is sent
// JPEG textures beside those who do, also by that gateway.
#include <cmath>
#include <condition_variable>
#include <map>
#include <mutex>

#include "client/live_reader.h"
#include "codec/frame3d_codec.h"
#include "tests/e2e/server/web_server.h"

namespace relievo::test {
namespace {

using Place = std::pair<int, int>;  // line of the full grid, and boundary

/// What a reader decoded: positions by place, of each frame.
class Watcher {
 public:
  explicit Watcher(std::optional<Rung> quality) {
    auto made =
        LiveReader::create({.domain = {own_domain(), "lo"},
                            .stream = "take",
                            .quality = quality,
                            .choice = {.calm_ns = kNanosecondsPerSecond},
                            .frame = [this](const Frame3D& f, const FrameMessage& m) { take(f, m); }});
    EXPECT_TRUE(made);
    if (made) reader_ = *std::move(made);
  }
  LiveReader& reader() { return *reader_; }
  LiveReader::Report report() const { return reader_->report(); }
  /// What each full frame takes from now on, besides decoding.
  void set_work(std::chrono::milliseconds time) { work_ms_ = static_cast<int>(time.count()); }

  struct Seen {
    std::map<Place, Vec3f> points;
    std::size_t bytes = 0;
    int texture_width = 0;
  };
  std::map<std::uint64_t, Seen> seen() const {
    const std::lock_guard lock(mutex_);
    return seen_;
  }

 private:
  void take(const Frame3D& frame, const FrameMessage& message) {
    Seen seen{.bytes = message.data->size(), .texture_width = frame.texture.width()};
    const int stride = message.rung == Rung::kReduced ? 2 : 1;
    for (std::size_t v = 0; v < frame.surface.grid.size(); ++v)
      seen.points[{frame.surface.grid[v].line * stride, frame.surface.grid[v].boundary}] =
          frame.surface.positions[v];
    {
      const std::lock_guard lock(mutex_);
      seen_[message.number] = std::move(seen);
    }
    if (message.rung == Rung::kFull && work_ms_ > 0)
      std::this_thread::sleep_for(std::chrono::milliseconds(work_ms_));  // as a slow renderer would
  }

  mutable std::mutex mutex_;
  std::map<std::uint64_t, Seen> seen_;
  std::atomic<int> work_ms_{0};
  std::unique_ptr<LiveReader> reader_;
};

/// A small take at 10 frames a second, in a loop.
class LadderTest : public ::testing::Test {
 protected:
  void SetUp() override {
    StripedScene scene = striped_scene();
    scene.rig.frame_rate = 10;
    ASSERT_TRUE(write_striped_take(scene, folder_ / "take", 12));
  }
  std::vector<std::string> command(const std::vector<std::string>& more = {}) const {
    std::vector<std::string> flags{"--loop", "--stream", "take", "--web", "127.0.0.1:0"};
    flags.insert(flags.end(), more.begin(), more.end());
    return serve("take:" + (folder_ / "take").string(), flags);
  }
  static int readers(const WebServer& server, const std::string& quality) {
    const auto stream = server.stream("take");
    if (!stream.is_object() || !stream["status"].is_object()) return -1;
    for (const auto& rung : stream["status"]["rungs"])
      if (rung["quality"] == quality) return rung["readers"];
    return -1;
  }
  const TempFolder folder_;
};

TEST_F(LadderTest, FullReducedAndTextureTogether) {
  WebServer server(command());
  ASSERT_NE(server.port(), 0);
  Watcher full(Rung::kFull), reduced(Rung::kReduced), texture(Rung::kTexture);
  std::map<std::uint64_t, Watcher::Seen> a, b;
  const auto common = [&] {
    std::vector<std::uint64_t> numbers;
    a = full.seen();
    b = reduced.seen();
    for (const auto& [number, seen] : b)
      if (a.contains(number) && !seen.points.empty()) numbers.push_back(number);
    return numbers;
  };
  ASSERT_TRUE(eventually([&] { return common().size() >= 5 && texture.seen().size() >= 5; }));
  EXPECT_TRUE(eventually([&] { return readers(server, "reduced") == 1 && readers(server, "texture") == 1; }));
  EXPECT_EQ(full.report().lost, 0U);
  EXPECT_EQ(full.report().skipped, 0U);
  EXPECT_EQ(reduced.report().skipped, 0U);
  for (const std::uint64_t number : common()) {
    const auto& whole = a.at(number);
    const auto& half = b.at(number);
    EXPECT_LT(half.bytes, whole.bytes);
    EXPECT_EQ(half.texture_width * 2, whole.texture_width);
    EXPECT_GT(half.points.size(), whole.points.size() / 3);
    for (const auto& [place, point] : half.points) {
      const auto there = whole.points.find(place);
      ASSERT_NE(there, whole.points.end()) << "line " << place.first << ", boundary " << place.second;
      // Steps of a sixteenth of a pixel instead of a 64th, at 640 pixels across.
      EXPECT_NEAR(point[2], there->second[2], 2e-3F * there->second[2]);
    }
  }
  for (const auto& [number, seen] : texture.seen()) {
    EXPECT_TRUE(seen.points.empty());
    EXPECT_GT(seen.texture_width, 0);
  }
}

TEST_F(LadderTest, ARungThatNobodyReadsStandsStill) {
  WebServer server(command());
  ASSERT_NE(server.port(), 0);
  const auto frames = [&] { return server.stream("take")["status"]["rungs"][0]["frames"].get<int>(); };
  ASSERT_TRUE(eventually([&] { return readers(server, "reduced") == 0; }));
  ASSERT_TRUE(server.goes_on("take", 10));
  EXPECT_EQ(frames(), 0);
  {
    Watcher reduced(Rung::kReduced);
    ASSERT_TRUE(eventually([&] { return reduced.report().frames >= 3 && frames() >= 3; }));
  }
  ASSERT_TRUE(eventually([&] { return readers(server, "reduced") == 0; }));
  const int then = frames();
  ASSERT_TRUE(server.goes_on("take", 15));
  EXPECT_LE(frames(), then + 2) << "but for one that was under way when this was said";
}

TEST_F(LadderTest, ASlowClientGoesDownAndComesBack) {
  WebServer server(command());
  ASSERT_NE(server.port(), 0);
  Watcher slow(std::nullopt), beside(Rung::kFull);
  ASSERT_TRUE(eventually([&] { return slow.report().frames >= 3 && !slow.report().rungs.empty(); }));
  slow.set_work(1s);  // longer than between frames of a server that falls short of its 10 a second, too
  EXPECT_TRUE(eventually([&] { return slow.report().rung != Rung::kFull; }));
  slow.set_work(0ms);
  EXPECT_TRUE(eventually([&] { return slow.report().rung == Rung::kFull; }));
  EXPECT_GE(slow.report().moves, 2U);
  EXPECT_EQ(beside.report().lost, 0U);
  slow.reader().compare_clocks();
  EXPECT_TRUE(eventually([&] {
    slow.reader().compare_clocks();
    return slow.report().clock.has_value();
  }));
}

TEST_F(LadderTest, AGatewayElsewhereRelaysWhatItsBrowsersAskFor) {
  WebServer server(command());
  ASSERT_NE(server.port(), 0);
  WebServer gateway({program("relievo").string(), "web", "--domain", std::to_string(own_domain()),
                     "--interface", "lo", "--listen", "127.0.0.1:0"});
  ASSERT_NE(gateway.port(), 0);
  ASSERT_TRUE(eventually([&] { return gateway.stream("take").is_object(); }));
  WsClient client(gateway.port(), "take");
  ASSERT_TRUE(client.send(R"({"type":"quality","want":"reduced"})"));
  ASSERT_TRUE(eventually([&] { return readers(server, "reduced") == 1; }));
  EXPECT_TRUE(eventually([&] {
    client.credit(1);
    const auto frame = client.next_of("frame");
    if (!frame) return false;
    const auto* bytes = reinterpret_cast<const std::uint8_t*>(frame->data.data()) + 48;
    const auto decoded = decode_frame({bytes, frame->data.size() - 48});
    return decoded && decoded->texture.width() == striped_scene().rig.camera.width / 2;
  }));
  EXPECT_TRUE(eventually([&] {  // asked for once a second
    return request(gateway.port(), "GET", "/metrics").body.find("clock_offset_seconds{stream=\"take\"}") !=
           std::string::npos;
  }));
}

/// The next frame's header; of no vertices and no texture where none came.
FrameHeader next_header(WsClient& client) {
  client.credit(1);
  const auto frame = client.next_of("frame");
  if (!frame) return {};
  const auto* bytes = reinterpret_cast<const std::uint8_t*>(frame->data.data()) + 48;
  const auto header = read_frame_header({bytes, frame->data.size() - 48});
  return header ? *header : FrameHeader{};
}

TEST_F(LadderTest, WhoDecodesNoVideoIsSentJpegTextures) {
  WebServer server(command({"--texture", "h264"}));
  if (server.port() == 0 && server.process().err().find("this build has no H.264") != std::string::npos)
    GTEST_SKIP() << "this build has no H.264";
  ASSERT_NE(server.port(), 0);
  WebServer elsewhere({program("relievo").string(), "web", "--domain", std::to_string(own_domain()),
                       "--interface", "lo", "--listen", "127.0.0.1:0"});
  ASSERT_NE(elsewhere.port(), 0);
  ASSERT_TRUE(eventually([&] { return elsewhere.stream("take").is_object(); }));
  const auto made = [&](const std::string& quality) {
    const auto stream = server.stream("take");
    for (const auto& rung : stream["status"]["rungs"])
      if (rung["quality"] == quality) return rung["frames"].get<int>();
    return -1;
  };
  WsClient with(server.port(), "take");
  ASSERT_TRUE(eventually([&] { return next_header(with).texture == TextureCodec::kH264; }));
  EXPECT_EQ(made("full-jpeg"), 0) << "nobody wants it";
  const auto width = static_cast<std::uint32_t>(striped_scene().rig.camera.width);
  for (const std::uint16_t port : {server.port(), elsewhere.port()}) {
    WsClient without(port, "take");
    for (const auto& [want, across] : {std::pair("full", width), std::pair("reduced", width / 2)}) {
      const std::string jpeg = std::string(want) + "-jpeg";
      ASSERT_TRUE(without.send(R"({"type":"quality","want":")" + std::string(want) +
                               R"(","textures":["jpeg","webp","png"]})"));
      ASSERT_TRUE(eventually([&, expected = across] {
        const FrameHeader header = next_header(without);
        return header.texture == TextureCodec::kJpeg && header.vertices > 0 &&
               header.texture_width == expected;
      })) << want;
      for (int i = 0; i < 3; ++i) EXPECT_EQ(next_header(without).texture, TextureCodec::kJpeg) << want;
      EXPECT_EQ(next_header(with).texture, TextureCodec::kH264) << "the other client's stays";
      EXPECT_TRUE(eventually([&] { return made(jpeg) > 0; })) << jpeg;  // its status is a second old at most
    }
  }
  ASSERT_TRUE(
      eventually([&] { return readers(server, "full-jpeg") == 0 && readers(server, "reduced-jpeg") == 0; }));
  const int then = made("reduced-jpeg");
  ASSERT_TRUE(server.goes_on("take", 15));
  EXPECT_LE(made("reduced-jpeg"), then + 2) << "made on where nobody wants it";
}

TEST_F(LadderTest, OneThatIsSwitchedOffIsMissedByItsReader) {
  WebServer server(command({"--ladder", "texture"}));
  ASSERT_NE(server.port(), 0);
  ASSERT_TRUE(server.goes_on("take", 1));
  const Finished stats =
      run({program("relievo").string(), "stats", "take", "--domain", std::to_string(own_domain()),
           "--interface", "lo", "--quality", "reduced", "--seconds", "3", "--json"});
  EXPECT_EQ(stats.status, 1);
  EXPECT_NE(stats.err.find("has no quality reduced"), std::string::npos) << stats.err;
}

}  // namespace
}  // namespace relievo::test
