// SPDX-License-Identifier: Apache-2.0
// Proves: `relievo web` of a file that is being written is of what it has by then: its stream goes on, and a
// page that reads the file reads what is new alone, until the file is finished; also where whoever writes it
// is killed.
#include <signal.h>

#include <fstream>
#include <set>

#include "tests/e2e/record_play.h"
#include "tests/support/patience.h"
#include "tests/support/socket_client.h"
#include "tests/support/temp_folder.h"

namespace relievo::test {
namespace {

using Json = nlohmann::json;

class GrowingFile : public ::testing::Test {
 protected:
  void SetUp() override {
    ASSERT_TRUE(eventually([&] {
      std::error_code none;
      return std::filesystem::file_size(file_, none) >= 200'000 && !none;
    })) << recorder_.err();
    web_.emplace(std::vector<std::string>{program("relievo"), "web", file_, "--listen", "127.0.0.1:0"});
    port_ = viewer_port(*web_);
    ASSERT_NE(port_, 0) << web_->err();
  }

  Json stream() const { return Json::parse(request(port_, "GET", "/api/streams").body)["streams"].at(0); }
  Response get(const std::string& headers = {}) const {
    return request(port_, "GET", "/recordings/face.mcap", headers);
  }
  /// As a page does that has `have_`: what is behind its data, with the index of all. False: nothing is.
  bool reads_on() {
    std::string headers;
    if (!have_.empty())
      headers = "Range: bytes=" + std::to_string(data_bytes()) + "-\r\nIf-None-Match: " + etag_ + "\r\n";
    const Response got = get(headers);
    if (got.status == 304) return false;
    EXPECT_EQ(got.status, have_.empty() ? 200 : 206);
    have_.resize(have_.empty() ? 0 : data_bytes());
    have_ += got.body;
    etag_ = got.headers.at("etag");
    std::ofstream(folder_ / "have.mcap", std::ios::binary) << have_;
    EXPECT_EQ(info(folder_ / "have.mcap")["recovered"], false) << "it has an index";
    return true;
  }
  std::size_t data_bytes() const {
    std::uint64_t summary = 0;
    std::memcpy(&summary, have_.data() + have_.size() - 8 - 20, sizeof summary);
    return summary - 13;
  }
  void expect_all() {
    const auto mine = recorded_frames(folder_ / "have.mcap");
    const auto all = recorded_frames(file_);
    EXPECT_EQ(mine.size(), all.size());
    EXPECT_TRUE(mine == all);
  }

  const TempFolder folder_;
  const std::filesystem::path file_ = folder_ / "growing.mcap";
  Process publisher_{publish_face(20000)};
  Process recorder_{on_loopback({"record", "face", "--out", file_})};
  std::optional<Process> web_;
  std::uint16_t port_ = 0;
  std::string have_, etag_;
};

// Who watches the stream of it, as programs do that know nothing of files.
TEST_F(GrowingFile, ItsStreamGoesOnWithWhatIsWritten) {
  const std::size_t at_first = recorded_frames(file_).size();
  WsClient client(port_, "face");
  ASSERT_EQ(client.status(), 101);
  ASSERT_TRUE(client.credit(8));
  std::set<std::string> seen;  // their bytes, of which no two frames have the same
  for (std::size_t came = 0; seen.size() < at_first + 120; ++came) {
    ASSERT_LT(came, 20 * at_first + 2000) << "it repeats what it had at first";
    const auto frame = client.next_of("frame");
    ASSERT_TRUE(frame) << "after " << seen.size() << " frames of " << at_first;
    constexpr std::size_t kPrefix = 48;
    seen.insert(frame->data.substr(kPrefix));
    ASSERT_TRUE(client.credit(1));
  }
}

TEST_F(GrowingFile, PagesReadWhatIsNewAloneUntilItIsFinished) {
  ASSERT_TRUE(eventually([&] { return stream()["recording"].is_string(); }));
  EXPECT_EQ(stream()["recording"], "recordings/face.mcap");
  ASSERT_TRUE(reads_on());
  const std::string first = have_, first_etag = etag_;
  for (int growths = 0; growths < 3; ++growths) {
    const std::size_t before = data_bytes();
    ASSERT_TRUE(eventually([&] { return stream()["growing_bytes"].get<std::uint64_t>() > before; }));
    ASSERT_TRUE(reads_on());
    EXPECT_GT(data_bytes(), before);
  }
  recorder_.signal(SIGINT);
  ASSERT_EQ(recorder_.wait(), 0) << recorder_.err();
  ASSERT_TRUE(eventually([&] { return stream()["growing_bytes"].is_null(); }));
  reads_on();
  expect_all();
  EXPECT_FALSE(reads_on()) << "that was the last time";
  EXPECT_EQ(get().body.size(), std::filesystem::file_size(file_)) << "the file itself";
  const Response part = get("Range: bytes=1000-\r\nIf-Range: " + first_etag + "\r\n");
  EXPECT_EQ(part.status, 206);
  EXPECT_TRUE(part.body == first.substr(1000)) << "who began to read it as it was goes on so";
}

TEST_F(GrowingFile, OfAKilledRecorderAllThatIsWholeIsThereWithAnIndex) {
  ASSERT_TRUE(eventually([&] { return stream()["recording"].is_string(); }));
  ASSERT_TRUE(reads_on());
  recorder_.signal(SIGKILL);
  ASSERT_TRUE(recorder_.wait());
  ASSERT_TRUE(eventually([&] { return stream()["growing_bytes"].is_null(); })) << "nothing came for 5 s";
  reads_on();
  expect_all();
}

// Where both programs are started again, it is still what the page had of it, and nothing comes any more.
TEST_F(GrowingFile, WhoBeganToReadItGoesOnAfterItsWriterAndTheGatewayWereKilled) {
  ASSERT_TRUE(eventually([&] { return stream()["recording"].is_string(); }));
  ASSERT_TRUE(reads_on());
  const std::string mine = have_;
  const std::string part = "Range: bytes=1000-\r\nIf-Range: " + etag_ + "\r\n";
  recorder_.signal(SIGKILL);
  ASSERT_TRUE(recorder_.wait());
  ASSERT_TRUE(eventually([&] { return stream()["growing_bytes"].is_null(); })) << "nothing came for 5 s";
  web_->signal(SIGKILL);
  ASSERT_TRUE(web_->wait());
  web_.emplace(std::vector<std::string>{program("relievo"), "web", file_, "--listen", "127.0.0.1:0"});
  port_ = viewer_port(*web_);
  ASSERT_NE(port_, 0) << web_->err();
  const Response got = get(part);
  EXPECT_EQ(got.status, 206) << "else the page says that it has changed";
  EXPECT_TRUE(got.body == mine.substr(1000));
  reads_on();
  expect_all();
}

TEST(FileThatIsPlayed, IsNotListedWhereItIsGone) {
  const TempFolder folder;
  const std::filesystem::path file = folder / "face.mcap", elsewhere = folder / "elsewhere.mcap";
  record_face(file, 2000, 60);
  Process web({program("relievo"), "web", file, "--listen", "127.0.0.1:0"});
  const auto port = viewer_port(web);
  ASSERT_NE(port, 0) << web.err();
  const auto listed = [&] {
    return Json::parse(request(port, "GET", "/api/streams").body)["streams"].at(0)["recording"].is_string();
  };
  const auto status = [&] { return request(port, "GET", "/recordings/face.mcap").status; };
  ASSERT_TRUE(eventually(listed));
  std::filesystem::rename(file, elsewhere);
  EXPECT_TRUE(eventually([&] { return !listed(); }));
  EXPECT_EQ(status(), 404);
  EXPECT_TRUE(eventually([&] { return web.err().find("is gone") != std::string::npos; })) << web.err();
  WsClient client(port, "face");
  ASSERT_TRUE(client.credit(8));
  EXPECT_TRUE(client.next_of("frame")) << "what is open of it is played on";
  std::filesystem::rename(elsewhere, file);
  EXPECT_TRUE(eventually(listed));
  EXPECT_EQ(status(), 200);
  std::filesystem::resize_file(file, std::filesystem::file_size(file) * 3 / 4);  // more than a chunk
  EXPECT_TRUE(eventually([&] {
    return request(port, "GET", "/recordings/face.mcap").headers.at("cache-control") == "no-cache";
  })) << "it is not whole any more";
}

Json streams_at(std::uint16_t port) {
  return Json::parse(request(port, "GET", "/api/streams").body)["streams"];
}

TEST(FileThatIsPlayed, IsNoStreamWhileItIsEmpty) {
  const TempFolder folder;
  const std::filesystem::path file = folder / "face.mcap", kept = folder / "kept.mcap";
  record_face(file, 2000, 60);
  std::filesystem::copy_file(file, kept);
  Process web({program("relievo"), "web", file, "--listen", "127.0.0.1:0"});
  const auto port = viewer_port(web);
  ASSERT_NE(port, 0) << web.err();
  std::filesystem::resize_file(file, 0);
  EXPECT_TRUE(eventually([&] { return streams_at(port).empty(); })) << streams_at(port).dump();
  EXPECT_NE(web.err().find("has become empty"), std::string::npos) << web.err();
  std::filesystem::copy_file(kept, file, std::filesystem::copy_options::overwrite_existing);
  EXPECT_TRUE(eventually([&] { return !streams_at(port).empty(); })) << web.err();
  WsClient client(port, "face");
  ASSERT_TRUE(client.credit(8));
  EXPECT_TRUE(client.next_of("frame"));
}

std::set<std::string> frames_in(const std::filesystem::path& file) {
  std::set<std::string> out;  // by their bytes
  for (const Bytes& cdr : recorded_frames(file))
    if (const auto frame = read_frame_cdr(cdr)) out.emplace(frame->data.begin(), frame->data.end());
  return out;
}

TEST(FileThatIsPlayed, IsTheOneThatWasMovedInItsPlace) {
  const TempFolder folder;
  const std::filesystem::path file = folder / "face.mcap", other = folder / "other.mcap";
  record_face(file, 2000, 60);
  record_face(other, 5000, 40);
  const std::set<std::string> others = frames_in(other);
  Process web({program("relievo"), "web", file, "--listen", "127.0.0.1:0"});
  const auto port = viewer_port(web);
  ASSERT_NE(port, 0) << web.err();
  const auto next_is_of_other = [&](WsClient& client) {
    constexpr std::size_t kPrefix = 48;
    EXPECT_TRUE(client.credit(1));
    const auto frame = client.next_of("frame");
    EXPECT_TRUE(frame);
    return frame && others.contains(frame->data.substr(kPrefix));
  };
  WsClient before(port, "face");
  EXPECT_FALSE(next_is_of_other(before));
  const auto bytes = std::filesystem::file_size(other);
  std::filesystem::rename(other, file);
  EXPECT_TRUE(eventually([&] { return web.err().find("is another file now") != std::string::npos; }))
      << web.err();
  WsClient client(port, "face");
  for (int i = 0; i < 5; ++i)
    EXPECT_TRUE(next_is_of_other(client)) << "what is opened anew is of the new one";
  EXPECT_TRUE(eventually([&] { return next_is_of_other(before); })) << "who is there goes on with it";
  EXPECT_EQ(streams_at(port).at(0)["recording"], "recordings/face.mcap");
  EXPECT_EQ(request(port, "GET", "/recordings/face.mcap").body.size(), bytes);
}

/// All of `file` once more, as many bytes of it, as if it were recorded `later_ns` later; frames have other
/// data.
void write_like(const std::filesystem::path& file, std::int64_t later_ns, const std::filesystem::path& out) {
  auto reader = RecordingReader::open(file);
  ASSERT_TRUE(reader.ok());
  auto writer = RecordingWriter::create(out, {});
  ASSERT_TRUE(writer.ok());
  const RecordingSummary& summary = (*reader)->summary();
  for (const RecordingChannel& channel : summary.channels) {
    const auto schema = std::ranges::find(summary.schemas, channel.schema, &RecordingSchema::name);
    ASSERT_TRUE((*writer)->add_channel(*schema, channel));
  }
  for (auto message = (*reader)->next(); message && *message; message = (*reader)->next()) {
    RecordedMessage& m = **message;
    m.log_time_ns += later_ns;
    if (later_ns > 0 && summary.channels[m.channel].topic == "relievo/frame") m.data.back() ^= 0xff;
    ASSERT_TRUE((*writer)->write(m).ok());
  }
  ASSERT_TRUE((*writer)->finish().ok());
}

void write_over(const std::filesystem::path& file, const std::string& content) {
  std::fstream(file, std::ios::binary | std::ios::in | std::ios::out) << content;
}
std::string content_of(const std::filesystem::path& file) {
  std::ifstream in(file, std::ios::binary);
  return {std::istreambuf_iterator<char>(in), {}};
}

// In place, with exactly as many bytes: the index of before is none of it.
TEST(FileThatIsPlayed, IsTheOneThatWasWrittenOverIt) {
  const TempFolder folder;
  const std::filesystem::path recorded = folder / "recorded.mcap", file = folder / "face.mcap",
                              other = folder / "other.mcap";
  record_face(recorded, 2000, 60);
  write_like(recorded, 0, file);
  write_like(recorded, 3'600'000'000'000, other);
  const std::set<std::string> others = frames_in(other);
  const std::string content = content_of(other);
  ASSERT_EQ(content.size(), std::filesystem::file_size(file));
  Process web({program("relievo"), "web", file, "--listen", "127.0.0.1:0"});
  const auto port = viewer_port(web);
  ASSERT_NE(port, 0) << web.err();
  WsClient client(port, "face");
  ASSERT_TRUE(client.credit(1));
  ASSERT_TRUE(client.next_of("frame"));
  write_over(file, content);
  EXPECT_TRUE(eventually([&] { return web.err().find("is another file now") != std::string::npos; }))
      << web.err();
  EXPECT_TRUE(eventually([&] {
    constexpr std::size_t kPrefix = 48;
    const auto frame = client.credit(1) ? client.next_of("frame") : std::nullopt;
    return frame && others.contains(frame->data.substr(kPrefix));
  })) << "who is there goes on with it";
  EXPECT_EQ(request(port, "GET", "/recordings/face.mcap").body, content);
}

// Of one that is being written, by more than there was, so that it looks like its growth.
TEST(FileThatIsPlayed, IsTheOneThatWasWrittenOverItWhereItGrew) {
  const TempFolder folder;
  const std::filesystem::path recorded = folder / "recorded.mcap", file = folder / "face.mcap",
                              other = folder / "other.mcap";
  record_face(recorded, 2000, 60);
  write_like(recorded, 3'600'000'000'000, other);
  const std::string content = content_of(other);
  std::ofstream(file, std::ios::binary) << content_of(recorded).substr(0, content.size() * 3 / 4);
  Process web({program("relievo"), "web", file, "--listen", "127.0.0.1:0"});
  const auto port = viewer_port(web);
  ASSERT_NE(port, 0) << web.err();
  write_over(file, content);
  EXPECT_TRUE(eventually([&] { return web.err().find("is another file now") != std::string::npos; }))
      << web.err();
  EXPECT_TRUE(eventually([&] { return request(port, "GET", "/recordings/face.mcap").body == content; }));
}

// Where its writer is killed within the message indexes behind a chunk, which is whole.
TEST(FileThatIsPlayed, HasItsLastChunkWhereNothingComesBehindIt) {
  const TempFolder folder;
  const std::filesystem::path recorded = folder / "recorded.mcap", file = folder / "face.mcap";
  record_face(recorded, 2000, 90);
  const std::string content = content_of(recorded);
  std::uint64_t summary = 0;
  std::memcpy(&summary, content.data() + content.size() - 8 - 20, sizeof summary);
  std::ofstream(file, std::ios::binary) << content.substr(0, summary - 13 - 20);
  Process web({program("relievo"), "web", file, "--listen", "127.0.0.1:0"});
  const auto port = viewer_port(web);
  ASSERT_NE(port, 0) << web.err();
  EXPECT_TRUE(eventually([&] {
    const Response got = request(port, "GET", "/recordings/face.mcap");
    EXPECT_EQ(got.status, 200) << "it is there all the time";
    std::ofstream(folder / "have.mcap", std::ios::binary) << got.body;
    return recorded_frames(folder / "have.mcap").size() == 90;
  }));
  EXPECT_EQ(info(folder / "have.mcap")["recovered"], false) << "it has an index";
  EXPECT_EQ(web.err().find("is another file now"), std::string::npos);
}

// What was recorded is described at the begin of the file, so that it looks as if there were a stream.
TEST(FileThatIsPlayed, IsNoStreamWhereItWasCutBeforeTheFirstFrame) {
  const TempFolder folder;
  const std::filesystem::path file = folder / "face.mcap", cut = folder / "cut.mcap";
  record_face(file, 2000, 60);
  const std::string content = content_of(file);
  constexpr char kChunk = 6;
  std::size_t at = 8;
  for (std::uint64_t bytes = 0; content.at(at) != kChunk; at += 9 + bytes)
    std::memcpy(&bytes, content.data() + at + 1, sizeof bytes);
  std::ofstream(cut, std::ios::binary) << content.substr(0, at + 100);
  Process web({program("relievo"), "web", file, "--listen", "127.0.0.1:0"});
  const auto port = viewer_port(web);
  ASSERT_NE(port, 0) << web.err();
  std::filesystem::rename(cut, file);
  EXPECT_TRUE(eventually([&] { return web.err().find("holds no frame") != std::string::npos; })) << web.err();
  EXPECT_TRUE(streams_at(port).empty()) << streams_at(port).dump();
  const auto anew = run({program("relievo"), "web", file, "--listen", "127.0.0.1:0"});
  EXPECT_EQ(anew.status, 1);
  EXPECT_NE(anew.err.find("cut short before"), std::string::npos) << anew.err;
  const Json list = Json::parse(request(port, "GET", "/api/streams").body);
  EXPECT_NE(list["hint"].get<std::string>().find("face.mcap"), std::string::npos) << list.dump();
}

TEST(FileThatIsPlayed, IsNoStreamWhereWhatWasMovedInItsPlaceIsNoRecording) {
  const TempFolder folder;
  const std::filesystem::path file = folder / "face.mcap", other = folder / "other";
  record_face(file, 2000, 60);
  Process web({program("relievo"), "web", file, "--listen", "127.0.0.1:0"});
  const auto port = viewer_port(web);
  ASSERT_NE(port, 0) << web.err();
  std::ofstream(other) << "a letter";
  std::filesystem::rename(other, file);
  EXPECT_TRUE(eventually([&] { return web.err().find("cannot be played") != std::string::npos; }))
      << web.err();
  EXPECT_TRUE(streams_at(port).empty()) << streams_at(port).dump();
}

}  // namespace
}  // namespace relievo::test
