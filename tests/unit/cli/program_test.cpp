// SPDX-License-Identifier: Apache-2.0
#include "cli/program.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <signal.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <atomic>
#include <chrono>
#include <cstdio>
#include <memory>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "base/log_format.h"
#include "cli/announce.h"
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

/// A thread that blocks no signal, as libraries start them when they are loaded.
class OlderThread {
 public:
  OlderThread() : thread_([this] { ended_.wait(false); }) {}
  ~OlderThread() {
    ended_ = true;
    ended_.notify_one();
    thread_.join();
  }
  OlderThread(const OlderThread&) = delete;
  OlderThread& operator=(const OlderThread&) = delete;

 private:
  std::atomic<bool> ended_ = false;
  std::thread thread_;
};

int exit_code(const std::vector<Command>& commands, std::vector<std::string> arguments) {
  arguments.insert(arguments.begin(), "tool");
  std::vector<char*> argv;
  for (std::string& a : arguments) argv.push_back(a.data());
  return run_program("tool", "a tool", commands, static_cast<int>(argv.size()), argv.data());
}

Outcome run(const std::vector<Command>& commands, const std::vector<std::string>& arguments) {
  testing::internal::CaptureStdout();
  testing::internal::CaptureStderr();
  Outcome o;
  o.code = exit_code(commands, arguments);
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

TEST(Program, ResultsThatCannotBeWrittenAreAFailure) {
  for (const std::size_t bytes : {10, 100'000}) {
    const auto commands = one_command([&](int, StopSignal&) {
      std::puts(std::string(bytes, 'x').c_str());
      return Status();
    });
    EXPECT_EXIT(
        {
          if (std::freopen("/dev/full", "w", stdout) == nullptr) _exit(7);
          _exit(exit_code(commands, {"work"}));
        },
        testing::ExitedWithCode(kExitFailed), "cannot write the results")
        << bytes;
  }
}

TEST(Program, SaysFailuresToProgramsToo) {
  const auto o = run(one_command([](int, StopSignal&) { return Status(Error{"no such\nfile"}); }),
                     {"work", "--log-json"});
  set_log_format(LogFormat::kText);  // of this process, for the tests after this one
  EXPECT_EQ(o.code, 1);
  EXPECT_THAT(o.err, HasSubstr(R"("level":"error","message":"tool work: no such file"})"));
  EXPECT_EQ(std::count(o.err.begin(), o.err.end(), '\n'), 1);
}

TEST(Program, AnnouncesToProgramsToo) {
  const auto say = one_command([](int, StopSignal&) {
    announce("viewer http://localhost/");
    return Status();
  });
  EXPECT_EQ(run(say, {"work", "-q"}).out, "viewer http://localhost/\n");
  const auto o = run(say, {"work", "--log-json"});
  set_log_format(LogFormat::kText);  // of this process, for the tests after this one
  EXPECT_THAT(o.out, HasSubstr(R"("level":"info","message":"viewer http://localhost/"})"));
  EXPECT_EQ(o.out.front(), '{');
  EXPECT_EQ(o.err, "");
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

TEST(Program, OverlongArgumentsAreNotRepeatedWhole) {
  std::string letters;
  for (int i = 0; i < 50'000; ++i) letters += "\u00e9";
  const auto commands =
      one_command([&](int, StopSignal&) { return Status(Error{"no file " + letters + ": give another"}); });
  for (const auto& [arguments, end] :
       {std::pair<std::vector<std::string>, std::string>{{letters}, "--help)\n"},
        {{"work", "--count", letters}, "--help)\n"},
        {{"work"}, ": give another\n"}}) {
    const auto o = run(commands, arguments);
    EXPECT_LT(o.err.size(), 2200U);
    EXPECT_THAT(o.err,
                AllOf(testing::StartsWith("tool"), HasSubstr("\u00e9 [...] \u00e9"), testing::EndsWith(end)));
  }
}

TEST(Program, ACommandWithinACommandIsNamedAndTakesTheCommonFlags) {
  const std::vector<Command> commands = {
      {"calibrate", "calibrates", [](CLI::App& app) {
         auto captures = std::make_shared<std::string>();
         app.require_subcommand(1);
         app.add_subcommand("colour", "the colours")->add_option("captures", *captures)->required();
         return [captures](StopSignal&) { return Status(Error{"too dark"}); };
       }}};
  auto o = run(commands, {"calibrate", "colour"});
  EXPECT_EQ(o.code, 2);
  EXPECT_EQ(o.err, "tool calibrate colour: captures is required (see tool calibrate colour --help)\n");
  EXPECT_EQ(run(commands, {"calibrate"}).err, "tool calibrate: which command? (see tool calibrate --help)\n");
  EXPECT_EQ(run(commands, {"calibrate", "colours"}).err,
            "tool calibrate: there is no command 'colours' (see tool calibrate --help)\n");
  o = run(commands, {"calibrate", "colour", "folder"});
  EXPECT_EQ(o.code, 1);
  EXPECT_EQ(o.err, "tool calibrate colour: error: too dark\n");
  EXPECT_THAT(run(commands, {"calibrate", "colour", "--help"}).out, HasSubstr("--log-json"));
  EXPECT_EQ(run(commands, {"calibrate", "colour", "--version"}).code, 0);
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

TEST(Program, HelpSaysWhatAnOptionTakes) {
  const std::vector<Command> commands = {
      {"work", "does work", [](CLI::App& app) {
         auto text = std::make_shared<std::string>();
         auto number = std::make_shared<int>();
         app.add_option("--where", *text)->type_name("HOST:PORT");
         app.add_option("--kind", *text)->check(CLI::IsMember({"a", "b"}));
         app.add_option("--named", *text)->check(CLI::IsMember({"c", "d"}))->type_name("NAME");
         app.add_option("--count", *number)->check(CLI::Range(2, 7));
         app.add_option("--most", *number)->check(CLI::Range(2, 9))->type_name("N");
         return [text, number](StopSignal&) { return Status(); };
       }}};
  EXPECT_THAT(run(commands, {"work", "--help"}).out,
              AllOf(HasSubstr("--where HOST:PORT "), HasSubstr("--kind a|b "), HasSubstr("--named c|d "),
                    HasSubstr("--count 2..7 "), HasSubstr("--most 2..9 ")));
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

bool blocks_signals() {
  sigset_t blocked;
  pthread_sigmask(SIG_SETMASK, nullptr, &blocked);
  return sigismember(&blocked, SIGINT) && sigismember(&blocked, SIGTERM) && sigismember(&blocked, SIGHUP);
}

// A handler runs on any thread that lets it, however long that thread may keep it waiting.
TEST(Program, SignalsComeToNoThreadOfTheCommand) {
  ASSERT_FALSE(blocks_signals());
  bool blocked_here = false, blocked_in_a_thread = false;
  run(one_command([&](int, StopSignal&) {
        blocked_here = blocks_signals();
        std::thread([&] { blocked_in_a_thread = blocks_signals(); }).join();
        return Status();
      }),
      {"work"});
  EXPECT_TRUE(blocked_here);
  EXPECT_TRUE(blocked_in_a_thread);
  EXPECT_FALSE(blocks_signals()) << "what the command's end should have given back";
}

TEST(Program, ASignalOnAThreadThatIsOlderThanTheCommandStopsIt) {
  const OlderThread older;
  const auto o = run(one_command([](int, StopSignal& stop) {
                       kill(getpid(), SIGTERM);
                       return stop.wait_for(std::chrono::seconds(60)) ? Status() : Error{"never stopped"};
                     }),
                     {"work"});
  EXPECT_EQ(o.code, 0) << o.err;
}

void stop_and_hang_in_the_callback() {
  exit_code(one_command([](int, StopSignal& stop) {
              std::atomic<bool> called = false;
              stop.on_stop([&] {
                called = true;
                for (;;) pause();
              });
              kill(getpid(), SIGINT);
              while (!called) usleep(1000);
              for (;;) {  // two that come close to each other may be one
                kill(getpid(), SIGTERM);
                usleep(1000);
              }
              return Status();
            }),
            {"work"});
}

TEST(Program, TheThirdSignalEndsWhatHangsInItsCallback) {
  EXPECT_EXIT(stop_and_hang_in_the_callback(), testing::ExitedWithCode(128 + SIGTERM), "");
}

void signal_after_the_end(int times) {
  const int code = exit_code(one_command([](int, StopSignal&) { return Status(); }), {"work"});
  for (int i = 0; i < times; ++i) raise(SIGINT);
  _exit(code);
}

// What a signal finds done stays done, until it has come as often as ends what hangs.
TEST(Program, ASignalThatComesAfterTheCommandChangesNothing) {
  EXPECT_EXIT(signal_after_the_end(2), testing::ExitedWithCode(0), "");
  EXPECT_EXIT(signal_after_the_end(3), testing::ExitedWithCode(128 + SIGINT), "");
}

void hang_up(bool ignored, bool terminated) {
  signal(SIGHUP, ignored ? SIG_IGN : SIG_DFL);
  _exit(exit_code(one_command([&](int, StopSignal& stop) {
                    kill(getpid(), SIGHUP);
                    if (terminated) kill(getpid(), SIGTERM);  // comes behind it
                    const bool stopped = stop.wait_for(std::chrono::seconds(terminated || !ignored ? 60 : 1));
                    return stopped ? Status() : Error{"went on"};
                  }),
                  {"work"}));
}

// As when its terminal is closed: what it has written so far is not to be left half done.
TEST(Program, AHangupStopsWhatReadsNothingAgain) {
  EXPECT_EXIT(hang_up(false, false), testing::ExitedWithCode(0), "");
  EXPECT_EXIT(hang_up(true, false), testing::ExitedWithCode(1), "went on");  // under nohup
  EXPECT_EXIT(hang_up(true, true), testing::ExitedWithCode(0), "");
}

TEST(Program, AHangupReadsAgain) {
  std::atomic<int> read = 0;
  const auto o = run(one_command([&](int, StopSignal& stop) {
                       stop.on_reload([&] { ++read; });
                       for (int wanted = 1; wanted <= 3; ++wanted) {
                         kill(getpid(), SIGHUP);
                         for (int i = 0; i < 60000 && read < wanted; ++i) usleep(1000);
                       }
                       stop.clear_on_reload();
                       return Status();
                     }),
                     {"work"});
  EXPECT_EQ(o.code, 0) << o.err;
  EXPECT_EQ(read, 3);
}

TEST(Program, AStopOvertakesAReload) {
  std::atomic<bool> reloads = false, ended = false;
  const auto o = run(one_command([&](int, StopSignal& stop) {
                       stop.on_reload([&] {
                         reloads = true;
                         for (int i = 0; i < 60000 && !ended; ++i) usleep(1000);
                       });
                       stop.on_stop([&] { ended = true; });
                       kill(getpid(), SIGHUP);
                       for (int i = 0; i < 60000 && !reloads; ++i) usleep(1000);
                       EXPECT_FALSE(ended);
                       kill(getpid(), SIGTERM);
                       for (int i = 0; i < 30000 && !ended; ++i) usleep(1000);
                       EXPECT_TRUE(ended);
                       ended = true;
                       stop.clear_on_reload();
                       stop.clear_on_stop();
                       return Status();
                     }),
                     {"work"});
  EXPECT_EQ(o.code, 0) << o.err;
}

TEST(Progress, LineShowsRateAndTimeLeft) {
  EXPECT_EQ(progress_line("export", "frames", 50, 100, 2, "3 lost"),
            "export  [############            ] 50/100 frames  25.0/s  2 s left  3 lost");
  EXPECT_EQ(progress_line("record", "frames", 60, 0, 2, ""), "record  60 frames  30.0/s  2 s");
}

}  // namespace
}  // namespace relievo
