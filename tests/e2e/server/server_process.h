// SPDX-License-Identifier: Apache-2.0
// relievo-server as users run it, on a small take drawn for the test.
#pragma once

#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <set>
#include <sstream>
#include <string>
#include <vector>

#include "tests/support/own_domain.h"
#include "tests/support/patience.h"
#include "tests/support/process.h"
#include "tests/support/striped_scene.h"
#include "tests/support/temp_folder.h"

namespace relievo::test {

inline std::vector<std::string> server(const std::vector<std::string>& arguments) {
  std::vector<std::string> command{program("relievo-server").string()};
  command.insert(command.end(), arguments.begin(), arguments.end());
  return command;
}

/// `serve` of `source` on this test's own domain, without a gateway unless `more` says so.
inline std::vector<std::string> serve(const std::string& source, const std::vector<std::string>& more) {
  std::vector<std::string> command =
      server({"serve", "--source", source, "--domain", std::to_string(own_domain()), "--interface", "lo"});
  command.insert(command.end(), more.begin(), more.end());
  if (std::find(more.begin(), more.end(), "--web") == more.end()) {
    command.push_back("--web");
    command.push_back("none");
  }
  return command;
}

inline std::vector<std::string> lines(const std::string& text) {
  std::vector<std::string> out;
  std::istringstream in(text);
  for (std::string line; std::getline(in, line);) out.push_back(line);
  return out;
}

/// The lines that say "error:".
inline std::vector<std::string> errors(const std::string& err) {
  std::vector<std::string> out;
  for (const std::string& line : lines(err)) {
    if (line.find("error:") != std::string::npos) out.push_back(line);
  }
  return out;
}

/// Exit status 1 and one line on stderr that says `what`, with nothing else beside it.
inline void expect_one_error(const Finished& finished, const std::string& what) {
  EXPECT_EQ(finished.status, 1) << finished.err;
  EXPECT_EQ(lines(finished.err).size(), 1U) << finished.err;
  EXPECT_EQ(errors(finished.err).size(), 1U) << finished.err;
  EXPECT_NE(finished.err.find(what), std::string::npos) << finished.err;
}

inline std::set<std::string> names_in(const std::filesystem::path& folder) {
  std::set<std::string> out;
  std::error_code code;
  for (const auto& entry : std::filesystem::directory_iterator(folder, code))
    out.insert(entry.path().filename().string());
  return out;
}

inline std::string read_text(const std::filesystem::path& file) {
  std::ifstream in(file, std::ios::binary);
  return {std::istreambuf_iterator<char>(in), {}};
}

/// A take of 12 frames in a folder of its own.
class TakeTest : public ::testing::Test {
 protected:
  void SetUp() override { ASSERT_TRUE(write_striped_take(striped_scene(), take_, 12)); }

  /// Takes the lines with `key` and those indented below it out of a file of the take.
  void remove_key(const std::string& file, const std::string& key) {
    std::string kept;
    bool inside = false;
    for (const std::string& line : lines(read_text(take_ / file))) {
      inside = line.starts_with(key + ":") || (inside && line.starts_with("   "));
      if (!inside) kept += line + "\n";
    }
    std::ofstream(take_ / file, std::ios::binary) << kept;
  }

  const TempFolder folder_;
  const std::filesystem::path take_ = folder_.path() / "take";
  const std::string source_ = "take:" + take_.string();
  const std::filesystem::path out_ = folder_.path() / "out";
};

}  // namespace relievo::test
