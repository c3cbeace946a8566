// SPDX-License-Identifier: Apache-2.0
// Proves: the gateway's texts are well formed whatever a stream is called or says.
#include "web/gateway/protocol.h"
#include "tests/support/metric.h"

#include <gtest/gtest.h>

#include <limits>
#include <nlohmann/json.hpp>

#include "tests/unit/web/gateway_fixture.h"

namespace relievo::test {
namespace {

TEST(Protocol, FramePrefixBytes) {
  FrameMessage frame;
  frame.sequence = 0x0102030405060708;
  frame.capture_time_ns = -1;
  const auto prefix = frame_prefix(frame, 3, 9);
  EXPECT_EQ(prefix[0], 48);
  EXPECT_EQ(prefix[8], 0x08);
  EXPECT_EQ(prefix[15], 0x01);
  EXPECT_EQ(prefix[23], 0xff);
  EXPECT_EQ(prefix[32], 9);
  EXPECT_EQ(prefix[40], 3);
}

TEST(Protocol, NumbersThatJsonLacksBecomeNull) {
  ServerStatus status;
  status.frame_rate = std::numeric_limits<double>::quiet_NaN();
  const auto json = nlohmann::json::parse(status_message(status));
  EXPECT_TRUE(json["frame_rate"].is_null());
}

TEST(Protocol, HostileNamesCannotForgeMetrics) {
  StreamSnapshot snapshot;
  snapshot.info.stream = "a\"} 1\nrelievo_forged 1\\";
  snapshot.published = 1;
  const std::string text = metrics_text({snapshot}, {}, {.handshakes = 2, .plain = 1});
  EXPECT_EQ(text.find("\nrelievo_forged"), std::string::npos);
  EXPECT_EQ(metric_in(text, R"(relievo_dds_refused_total{reason="handshake"})"), 2);
  EXPECT_EQ(metric_in(text, R"(relievo_dds_refused_total{reason="plain"})"), 1);
  EXPECT_NE(text.find(R"({stream="a\"} 1\nrelievo_forged 1\\"} 1)"), std::string::npos);
}

TEST(Protocol, ClientsOverDdsAreToldApartWhateverTheyCallThemselves) {
  StreamSnapshot snapshot;
  snapshot.info.stream = "s";
  StageTimes& stages = snapshot.stages.emplace();
  const std::string name = "a\"} 1\nrelievo_forged 1\\";
  stages.clients.clients = {{.client = name, .id = 1, .lost = 5}, {.client = name, .id = 2, .skipped = 6}};
  stages.clients.clients[1].decode.add(0.003);
  stages.clients.decode.add(0.003);
  const std::string text = metrics_text({snapshot}, {}, {});
  EXPECT_EQ(text.find("\nrelievo_forged"), std::string::npos);
  const auto of = [&](const char* id) {
    return R"({stream="s",client="a\"} 1\nrelievo_forged 1\\",id="000000000000000)" + std::string(id) + "\"}";
  };
  EXPECT_EQ(metric_in(text, "relievo_client_lost_total" + of("1")), 5);
  EXPECT_EQ(metric_in(text, "relievo_client_skipped_total" + of("2")), 6);
  EXPECT_EQ(metric_in(text, "relievo_client_decode_seconds_count" + of("1")), 0);
  EXPECT_EQ(metric_in(text, "relievo_client_decode_seconds_count" + of("2")), 1);
  EXPECT_EQ(metric_in(text, R"(relievo_stage_seconds_count{stream="s",stage="decode"})"), 1);
}

TEST(Protocol, ClientMessages) {
  const auto credit = parse_client_message(R"({"type":"credit","n":2})");
  ASSERT_TRUE(credit.ok());
  EXPECT_EQ(credit->credit, 2);
  EXPECT_FALSE(parse_client_message("").ok());
  EXPECT_FALSE(parse_client_message("\xff\xfe").ok());
  EXPECT_FALSE(parse_client_message(R"({"type":1})").ok());
  EXPECT_FALSE(parse_client_message(R"({"type":"credit","n":99999999999999999999})").ok());
}

}  // namespace
}  // namespace relievo::test
