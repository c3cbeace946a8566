// SPDX-License-Identifier: Apache-2.0
#include "base/log_format.h"

#include <gtest/gtest.h>

#include "base/time.h"

namespace relievo {
namespace {

constexpr std::int64_t kNow_ns = 1'700'000'000 * kNanosecondsPerSecond + 42'000'000;

TEST(LogLine, ForPeopleSaysWhatIsNotUsual) {
  EXPECT_EQ(log_line(LogFormat::kText, LogLevel::kInfo, "stream face", kNow_ns), "stream face");
  EXPECT_EQ(log_line(LogFormat::kText, LogLevel::kWarning, "no \"rig\"", kNow_ns), "warning: no \"rig\"");
}

TEST(LogLine, ForProgramsIsOneObject) {
  EXPECT_EQ(log_line(LogFormat::kJson, LogLevel::kError, "a \"b\" \\ c\nd\x01", kNow_ns),
            R"({"time":"2023-11-14T22:13:20.042Z","level":"error","message":"a \"b\" \\ c\u000ad\u0001"})");
  EXPECT_EQ(log_line(LogFormat::kJson, LogLevel::kDebug, "", 0),
            R"({"time":"1970-01-01T00:00:00.000Z","level":"debug","message":""})");
}

}  // namespace
}  // namespace relievo
