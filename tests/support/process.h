// SPDX-License-Identifier: Apache-2.0
// Real programs as child processes of a test.
#pragma once

#include <sys/types.h>

#include <chrono>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "tests/support/patience.h"

namespace relievo::test {

/// A running child; killed and reaped in the destructor, and killed with the thread that made it, so that
/// none is left behind. Its output goes to files.
class Process {
 public:
  /// `program` is a path; throws where it cannot be started.
  explicit Process(const std::vector<std::string>& command,
                   const std::vector<std::string>& environment = {});  // "NAME=value", besides ours
  Process(const Process&) = delete;
  Process& operator=(const Process&) = delete;
  ~Process();

  pid_t pid() const { return pid_; }
  void signal(int number) const;
  /// The exit status (128 + n for signal n); nothing where it still runs after `timeout`.
  std::optional<int> wait(std::chrono::milliseconds timeout = kPatience);
  /// What it has written so far.
  std::string out() const;
  std::string err() const;
  /// Waits until its standard error or output contains `text`; false where it ends without.
  bool wait_for_text(const std::string& text);

 private:
  pid_t pid_ = -1;
  std::optional<int> status_;
  std::filesystem::path folder_;
};

struct Finished {
  int status = -1;  // -1: still ran after the timeout, and was killed
  std::string out;
  std::string err;
};
Finished run(const std::vector<std::string>& command, std::chrono::milliseconds timeout = kPatience,
             const std::vector<std::string>& environment = {});

/// The port of a program's gateway on 127.0.0.1, once it says where its viewer is; 0 where it ends without.
std::uint16_t viewer_port(Process& process);

/// The folder of the built programs.
std::filesystem::path program(const std::string& name);

}  // namespace relievo::test
