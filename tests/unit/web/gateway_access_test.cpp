// SPDX-License-Identifier: Apache-2.0
// Proves: who has no token, a wrong one, or comes from another site's page sees nothing and is counted; who
// has one gets in by a header, a cookie or once by the address.
#include <gtest/gtest.h>

#include <chrono>
#include <filesystem>
#include <fstream>

#include "tests/support/temp_folder.h"
#include "tests/unit/web/gateway_fixture.h"
#include "web/gateway/access.h"

namespace relievo::test {
namespace {

const std::string kToken = "correct-horse-battery";

std::string bearer(const std::string& token) {
  return "Authorization: Bearer " + token + "\r\n";
}

TEST(FileMarks, AreOthersWhereAFileIsWrittenToWithinATickOfItsTime) {
  const TempFolder folder;
  const auto file = folder / "file";
  std::ofstream(file) << "one";
  // As file systems set times that go by a clock of 100 Hz.
  const auto touch = [&] {
    using Ticks = std::chrono::duration<std::int64_t, std::centi>;
    const auto now = std::filesystem::file_time_type::clock::now();
    std::filesystem::last_write_time(file, std::chrono::floor<Ticks>(now));
  };
  touch();
  const FileMark mark = settled_mark_of(file);
  touch();
  EXPECT_NE(mark_of(file).time_ns, mark.time_ns);
  EXPECT_EQ(settled_mark_of(folder / "none"), FileMark{});
}

class GatewayTokens : public GatewayTest {
 protected:
  void SetUp() override {
    std::ofstream(file) << "# of the lab\n\n" << kToken << "\nanother.token_of-16\n";
    start({.port = 0, .web = {.token_file = file}});
    gateway->announce(make_info());
  }
  double refused(const std::string& reason) {
    return metric_in(request(port, "GET", "/metrics", bearer(kToken)).body, refused_for(reason));
  }

  TempFolder folder;
  const std::string file = folder / "tokens";
};

TEST_F(GatewayTokens, WithoutOneNothingIsTold) {
  for (const char* target : {"/", "/api/streams", "/metrics", "/index.html", "/nothing"})
    EXPECT_EQ(request(port, "GET", target).status, 401) << target;
  EXPECT_EQ(WsClient(port, "face").status(), 401);
  EXPECT_EQ(request(port, "GET", "/healthz").status, 200) << "who watches over the machine needs none";
  EXPECT_EQ(refused("token"), 6);
  EXPECT_NE(request(port, "GET", "/").body.find("name=\"token\""), std::string::npos) << "a person is asked";
}

TEST_F(GatewayTokens, AWrongOneIsNone) {
  for (const std::string token :
       {"", "correct-horse-batter", "correct-horse-batteryy", "Correct-horse-battery", "# of the lab",
        "correct-horse-battery,another.token_of-16"}) {
    EXPECT_EQ(request(port, "GET", "/api/streams", bearer(token)).status, 401) << token;
    EXPECT_EQ(request(port, "GET", "/api/streams?token=" + token.substr(0, token.find(' '))).status, 401);
  }
  EXPECT_EQ(request(port, "GET", "/api/streams", "Authorization: Basic " + kToken + "\r\n").status, 401);
  EXPECT_EQ(WsClient(port, "face", bearer("wrong")).status(), 401);
}

TEST_F(GatewayTokens, ProgramsSendAHeaderOrAQuery) {
  EXPECT_EQ(request(port, "GET", "/api/streams", bearer(kToken)).status, 200);
  EXPECT_EQ(request(port, "GET", "/api/streams", bearer("another.token_of-16")).status, 200);
  for (const char* scheme : {"bearer ", "BEARER ", "Bearer   "})
    EXPECT_EQ(request(port, "GET", "/api/streams", "Authorization: " + (scheme + kToken) + "\r\n").status,
              200)
        << scheme;
  EXPECT_EQ(request(port, "GET", "/api/streams?token=" + kToken).status, 200);
  WsClient client(port, "face", bearer(kToken));
  EXPECT_EQ(client.status(), 101);
  EXPECT_TRUE(client.next_of("info"));
  EXPECT_EQ(WsClient(port, "face?token=" + kToken).status(), 101);
}

TEST_F(GatewayTokens, OtherOptionsHoldFromThenOnAndNobodyIsDisconnected) {
  WsClient client(port, "face", bearer(kToken));
  ASSERT_TRUE(client.next_of("info"));
  ASSERT_TRUE(gateway->apply({.origins = {"https://a.example"}, .max_clients = 1}));
  EXPECT_TRUE(eventually([&] { return request(port, "GET", "/api/streams").status == 200; }))
      << "no token is needed now";
  const std::string listed = "Origin: https://a.example\r\n";
  EXPECT_EQ(request(port, "GET", "/api/streams", listed).headers.at("access-control-allow-origin"),
            "https://a.example");
  EXPECT_EQ(WsClient(port, "face", listed).status(), 503) << "the one place is taken";
  ASSERT_TRUE(gateway->apply({.token_file = file, .max_per_address = 5, .max_rate = 1000}));
  EXPECT_TRUE(eventually([&] { return request(port, "GET", "/api/streams").status == 401; }));
  EXPECT_TRUE(client.credit(1));
  gateway->publish("face", make_frame(0));
  EXPECT_TRUE(client.next_of("frame")) << "who watches goes on";
}

TEST_F(GatewayTokens, OptionsWithAMistakeChangeNothing) {
  const Status missing = gateway->apply({.token_file = folder / "none"});
  ASSERT_FALSE(missing);
  EXPECT_NE(missing.error().message.find("none"), std::string::npos) << missing.error().message;
  EXPECT_FALSE(gateway->apply({.tls_cert = folder / "a.pem", .tls_key = folder / "a.key"}));
  EXPECT_EQ(request(port, "GET", "/api/streams").status, 401);
  EXPECT_EQ(request(port, "GET", "/api/streams", bearer(kToken)).status, 200);
}

TEST_F(GatewayTokens, WhereOthersReachItNoneIsNotMadeLater) {
  start({.host = "0.0.0.0", .port = 0, .web = {.token_file = file}});
  EXPECT_FALSE(gateway->apply({})) << "nobody would be told the token";
  EXPECT_EQ(request(port, "GET", "/api/streams").status, 401);
  ASSERT_TRUE(gateway->apply({.open = true}));
  EXPECT_TRUE(eventually([&] { return request(port, "GET", "/api/streams").status == 200; }));
  start({.host = "0.0.0.0", .port = 0});
  const std::string made = gateway->made_token();
  ASSERT_FALSE(made.empty());
  ASSERT_TRUE(gateway->apply({.token_file = file}));
  EXPECT_TRUE(eventually([&] { return request(port, "GET", "/api/streams", bearer(kToken)).status == 200; }));
  ASSERT_TRUE(gateway->apply({.max_clients = 3}));
  EXPECT_TRUE(eventually([&] { return request(port, "GET", "/api/streams", bearer(made)).status == 200; }))
      << "the one that was printed";
}

TEST_F(GatewayTokens, ABrowserKeepsItAsACookieAndNotInTheAddress) {
  const auto sent = request(port, "GET", "/?stream=face&token=" + kToken + "&x=1");
  ASSERT_EQ(sent.status, 303);
  const std::string next = sent.headers.at("location");
  EXPECT_EQ(next.find(kToken), std::string::npos) << next;
  const std::string cookie = sent.headers.at("set-cookie");
  EXPECT_NE(cookie.find("; HttpOnly"), std::string::npos);
  EXPECT_NE(cookie.find("; SameSite=Lax"), std::string::npos);
  const std::string header = "Cookie: a=b; " + cookie.substr(0, cookie.find(';')) + "; c=d\r\n";
  const auto led = request(port, "GET", next, header);
  ASSERT_EQ(led.status, 303);
  EXPECT_EQ(led.headers.at("location"), "/?stream=face&x=1");
  EXPECT_EQ(request(port, "GET", "/?stream=face&x=1", header).status, 200);
  EXPECT_EQ(WsClient(port, "face", header).status(), 101);
  EXPECT_EQ(WsClient(port, "face", header + "Origin: http://evil.example\r\n").status(), 403)
      << "a cookie comes along with whatever page asks";
  EXPECT_EQ(request(port, "GET", "/", "Cookie: x" + header.substr(13)).status, 401);
}

TEST_F(GatewayTokens, TheRigsPageTakesATokenAsTheViewersDoes) {
  const auto sent = request(port, "GET", "/rig?token=" + kToken + "&stream=face");
  ASSERT_EQ(sent.status, 303);
  const std::string cookie = sent.headers.at("set-cookie");
  const std::string header = "Cookie: " + cookie.substr(0, cookie.find(';')) + "\r\n";
  EXPECT_EQ(request(port, "GET", sent.headers.at("location"), header).headers.at("location"),
            "/rig?stream=face");
  EXPECT_NE(cookie.find("; Path=/;"), std::string::npos) << "what the page loads needs it, too";
  EXPECT_EQ(request(port, "GET", "/api/streams", header).status, 200);
}

TEST_F(GatewayTokens, ABrowserThatKeepsNoCookiesIsToldSo) {
  for (const std::string address : {"/", "/rig?stream=face"}) {
    const auto sent = request(port, "GET", address + (address == "/" ? "?" : "&") + "token=" + kToken);
    ASSERT_EQ(sent.status, 303);
    const auto form = request(port, "GET", sent.headers.at("location"));
    EXPECT_EQ(form.status, 401);
    EXPECT_NE(form.body.find("allow cookies"), std::string::npos) << form.body;
    EXPECT_EQ(form.body.find("signed-in"), std::string::npos) << "the form leads to what was asked for";
    EXPECT_EQ(request(port, "GET", address).body.find("allow cookies"), std::string::npos);
  }
}

TEST_F(GatewayTokens, TheFormLeadsToWhatWasAskedFor) {
  const auto form = [&](const std::string& target) { return request(port, "GET", target).body; };
  const auto has = [](const std::string& text, const std::string& part) {
    return text.find(part) != std::string::npos;
  };
  const std::string viewer = form("/?stream=face&token=wrong&quality=auto");
  EXPECT_FALSE(has(viewer, "action=")) << "to the page's own address: " << viewer;
  EXPECT_TRUE(has(viewer, "<input type=\"hidden\" name=\"stream\" value=\"face\">")) << viewer;
  EXPECT_TRUE(has(viewer, "<input type=\"hidden\" name=\"quality\" value=\"auto\">")) << viewer;
  EXPECT_FALSE(has(viewer, "wrong")) << "the token is asked for anew";
  const std::string rig = form("/rig?stream=face");
  EXPECT_FALSE(has(rig, "action=")) << rig;
  EXPECT_TRUE(has(rig, "name=\"stream\"")) << rig;
  for (const char* hostile :
       {"/?stream=%22%3E%3Cscript%3Ealert(1)%3C/script%3E", "/?stream=\"><script>alert(1)</script>",
        "/?\"><script>=1", "/?a=%27%3cscript%3e", "/?stream=%", "/?=&&%zz=%0", "/?a"}) {
    const std::string page = form(hostile);
    EXPECT_TRUE(has(page, "name=\"token\"")) << hostile;
    EXPECT_FALSE(has(page, "<script")) << page;
  }
}

TEST_F(GatewayTokens, WhoSendsOneThatIsNotKnownIsToldSo) {
  const std::string told = "not known";
  const std::string kept = "Cookie: relievo_token_" + std::to_string(port) + "=made-yesterday-or-so\r\n";
  EXPECT_EQ(request(port, "GET", "/").body.find(told), std::string::npos);
  EXPECT_EQ(request(port, "GET", "/?token=").body.find(told), std::string::npos);
  for (const auto& [target, headers] : {std::pair<std::string, std::string>("/?token=wrong", ""),
                                        {"/rig?stream=face&token=wrong", ""},
                                        {"/", kept},
                                        {"/api/streams?token=wrong", ""},
                                        {"/api/streams", bearer("wrong")}}) {
    const auto response = request(port, "GET", target, headers);
    EXPECT_EQ(response.status, 401) << target;
    EXPECT_NE(response.body.find(told), std::string::npos) << target << headers << response.body;
  }
}

TEST_F(GatewayTokens, SpacesPastedWithOneAreNoneOfIt) {
  for (const std::string around : {"+", "%20", "%0A"}) {
    auto sent = request(port, "GET", "/?token=" + around + kToken + around);
    EXPECT_EQ(sent.status, 303) << around;
    EXPECT_NE(sent.headers["set-cookie"].find("=" + kToken + ";"), std::string::npos) << around;
  }
  EXPECT_EQ(request(port, "GET", "/?token=correct-horse+-battery").status, 401);
}

TEST_F(GatewayTokens, ANewFileCountsAndABrokenOneDoesNot) {
  const auto status = [&](const std::string& token) {
    return request(port, "GET", "/api/streams", bearer(token)).status;
  };
  WsClient client(port, "face", bearer(kToken));
  ASSERT_TRUE(client.next_of("info"));
  std::ofstream(file) << "a-token-made-yesterday\n";
  EXPECT_EQ(status("a-token-made-yesterday"), 200);
  EXPECT_EQ(status(kToken), 401);
  std::ofstream(file) << "short\n";
  EXPECT_EQ(status("a-token-made-yesterday"), 200);
  EXPECT_EQ(status("short"), 401);
  client.credit(1);
  gateway->publish("face", make_frame(0));
  EXPECT_TRUE(client.next_of("frame")) << "who watches goes on";
}

TEST_F(GatewayTokens, OneThatWasTakenOutIsRefusedOnAConnectionThatIsKept) {
  TcpClient client(port);
  const auto ask = [&](const std::string& method, const std::string& target) {
    client.send(method + " " + target + " HTTP/1.1\r\nHost: localhost\r\nContent-Length: 0\r\n" +
                bearer(kToken) + "\r\n");
    return read_response(client).status;
  };
  ASSERT_EQ(ask("GET", "/api/streams"), 200);
  ASSERT_EQ(ask("POST", "/api/projector"), 404);
  ASSERT_EQ(ask("GET", "/recordings/none.mcap"), 404);
  std::ofstream(file) << "a-token-made-yesterday\n";
  EXPECT_EQ(ask("GET", "/api/streams"), 401);
  EXPECT_EQ(ask("POST", "/api/projector"), 401);
  EXPECT_EQ(ask("GET", "/recordings/none.mcap"), 401);
  std::ofstream(file) << kToken << "\n";
  EXPECT_EQ(ask("GET", "/api/streams"), 200) << "all on one connection";
}

TEST_F(GatewayTokens, AFileMovedInItsPlaceCountsWhateverItsTime) {
  const std::string next = folder / "next";
  std::ofstream(file) << kToken << "\n";
  ASSERT_EQ(request(port, "GET", "/api/streams", bearer(kToken)).status, 200);
  std::ofstream(next) << "incorrect-horse-batte\n";  // as long
  std::filesystem::last_write_time(next, std::filesystem::last_write_time(file));
  std::filesystem::rename(next, file);
  EXPECT_EQ(request(port, "GET", "/api/streams", bearer(kToken)).status, 401);
}

TEST(Tokens, FilesThatCannotBeUsedAreOneClearLine) {
  const TempFolder folder;
  const std::string file = folder / "tokens";
  EXPECT_FALSE(Tokens::load(file).ok());
  EXPECT_FALSE(Tokens::load(folder.path()).ok());
  for (const char* text : {"", "# nothing\n", "short\n", "sixteen characters\n", "quoted\"0123456789\n"}) {
    std::ofstream(file) << text;
    const auto loaded = Tokens::load(file);
    ASSERT_FALSE(loaded.ok()) << text;
    EXPECT_NE(loaded.error().message.find(file), std::string::npos);
    EXPECT_NE(loaded.error().message.find("openssl rand"), std::string::npos) << loaded.error().message;
  }
  std::ofstream(file) << std::string(2 << 20, '#');
  EXPECT_FALSE(Tokens::load(file).ok()) << "it is no list of tokens";
  ASSERT_TRUE(make_pipe(file));
  EXPECT_FALSE(Tokens::load(file).ok());
  const auto made = Tokens::make(), other = Tokens::make();
  ASSERT_TRUE(made.ok() && other.ok());
  EXPECT_TRUE(made->accepts(made->first()));
  EXPECT_FALSE(made->accepts(other->first()));
  EXPECT_FALSE(Tokens::none().needed());
}

using GatewayReach = GatewayTest;

TEST_F(GatewayReach, OnAnAddressOfOthersATokenIsMade) {
  EXPECT_EQ(gateway->made_token(), "");
  start({.host = "0.0.0.0", .port = 0});
  ASSERT_EQ(gateway->made_token().size(), 48u);
  EXPECT_EQ(request(port, "GET", "/api/streams").status, 401);
  EXPECT_EQ(request(port, "GET", "/api/streams", bearer(gateway->made_token())).status, 200);
  start({.host = "0.0.0.0", .port = 0, .web = {.open = true}});
  EXPECT_EQ(gateway->made_token(), "");
  EXPECT_EQ(request(port, "GET", "/api/streams").status, 200);
}

TEST_F(GatewayReach, EveryInterfaceIsAlsoThatOfIpv6) {
  start({.host = "", .port = 0, .web = {.open = true, .max_per_address = 1}});
  TcpClient v4("127.0.0.1", port, kPatience), v6("::1", port, kPatience);
  ASSERT_TRUE(v4.connected());
  v4.send("GET /healthz HTTP/1.1\r\nHost: localhost\r\n\r\n");
  EXPECT_EQ(read_response(v4).status, 200);
  EXPECT_EQ(request(port, "GET", "/healthz").status, 0) << "an address is the same however it is written";
  if (!v6.connected()) GTEST_SKIP() << "this machine has no IPv6";
  v6.send("GET /healthz HTTP/1.1\r\nHost: localhost\r\n\r\n");
  EXPECT_EQ(read_response(v6).status, 200);
}

TEST_F(GatewayReach, PagesOfListedSitesMayWatch) {
  start({.port = 0, .web = {.origins = {"https://viewer.example"}}});
  const std::string listed = "Origin: https://viewer.example\r\n";
  EXPECT_EQ(WsClient(port, "face", listed).status(), 101);
  EXPECT_EQ(WsClient(port, "face", "Origin: https://viewer.example.evil\r\n").status(), 403);
  EXPECT_EQ(WsClient(port, "face", "Origin: http://viewer.example\r\n").status(), 403);
  const auto shared = request(port, "GET", "/api/streams", listed);
  EXPECT_EQ(shared.headers.at("access-control-allow-origin"), "https://viewer.example");
  const auto other = request(port, "GET", "/api/streams", "Origin: https://evil.example\r\n");
  EXPECT_EQ(other.headers.count("access-control-allow-origin"), 0u);
  EXPECT_EQ(request(port, "OPTIONS", "/api/streams", listed).status, 204);
  EXPECT_EQ(request(port, "OPTIONS", "/api/streams", "Origin: https://evil.example\r\n").status, 405);
  EXPECT_EQ(metric(refused_for("origin")), 2);

  TcpClient proxy(port);
  proxy.send("GET /healthz HTTP/1.1\r\nHost: viewer.example\r\n\r\n");
  EXPECT_EQ(read_response(proxy).status, 200);
}

}  // namespace
}  // namespace relievo::test
