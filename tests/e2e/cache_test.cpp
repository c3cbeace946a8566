// SPDX-License-Identifier: Apache-2.0
// Proves: behind nginx with the configuration of docs/scaling.md recordings are served by the cache alone
// once one reader has had them, and all else goes through.
#include <arpa/inet.h>
#include <gmock/gmock.h>
#include <signal.h>

#include <fstream>
#include <sstream>

#include "tests/e2e/record_play.h"
#include "tests/support/metric.h"
#include "tests/support/patience.h"
#include "tests/support/replace_in.h"
#include "tests/support/socket_client.h"
#include "tests/support/temp_folder.h"

namespace relievo::test {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;

constexpr std::size_t kBlock = 1 << 18;  // as pages read them

std::string find_nginx() {
  std::istringstream folders(std::string(std::getenv("PATH")) + ":/usr/sbin");
  for (std::string folder; std::getline(folders, folder, ':');)
    if (fs::exists(fs::path(folder) / "nginx")) return fs::path(folder) / "nginx";
  return {};
}

/// Nobody's, a moment ago.
std::uint16_t free_port() {
  const int fd = socket(AF_INET, SOCK_STREAM, 0);
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  socklen_t size = sizeof address;
  bind(fd, reinterpret_cast<sockaddr*>(&address), size);
  getsockname(fd, reinterpret_cast<sockaddr*>(&address), &size);
  close(fd);
  return ntohs(address.sin_port);
}

/// The indented lines from `first` on.
std::string configuration_in(const fs::path& document, const std::string& first) {
  std::ifstream in(document);
  std::string out;
  for (std::string line; std::getline(in, line);) {
    if (out.empty() && !line.starts_with("    " + first)) continue;
    if (!line.starts_with("    ")) break;
    out += line.substr(4) + "\n";
  }
  return out;
}

class Cache : public ::testing::Test {
 protected:
  void SetUp() override {
    nginx_program_ = find_nginx();
    if (nginx_program_.empty()) GTEST_SKIP() << "no nginx here: apt-get install nginx-light";
    record_face(file_, 20'000, 60);
    web_.emplace(std::vector<std::string>{program("relievo"), "web", file_, "--listen", "127.0.0.1:0"});
    origin_ = viewer_port(*web_);
    ASSERT_NE(origin_, 0) << web_->err();
    ASSERT_TRUE(start_nginx());
  }
  void TearDown() override {
    if (nginx_) nginx_->signal(SIGQUIT);
    if (nginx_) nginx_->wait();
  }

  bool start_nginx() {
    for (int tries = 0; tries < 5; ++tries) {
      port_ = free_port();
      std::ofstream(folder_ / "nginx.conf")
          << (geteuid() == 0 ? "user root;\n" : "") << "daemon off;\nmaster_process on;\npid nginx.pid;\n"
          << "error_log stderr;\nevents {}\nhttp {\naccess_log off;\nclient_body_temp_path body;\n"
          << "proxy_temp_path proxy;\nfastcgi_temp_path f;\nuwsgi_temp_path u;\nscgi_temp_path s;\n"
          << configuration_in(fs::path(RELIEVO_SOURCE_DIR) / "docs/scaling.md", "proxy_cache_path") << "}\n";
      const auto replace = [&](const std::string& what, const std::string& by) {
        replace_in(folder_ / "nginx.conf", what, by);
      };
      replace("/var/cache/nginx/relievo", (folder_ / "cache").string());
      replace("listen 80;", "listen 127.0.0.1:" + std::to_string(port_) + ";");
      for (int i = 0; i < 2; ++i) replace("127.0.0.1:8080", "127.0.0.1:" + std::to_string(origin_));
      nginx_ = std::make_unique<Process>(
          std::vector<std::string>{nginx_program_, "-p", folder_.path(), "-c", "nginx.conf", "-e", "stderr"});
      const bool came =
          eventually([&] { return nginx_->wait(0ms) || request(port_, "GET", "/healthz").status == 200; });
      if (came && !nginx_->wait(0ms)) return true;
      std::printf("%s\n", nginx_->err().c_str());
    }
    return false;
  }

  double requests() const {
    return metric_in(request(origin_, "GET", "/metrics").body, "relievo_gateway_requests_total");
  }
  static std::string status_of(const Response& response) {
    const auto found = response.headers.find("x-cache-status");
    return found == response.headers.end() ? "none" : found->second;
  }
  /// The whole file as a page reads it, and how often the cache had it (HIT), or not.
  std::pair<std::string, std::map<std::string, int>> read_as_a_page() const {
    std::pair<std::string, std::map<std::string, int>> out;
    const std::string path = "/recordings/face.mcap";
    const Response head = request(port_, "GET", path, "Range: bytes=0-0\r\nCache-Control: no-cache\r\n");
    ++out.second[status_of(head)];
    EXPECT_EQ(head.status, 206);
    const std::string& range = head.headers.at("content-range");
    const std::size_t size = std::stoul(range.substr(range.find('/') + 1));
    for (std::size_t at = 0; at < size; at += kBlock) {
      const Response part = request(
          port_, "GET", path,
          "Range: bytes=" + std::to_string(at) + "-" + std::to_string(std::min(size, at + kBlock) - 1) +
              "\r\nIf-Range: " + head.headers.at("etag") + "\r\nCache-Control: no-cache\r\n");
      EXPECT_EQ(part.status, 206) << at;
      ++out.second[status_of(part)];
      out.first += part.body;
    }
    return out;
  }

  const TempFolder folder_;
  const fs::path file_ = folder_ / "a.mcap";
  std::string nginx_program_;
  std::optional<Process> web_;
  std::unique_ptr<Process> nginx_;
  std::uint16_t origin_ = 0, port_ = 0;
};

TEST_F(Cache, TheSecondReaderCostsTheGatewayNothing) {
  std::ifstream in(file_, std::ios::binary);
  const std::string whole{std::istreambuf_iterator<char>(in), {}};
  const int parts = 1 + static_cast<int>((whole.size() + kBlock - 1) / kBlock);
  ASSERT_GT(parts, 4);
  const auto first = read_as_a_page();
  EXPECT_TRUE(first.first == whole);
  EXPECT_EQ(first.second, (std::map<std::string, int>{{"MISS", parts}}));
  const double before = requests();
  for (int reader = 0; reader < 3; ++reader) {
    const auto next = read_as_a_page();
    EXPECT_TRUE(next.first == whole);
    EXPECT_EQ(next.second, (std::map<std::string, int>{{"HIT", parts}}));
  }
  EXPECT_EQ(requests(), before + 1) << "which asks itself";
}

TEST_F(Cache, WhatIsLiveOrChangesGoesThrough) {
  WsClient client(port_, "face");
  ASSERT_EQ(client.status(), 101);
  EXPECT_TRUE(client.credit(2));
  EXPECT_TRUE(client.next_of("frame"));
  const double before = requests();
  for (int i = 0; i < 3; ++i) EXPECT_THAT(request(port_, "GET", "/api/streams").body, HasSubstr("\"face\""));
  EXPECT_EQ(requests(), before + 4);
  for (int i = 0; i < 2; ++i) {
    const Response none = request(port_, "GET", "/recordings/none.mcap");
    EXPECT_EQ(none.status, 404);
    EXPECT_EQ(status_of(none), "none") << "nothing is added to errors, and nothing of them kept";
  }
  EXPECT_EQ(requests(), before + 7);
}

TEST_F(Cache, WhatIsBeingWrittenIsReadAsItGrows) {
  Process publisher(publish_face(20'000));
  const fs::path growing = folder_ / "growing.mcap";
  Process recorder(on_loopback({"record", "face", "--out", growing}));
  ASSERT_TRUE(wait_for_size(growing, 200'000)) << recorder.err();
  nginx_->signal(SIGQUIT);
  nginx_->wait();
  web_.emplace(std::vector<std::string>{program("relievo"), "web", growing, "--listen", "127.0.0.1:0"});
  origin_ = viewer_port(*web_);
  ASSERT_TRUE(start_nginx());
  const auto get = [&](const std::string& headers) {
    return request(port_, "GET", "/recordings/face.mcap", headers);
  };
  Response first;
  ASSERT_TRUE(eventually([&] {
    first = get("Range: bytes=0-99\r\n");
    return first.status == 206;
  }));
  const std::string etag = first.headers.at("etag");
  EXPECT_THAT(etag, HasSubstr("growing"));
  EXPECT_TRUE(eventually([&] {
    const Response more = get("Range: bytes=0-0\r\nIf-None-Match: " + etag + "\r\n");
    EXPECT_TRUE(more.status == 304 || more.status == 206) << more.status;
    return more.status == 206 && more.headers.at("etag") != etag;
  }));
  const Response same = get("Range: bytes=0-99\r\nIf-Range: " + etag + "\r\n");
  EXPECT_EQ(same.status, 206) << "who began with it goes on with it";
  EXPECT_EQ(same.headers.at("content-range"), first.headers.at("content-range"));
  recorder.signal(SIGINT);
  EXPECT_EQ(recorder.wait(), 0) << recorder.err();
}

}  // namespace
}  // namespace relievo::test
