// SPDX-License-Identifier: Apache-2.0
// Proves: https and wss work, speak nothing older than TLS 1.2, tell who comes without, and take a new
// certificate without a client losing its stream; one out of its time is said.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <fstream>

#include "base/time.h"

#include "tests/support/temp_folder.h"
#include "tests/support/tls_client.h"
#include "tests/unit/web/gateway_fixture.h"

namespace relievo::test {
namespace {

using testing::HasSubstr;
using testing::Not;

constexpr long kDay_s = 24 * 3600;

std::string date_in(long s) {
  return utc_text(utc_now_ns() + s * kNanosecondsPerSecond, "%Y-%m-%d");
}

class GatewayTls : public GatewayTest {
 protected:
  void SetUp() override {
    ASSERT_TRUE(make_certificate(cert, key, "first"));
    start({.port = 0, .web = {.tls_cert = cert, .tls_key = key}});
  }
  Response get(const std::string& target) {
    TlsClient client(port);
    return request(client, port, "GET", target);
  }

  void make(const std::string& name, Validity validity) const {
    ASSERT_TRUE(make_certificate(cert, key, name, "", validity));
  }
  /// Until when the gateway says that its certificate is valid, from now on, in days.
  double days_left() {
    const double until_s = metric_in(get("/metrics").body, "relievo_gateway_certificate_expiry_seconds");
    return std::round((until_s - seconds(utc_now_ns())) / static_cast<double>(kDay_s));
  }

  TempFolder folder;
  const std::string cert = folder / "cert.pem", key = folder / "key.pem";
};

TEST_F(GatewayTls, ServesThePageAndAStream) {
  gateway->announce(make_info());
  EXPECT_EQ(get("/healthz").body, "ok\n");
  const auto page = get("/");
  EXPECT_EQ(page.status, 200);
  EXPECT_EQ(page.headers.count("strict-transport-security"), 0u) << "for all of localhost's ports";

  auto tls = std::make_unique<TlsClient>(port);
  ASSERT_TRUE(tls->secured());
  WsClient client(std::move(tls), port, "/ws/face");
  ASSERT_EQ(client.status(), 101);
  ASSERT_TRUE(client.next_of("info"));
  client.credit(8);
  for (std::uint64_t i = 0; i < 20; ++i) {
    gateway->publish("face", make_frame(i, 300'000));
    const auto frame = client.next_of("frame");
    ASSERT_TRUE(frame) << i;
    EXPECT_EQ(frame->data.substr(48), std::string(300'000, static_cast<char>(i)));
    client.credit(1);
  }
}

TEST_F(GatewayTls, KeepsBrowsersToIt) {
  start({.port = 0, .web = {.tls_cert = cert, .tls_key = key, .origins = {"https://rig.example"}}});
  TlsClient client(port);
  client.send("GET / HTTP/1.1\r\nHost: rig.example\r\n\r\n");
  EXPECT_EQ(read_response(client).headers.at("strict-transport-security"), "max-age=31536000");
}

TEST_F(GatewayTls, WhoSpeaksPlainIsSentToHttps) {
  const auto sent = request(port, "GET", "/?stream=face");
  EXPECT_EQ(sent.status, 308);
  EXPECT_EQ(sent.headers.at("location"), "https://127.0.0.1:" + std::to_string(port) + "/?stream=face");
  EXPECT_EQ(request(port, "GET", "/api/streams").status, 308) << "nothing is told in plain";
  EXPECT_EQ(WsClient(port, "face").status(), 308);
}

TEST_F(GatewayTls, OldVersionsAndNoiseAreRefusedAndCounted) {
  start({.port = 0,
         .web = {.tls_cert = cert, .tls_key = key},
         .request_time = 2s});  // enough for who is no noise
  TcpClient noise(port);
  noise.send("\x16\x03\x01 this is no client's hello and never will be one");
  while (noise.receive()) {
  }
  EXPECT_TRUE(noise.at_end());
  EXPECT_NE(get("/metrics").body.find("relievo_gateway_refused_total{reason=\"tls\"} 1\n"),
            std::string::npos);
}

TEST_F(GatewayTls, ANewCertificateReachesNewClientsAndDisturbsNoOther) {
  gateway->announce(make_info());
  auto tls = std::make_unique<TlsClient>(port);
  EXPECT_EQ(tls->peer_name(), "first");
  WsClient client(std::move(tls), port, "/ws/face");
  ASSERT_TRUE(client.next_of("info"));
  client.credit(8);

  ASSERT_TRUE(make_certificate(cert, folder / "other.pem", "second, without its key"));
  EXPECT_EQ(TlsClient(port).peer_name(), "first") << "the two do not fit together yet";
  ASSERT_TRUE(make_certificate(cert, key, "second"));
  EXPECT_EQ(TlsClient(port).peer_name(), "second");
  std::ofstream(cert) << "no certificate";
  EXPECT_EQ(TlsClient(port).peer_name(), "second");
  ASSERT_TRUE(make_pipe(cert));
  EXPECT_EQ(TlsClient(port).peer_name(), "second") << "nobody waits for who writes to it";

  gateway->publish("face", make_frame(0));
  EXPECT_TRUE(client.next_of("frame"));
}

TEST_F(GatewayTls, ACertificateOutOfItsTimeIsSaidOnce) {
  const struct {
    Validity validity;
    std::string said, date;
  } cases[] = {{{-9 * kDay_s, -2 * kDay_s}, " has expired on ", date_in(-2 * kDay_s)},
               {{5 * kDay_s, 90 * kDay_s}, " is valid from ", date_in(5 * kDay_s)},
               {{-9 * kDay_s, 13 * kDay_s}, " expires on ", date_in(13 * kDay_s)}};
  for (const auto& c : cases) {
    make("first", {});
    start({.port = 0, .web = {.tls_cert = cert, .tls_key = key}});
    testing::internal::CaptureStderr();
    if (c.said != " has expired on ") {  // which would not take a valid one's place
      make("late", c.validity);
      EXPECT_EQ(TlsClient(port).peer_name(), "late");
      EXPECT_EQ(TlsClient(port).peer_name(), "late");
      const std::string log = testing::internal::GetCapturedStderr();
      EXPECT_THAT(log, HasSubstr("warning: the certificate " + cert + c.said + c.date));
      EXPECT_EQ(log.find(c.said), log.rfind(c.said)) << "once";
      testing::internal::CaptureStderr();
    }
    make("late", c.validity);
    start({.port = 0, .web = {.tls_cert = cert, .tls_key = key}});
    EXPECT_EQ(TlsClient(port).peer_name(), "late") << "whose certificate it is may know better";
    const std::string log = testing::internal::GetCapturedStderr();
    EXPECT_THAT(log, HasSubstr("warning: the certificate " + cert + c.said + c.date));
    EXPECT_EQ(log.find(c.said), log.rfind(c.said)) << "once";
  }
  testing::internal::CaptureStderr();
  make("good", {});
  start({.port = 0, .web = {.tls_cert = cert, .tls_key = key}});
  EXPECT_EQ(TlsClient(port).peer_name(), "good");
  EXPECT_THAT(testing::internal::GetCapturedStderr(), Not(HasSubstr("warning")));
}

TEST_F(GatewayTls, AnExpiredCertificateDoesNotReplaceAValidOne) {
  EXPECT_EQ(TlsClient(port).peer_name(), "first");
  testing::internal::CaptureStderr();
  make("expired", {-9 * kDay_s, -2 * kDay_s});
  EXPECT_EQ(TlsClient(port).peer_name(), "first");
  EXPECT_THAT(testing::internal::GetCapturedStderr(),
              HasSubstr("the old certificate stays: " + cert + " has expired on " + date_in(-2 * kDay_s)));
  ASSERT_TRUE(gateway->apply({.tls_cert = cert, .tls_key = key}));
  EXPECT_EQ(TlsClient(port).peer_name(), "first") << "nor where the configuration is read again";
  EXPECT_EQ(days_left(), 90);
  make("next", {-9 * kDay_s, 30 * kDay_s});
  EXPECT_EQ(TlsClient(port).peer_name(), "next");

  make("expired", {-9 * kDay_s, -2 * kDay_s});
  start({.port = 0, .web = {.tls_cert = cert, .tls_key = key}});
  make("expired later", {-9 * kDay_s, -kDay_s});
  EXPECT_EQ(TlsClient(port).peer_name(), "expired later") << "of two expired ones the newer file";
}

TEST_F(GatewayTls, MetricsSayUntilWhenTheCertificateIsValid) {
  EXPECT_EQ(days_left(), 90);
  make("next", {-60, 30 * kDay_s});
  EXPECT_EQ(days_left(), 30);
  start({.port = 0});
  EXPECT_EQ(metric("relievo_gateway_certificate_expiry_seconds"), -1) << "no certificate";
}

TEST_F(GatewayTls, FilesThatCannotBeUsedAreOneClearLine) {
  std::ofstream(folder / "text") << "no certificate";
  const std::string text = folder / "text";
  ASSERT_TRUE(make_certificate(folder / "c2", folder / "k2", "another"));
  ASSERT_TRUE(make_pipe(folder / "pipe"));
  // Of which OpenSSL asks the password at the terminal, where there is one.
  ASSERT_TRUE(make_certificate(folder / "c3", folder / "k3", "a third", "password"));
  const struct {
    std::string cert, key, named;
  } cases[] = {{folder / "missing", key, "missing"},
               {text, key, text},
               {cert, text, text},
               {folder / "pipe", key, folder / "pipe"},
               {cert, folder / "pipe", folder / "pipe"},
               {folder / "c3", folder / "k3", folder / "k3"},
               {cert, folder / "k2", folder / "k2"}};
  for (const auto& c : cases) {
    const auto made = Gateway::start({.port = 0, .web = {.tls_cert = c.cert, .tls_key = c.key}});
    ASSERT_FALSE(made.ok()) << c.named;
    EXPECT_NE(made.error().message.find(c.named), std::string::npos) << made.error().message;
    EXPECT_EQ(made.error().message.find('\n'), std::string::npos);
  }
}

}  // namespace
}  // namespace relievo::test
