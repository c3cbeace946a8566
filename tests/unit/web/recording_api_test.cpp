// SPDX-License-Identifier: Apache-2.0
// Proves: recordings are started, stopped, listed and read over HTTP by those who may, and by nobody else.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <chrono>
#include <filesystem>
#include <fstream>
#include <mutex>
#include <nlohmann/json.hpp>
#include <thread>
#include <utility>

#include "codec/recording.h"
#include "tests/support/temp_folder.h"
#include "tests/unit/web/gateway_fixture.h"

namespace relievo::test {
namespace {

using Json = nlohmann::json;
using testing::EndsWith;
using testing::HasSubstr;
using testing::StartsWith;

constexpr const char* kFace = "/api/recording/face";
constexpr const char* kStart = R"({"action":"start"})";
constexpr const char* kStop = R"({"action":"stop"})";

/// Who records: a stream that is called face is all there is, and its file holds one chunk at once. Any
/// thread.
class OneStream final : public RecordingControl {
 public:
  explicit OneStream(std::filesystem::path folder) : folder_(std::move(folder)) {}

  std::optional<RecordingState> state(const std::string& stream) const override {
    if (stream != "face") return std::nullopt;
    const std::lock_guard lock(mutex_);
    RecordingState state = state_;
    state.whole_bytes = growing_ ? growing_->bytes() : 0;
    return state;
  }
  Status start(const std::string&) override {
    const std::lock_guard lock(mutex_);
    if (state_.activity == RecordingActivity::kRecording) return Error{"is recorded already"};
    state_ = {.activity = RecordingActivity::kRecording,
              .file = "face-1.mcap",
              .frames = 3,
              .bytes = 7,
              .room_bytes = 11};
    auto writer = RecordingWriter::create(folder_ / state_.file, {.chunk_ns = 0});
    if (!writer) return writer.error();
    writer_ = std::move(*writer);
    growing_ = writer_->growing();
    if (auto added = writer_->add_channel({"T", "omgidl", "struct T {};"}, {"t", "cdr", "T", {}}); !added)
      return added.error();
    return grow();
  }
  /// By a chunk of one message, the time of which is its number.
  Status grow() {
    const std::lock_guard lock(mutex_);
    ++messages_;
    if (auto status = writer_->write({0, messages_, messages_, messages_, Bytes(1000, 7)}); !status)
      return status;
    return writer_->flush_if_due(messages_);
  }
  Status stop(const std::string&) override {
    const std::lock_guard lock(mutex_);
    if (state_.activity != RecordingActivity::kRecording) return Error{"is not recorded"};
    state_.activity = RecordingActivity::kOff;
    return writer_->finish();
  }
  void starts_at(std::uint32_t time) { messages_ = time; }
  /// As if nothing of it were on the disk.
  void has_just_begun() {
    const std::lock_guard lock(mutex_);
    growing_.reset();
  }
  std::filesystem::path folder() const override { return folder_; }
  /// As if its writer ended it at the very moment at which it is asked for next.
  void ends_when_asked() {
    const std::lock_guard lock(mutex_);
    ends_when_asked_ = true;
  }
  bool is_open(const std::string& file) const override {
    std::this_thread::sleep_for(answers_after);
    const std::lock_guard lock(mutex_);
    if (std::exchange(ends_when_asked_, false)) {
      EXPECT_TRUE(const_cast<OneStream*>(this)->stop("face"));
    }
    return state_.activity == RecordingActivity::kRecording && state_.file == file;
  }
  std::shared_ptr<const GrowingRecording> growing(const std::string& file) const override {
    const std::lock_guard lock(mutex_);
    return state_.file == file ? growing_ : nullptr;
  }

  std::chrono::milliseconds answers_after{0};  // set before it is asked whether a file is open

 private:
  const std::filesystem::path folder_;
  mutable std::recursive_mutex mutex_;  // of what follows
  RecordingState state_;
  mutable bool ends_when_asked_ = false;
  std::unique_ptr<RecordingWriter> writer_;
  std::shared_ptr<const GrowingRecording> growing_;
  std::uint32_t messages_ = 0;
};

class RecordingApi : public GatewayTest {
 protected:
  void SetUp() override { start({.port = 0, .recordings = &control}); }
  void TearDown() override { gateway.reset(); }
  Json list() const { return Json::parse(request(port, "GET", "/api/recordings").body); }
  std::vector<std::string> listed() const {
    std::vector<std::string> out;
    const Json answer = list();
    for (const auto& one : answer["recordings"]) out.push_back(one["file"]);
    return out;
  }
  Response get(const std::string& headers = {}) const {
    return request(port, "GET", "/recordings/face-1.mcap", headers);
  }
  static std::string content_of(const std::filesystem::path& file) {
    std::ifstream in(file, std::ios::binary);
    return {std::istreambuf_iterator<char>(in), {}};
  }
  /// Of a recording that has its index.
  std::uint64_t messages_in(const std::string& content) const {
    const TempFolder there;
    std::ofstream(there / "got.mcap", std::ios::binary) << content;
    auto reader = RecordingReader::open(there / "got.mcap");
    if (!reader) ADD_FAILURE() << reader.error().message;
    if (!reader) return 0;
    EXPECT_FALSE((*reader)->summary().recovered);
    std::uint64_t read = 0;
    for (auto message = (*reader)->next(); message && *message; message = (*reader)->next())
      EXPECT_EQ((**message).log_time_ns, static_cast<std::int64_t>(++read));
    EXPECT_EQ((*reader)->summary().messages, read);
    EXPECT_EQ((*reader)->summary().channel_messages, std::vector<std::uint64_t>{read});
    EXPECT_EQ((*reader)->summary().end_ns, static_cast<std::int64_t>(read));
    return read;
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

TEST_F(RecordingApi, WhatACrashCutShortIsListedSoAndNoCacheKeepsIt) {
  const auto cut = [&](const std::string& file) {
    const Json all = list();
    for (const Json& one : all["recordings"])
      if (one["file"] == file) return one["cut"];
    return Json();
  };
  const auto kept = [&](const std::string& file) {
    return request(port, "GET", "/recordings/" + file).headers.at("cache-control");
  };
  ASSERT_EQ(post_json(port, kFace, kStart).status, 200);
  for (int i = 0; i < 4; ++i) ASSERT_TRUE(control.grow());
  EXPECT_EQ(cut("face-1.mcap"), false) << "it is being written";
  ASSERT_EQ(post_json(port, kFace, kStop).status, 200);
  const std::string content = content_of(folder / "face-1.mcap");
  EXPECT_EQ(cut("face-1.mcap"), false);
  EXPECT_EQ(kept("face-1.mcap"), "max-age=0, s-maxage=300");
  const std::size_t nothing_whole = content.find(std::string(100, 7)) + 100;
  for (const std::size_t bytes :
       {std::size_t{0}, std::size_t{8}, nothing_whole, content.size() / 2, content.size() - 1}) {
    std::ofstream(folder / "cut.mcap", std::ios::binary) << content.substr(0, bytes);
    EXPECT_EQ(cut("cut.mcap"), bytes > nothing_whole ? Json(true) : Json()) << bytes;
    EXPECT_EQ(kept("cut.mcap"), "no-cache") << bytes;
    EXPECT_EQ(request(port, "GET", "/recordings/cut.mcap").body, content.substr(0, bytes));
  }
  std::ofstream(folder / "cut.mcap", std::ios::binary) << "no recording at all";
  EXPECT_EQ(cut("cut.mcap"), true) << "damaged, perhaps";
  std::ofstream(folder / "cut.mcap", std::ios::binary) << content;
  EXPECT_EQ(cut("cut.mcap"), false) << "mended";
  EXPECT_EQ(kept("cut.mcap"), "max-age=0, s-maxage=300");
}

TEST_F(RecordingApi, WhatACrashCutShortIsReadWithAnIndexThatIsNotInIt) {
  ASSERT_EQ(post_json(port, kFace, kStart).status, 200);
  for (int i = 0; i < 4; ++i) ASSERT_TRUE(control.grow());
  ASSERT_EQ(post_json(port, kFace, kStop).status, 200);
  const std::string content = content_of(folder / "face-1.mcap");
  const std::string cut = content.substr(0, content.size() / 2);
  const auto left = [&](std::chrono::seconds ago) {
    std::filesystem::last_write_time(folder / "cut.mcap",
                                     std::filesystem::file_time_type::clock::now() - ago);
  };
  const auto get_cut = [&](const std::string& headers = {}) {
    return request(port, "GET", "/recordings/cut.mcap", headers);
  };
  std::ofstream(folder / "cut.mcap", std::ios::binary) << cut;
  EXPECT_EQ(get_cut().body, cut) << "another program may be writing it";
  left(10s);
  const auto got = get_cut();
  ASSERT_EQ(got.status, 200);
  const std::uint64_t messages = messages_in(got.body);
  EXPECT_GE(messages, 1u);
  EXPECT_LT(messages, 5u);
  EXPECT_EQ(content_of(folder / "cut.mcap"), cut) << "it was written to";
  EXPECT_EQ(got.headers.at("cache-control"), "no-cache");
  EXPECT_THAT(got.headers.at("etag"), StartsWith("\"cut-"));
  const std::string same = "If-Range: " + got.headers.at("etag") + "\r\n";
  std::string parts;
  while (parts.size() < got.body.size()) {
    const auto part = get_cut("Range: bytes=" + std::to_string(parts.size()) + "-" +
                              std::to_string(parts.size() + 499) + "\r\n" + same);
    ASSERT_EQ(part.status, 206);
    parts += part.body;
  }
  EXPECT_EQ(parts, got.body);
  EXPECT_EQ(get_cut("If-None-Match: " + got.headers.at("etag") + "\r\n").status, 304);

  std::ofstream(folder / "cut.mcap", std::ios::binary) << content;
  left(10s);
  EXPECT_EQ(get_cut("Range: bytes=0-9\r\n" + same).body, content) << "mended, it is another";
  std::ofstream(folder / "cut.mcap", std::ios::binary) << "no recording at all";
  left(10s);
  EXPECT_EQ(get_cut().body, "no recording at all");
}

// Where the chunks end in a recording that has its index: the index, and what says that the data ends, is
// behind.
std::size_t end_of_data(const std::string& recording) {
  constexpr std::size_t kFooter = 8 + 8 + 4, kMagic = 8, kDataEnd = 9 + 4;
  return u64_at(recording, recording.size() - kMagic - kFooter) - kDataEnd;
}

/// Asks for what came behind the chunks of `recording`, where it is no longer the one with this ETag.
std::string new_since(const std::string& recording, const std::string& etag) {
  return "Range: bytes=" + std::to_string(end_of_data(recording)) + "-\r\nIf-None-Match: " + etag + "\r\n";
}

// Of a server that was killed and is there again: until it is clear that nobody writes the file.
TEST_F(RecordingApi, WhoFollowedWhatACrashCutShortGoesOnAtOnce) {
  ASSERT_EQ(post_json(port, kFace, kStart).status, 200);
  ASSERT_TRUE(control.grow());
  const auto had = request(port, "GET", "/recordings/face-1.mcap");
  ASSERT_THAT(had.headers.at("etag"), StartsWith("\"growing-"));
  for (int i = 0; i < 3; ++i) ASSERT_TRUE(control.grow());
  ASSERT_EQ(post_json(port, kFace, kStop).status, 200);
  const std::string content = content_of(folder / "face-1.mcap");
  std::filesystem::resize_file(folder / "face-1.mcap", end_of_data(content) - 10);
  const auto got =
      request(port, "GET", "/recordings/face-1.mcap", new_since(had.body, had.headers.at("etag")));
  ASSERT_EQ(got.status, 206);
  EXPECT_THAT(got.headers.at("etag"), StartsWith("\"growing-"));
  const std::string now = had.body.substr(0, end_of_data(had.body)) + got.body;
  EXPECT_GT(messages_in(now), messages_in(had.body)) << "it has an index";
}

// As many bytes, so that its chunks lie where those of the one before it did.
class WrittenOver : public RecordingApi, public testing::WithParamInterface<bool> {};
INSTANTIATE_TEST_SUITE_P(ByItsWriter, WrittenOver, testing::Bool(), [](const auto& param) {
  return std::string(param.param ? "Remembered" : "Forgotten");
});
TEST_P(WrittenOver, WhoFollowedAFileHasNoPartOfAnother) {
  ASSERT_EQ(post_json(port, kFace, kStart).status, 200);
  ASSERT_TRUE(control.grow());
  const auto had = get();
  const std::string etag = had.headers.at("etag");
  ASSERT_TRUE(control.grow());
  ASSERT_EQ(post_json(port, kFace, kStop).status, 200);
  if (!GetParam()) control.has_just_begun();  // nobody knows any more how it grew
  EXPECT_EQ(get("Range: bytes=0-9\r\nIf-Range: " + etag + "\r\n").status, 206);
  EXPECT_EQ(get(new_since(had.body, etag)).status, 206);

  const TempFolder elsewhere;
  OneStream later(elsewhere.path());
  later.starts_at(1000);
  ASSERT_TRUE(later.start("face"));
  ASSERT_TRUE(later.grow());
  ASSERT_TRUE(later.grow());
  ASSERT_TRUE(later.stop("face"));
  const std::string other = content_of(elsewhere / "face-1.mcap");
  ASSERT_EQ(other.size(), content_of(folder / "face-1.mcap").size());
  std::fstream(folder / "face-1.mcap", std::ios::binary | std::ios::in | std::ios::out) << other;
  for (const std::string& asked :
       {"Range: bytes=0-9\r\nIf-Range: " + etag + "\r\n", new_since(had.body, etag)}) {
    const auto got = get(asked);
    EXPECT_EQ(got.status, 200) << asked;
    EXPECT_TRUE(got.body == other) << asked;
  }
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
