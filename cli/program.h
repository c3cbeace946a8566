// SPDX-License-Identifier: Apache-2.0
// The skeleton of both programs: commands, --help, --version, -v/-q and the exit codes.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "base/result.h"
#include "cli/stop_signal.h"

namespace CLI {
class App;
}

namespace relievo {

enum ExitCode : int { kExitDone = 0, kExitFailed = 1, kExitUsage = 2 };

/// One verb of a program.
struct Command {
  std::string name;
  std::string description;  // one line, for --help
  /// Adds the verb's options to its own CLI::App and returns what runs when it is chosen and its options
  /// are well formed. Options live as long as the returned function: keep them in a shared_ptr it captures.
  std::function<std::function<Status(StopSignal&)>(CLI::App&)> define;
};

/// Runs a program's main: parses, sets the log level from -v/-q, runs one command. A command's results go to
/// stdout (std::cout or stdio), logs to stderr. Returns the process's exit code: 0 done, also when stopped by
/// a signal; 1 failed, the error written as one line; 2 wrong usage, one line. No exception escapes.
int run_program(const std::string& name, const std::string& description, const std::vector<Command>& commands,
                int argc, char** argv);

}  // namespace relievo
