// SPDX-License-Identifier: Apache-2.0
#include "server/sinks.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstdlib>

#include "tests/support/service_manager.h"
#include "tests/support/temp_folder.h"

namespace relievo {
namespace {

using testing::HasSubstr;
using testing::Not;

TEST(ServiceSink, WatchdogHearsNothingWhereFramesGoInAndNoneComesOut) {
  const test::TempFolder folder;
  const auto path = folder / "notify";
  test::ServiceManager manager(path);
  ASSERT_TRUE(manager.bound());
  setenv("NOTIFY_SOCKET", path.c_str(), 1);
  ServiceBoard board;
  const auto sink = make_service_sink(board, "face");
  const auto told = [&](std::uint64_t published, std::uint64_t dropped) {
    ServerStatus status;
    status.frames_published = published;
    status.drops_reconstruct = dropped;
    const std::size_t before = manager.said().size();
    EXPECT_TRUE(sink->consume(status));
    return manager.said().substr(before);
  };
  EXPECT_THAT(told(0, 0), HasSubstr("WATCHDOG=1"));  // the first surface is yet to come
  EXPECT_THAT(told(30, 0), HasSubstr("WATCHDOG=1"));
  EXPECT_THAT(told(60, 9), HasSubstr("WATCHDOG=1"));  // slow is not stuck
  EXPECT_THAT(told(60, 9), HasSubstr("WATCHDOG=1"));  // the camera is away
  const std::string stuck = told(60, 40);
  EXPECT_THAT(stuck, Not(HasSubstr("WATCHDOG=1")));
  EXPECT_THAT(stuck, HasSubstr("STATUS="));
  EXPECT_THAT(told(61, 41), HasSubstr("WATCHDOG=1"));
  unsetenv("NOTIFY_SOCKET");
}

}  // namespace
}  // namespace relievo
