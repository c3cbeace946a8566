// SPDX-License-Identifier: Apache-2.0
// Proves: recordings are started, stopped, listed and read over HTTP by those who may, and by nobody else.
#include <gmock/gmock.h>

#include "tests/unit/web/recording_fixture.h"

namespace relievo::test {
namespace {

using testing::EndsWith;
using testing::HasSubstr;

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
  EXPECT_EQ(list()["recordings"][0]["recording"], true);
  EXPECT_EQ(Json::parse(post_json(port, kFace, kStop).body)["state"], "off");
  EXPECT_EQ(listed(), std::vector<std::string>{"face-1.mcap"});
  EXPECT_EQ(list()["recordings"][0]["recording"], false);
  const std::string content = content_of(folder / "face-1.mcap");
  EXPECT_EQ(get().body, content);
  const auto part = get("Range: bytes=1-3\r\n");
  EXPECT_EQ(part.status, 206);
  EXPECT_EQ(part.body, "MCA");
}

TEST_F(RecordingApi, AFileThatIsBeingWrittenIsReadUpToItsLastWholeChunk) {
  ASSERT_EQ(post_json(port, kFace, kStart).status, 200);
  const auto first = get();
  ASSERT_EQ(first.status, 200) << first.body;
  EXPECT_EQ(list()["recordings"][0]["bytes"], first.body.size());
  EXPECT_EQ(messages_in(first.body), 1u);
  const std::string etag = first.headers.at("etag");
  EXPECT_EQ(get("If-None-Match: " + etag + "\r\n").status, 304) << "nothing more came";

  ASSERT_TRUE(control.grow());
  ASSERT_TRUE(control.grow());
  const auto second = get("If-None-Match: " + etag + "\r\n");
  EXPECT_EQ(second.status, 200);
  EXPECT_NE(second.headers.at("etag"), etag);
  EXPECT_EQ(messages_in(second.body), 3u);

  // Who began before goes on with what there was, in parts of any length, also over where it ended.
  const auto in_parts = [&](std::size_t step) {
    std::string got;
    for (std::size_t at = 0; at < first.body.size(); at += step) {
      const auto part = get("Range: bytes=" + std::to_string(at) + "-" + std::to_string(at + step - 1) +
                            "\r\nIf-Range: " + etag + "\r\n");
      EXPECT_EQ(part.status, 206);
      EXPECT_THAT(part.headers.at("content-range"), EndsWith("/" + std::to_string(first.body.size())));
      got += part.body;
    }
    return got;
  };
  EXPECT_EQ(in_parts(97), first.body);
  EXPECT_EQ(in_parts(1000), first.body);
  ASSERT_EQ(post_json(port, kFace, kStop).status, 200);
  EXPECT_EQ(in_parts(211), first.body) << "although it is finished now";
  EXPECT_EQ(get().body, content_of(folder / "face-1.mcap"));

  // What was never a state of it is none.
  const std::string inode = etag.substr(0, etag.rfind('-') + 1);
  for (const std::string& other : {inode + "1\"", inode + "\"", inode + "ffffffffffffffffff\"",
                                   std::string("\"growing-1-1\""), std::string("\"growing\"")})
    EXPECT_EQ(get("Range: bytes=0-9\r\nIf-Range: " + other + "\r\n").status, 200) << other;
}

TEST_F(RecordingApi, WhatIsFinishedWhileItIsListedHasItsWholeSize) {
  ASSERT_EQ(post_json(port, kFace, kStart).status, 200);
  control.ends_when_asked();
  const Json one = list()["recordings"][0];
  EXPECT_EQ(one["recording"], false);
  EXPECT_EQ(one["bytes"], std::filesystem::file_size(folder / "face-1.mcap"));
  EXPECT_EQ(one["bytes"], get().body.size());
}

TEST_F(RecordingApi, AFolderOnASlowDiskIsListed) {
  ASSERT_EQ(post_json(port, kFace, kStart).status, 200);
  start({.port = 0, .recordings = &control, .request_time = 300ms});
  control.answers_after = 600ms;
  EXPECT_EQ(listed(), std::vector<std::string>{"face-1.mcap"});
}

ServerStatus make_status() {
  ServerStatus status;
  status.stream = "face";
  return status;
}

TEST_F(RecordingApi, WhoWatchesIsToldThatARecordingGrowsAndReadsWhatIsNew) {
  gateway->announce(make_info());
  WsClient client(port, "face");
  ASSERT_TRUE(client.next_of("info"));
  gateway->publish(make_status());
  ASSERT_TRUE(client.next_of("status"));
  ASSERT_EQ(post_json(port, kFace, kStart).status, 200);
  std::string have, etag;
  const auto told = [&] {
    gateway->publish(make_status());
    const auto message = client.next_of("recording");
    EXPECT_TRUE(message);
    return message ? Json::parse(message->data) : Json();
  };
  for (std::uint64_t messages = 1; messages <= 4; ++messages) {
    const Json event = told();
    EXPECT_EQ(event["state"], "recording");
    EXPECT_EQ(event["file"], "face-1.mcap");
    const auto got = have.empty() ? get() : get(new_since(have, etag));
    ASSERT_EQ(got.status, have.empty() ? 200 : 206);
    if (!have.empty()) have.resize(end_of_data(have));
    have += got.body;
    etag = got.headers.at("etag");
    EXPECT_EQ(end_of_data(have), event["whole_bytes"]);
    EXPECT_EQ(messages_in(have), messages);
    EXPECT_EQ(get(new_since(have, etag)).status, 304) << "until it grows";
    ASSERT_TRUE(control.grow());
  }
  ASSERT_EQ(post_json(port, kFace, kStop).status, 200);
  EXPECT_EQ(told()["state"], "off");
  const auto rest = get(new_since(have, etag));
  ASSERT_EQ(rest.status, 206) << "it is finished";
  EXPECT_EQ(have.substr(0, end_of_data(have)) + rest.body, content_of(folder / "face-1.mcap"));

  WsClient late(port, "face");
  const auto late_told = late.next_of("recording");
  ASSERT_TRUE(late_told);
  EXPECT_EQ(Json::parse(late_told->data)["state"], "off");
}

TEST_F(RecordingApi, AFileThatHasNoWholeChunkYetIsNotOfferedYet) {
  ASSERT_EQ(post_json(port, kFace, kStart).status, 200);
  control.has_just_begun();
  EXPECT_TRUE(listed().empty());
  const auto early = get();
  EXPECT_EQ(early.status, 404);
  EXPECT_THAT(early.body, HasSubstr("ask again"));
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

TEST_F(RecordingApi, AFolderThatCannotBeReadIsNotAnEmptyOne) {
  ASSERT_TRUE(listed().empty());
  std::filesystem::remove_all(folder.path());
  std::ofstream(folder.path()) << "no folder";
  const auto response = request(port, "GET", "/api/recordings");
  EXPECT_EQ(response.status, 503);
  EXPECT_EQ(response.body, "the folder of recordings cannot be read: Not a directory\n");
  std::filesystem::remove(folder.path());
  EXPECT_THAT(request(port, "GET", "/api/recordings").body, HasSubstr("No such file or directory"));
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
