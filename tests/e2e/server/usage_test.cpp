// SPDX-License-Identifier: Apache-2.0
// Wrong usage: exit status 2 and one line that says where help is. Flags and settings are the same.
#include <gmock/gmock.h>

#include <map>
#include <regex>

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
      {"serve", "--decoder", "auto", "--half-lines"},
      {"serve", "--bound", "nan"},
      {"serve", "--deadline", "nan"},
      {"serve", "--psnr", "nan"},
      {"calibrate"},
      {"reconstruct"},
      {"reconstruct", "take"},
      {"reconstruct", "--out", "folder"},
      {"reconstruct", "take", "--out", "take.ply"},
      {"evaluate"},
      {"evaluate", "take", "--pictures", "take.png"},
      {"evaluate", "take", "--skip", "-1"},
      {"evaluate", "take", "--pictures", ""},
      {"evaluate", ""},
      {"serve", "--source", "sim:plane", "--record", ""},
      {"serve", "--source", "sim:plane", "--record", "a.mcap", "--keep-for", "1h"},
      {"simulate", "--scene", "plane", "--scheme", "", "--out", "folder"},
      {"plan", "--slides", "3"},
      {"pattern", "--slides", "0", "--out", "folder"},
      {"simulate", "--frames", "5"},
      {"simulate", "--scene", "plane", "--frames", "-1", "--out", "folder"},
      {"simulate", "--scene", "plane,bogus=1", "--out", "folder"},
      {"simulate", "--scene", "plane,stripes=-1", "--out", "folder"},
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

/// "camera.controls", of each table of the installed configuration, whose examples name those of [[stream]].
std::set<std::string> settings() {
  std::set<std::string> out;
  std::string table;
  std::smatch found;
  for (const std::string& line :
       lines(read_text(std::string(RELIEVO_SOURCE_DIR) + "/packaging/server.toml"))) {
    if (std::regex_match(line, found, std::regex(R"(#? *\[+(\w+)\]+)"))) table = found[1].str() + ".";
    if (!line.starts_with("# ") && table == "stream.") table.clear();
    if (std::regex_match(line, found, std::regex(R"(#?(?:   )?(\w+) = .*)")))
      out.insert(table + found[1].str());
  }
  return out;
}

std::set<std::string> flags() {
  const std::string help = run(server({"serve", "--help"})).out;
  std::set<std::string> out;
  const std::regex flag(R"((?:^|\n)  (?:-\w,)?--([a-z-]+))");
  for (std::sregex_iterator it(help.begin(), help.end(), flag), end; it != end; ++it) out.insert((*it)[1]);
  return out;
}

TEST(ServerUsage, EverySettingIsAFlagAndEveryFlagASetting) {
  // Where a table says what a flag's name has to, and what is several settings or one flag again and again.
  const std::map<std::string, std::string> otherwise{
      {"recording.folder", "record-dir"},   {"projector.output", "projector"},
      {"projector.size", "projector-size"}, {"gateway.allow_origins", "allow-origin"},
      {"camera.controls", "control"},       {"stream.name", "stream"}};
  std::set<std::string> wanted;
  for (const std::string& setting : settings()) {
    const auto known = otherwise.find(setting);
    std::string name = known == otherwise.end() ? setting.substr(setting.find('.') + 1) : known->second;
    std::replace(name.begin(), name.end(), '_', '-');
    wanted.insert(name);
  }
  // Of a run, not of what is served: where the settings are, what is printed.
  for (const char* alone : {"config", "help", "version", "verbose", "quiet", "log-json"})
    wanted.insert(alone);
  ASSERT_GT(wanted.size(), 50U);
  EXPECT_THAT(flags(), testing::ContainerEq(wanted));
}

}  // namespace
}  // namespace relievo::test
