// SPDX-License-Identifier: Apache-2.0
// Wrong usage: exit status 2 and one line that says where help is.
#include "tests/e2e/server/server_process.h"

namespace relievo::test {
namespace {

TEST(ServerUsage, WrongUsageIsTwoAndOneLine) {
  const std::vector<std::vector<std::string>> wrong{
      {},
      {"sing"},
      {"--no-such-flag"},
      {"serve", "--no-such-flag"},
      {"serve", "--frames", "0"},
      {"serve", "--frames", "many"},
      {"serve", "--domain", "231"},
      {"serve", "--threads", "0"},
      {"serve", "--texture-quality", "101"},
      {"serve", "--draco-speed", "10"},
      {"serve", "--source"},
      {"serve", "left-over"},
      {"serve", "--frames", "99999999999999999999"},
      {"serve", "--web", "8080"},
      {"serve", "--web", "127.0.0.1:99999"},
      {"serve", "--stream", "two words"},
      {"calibrate"},
      {"reconstruct"},
      {"reconstruct", "take"},
      {"reconstruct", "--out", "folder"},
      {"evaluate"},
      {"evaluate", "take", "--skip", "-1"},
      {"simulate", "--frames", "5"},
      {"simulate", "--scene", "plane", "--frames", "-1", "--out", "folder"},
  };
  for (const auto& arguments : wrong) {
    std::string shown;
    for (const std::string& a : arguments) shown += " " + a;
    const Finished done = run(server(arguments));
    EXPECT_EQ(done.status, 2) << shown << "\n" << done.out << done.err;
    EXPECT_EQ(done.out, "") << shown;
    EXPECT_EQ(lines(done.err).size(), 1U) << shown << "\n" << done.err;
    EXPECT_NE(done.err.find("--help"), std::string::npos) << shown << "\n" << done.err;
  }
}

TEST(ServerUsage, HelpAndVersion) {
  for (const std::vector<std::string>& command :
       {std::vector<std::string>{}, {"serve"}, {"simulate"}, {"reconstruct"}, {"evaluate"}}) {
    for (const std::string flag : {"--help", "--version"}) {
      std::vector<std::string> arguments = command;
      arguments.push_back(flag);
      const Finished done = run(server(arguments));
      EXPECT_EQ(done.status, 0) << done.err;
      EXPECT_EQ(done.err, "");
      EXPECT_NE(done.out, "");
    }
  }
}

}  // namespace
}  // namespace relievo::test
