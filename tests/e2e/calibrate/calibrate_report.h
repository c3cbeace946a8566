// SPDX-License-Identifier: Apache-2.0
// relievo-server's commands as tests of calibration call them.
#pragma once

#include <gtest/gtest.h>

#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "tests/support/process.h"

namespace relievo::test {

inline Finished server(std::vector<std::string> arguments) {
  arguments.insert(arguments.begin(), program("relievo-server").string());
  return run(arguments, kLongPatience);
}

/// What a command that succeeds prints with --json.
inline nlohmann::json report(const std::vector<std::string>& arguments) {
  const Finished done = server(arguments);
  EXPECT_EQ(done.status, 0) << done.err;
  const auto parsed = nlohmann::json::parse(done.out, nullptr, false);
  EXPECT_FALSE(parsed.is_discarded()) << done.out;
  return parsed.is_discarded() ? nlohmann::json::object() : parsed;
}

}  // namespace relievo::test
