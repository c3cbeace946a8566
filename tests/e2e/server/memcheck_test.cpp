// SPDX-License-Identifier: Apache-2.0
// A surface is made of its frames alone: under valgrind no decoder goes by memory that nothing was written
// to, which the address sanitizer does not see and which makes a surface in thirty another one.
#include <gtest/gtest.h>

#include <csignal>
#include <filesystem>
#include <ostream>
#include <string>
#include <vector>

#include "server_process.h"

namespace relievo::test {
namespace {

struct Case {
  const char* name;
  const char* scene;
  std::vector<std::string> options;  // of reconstruct
};

void PrintTo(const Case& c, std::ostream* out) {
  *out << c.name;
}

class Memcheck : public ::testing::TestWithParam<Case> {};

TEST_P(Memcheck, ReadsOnlyWhatWasWritten) {
  const std::filesystem::path valgrind = "/usr/bin/valgrind";
  if (!std::filesystem::exists(valgrind)) GTEST_SKIP() << "apt-get install valgrind";
  const auto& [name, scene, options] = GetParam();
  const TempFolder folder;
  const std::string take = (folder.path() / "take").string();
  const Finished simulated =
      run(server({"simulate", "--scene", scene, "--frames", "4", "--out", take}), kLongPatience);
  ASSERT_EQ(simulated.status, 0) << simulated.err;
  const std::vector<std::string> under_valgrind{valgrind, "--quiet", "--error-exitcode=99"};
  std::vector<std::string> command = under_valgrind;
  for (const std::string& word : server({"reconstruct", take, "--out", (folder.path() / "out").string()}))
    command.push_back(word);
  command.insert(command.end(), options.begin(), options.end());
  const Finished done = run(command, kLongPatience);
  // It knows no instruction that its processor does not name, and a library may use one all the same: libhwy
  // does so before main(), on some virtual machines. Then nothing of the server can run.
  constexpr int kIllegalInstruction = 128 + SIGILL;
  if (done.status == kIllegalInstruction) {
    std::vector<std::string> version = under_valgrind;
    for (const std::string& word : server({"--version"})) version.push_back(word);
    if (const Finished started = run(version, kLongPatience); started.status == kIllegalInstruction)
      GTEST_SKIP() << "valgrind cannot run a library of the server's here: " << started.err;
  }
  EXPECT_EQ(done.status, 0) << done.err;
}

INSTANTIATE_TEST_SUITE_P(
    , Memcheck,
    ::testing::Values(Case{"Ordered", "walk,width=320,height=240,stripes=45", {}},
                      Case{"Quick", "walk,width=320,height=240,stripes=45", {"--decoder", "quick"}},
                      Case{"Dense", "object,width=320,height=240,stripes=45,scan=progressive", {"--dense"}},
                      Case{"WhiteField", "walk,width=320,height=240,stripes=45,scheme=white-field", {}},
                      Case{"OneSlide", "walk,width=320,height=240,stripes=45,scheme=one-slide", {}}),
    [](const auto& c) { return std::string(c.param.name); });

}  // namespace
}  // namespace relievo::test
