// SPDX-License-Identifier: Apache-2.0
// Proves: the gateway's HTTP side answers what it should, refuses what it should, and outlives hostile input.
#include <gtest/gtest.h>

#include <ctime>
#include <nlohmann/json.hpp>

#include "base/time.h"
#include "tests/unit/web/gateway_fixture.h"
#include "web/gateway/routes.h"

namespace relievo::test {
namespace {

using Json = nlohmann::json;
using GatewayHttp = GatewayTest;

TEST_F(GatewayHttp, HealthzIsOk) {
  const auto response = request(port, "GET", "/healthz");
  EXPECT_EQ(response.status, 200);
  EXPECT_EQ(response.body, "ok\n");
}

TEST_F(GatewayHttp, AnswersSayTheServersTime) {
  const std::int64_t before_s = utc_now_ns() / kNanosecondsPerSecond;
  for (const char* path : {"/healthz", "/", "/api/streams", "/nothing"}) {
    const auto response = request(port, "GET", path);
    ASSERT_TRUE(response.headers.contains("date")) << path;
    std::tm utc{};
    const char* end = strptime(response.headers.at("date").c_str(), "%a, %d %b %Y %H:%M:%S GMT", &utc);
    ASSERT_TRUE(end != nullptr && *end == '\0') << response.headers.at("date");
    EXPECT_GE(timegm(&utc), before_s);
    EXPECT_LE(timegm(&utc), utc_now_ns() / kNanosecondsPerSecond);
  }
}

TEST_F(GatewayHttp, PageAndItsFilesAreServedWithPolicy) {
  const auto page = request(port, "GET", "/");
  ASSERT_EQ(page.status, 200);
  EXPECT_EQ(page.headers.at("content-type"), "text/html; charset=utf-8");
  EXPECT_NE(page.body.find("<title>Relievo"), std::string::npos);
  EXPECT_EQ(page.headers.at("cache-control"), "no-cache");
  const std::string policy = page.headers.at("content-security-policy");
  EXPECT_NE(policy.find("script-src 'self' 'wasm-unsafe-eval'"), std::string::npos);
  EXPECT_EQ(policy.find("unsafe-inline"), std::string::npos) << policy;
  EXPECT_EQ(policy.find("http"), std::string::npos) << "the page needs another host: " << policy;
  EXPECT_EQ(page.headers.at("x-content-type-options"), "nosniff");

  const auto at = page.body.find("assets/");
  ASSERT_NE(at, std::string::npos);
  const std::string script = page.body.substr(at, page.body.find('"', at) - at);
  const auto file = request(port, "GET", "/" + script);
  EXPECT_EQ(file.status, 200) << script;
  EXPECT_NE(file.headers.at("cache-control").find("immutable"), std::string::npos);
  const auto again = request(port, "GET", "/" + script, "If-None-Match: " + file.headers.at("etag") + "\r\n");
  EXPECT_EQ(again.status, 304);
  EXPECT_TRUE(again.body.empty());
}

TEST_F(GatewayHttp, StreamsAreListed) {
  auto empty = Json::parse(request(port, "GET", "/api/streams").body);
  EXPECT_EQ(empty["hint"], "start one with relievo-server serve");
  EXPECT_TRUE(empty["streams"].empty());

  gateway->announce(make_info());
  gateway->publish("face", make_frame(0));
  ServerStatus status;
  status.stream = "face";
  status.state = StreamState::kStalled;
  status.frame_rate = 12.5;
  status.message = "no \"signal\" \xff";  // not UTF-8
  gateway->publish(status);
  const auto listed = Json::parse(request(port, "GET", "/api/streams").body);
  EXPECT_EQ(listed["hint"], "") << "there is one";
  const auto stream = listed["streams"][0];
  EXPECT_EQ(stream["name"], "face");
  EXPECT_EQ(stream["source"], "sim:face");
  EXPECT_EQ(stream["state"], "stalled");
  EXPECT_EQ(stream["frame_rate"], 12.5);
  EXPECT_EQ(stream["frames"], 1);
  EXPECT_EQ(stream["rig"]["camera"]["fx"], 800.0);
  EXPECT_EQ(stream["rig"]["stripes"], 90);

  gateway->withdraw("face");
  EXPECT_TRUE(Json::parse(request(port, "GET", "/api/streams").body)["streams"].empty());
}

TEST_F(GatewayHttp, MetricsCount) {
  gateway->announce(make_info());
  for (int i = 0; i < 3; ++i) gateway->publish("face", make_frame(static_cast<std::uint64_t>(i)));
  ServerStatus status;
  status.stream = "face";
  status.state = StreamState::kRunning;
  status.drops_encode = 7;
  status.filters.small_component = 12;
  status.step = {.mixed = 4, .regrouped = 2, .phase = 0.25, .drift_fields_s = -1.5};
  status.latency_ms = 40;
  gateway->publish(status);
  EXPECT_EQ(metric("relievo_gateway_frames_total{stream=\"face\"}"), 3);
  EXPECT_EQ(metric("relievo_gateway_clients"), 0);
  EXPECT_EQ(metric("relievo_stream_drops_total{stream=\"face\",place=\"encode\"}"), 7);
  EXPECT_EQ(metric("relievo_stream_filters_total{stream=\"face\",filter=\"small_component\"}"), 12);
  EXPECT_EQ(metric("relievo_stream_mixed_total{stream=\"face\"}"), 4);
  EXPECT_EQ(metric("relievo_stream_regrouped_total{stream=\"face\"}"), 2);
  EXPECT_EQ(metric("relievo_stream_step_phase{stream=\"face\"}"), 0.25);
  EXPECT_EQ(metric("relievo_stream_step_drift{stream=\"face\"}"), -1.5);
  EXPECT_EQ(metric("relievo_stream_state{stream=\"face\",state=\"running\"}"), 1);
  EXPECT_EQ(metric("relievo_stream_state{stream=\"face\",state=\"ended\"}"), 0);
  EXPECT_DOUBLE_EQ(metric("relievo_stream_latency_seconds{stream=\"face\"}"), 0.04);
}

TEST_F(GatewayHttp, WhatARecordingCountedIsNoCounter) {
  gateway->announce(make_info());
  gateway->offer("face", {.file = "/recorded/face.mcap"});
  ServerStatus status;
  status.stream = "face";
  status.frames_captured = 70;
  status.drops_encode = 7;
  status.latency_ms = 40;
  status.rungs = {{.rung = Rung::kReduced, .frames = 5}};
  gateway->publish(status);
  for (const char* name : {"relievo_stream_frames_captured_total{stream=\"face\"}",
                           "relievo_stream_mixed_total{stream=\"face\"}",
                           "relievo_stream_drops_total{stream=\"face\",place=\"encode\"}",
                           "relievo_stream_filters_total{stream=\"face\",filter=\"small_component\"}",
                           "relievo_stream_rung_frames_total{stream=\"face\",quality=\"reduced\"}"})
    EXPECT_EQ(metric(name), -1) << "it would go back with each pass: " << name;
  EXPECT_EQ(metric("relievo_gateway_frames_total{stream=\"face\"}"), 0) << "those of this gateway do not";
  EXPECT_DOUBLE_EQ(metric("relievo_stream_latency_seconds{stream=\"face\"}"), 0.04);
}

TEST_F(GatewayHttp, LatenciesAreHistograms) {
  gateway->announce(make_info());
  WsClient client(port, "face");
  client.credit(1);
  FrameMessage frame = make_frame(0);
  frame.capture_time_ns = utc_now_ns() - 3'500'000'000;
  frame.publish_time_ns = frame.capture_time_ns + 25'000'000;
  gateway->publish("face", frame);
  ASSERT_TRUE(client.next_of("frame"));
  const auto value = [&](const std::string& name, const std::string& until, const std::string& more) {
    return metric("relievo_gateway_latency_seconds_" + name + "{stream=\"face\",until=\"" + until + "\"" +
                  more + "}");
  };
  EXPECT_EQ(value("bucket", "published", ",le=\"0.02\""), 0);
  EXPECT_EQ(value("bucket", "published", ",le=\"0.03\""), 1);
  EXPECT_EQ(value("bucket", "published", ",le=\"+Inf\""), 1);
  EXPECT_DOUBLE_EQ(value("sum", "published", ""), 0.025);
  EXPECT_EQ(value("bucket", "here", ",le=\"2\""), 0);
  EXPECT_GE(value("sum", "here", ""), 3.5);
  EXPECT_TRUE(eventually([&] { return value("count", "sent", "") == 1; }));
  EXPECT_GE(value("sum", "sent", ""), value("sum", "here", ""));
  EXPECT_EQ(value("count", "taken", ""), 0) << "the credit that it began with is for no frame";
  client.credit(2);
  EXPECT_TRUE(eventually([&] { return value("count", "taken", "") == 1; }));
  EXPECT_GE(value("sum", "taken", ""), value("sum", "sent", ""));
}

TEST_F(GatewayHttp, UnknownPathsAndTraversalAreNotFound) {
  for (const char* target : {"/nothing", "/../../etc/passwd", "/assets/../../../etc/passwd",
                             "/%2e%2e/%2e%2e/etc/passwd", "/assets/", "//etc/passwd", "/index.html%00.js"}) {
    EXPECT_EQ(request(port, "GET", target).status, 404) << target;
  }
}

TEST_F(GatewayHttp, OtherMethodsAreRefused) {
  for (const char* method : {"POST", "PUT", "DELETE", "OPTIONS"}) {
    const auto response = request(port, method, "/api/streams");
    EXPECT_EQ(response.status, 405) << method;
    EXPECT_EQ(response.headers.at("allow"), "GET, HEAD");
  }
}

TEST_F(GatewayHttp, HeadHasTheLengthAndNoBody) {
  TcpClient client(port);
  client.send("HEAD / HTTP/1.1\r\nHost: localhost\r\n\r\nGET /healthz HTTP/1.1\r\nHost: localhost\r\n\r\n");
  const auto head = read_response(client, true);
  EXPECT_EQ(head.status, 200);
  EXPECT_GT(std::stoi(head.headers.at("content-length")), 100);
  const auto next = read_response(client);  // on the same connection: nothing of the body came before it
  EXPECT_EQ(next.status, 200);
  EXPECT_EQ(next.body, "ok\n");
}

TEST_F(GatewayHttp, WebSocketAddressesNeedAnUpgradeAndAName) {
  const auto plain = request(port, "GET", "/ws/face");
  EXPECT_EQ(plain.status, 426);
  EXPECT_EQ(plain.headers.at("upgrade"), "websocket");
  EXPECT_EQ(request(port, "GET", "/ws/").status, 400);
  EXPECT_EQ(request(port, "GET", "/ws/.hidden").status, 400);
  EXPECT_EQ(request(port, "GET", "/ws/a/b").status, 400);
}

TEST_F(GatewayHttp, ForeignPagesAreRefused) {
  const std::string own = "Origin: http://127.0.0.1:" + std::to_string(port) + "\r\n";
  EXPECT_EQ(WsClient(port, "face", own).status(), 101);
  EXPECT_EQ(WsClient(port, "face").status(), 101);
  EXPECT_EQ(WsClient(port, "face", "Origin: http://evil.example\r\n").status(), 403);
  EXPECT_EQ(WsClient(port, "face", "Origin: null\r\n").status(), 403);
  EXPECT_EQ(WsClient(port, "face", "Origin: http://127.0.0.1:1\r\n").status(), 403);
}

TEST(Origin, Rules) {
  EXPECT_TRUE(same_origin("http://Rig.local:8080", "rig.local:8080"));
  EXPECT_TRUE(same_origin("https://rig", "rig"));
  EXPECT_FALSE(same_origin("http://rig:8080", "rig"));
  EXPECT_FALSE(same_origin("file://rig", "rig"));
  EXPECT_FALSE(same_origin("http://", ""));
  EXPECT_TRUE(loopback_host("localhost:8080"));
  EXPECT_TRUE(loopback_host("127.0.0.1:8080"));
  EXPECT_TRUE(loopback_host("[::1]:8080"));
  EXPECT_TRUE(loopback_host("relievo.localhost"));
  EXPECT_FALSE(loopback_host("evil.example:8080"));
  EXPECT_FALSE(loopback_host("127.0.0.1.evil.example"));
  EXPECT_FALSE(loopback_host(":8080"));
}

// Which of them counts a proxy in front may see otherwise (RFC 9112, 3.2).
TEST_F(GatewayHttp, TwoNamesAtOnceAreRefused) {
  TcpClient client(port);
  client.send("GET /healthz HTTP/1.1\r\nHost: localhost\r\nHost: evil.example\r\n\r\n");
  EXPECT_EQ(read_response(client).status, 400);
}

TEST_F(GatewayHttp, ANameThatWasPointedAtLoopbackIsRefused) {
  TcpClient client(port);
  client.send("GET /api/streams HTTP/1.1\r\nHost: evil.example\r\n\r\n");
  EXPECT_EQ(read_response(client).status, 421);
}

// RFC 9112, 3.2; the name in an absolute address goes before it (3.2.2).
TEST_F(GatewayHttp, AHostThatIsMissingOrNoneIsRefused) {
  const auto status = [&](const std::string& head) {
    TcpClient client(port);
    client.send(head + "\r\n\r\n");
    return read_response(client).status;
  };
  EXPECT_EQ(status("GET /healthz HTTP/1.1"), 400);
  EXPECT_EQ(status("GET /healthz HTTP/1.0"), 200) << "which did not have it";
  for (const char* wrong :
       {"localhost/evil.example", "a b", "localhost:80x", "user@localhost", "[::1", "a:1:2"})
    EXPECT_EQ(status(std::string("GET /healthz HTTP/1.1\r\nHost: ") + wrong), 400) << wrong;
  for (const char* right : {"localhost", "127.0.0.1:80", "[::1]", "[::1]:8080", "x.localhost:1"})
    EXPECT_EQ(status(std::string("GET /healthz HTTP/1.1\r\nHost: ") + right), 200) << right;
  EXPECT_EQ(status("GET http://localhost/healthz HTTP/1.1\r\nHost: evil.example"), 200);
  EXPECT_EQ(status("GET http://evil.example/healthz HTTP/1.1\r\nHost: localhost"), 421);
  EXPECT_EQ(status("GET http://a@localhost/healthz HTTP/1.1\r\nHost: localhost"), 400);
  EXPECT_EQ(status("GET http:///healthz HTTP/1.1\r\nHost: localhost"), 400);
}

// A proxy in front and this server must see the same end of a request (RFC 9112, 6.3).
TEST_F(GatewayHttp, LengthsThatContradictEachOtherAreRefused) {
  for (const char* lengths :
       {"Content-Length: 4\r\nTransfer-Encoding: chunked", "Content-Length: 4\r\nContent-Length: 5",
        "Content-Length: +4", "Content-Length: 4, 5", "Content-Length: -1",
        "Content-Length: 99999999999999999999", "Transfer-Encoding: chunked, identity", "Content-Length : 4",
        " Content-Length: 4"}) {
    TcpClient client(port);
    client.send(std::string("POST /healthz HTTP/1.1\r\nHost: localhost\r\n") + lengths +
                "\r\n\r\n0\r\n\r\nGET /healthz HTTP/1.1\r\nHost: localhost\r\n\r\n");
    const int status = read_response(client).status;
    EXPECT_TRUE(status == 400 || status == 413 || status == 501) << lengths << ": " << status;
    while (client.receive()) continue;
    EXPECT_EQ(client.buffer(), "") << lengths << ": what comes behind it is no request";
  }
}

// RFC 9110, 10.1.1.
TEST_F(GatewayHttp, WhoAsksBeforeItSendsIsToldToGoOn) {
  const auto head = [](const std::string& more) {
    return "POST /api/streams HTTP/1.1\r\nHost: localhost\r\nContent-Length: " + more + "\r\n\r\n";
  };
  TcpClient client(port);
  client.send(head("4\r\nExpect: 100-Continue"));
  EXPECT_EQ(read_response(client).status, 100);
  client.send("body" + head("4\r\nExpect: 100-continue"));
  EXPECT_EQ(read_response(client).status, 405) << "the answer proper";
  EXPECT_EQ(read_response(client).status, 100) << "and so the next";
  client.send("body" + head("4\r\nExpect: 200-maybe"));
  EXPECT_EQ(read_response(client).status, 405);
  EXPECT_EQ(read_response(client).status, 417);
  TcpClient large(port);
  large.send(head("5000\r\nExpect: 100-continue"));
  EXPECT_EQ(read_response(large).status, 413) << "before anything of it is sent";
  TcpClient old(port);
  old.send("POST /api/streams HTTP/1.0\r\nContent-Length: 4\r\nExpect: 100-continue\r\n\r\nbody");
  EXPECT_EQ(read_response(old).status, 405) << "HTTP/1.0 does not know it";
}

TEST_F(GatewayHttp, PortInUseIsOneClearLine) {
  const auto second = Gateway::start({.port = port});
  ASSERT_FALSE(second.ok());
  EXPECT_EQ(second.error().message, "cannot listen on 127.0.0.1:" + std::to_string(port) +
                                        ": the port is in use: stop what listens there or give another");
}

TEST_F(GatewayHttp, AnAddressOfNobodyIsOneClearLine) {
  const auto result = Gateway::start({.host = "192.0.2.1", .port = 0});
  ASSERT_FALSE(result.ok());
  EXPECT_NE(result.error().message.find("192.0.2.1:0: "), std::string::npos);
  EXPECT_EQ(result.error().message.find('\n'), std::string::npos);
}

TEST_F(GatewayHttp, OversizedHeaderAndBodyAreRefused) {
  const auto header = request(port, "GET", "/", "X-Long: " + std::string(9000, 'x') + "\r\n");
  EXPECT_EQ(header.status, 431);
  const auto body = request(port, "POST", "/", "Content-Length: 1000000\r\n");
  EXPECT_EQ(body.status, 413);
  EXPECT_EQ(request(port, "GET", "/healthz").status, 200);
}

TEST_F(GatewayHttp, OutlivesGarbage) {
  std::uint32_t random = 1;
  int answered = 0;
  for (int i = 0; i < 100; ++i) {
    TcpClient client(port);
    ASSERT_TRUE(client.connected());
    std::string bytes;
    for (int k = 0; k < 20 + i * 10; ++k) {
      random = random * 1664525u + 1013904223u;
      bytes += static_cast<char>(random >> 24);
    }
    client.send(bytes + "\r\n\r\n");
    answered += read_response(client).status == 400;
  }
  EXPECT_GT(answered, 90);  // some begin like something else
  EXPECT_EQ(request(port, "GET", "/healthz").status, 200);
}

}  // namespace
}  // namespace relievo::test
