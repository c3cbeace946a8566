// SPDX-License-Identifier: Apache-2.0
// relievo-server under a service manager: what it says on the socket in NOTIFY_SOCKET (sd_notify(3)).
#include <signal.h>

#include "tests/e2e/server/server_process.h"
#include "tests/support/service_manager.h"

namespace relievo::test {
namespace {

TEST(Service, SaysThatItIsReadyAliveAndStopping) {
  const TempFolder folder;
  const auto path = folder / "notify";
  ServiceManager manager(path);
  ASSERT_TRUE(manager.bound());
  Process serving(serve("sim:face", {}), {"NOTIFY_SOCKET=" + path.string()});
  EXPECT_TRUE(manager.hears("READY=1")) << serving.err();
  EXPECT_TRUE(manager.hears("WATCHDOG=1"));
  EXPECT_TRUE(manager.hears("STATUS=running"));
  EXPECT_EQ(manager.said().find("STOPPING=1"), std::string::npos);
  serving.signal(SIGTERM);
  EXPECT_EQ(serving.wait(), 0) << serving.err();
  EXPECT_TRUE(manager.hears("STOPPING=1"));
}

// Both outputs are one journal there.
TEST(Service, WithJsonLinesEveryLineOfEitherOutputIsOne) {
  Process serving(serve("sim:plane,width=160,height=120",
                        {"--frames", "3", "--fast", "--log-json", "--web", "127.0.0.1:0"}));
  EXPECT_EQ(serving.wait(), 0) << serving.err();
  const std::string all = serving.out() + serving.err();
  EXPECT_NE(all.find("\"message\":\"stream "), std::string::npos) << all;
  EXPECT_NE(all.find("\"message\":\"viewer http"), std::string::npos) << all;
  for (const std::string& line : lines(all)) EXPECT_TRUE(line.starts_with("{\"time\":\"")) << line;
}

// It hung for ever, deaf to SIGTERM: sd_notify(3) waits for room.
TEST(Service, AManagerThatReadsNothingKeepsNobodyWaiting) {
  const TempFolder folder;
  const auto path = folder / "notify";
  const ServiceManager manager(path);
  ASSERT_TRUE(manager.bound());
  manager.fill_up();
  Process serving(serve("sim:plane,width=160,height=120", {"--frames", "60"}),
                  {"NOTIFY_SOCKET=" + path.string()});
  EXPECT_EQ(serving.wait(), 0) << serving.err();
  EXPECT_NE(serving.err().find("60 frames captured"), std::string::npos) << serving.err();
}

}  // namespace
}  // namespace relievo::test
