// SPDX-License-Identifier: Apache-2.0
// Proves: a recording is read in parts by its name alone, no name leads to another file, and a file that
// changes is never mixed up with what it was.
#include "web/gateway/recording_route.h"

#include <gtest/gtest.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <atomic>
#include <filesystem>
#include <fstream>
#include <future>
#include <mutex>
#include <nlohmann/json.hpp>
#include <thread>

#include "codec/recording.h"
#include "tests/support/temp_folder.h"
#include "tests/unit/web/gateway_fixture.h"
#include "web/gateway/byte_range.h"

namespace {
std::mutex stuck_disk;
std::atomic<ino_t> on_disk{0};  // the file that is alone there; 0: all are
std::atomic<int> waiting_reads{0};
std::atomic<bool> slow_disk{false};
}  // namespace

// In place of the system's, for the gateway's reads of recordings.
extern "C" ssize_t pread(int descriptor, void* into, size_t bytes, off_t offset) {
  struct stat file {};
  if (on_disk == 0 || (fstat(descriptor, &file) == 0 && file.st_ino == on_disk)) {
    ++waiting_reads;
    { const std::lock_guard lock(stuck_disk); }
    if (slow_disk) std::this_thread::sleep_for(std::chrono::milliseconds(20));
    --waiting_reads;
  }
  return syscall(SYS_pread64, descriptor, into, bytes, offset);
}

namespace relievo::test {
namespace {

TEST(ByteRange, Headers) {
  const struct {
    const char* header;
    RangeKind kind;
    ByteRange range;
  } cases[] = {{"", RangeKind::kWhole, {0, 100}},
               {"bytes=0-9", RangeKind::kPart, {0, 10}},
               {"Bytes=0-9", RangeKind::kPart, {0, 10}},
               {"bytes=90-", RangeKind::kPart, {90, 10}},
               {"bytes=0-", RangeKind::kPart, {0, 100}},
               {"bytes=-10", RangeKind::kPart, {90, 10}},
               {"bytes=-1000", RangeKind::kPart, {0, 100}},
               {"bytes=99-99", RangeKind::kPart, {99, 1}},
               {"bytes=50-18446744073709551615", RangeKind::kPart, {50, 50}},
               {"bytes=100-", RangeKind::kUnsatisfiable, {0, 100}},
               {"bytes=100-200", RangeKind::kUnsatisfiable, {0, 100}},
               {"bytes=-0", RangeKind::kUnsatisfiable, {0, 100}},
               {"bytes=9-3", RangeKind::kWhole, {0, 100}},
               {"bytes=0-1,5-6", RangeKind::kWhole, {0, 100}},
               {"bytes=0-99999999999999999999", RangeKind::kWhole, {0, 100}},
               {"bytes= 1-2", RangeKind::kWhole, {0, 100}},
               {"bytes=--2", RangeKind::kWhole, {0, 100}},
               {"bytes=-", RangeKind::kWhole, {0, 100}},
               {"bytes=", RangeKind::kWhole, {0, 100}},
               {"lines=1-2", RangeKind::kWhole, {0, 100}}};
  for (const auto& c : cases) {
    ByteRange range;
    EXPECT_EQ(parse_range(c.header, 100, range), c.kind) << c.header;
    if (c.kind != RangeKind::kUnsatisfiable) {
      EXPECT_EQ(range, c.range) << c.header;
    }
  }
  ByteRange none;
  EXPECT_EQ(parse_range("bytes=-5", 0, none), RangeKind::kUnsatisfiable);
  EXPECT_EQ(parse_range("bytes=0-", 0, none), RangeKind::kUnsatisfiable);
}

class Recordings : public GatewayTest {
 protected:
  void SetUp() override {
    GatewayTest::SetUp();
    for (int i = 0; i < 1'000'000; ++i) content += static_cast<char>(i * 7 + i / 256);
    std::ofstream(file, std::ios::binary) << content;
    std::ofstream(folder / "secret.mcap") << "secret";
    gateway->announce(make_info());
    gateway->offer("face", {.file = file});
  }
  Response get(const std::string& headers = {}) {
    return request(port, "GET", "/recordings/face.mcap", headers);
  }
  /// As "cut", a recording without an end, that is alone on the disk.
  void offer_cut(std::uint32_t chunks) {
    const auto cut = folder / "cut.mcap";
    {
      auto writer = *RecordingWriter::create(cut, {.chunk_ns = 0, .sync_ns = -1});
      ASSERT_TRUE(writer->add_channel({"T", "omgidl", "struct T {};"}, {"t", "cdr", "T", {}}));
      for (std::uint32_t i = 1; i <= chunks; ++i) {
        ASSERT_TRUE(writer->write({0, i, i, i, Bytes(1000, 7)}));
        ASSERT_TRUE(writer->flush_if_due(i));
      }
      ASSERT_TRUE(writer->finish());
    }
    std::filesystem::resize_file(cut, std::filesystem::file_size(cut) - 100);
    std::filesystem::last_write_time(cut, std::filesystem::last_write_time(cut) - std::chrono::hours(1));
    gateway->announce(make_info("cut"));
    gateway->offer("cut", {.file = cut, .whole = false});
    struct stat status {};
    ASSERT_EQ(stat(cut.c_str(), &status), 0);
    on_disk = status.st_ino;
  }

  TempFolder folder;
  const std::filesystem::path file = folder / "a take of yesterday.mcap";
  std::string content;
};

// A cache that many share need not ask about a finished file for each of them; a browser's own asks each
// time.
TEST_F(Recordings, ASharedCacheMayKeepWhatIsFinishedAndNeedsNoToken) {
  const std::string kept = "max-age=0, s-maxage=300";
  EXPECT_EQ(get().headers.at("cache-control"), kept);
  const Response part = get("Range: bytes=0-9\r\n");
  EXPECT_EQ(part.headers.at("cache-control"), kept);
  const std::string etag = part.headers.at("etag");
  EXPECT_EQ(get("If-None-Match: " + etag + "\r\n").headers.at("cache-control"), kept);
  EXPECT_EQ(get("Range: bytes=2000000-\r\n").headers.at("cache-control"), "no-cache") << "of no part";
  std::ofstream(folder / "tokens") << "correct-horse-battery\n";
  ASSERT_TRUE(gateway->apply({.token_file = folder / "tokens"}));
  ASSERT_TRUE(eventually([&] { return get().status == 401; }));
  const Response own = get("Authorization: Bearer correct-horse-battery\r\n");
  EXPECT_EQ(own.status, 200);
  EXPECT_EQ(own.headers.at("cache-control"), "private, no-cache");
}

TEST_F(Recordings, WhatWasCutShortIsKeptByNobody) {
  const OfferedRecording cut{.file = file, .whole = false};
  gateway->offer("face", cut);
  EXPECT_EQ(get().headers.at("cache-control"), "no-cache");
  EXPECT_EQ(get("Range: bytes=0-9\r\n").headers.at("cache-control"), "no-cache");
}

// A disk that stands still (pread below) keeps who reads from it waiting, and nobody else.
TEST_F(Recordings, ASlowDiskHoldsNobodyElseUp) {
  stuck_disk.lock();
  {
    std::jthread reader([&] { EXPECT_EQ(get().body, content); });
    EXPECT_TRUE(eventually([] { return waiting_reads == 1; }));
    EXPECT_EQ(request(port, "GET", "/healthz").status, 200);
    WsClient client(port, "face");
    client.credit(1);
    gateway->publish("face", make_frame(7));
    EXPECT_TRUE(client.next_of("frame"));
    stuck_disk.unlock();
  }
  stuck_disk.lock();
  TcpClient leaves(port);
  leaves.send("GET /recordings/face.mcap HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n");
  EXPECT_TRUE(eventually([] { return waiting_reads == 1; }));
  std::jthread stops([&] { gateway.reset(); });
  std::this_thread::sleep_for(100ms);
  stuck_disk.unlock();  // its last read ends with the gateway gone
}

// A disk that has to spin up takes longer than a client may: that is not the client's fault.
TEST_F(Recordings, ADiskTakesItsTime) {
  start({.port = 0, .request_time = 300ms});
  gateway->announce(make_info());
  gateway->offer("face", {.file = file});
  stuck_disk.lock();
  std::jthread reader([&] { EXPECT_TRUE(get().body == content); });
  EXPECT_TRUE(eventually([] { return waiting_reads == 1; }));
  std::this_thread::sleep_for(600ms);
  stuck_disk.unlock();
}

// A long one that was cut short is gone through once, for all who ask for it, and nobody else waits.
TEST_F(Recordings, OneIsIndexedForAllAndHoldsNobodyElseUp) {
  offer_cut(3);
  stuck_disk.lock();
  {
    std::promise<void> read;
    std::vector<std::jthread> readers;
    for (int i = 0; i < 4; ++i)
      readers.emplace_back([&] {
        const auto got = request(port, "GET", "/recordings/cut.mcap", "Range: bytes=0-9\r\n");
        EXPECT_EQ(got.status, 206);
        EXPECT_EQ(got.headers.at("etag").substr(0, 5), "\"cut-");
      });
    EXPECT_TRUE(eventually([] { return waiting_reads > 0; }));
    readers.emplace_back([&] {
      EXPECT_EQ(get().body, content);
      read.set_value();
    });
    EXPECT_EQ(read.get_future().wait_for(kPatience / 6), std::future_status::ready);
    EXPECT_EQ(waiting_reads, 1);
    stuck_disk.unlock();
  }
  on_disk = 0;
}

// Going through one may take half an hour: who ends the server does not wait for that.
TEST_F(Recordings, AWalkEndsWithTheGateway) {
  offer_cut(3000);
  slow_disk = true;
  TcpClient asks(port);
  asks.send("GET /recordings/cut.mcap HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n");
  EXPECT_TRUE(eventually([] { return waiting_reads > 0; }));
  const auto begin = std::chrono::steady_clock::now();
  gateway.reset();
  EXPECT_LT(std::chrono::steady_clock::now() - begin, kPatience / 6);
  slow_disk = false;
  on_disk = 0;
}

// A page that asks again and again while a disk stands still would use up all that its address may have.
TEST_F(Recordings, WhoLeavesBeforeTheDiskAnswersLeavesTheirPlaces) {
  start({.port = 0, .web = {.max_per_address = 3}, .request_time = 300ms});
  gateway->announce(make_info());
  gateway->offer("face", {.file = file});
  stuck_disk.lock();
  {
    std::vector<TcpClient> leave;
    for (int i = 0; i < 3; ++i) {
      leave.emplace_back(port).send("GET /recordings/face.mcap HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n");
      EXPECT_TRUE(eventually([&] { return waiting_reads == std::min(i + 1, 2); }));
    }
    EXPECT_NE(request(port, "GET", "/healthz").status, 200) << "they are there yet";
  }
  EXPECT_TRUE(eventually([&] { return request(port, "GET", "/healthz").status == 200; }, kPatience / 4));
  stuck_disk.unlock();
}

TEST_F(Recordings, AreListedAndReadInParts) {
  const auto stream = nlohmann::json::parse(request(port, "GET", "/api/streams").body)["streams"][0];
  EXPECT_EQ(stream["recording"], "recordings/face.mcap");
  const auto whole = get();
  EXPECT_EQ(whole.status, 200);
  EXPECT_EQ(whole.headers.at("accept-ranges"), "bytes");
  EXPECT_EQ(whole.body, content);
  const auto part = get("Range: bytes=1000-299999\r\n");
  EXPECT_EQ(part.status, 206);
  EXPECT_EQ(part.headers.at("content-range"), "bytes 1000-299999/1000000");
  EXPECT_EQ(part.body, content.substr(1000, 299000));
  EXPECT_EQ(get("Range: bytes=-3\r\n").body, content.substr(content.size() - 3));
  const auto behind = get("Range: bytes=1000000-\r\n");
  EXPECT_EQ(behind.status, 416);
  EXPECT_EQ(behind.headers.at("content-range"), "bytes */1000000");
  for (const char* range : {"", "Range: bytes=1000-299999\r\n"}) {  // which is for GET alone
    const auto head = request(port, "HEAD", "/recordings/face.mcap", range);
    EXPECT_EQ(head.status, 200);
    EXPECT_EQ(head.headers.at("content-length"), "1000000");
  }
}

TEST_F(Recordings, OneConnectionReadsPartAfterPart) {
  TcpClient client(port);
  for (int i = 0; i < 20; ++i) {
    const int at = i * 49'999;
    client.send("GET /recordings/face.mcap HTTP/1.1\r\nHost: localhost\r\nRange: bytes=" +
                std::to_string(at) + "-" + std::to_string(at + 9'999) + "\r\n\r\n");
    EXPECT_EQ(read_response(client).body, content.substr(static_cast<std::size_t>(at), 10'000)) << i;
  }
}

TEST_F(Recordings, NoNameLeadsElsewhere) {
  for (const char* name :
       {"secret.mcap", "../secret.mcap", "%2e%2e/secret.mcap", "..%2fsecret.mcap", "/etc/passwd",
        "//etc/passwd", "../../../../etc/passwd", "face.mcap/../secret.mcap", "./face.mcap", "face.mcap/",
        "face.mcap%00", "a%20take%20of%20yesterday.mcap", "face", ".mcap", "", "face.MCAP"}) {
    const auto response = request(port, "GET", std::string("/recordings/") + name);
    EXPECT_EQ(response.status, 404) << name;
    EXPECT_EQ(response.body.find("secret"), std::string::npos) << name;
  }
  gateway->announce(make_info("live"));
  EXPECT_EQ(request(port, "GET", "/recordings/live.mcap").status, 404) << "it is played from no file";
}

TEST_F(Recordings, AFileThatChangedIsAnotherOne) {
  const std::string etag = get("Range: bytes=0-9\r\n").headers.at("etag");
  EXPECT_EQ(get("If-None-Match: " + etag + "\r\n").status, 304);
  const std::string same = "Range: bytes=0-9\r\nIf-Range: " + etag + "\r\n";
  EXPECT_EQ(get(same).status, 206);
  std::ofstream(file, std::ios::binary) << "something else, and shorter";
  const auto now = get(same);
  EXPECT_EQ(now.status, 200) << "parts of two files would have been put together";
  EXPECT_EQ(now.body, "something else, and shorter");
  std::filesystem::remove(file);
  EXPECT_EQ(get().status, 404);
  std::filesystem::create_directory(file);
  EXPECT_EQ(get().status, 404);
}

TEST_F(Recordings, AFileThatCannotBeReadIsNotGone) {
  std::filesystem::remove(file);
  std::filesystem::create_symlink(file, file);
  const auto response = get();
  EXPECT_EQ(response.status, 503);
  EXPECT_EQ(response.body, "the recording cannot be read: Too many levels of symbolic links\n");
}

// Also where its size is the same, and so would be the time by the file system's clock, which goes in steps.
TEST_F(Recordings, AFileThatChangedAtOnceIsAnotherOne) {
  const auto write = [&](const char* text) {
    using namespace std::filesystem;
    std::ofstream(file, std::ios::binary) << text;
    last_write_time(file, std::chrono::floor<std::chrono::duration<file_time_type::rep, std::ratio<1, 100>>>(
                              last_write_time(file)));
  };
  for (int i = 0; i < 5; ++i) {
    write("what it was");
    const auto was = get();
    EXPECT_EQ(was.body, "what it was");
    write("what it is!");
    EXPECT_EQ(get("If-None-Match: " + was.headers.at("etag") + "\r\n").body, "what it is!");
  }
}

TEST_F(Recordings, AreComparedByAnyOfTheirTags) {
  const std::string etag = get().headers.at("etag");
  EXPECT_EQ(get("If-None-Match: W/\"other\", W/" + etag + "\r\n").status, 304);
  EXPECT_EQ(get("If-None-Match: \"other\"\r\nIf-None-Match: " + etag + "\r\n").status, 304)
      << "a list in two lines";
  EXPECT_EQ(get("If-Match: \"other\"\r\nIf-Match: " + etag + "\r\n").status, 200);
  EXPECT_EQ(get("If-None-Match: *\r\nRange: bytes=2000000-\r\n").status, 304)
      << "before ranges are looked at";
  EXPECT_EQ(get("If-Match: " + etag + "\r\n").status, 200);
  const Response other = get("If-Match: \"other\"\r\n");
  EXPECT_EQ(other.status, 412);
  EXPECT_EQ(other.body, "");
}

TEST_F(Recordings, AreFoundByNamesThatAreEscapedWithoutNeed) {
  EXPECT_EQ(request(port, "GET", "/recordings/fa%63e%2Emcap").body, content);
  EXPECT_EQ(request(port, "GET", "/ws/fa%63e").status, 426);
}

TEST_F(Recordings, GoWithTheirStream) {
  gateway->withdraw("face");
  EXPECT_EQ(get().status, 404);
  gateway->announce(make_info());
  EXPECT_EQ(get().status, 404) << "what comes back under the name may be live";
}

TEST_F(Recordings, AreNotToldWithoutAToken) {
  std::ofstream(folder / "tokens") << "correct-horse-battery\n";
  start({.port = 0, .web = {.token_file = folder / "tokens"}});
  gateway->announce(make_info());
  gateway->offer("face", {.file = file});
  EXPECT_EQ(get().status, 401);
  EXPECT_EQ(get("Authorization: Bearer correct-horse-battery\r\n").status, 200);
}

}  // namespace
}  // namespace relievo::test
