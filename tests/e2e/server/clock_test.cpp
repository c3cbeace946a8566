// SPDX-License-Identifier: Apache-2.0
// Proves: a server whose clock is set while it runs goes on, in the time that it is then, as do its
// recordings, and those of a client whose clock is set; clients whose clock is another count no latency
// before they know the difference.
#include <signal.h>

#include <cstdlib>

#include "base/time.h"
#include "codec/recording.h"
#include "tests/e2e/server/web_server.h"
#include "tests/support/metric.h"

namespace relievo::test {
namespace {

constexpr std::int64_t kHour_s = 3600;

class SetClock : public TakeTest {
 protected:
  void SetUp() override {
    TakeTest::SetUp();
    set_by(0);
    server_.emplace(serve(source_, {"--loop", "--web", "127.0.0.1:0", "--record-dir", folder_.path(),
                                    "--split-every", "1min"}),
                    std::vector<std::string>{std::string("LD_PRELOAD=") + RELIEVO_SET_CLOCK,
                                             "RELIEVO_CLOCK_SET=" + clock_.string()});
    ASSERT_NE(server_->port(), 0) << server_->process().err();
  }
  void set_by(std::int64_t s) const {
    std::ofstream(clock_.string() + ".new") << s;
    std::filesystem::rename(clock_.string() + ".new", clock_);
  }
  /// When the next frame was captured, less what the clock here says, to the hour.
  double hours_off() {
    WsClient client(server_->port(), "take");
    EXPECT_TRUE(client.credit(1));
    const auto old = client.next_of("frame");
    EXPECT_TRUE(client.credit(1));
    const auto frame = client.next_of("frame");
    if (!old || !frame) return 1e9;
    const auto captured_ns = static_cast<std::int64_t>(u64_at(frame->data, 16));
    return std::round(seconds(captured_ns - utc_now_ns()) / kHour_s * 10) / 10;
  }

  const std::filesystem::path clock_ = folder_.path() / "clock";
  std::optional<WebServer> server_;
};

TEST_F(SetClock, AStreamGoesOnInTheTimeThatItIsThen) {
  EXPECT_TRUE(server_->goes_on("take", 5));
  EXPECT_EQ(hours_off(), 0);
  ASSERT_EQ(server_->order("take", "start").status, 200);
  for (const int hours : {1, -2, 0}) {
    set_by(hours * kHour_s);
    EXPECT_TRUE(server_->goes_on("take", 10)) << hours << " h: " << server_->process().err();
    EXPECT_TRUE(eventually([&] { return hours_off() == hours; })) << hours << " h, but " << hours_off();
    EXPECT_TRUE(eventually([&] { return server_->stream("take")["state"] == "running"; }));
  }
  ASSERT_EQ(server_->order("take", "stop").status, 200);
  server_->process().signal(SIGTERM);
  EXPECT_EQ(server_->process().wait(), 0) << server_->process().err();
  std::uint64_t frames = 0, files = 0;
  for (const auto& entry : std::filesystem::directory_iterator(folder_.path())) {
    if (entry.path().extension() != ".mcap") continue;
    ++files;
    const auto reader = RecordingReader::open(entry.path());
    ASSERT_TRUE(reader) << reader.error().message;
    EXPECT_FALSE((*reader)->summary().recovered) << entry.path();
    while (const auto message = (*reader)->next()) {
      if (!*message) break;
      frames += (*reader)->summary().channels[(*message)->channel].topic == "relievo/frame";
    }
  }
  EXPECT_GE(frames, 30U);
  EXPECT_GE(files, 3U) << "a file of one minute ends where an hour passes, forth or back";
}

TEST_F(SetClock, ARecordingOfAClientGoesOnEvenly) {
  const std::string file = folder_ / "client.mcap";
  const auto clock = folder_ / "clients_clock";
  std::ofstream(clock) << 0;
  Process recorder({program("relievo"), "record", "take", "--out", file, "--json", "--seconds", "1000",
                    "--domain", std::to_string(own_domain()), "--interface", "lo"},
                   {std::string("LD_PRELOAD=") + RELIEVO_SET_CLOCK, "RELIEVO_CLOCK_SET=" + clock.string()});
  std::uintmax_t size = 1000;
  for (const int hours : {1, -2}) {
    ASSERT_TRUE(wait_for_size(file, size)) << recorder.err();
    std::ofstream(clock.string() + ".new") << hours * kHour_s;
    std::filesystem::rename(clock.string() + ".new", clock);
    size = 2 * std::filesystem::file_size(file);  // more than was on its way
  }
  ASSERT_TRUE(wait_for_size(file, size)) << recorder.err();
  recorder.signal(SIGINT);
  ASSERT_EQ(recorder.wait(), 0) << recorder.err();
  const auto said = nlohmann::json::parse(recorder.out());
  EXPECT_GT(said["duration_s"], 0);
  EXPECT_LT(said["duration_s"], kHour_s);
  const auto reader = RecordingReader::open(file);
  ASSERT_TRUE(reader) << reader.error().message;
  EXPECT_LT(seconds((*reader)->summary().end_ns - (*reader)->summary().start_ns), kHour_s);
  std::optional<std::uint32_t> last;
  while (const auto message = (*reader)->next()) {
    if (!*message) break;
    if ((*reader)->summary().channels[(*message)->channel].topic != "relievo/frame") continue;
    EXPECT_TRUE(!last || (*message)->sequence > *last) << "in the order in which they came";
    last = (*message)->sequence;
  }
  EXPECT_TRUE(last);
}

/// Of clients here, an hour ahead of the server.
class ClockAnHourBehind : public SetClock {
 protected:
  void SetUp() override {
    SetClock::SetUp();
    set_by(-kHour_s);
    ASSERT_TRUE(eventually([&] { return hours_off() == -1; }));
  }
  static std::vector<std::string> client(std::vector<std::string> arguments) {
    arguments.insert(arguments.begin(), program("relievo").string());
    arguments.insert(arguments.end(), {"--domain", std::to_string(own_domain()), "--interface", "lo"});
    return arguments;
  }
  static double metric(std::uint16_t port, const std::string& name) {
    return metric_in(request(port, "GET", "/metrics").body, name);
  }
};

TEST_F(ClockAnHourBehind, AGatewayCountsNoLatencyBeforeItKnows) {
  WebServer gateway(client({"web", "--listen", "127.0.0.1:0"}));
  ASSERT_NE(gateway.port(), 0) << gateway.process().err();
  const std::string of = R"({stream="take",until="here"})";
  ASSERT_TRUE(
      eventually([&] { return metric(gateway.port(), "relievo_gateway_latency_seconds_count" + of) >= 3; }));
  EXPECT_LT(metric(gateway.port(), "relievo_gateway_latency_seconds_sum" + of), 600);
  EXPECT_NEAR(metric(gateway.port(), R"(relievo_gateway_clock_offset_seconds{stream="take"})"), -kHour_s, 60);
}

TEST_F(ClockAnHourBehind, StatsCountsNoLatencyBeforeItKnows) {
  Process stats(client({"stats", "take"}));
  std::string of;
  ASSERT_TRUE(eventually([&] {
    const std::string metrics = request(server_->port(), "GET", "/metrics").body;
    const std::string name = "relievo_client_latency_seconds_count";
    const auto at = metrics.find(name + "{stream=\"take\"");
    if (at == std::string::npos) return false;
    of = metrics.substr(at + name.size(), metrics.find('}', at) + 1 - at - name.size());
    return metric_in(metrics, name + of) >= 3;
  }));
  EXPECT_LT(metric(server_->port(), "relievo_client_latency_seconds_sum" + of), 600);
  stats.signal(SIGINT);
  EXPECT_EQ(stats.wait(), 0) << stats.err();
  for (const std::string& line : lines(stats.out())) {
    double latency_ms = 0;
    const bool told = std::sscanf(line.c_str() + line.find("latency"), "latency %lf ms", &latency_ms) == 1;
    EXPECT_LT(latency_ms, 600'000) << line;
    EXPECT_FALSE(told && line.find("clock not known") != std::string::npos) << line;
    EXPECT_TRUE(told || line.find("latency       - ms") != std::string::npos) << line;
  }
}

TEST_F(ClockAnHourBehind, StatsInJsonHasALatencyOnlyWhereItIsOne) {
  const Finished done = run(client({"stats", "take", "--json", "--seconds", "1.2"}));
  const auto stats = nlohmann::json::parse(done.out);
  const auto& latency = stats["latency_ms"];
  EXPECT_TRUE(latency.is_null() || (latency < 600'000 && !stats["clock_offset_ms"].is_null())) << done.out;
}

}  // namespace
}  // namespace relievo::test
