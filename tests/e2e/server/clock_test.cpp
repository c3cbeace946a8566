// SPDX-License-Identifier: Apache-2.0
// Proves: a server whose clock is set while it runs goes on, in the time that it is then, as do its
// recordings.
#include <signal.h>

#include <cstdlib>

#include "base/time.h"
#include "codec/recording.h"
#include "tests/e2e/server/web_server.h"

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

}  // namespace
}  // namespace relievo::test
