// SPDX-License-Identifier: Apache-2.0
#include "cli/program.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <signal.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <atomic>
#include <chrono>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "base/log_format.h"
#include "cli/progress.h"

namespace relievo {
namespace {

using testing::AllOf;
using testing::HasSubstr;

struct Outcome {
  int code = -1;
  std::string out;
  std::string err;
};

Outcome run(const std::vector<Command>& commands, std::vector<std::string> arguments) {
  arguments.insert(arguments.begin(), "tool");
  std::vector<char*> argv;
  for (std::string& a : arguments) argv.push_back(a.data());
  testing::internal::CaptureStdout();
  testing::internal::CaptureStderr();
  Outcome o;
  o.code = run_program("tool", "a tool", commands, static_cast<int>(argv.size()), argv.data());
  o.out = testing::internal::GetCapturedStdout();
  o.err = testing::internal::GetCapturedStderr();
  return o;
}

std::vector<Command> one_command(std::function<Status(int, StopSignal&)> action) {
  return {{"work", "does work", [action](CLI::App& app) {
             auto count = std::make_shared<int>(1);
             app.add_option("--count", *count, "how many");
             return [action, count](StopSignal& stop) { return action(*count, stop); };
           }}};
}

TEST(Program, SaysFailuresToProgramsToo) {
  const auto o = run(one_command([](int, StopSignal&) { return Status(Error{"no such\nfile"}); }),
                     {"work", "--log-json"});
  set_log_format(LogFormat::kText);  // of this process, for the tests after this one
  EXPECT_EQ(o.code, 1);
  EXPECT_THAT(o.err, HasSubstr(R"("level":"error","message":"tool work: no such file"})"));
  EXPECT_EQ(std::count(o.err.begin(), o.err.end(), '\n'), 1);
}

TEST(Program, RunsTheCommandWithItsOptions) {
  int seen = 0;
  const auto o = run(one_command([&](int count, StopSignal&) {
                       seen = count;
                       return Status();
                     }),
                     {"work", "--count", "7"});
  EXPECT_EQ(o.code, 0);
  EXPECT_EQ(seen, 7);
  EXPECT_EQ(o.err, "");
}

TEST(Program, FailureIsExitOneAndOneLine) {
  const auto o =
      run(one_command([](int, StopSignal&) { return Status(Error{"no camera\nplug it in"}); }), {"work"});
  EXPECT_EQ(o.code, 1);
  EXPECT_EQ(o.err, "tool work: error: no camera plug it in\n");
}

TEST(Program, WrongUsageIsExitTwoAndOneLine) {
  const auto never = one_command([](int, StopSignal&) -> Status {
    ADD_FAILURE() << "ran in spite of wrong usage";
    return {};
  });
  const std::vector<std::vector<std::string>> wrong = {
      {}, {"nonsense"}, {"work", "--count", "many"}, {"work", "--unknown"}, {"work", "-v", "-q"}};
  for (const auto& arguments : wrong) {
    const auto o = run(never, arguments);
    EXPECT_EQ(o.code, 2) << testing::PrintToString(arguments);
    EXPECT_EQ(std::count(o.err.begin(), o.err.end(), '\n'), 1) << o.err;
    EXPECT_THAT(o.err, HasSubstr("--help"));
    EXPECT_EQ(o.out, "");
  }
}

TEST(Program, UnknownCommandIsNamed) {
  const auto o = run(one_command([](int, StopSignal&) { return Status(); }), {"-v", "wrok", "--count", "1"});
  EXPECT_EQ(o.code, 2);
  EXPECT_EQ(o.err, "tool: there is no command 'wrok' (see tool --help)\n");
}

TEST(Program, HelpAndVersionBehindTheVerbToo) {
  const auto never = one_command([](int, StopSignal&) { return Status(Error{"ran"}); });
  for (const std::vector<std::string>& arguments :
       std::vector<std::vector<std::string>>{{"--version"}, {"work", "--version"}}) {
    const auto o = run(never, arguments);
    EXPECT_EQ(o.code, 0);
    EXPECT_EQ(o.out, std::string("tool ") + RELIEVO_VERSION + "\n");
  }
  const auto help = run(never, {"work", "--help"});
  EXPECT_EQ(help.code, 0);
  EXPECT_THAT(help.out, AllOf(HasSubstr("--count"), HasSubstr("--quiet"), HasSubstr("--version")));
}

TEST(Program, SignalStopsTheCommandCleanly) {
  std::atomic<int> called = 0;
  const auto o = run(one_command([&](int, StopSignal& stop) {
                       stop.on_stop([&] { ++called; });
                       kill(getpid(), SIGTERM);
                       if (!stop.wait_for(std::chrono::seconds(60))) return Status(Error{"never stopped"});
                       for (int i = 0; i < 60000 && called == 0; ++i) usleep(1000);
                       stop.clear_on_stop();
                       return Status();
                     }),
                     {"work"});
  EXPECT_EQ(o.code, 0) << o.err;
  EXPECT_EQ(called, 1);
}

TEST(Progress, LineShowsRateAndTimeLeft) {
  EXPECT_EQ(progress_line("export", "frames", 50, 100, 2, "3 lost"),
            "export  [############            ] 50/100 frames  25.0/s  2 s left  3 lost");
  EXPECT_EQ(progress_line("record", "frames", 60, 0, 2, ""), "record  60 frames  30.0/s  2 s");
}

}  // namespace
}  // namespace relievo
