// SPDX-License-Identifier: Apache-2.0
// Proves: recordings are started, stopped, listed and read over HTTP by those who may, and by nobody else.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>

#include "tests/support/temp_folder.h"
#include "tests/unit/web/gateway_fixture.h"

namespace relievo::test {
namespace {

using Json = nlohmann::json;
using testing::HasSubstr;

constexpr const char* kFace = "/api/recording/face";
constexpr const char* kStart = R"({"action":"start"})";
constexpr const char* kStop = R"({"action":"stop"})";

/// Who records: writes a file at once, and a stream that is called face is all there is.
class OneStream final : public RecordingControl {
 public:
  explicit OneStream(std::filesystem::path folder) : folder_(std::move(folder)) {}

  std::optional<RecordingState> state(const std::string& stream) const override {
    return stream == "face" ? std::optional(state_) : std::nullopt;
  }
  Status start(const std::string&) override {
    if (state_.activity == RecordingActivity::kRecording) return Error{"is recorded already"};
    state_ = {.activity = RecordingActivity::kRecording,
              .file = "face-1.mcap",
              .frames = 3,
              .bytes = 7,
              .room_bytes = 11};
    std::ofstream(folder_ / state_.file) << "content";
    return {};
  }
  Status stop(const std::string&) override {
    if (state_.activity != RecordingActivity::kRecording) return Error{"is not recorded"};
    state_.activity = RecordingActivity::kOff;
    return {};
  }
  std::filesystem::path folder() const override { return folder_; }
  bool is_open(const std::string& file) const override {
    return state_.activity == RecordingActivity::kRecording && state_.file == file;
  }

 private:
  const std::filesystem::path folder_;
  RecordingState state_;  // of the gateway's thread
};

class RecordingApi : public GatewayTest {
 protected:
  void SetUp() override { start({.port = 0, .recordings = &control}); }
  void TearDown() override { gateway.reset(); }
  std::vector<std::string> listed() const {
    std::vector<std::string> out;
    const Json answer = Json::parse(request(port, "GET", "/api/recordings").body);
    for (const auto& one : answer["recordings"]) out.push_back(one["file"]);
    return out;
  }

  TempFolder folder;
  OneStream control{folder.path()};
};

TEST_F(RecordingApi, StartsStopsAndSaysWhatThereIs) {
  Json state = Json::parse(request(port, "GET", kFace).body);
  EXPECT_EQ(state["state"], "off");
  EXPECT_EQ(state["file"], "");
  EXPECT_EQ(post_json(port, kFace, kStop).status, 409);
  const auto started = post_json(port, kFace, kStart);
  EXPECT_EQ(started.status, 200) << started.body;
  EXPECT_EQ(started.headers.at("content-type"), "application/json");
  EXPECT_EQ(Json::parse(started.body)["state"], "recording");
  EXPECT_EQ(post_json(port, kFace, kStart).status, 409);
  state = Json::parse(request(port, "GET", kFace).body);
  EXPECT_EQ(state["frames"], 3);
  EXPECT_EQ(state["file"], "face-1.mcap");
  EXPECT_TRUE(listed().empty()) << "it is being written";
  EXPECT_EQ(request(port, "GET", "/recordings/face-1.mcap").status, 404);
  EXPECT_EQ(Json::parse(post_json(port, kFace, kStop).body)["state"], "off");
  EXPECT_EQ(listed(), std::vector<std::string>{"face-1.mcap"});
  EXPECT_EQ(request(port, "GET", "/recordings/face-1.mcap").body, "content");
  const auto part = request(port, "GET", "/recordings/face-1.mcap", "Range: bytes=1-3\r\n");
  EXPECT_EQ(part.status, 206);
  EXPECT_EQ(part.body, "ont");
}

TEST_F(RecordingApi, RefusesWhatItMust) {
  EXPECT_EQ(post_json(port, "/api/recording/other", kStart).status, 404);
  EXPECT_EQ(request(port, "GET", "/api/recording/other").status, 404);
  for (const char* body : {"", "start", "[]", "{}", R"({"action":"pause"})", R"({"action":1})"})
    EXPECT_EQ(post_json(port, kFace, body).status, 400) << body;
  EXPECT_EQ(post_json(port, kFace, std::string(5000, ' ')).status, 413);
  EXPECT_EQ(post_json(port, kFace, kStart, "Origin: https://evil.example\r\n").status, 403);
  EXPECT_EQ(metric(refused_for("origin")), 1);
  const std::string own = "Origin: http://127.0.0.1:" + std::to_string(port) + "\r\n";
  TcpClient client(port);
  const auto plain =
      request(client, port, "POST", kFace, "Content-Type: text/plain\r\nContent-Length: 0\r\n");
  EXPECT_EQ(plain.status, 415) << "a page of another site could send that unasked";
  for (const char* method : {"PUT", "DELETE", "PATCH"})
    EXPECT_EQ(request(port, method, kFace).headers.at("allow"), "GET, HEAD, POST");
  EXPECT_EQ(post_json(port, "/api/streams", kStart).status, 405);
  EXPECT_EQ(Json::parse(request(port, "GET", kFace).body)["state"], "off") << "none of it did anything";
  EXPECT_EQ(post_json(port, kFace, kStart, own).status, 200);
}

TEST_F(RecordingApi, WithTokensOnlyWhoHasOne) {
  const std::string token = "0123456789abcdef0123456789abcdef";
  std::ofstream(folder / "tokens") << token << "\n";
  start({.port = 0, .web = {.token_file = folder / "tokens"}, .recordings = &control});
  EXPECT_EQ(post_json(port, kFace, kStart).status, 401);
  EXPECT_EQ(request(port, "GET", kFace).status, 401);
  EXPECT_EQ(request(port, "GET", "/api/recordings").status, 401);
  EXPECT_EQ(post_json(port, kFace, kStart, "Authorization: Bearer " + token + "\r\n").status, 200);
  EXPECT_EQ(post_json(port, std::string(kFace) + "?token=" + token, kStop).status, 200);
}

TEST_F(RecordingApi, AListedSitesPageMayAfterAskingForIt) {
  start({.port = 0, .web = {.origins = {"https://a.example"}}, .recordings = &control});
  const std::string origin = "Origin: https://a.example\r\n";
  const auto asked = request(port, "OPTIONS", kFace, origin);
  EXPECT_THAT(asked.headers.at("access-control-allow-methods"), HasSubstr("POST"));
  EXPECT_THAT(asked.headers.at("access-control-allow-headers"), HasSubstr("Content-Type"));
  EXPECT_EQ(post_json(port, kFace, kStart, origin).status, 200);
}

TEST_F(RecordingApi, NoNameLeadsOutOfTheFolder) {
  const TempFolder elsewhere;
  std::ofstream(elsewhere / "secret.mcap") << "secret";
  std::ofstream(folder / ".hidden.mcap") << "secret";
  std::ofstream(folder / "secret.txt") << "secret";
  std::ofstream(folder / "a b.mcap") << "secret";
  std::filesystem::create_symlink(elsewhere / "secret.mcap", folder / "link.mcap");
  std::filesystem::create_directory(folder / "sub.mcap");
  const std::string up = "../" + elsewhere.path().filename().string() + "/secret.mcap";
  for (const std::string& name :
       {std::string(".hidden.mcap"), std::string("secret.txt"), std::string("a b.mcap"),
        std::string("a%20b.mcap"), std::string("link.mcap"), std::string("sub.mcap"), up}) {
    const auto response = request(port, "GET", "/recordings/" + name);
    EXPECT_NE(response.status, 200) << name;
    EXPECT_EQ(response.body.find("secret"), std::string::npos) << name;
  }
  EXPECT_TRUE(listed().empty());
}

TEST_F(RecordingApi, MetricsSayWhatItDoes) {
  gateway->announce(make_info());
  EXPECT_EQ(metric("relievo_recording_state{stream=\"face\",state=\"off\"}"), 1);
  ASSERT_EQ(post_json(port, kFace, kStart).status, 200);
  EXPECT_EQ(metric("relievo_recording_state{stream=\"face\",state=\"recording\"}"), 1);
  EXPECT_EQ(metric("relievo_recording_frames{stream=\"face\"}"), 3);
  EXPECT_EQ(metric("relievo_recording_bytes{stream=\"face\"}"), 7);
  EXPECT_EQ(metric("relievo_recording_room_bytes{stream=\"face\"}"), 11);
}

TEST_F(RecordingApi, WithoutAFolderItSaysHow) {
  start({.port = 0});
  for (const auto& response : {request(port, "GET", kFace), post_json(port, kFace, kStart),
                               request(port, "GET", "/api/recordings")}) {
    EXPECT_EQ(response.status, 404);
    EXPECT_THAT(response.body, HasSubstr("--record-dir DIR"));
  }
}

}  // namespace
}  // namespace relievo::test
