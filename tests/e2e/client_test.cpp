// SPDX-License-Identifier: Apache-2.0
// `relievo` as a user meets it: exit codes, one clear line for every failure, results on stdout.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <signal.h>

#include <algorithm>
#include <fstream>
#include <nlohmann/json.hpp>

#include "tests/support/own_domain.h"
#include "tests/support/patience.h"
#include "tests/support/process.h"
#include "tests/support/temp_folder.h"

namespace relievo {
namespace {

using test::program;
using testing::HasSubstr;

const std::string kDomain = std::to_string(test::own_domain());

std::vector<std::string> relievo(std::vector<std::string> arguments) {
  arguments.insert(arguments.begin(), program("relievo"));
  return arguments;
}

void expect_one_line(const std::string& text) {
  EXPECT_EQ(std::count(text.begin(), text.end(), '\n'), 1) << text;
}

TEST(Client, WrongUsageIsExitTwoAndOneLine) {
  const std::vector<std::vector<std::string>> wrong = {
      {},
      {"strems"},
      {"streams", "--wait", "soon"},
      {"streams", "--domain", "231"},
      {"record"},
      {"record", ""},
      {"record", "no spaces"},
      {"record", "face", "--frames", "0"},
      {"record", "face", "--frames", "-3"},
      {"play"},
      {"play", "a.mcap", "--speed", "0"},
      {"play", "a.mcap", "--loop", "--once"},
      {"stats", "no spaces"},
      {"info"},
      {"info", "face", "--stream", "other"},
      {"export", "a.mcap", "--out", "d", "--format", "stl"},
      {"export", "a.mcap", "--out", "a.mcap", "--format", "animation"},
      {"export", "a.mcap", "--out", "d", "--format", "depth", "--depth-unit", "nan"},
      {"export", "a.mcap", "--out", "d", "--depth-unit", "2"},
      {"export", "a.mcap", "--out", "d", "--reencode"},
      {"export", "a.mcap", "--out", "a.glb", "--format", "glb"},
      {"export", "a.mcap", "--out", "a.PLY"},
      {"shot", "a.mcap", "--out", "a.jpg"},
      {"convert", "a.mcap", "--out", "b.mcap", "--geometry", "visual", "--bound", "nan"},
      {"convert", "a.mcap", "--out", "b.mcap", "--bound", "1"},
      {"convert", "a.mcap", "--out", "b.mcap", "--geometry", "draco-mesh", "--step-bits", "4"},
      {"convert", "a.mcap", "--out", "b.mcap", "--draco-speed", "3"},
      {"web", "--listen"},
      {"web", "--listen", "here"},
  };
  for (const auto& arguments : wrong) {
    const auto done = test::run(relievo(arguments));
    EXPECT_EQ(done.status, 2) << testing::PrintToString(arguments) << done.err;
    EXPECT_EQ(done.out, "");
    expect_one_line(done.err);
  }
}

TEST(Client, EveryVerbHasHelpAndVersion) {
  for (const std::string verb : {"streams", "record", "play", "info", "export", "web", "doctor"}) {
    const auto help = test::run(relievo({verb, "--help"}));
    EXPECT_EQ(help.status, 0) << verb;
    EXPECT_THAT(help.out, HasSubstr("--quiet"));
    const auto version = test::run(relievo({verb, "--version"}));
    EXPECT_EQ(version.status, 0) << verb;
    EXPECT_THAT(version.out, HasSubstr("relievo "));
  }
}

TEST(Client, DoctorSaysWhatItFoundAndFailsWhereThereIsTrouble) {
  const test::TempFolder folder;
  const auto doctor = [&](const std::string& where) {
    return test::run(relievo({"doctor", "--json", "--interface", "lo", "--domain", kDomain, "--keys", "none",
                              "--wait", "0.2", "--folder", where}));
  };
  const auto found = nlohmann::json::parse(doctor(folder.path()).out);
  std::vector<std::string> checks;
  for (const auto& finding : found) checks.push_back(finding["check"]);
  EXPECT_THAT(checks,
              testing::IsSupersetOf({"interface", "receive buffer", "streams", "keys", "disk", "clock"}));
  const auto streams = std::find(checks.begin(), checks.end(), "streams") - checks.begin();
  EXPECT_EQ(found[static_cast<std::size_t>(streams)]["grade"], "good");
  const auto failed = doctor(folder / "missing");
  EXPECT_EQ(failed.status, 1);
  expect_one_line(failed.err);
  EXPECT_THAT(failed.err, HasSubstr("trouble"));
  EXPECT_THAT(failed.out, HasSubstr("--folder"));
}

TEST(Client, StatsEndWhereNobodyReadsThem) {
  std::vector<std::string> command = {"/bin/sh", "-c", "exec \"$0\" \"$@\" > /dev/full"};
  for (const std::string& word : relievo({"stats", "absent", "--domain", kDomain, "--interface", "lo"}))
    command.push_back(word);
  const auto done = test::run(command);
  EXPECT_EQ(done.status, 1);
  EXPECT_THAT(done.err, HasSubstr("cannot write the results"));
}

TEST(Client, FailuresAreExitOneAndOneLine) {
  const test::TempFolder folder;
  std::ofstream(folder / "text.mcap") << "no recording\n";
  const std::string text = folder / "text.mcap";
  const std::vector<std::vector<std::string>> failing = {
      {"info", folder / "none.mcap"},
      {"info", text},
      {"info", "nobody", "--wait", "0.2", "--domain", kDomain, "--interface", "lo"},
      {"play", folder / "none.mcap"},
      {"play", text},
      {"export", text, "--out", folder / "out"},
      {"web", text},
      {"web", folder / "none.mcap"},
      {"record", "face", "--out", text},
      {"record", "face", "--out", folder / "no" / "folder.mcap"},
      {"record", "face", "--out", folder / "new.mcap", "--interface", "no-such-if0"},
      {"streams", "--interface", "no-such-if0"},
  };
  for (const auto& arguments : failing) {
    const auto done = test::run(relievo(arguments));
    EXPECT_EQ(done.status, 1) << testing::PrintToString(arguments) << done.err;
    EXPECT_EQ(done.out, "");
    expect_one_line(done.err);
    EXPECT_THAT(done.err, HasSubstr("error: "));
  }
  EXPECT_FALSE(std::filesystem::exists(folder / "new.mcap"));
  EXPECT_FALSE(std::filesystem::exists(folder / "out"));
}

TEST(Client, RecordingAnAbsentStreamSaysSoAndLeavesNoFile) {
  const test::TempFolder folder;
  const auto done = test::run(relievo({"record", "absent", "--domain", kDomain, "--interface", "lo", "--wait",
                                       "1.5", "--out", folder / "a.mcap"}));
  EXPECT_EQ(done.status, 1);
  EXPECT_THAT(done.err, HasSubstr("waiting for stream 'absent'"));
  EXPECT_THAT(done.err, HasSubstr("error: no stream 'absent' in domain " + kDomain));
  EXPECT_FALSE(std::filesystem::exists(folder / "a.mcap"));
}

TEST(Client, StatsOfAnAbsentStreamHaveNoTimes) {
  const auto done = test::run(
      relievo({"stats", "absent", "--domain", kDomain, "--interface", "lo", "--seconds", "0.2", "--json"}));
  EXPECT_EQ(done.status, 1);
  const auto stats = nlohmann::json::parse(done.out);
  EXPECT_EQ(stats["frames"], 0);
  EXPECT_TRUE(stats["decode_ms"].is_null() && stats["latency_ms"].is_null()) << done.out;
}

TEST(Client, StreamsListsWhatIsLive) {
  const auto empty =
      test::run(relievo({"streams", "--json", "--domain", kDomain, "--interface", "lo", "--wait", "0.3"}));
  EXPECT_EQ(empty.status, 0);
  EXPECT_EQ(nlohmann::json::parse(empty.out), nlohmann::json::array());
  EXPECT_THAT(empty.err, HasSubstr("no live stream in domain " + kDomain));

  test::Process server({program("test_publisher"), "listed", kDomain, "100", "50", "5"});
  ASSERT_TRUE(server.wait_for_text("done")) << server.err();
  // It listens for a second; on a loaded machine the stream may be heard of in the next one only.
  nlohmann::json json;
  ASSERT_TRUE(test::eventually([&] {
    json = nlohmann::json::parse(
        test::run(relievo({"streams", "--json", "--domain", kDomain, "--interface", "lo"})).out);
    return !json.empty() && json[0].contains("state");
  }));
  ASSERT_EQ(json.size(), 1u) << json;
  EXPECT_EQ(json[0]["stream"], "listed");
  EXPECT_EQ(json[0]["state"], "running");
  EXPECT_EQ(json[0]["stripes"], 7);
  test::Finished table;
  ASSERT_TRUE(test::eventually([&] {
    table = test::run(relievo({"streams", "--domain", kDomain, "--interface", "lo"}));
    return table.out.find("listed") != std::string::npos;
  })) << table.out;
  EXPECT_EQ(table.err, "");
}

TEST(Client, InfoDescribesALiveStreamAlsoBesideAFolderOfItsName) {
  const test::TempFolder folder;
  std::filesystem::create_directory(folder / "watched");
  test::Process server({program("test_publisher"), "watched", kDomain, "5000", "50", "100000"});
  ASSERT_TRUE(server.wait_for_text("live")) << server.err();
  nlohmann::json json;
  ASSERT_TRUE(test::eventually([&] {
    const auto info = test::run({"/usr/bin/env", "-C", folder.path(), program("relievo"), "info", "watched",
                                 "--json", "--wait", "1", "--domain", kDomain, "--interface", "lo"});
    json = info.status == 0 ? nlohmann::json::parse(info.out) : nlohmann::json();
    return info.status == 0 && json["frames"] > 10;
  })) << json;
  EXPECT_GT(json["frame_rate"], 0);
  EXPECT_EQ(json["state"], "running");
  EXPECT_EQ(json["info"]["rig"]["camera"]["size"], nlohmann::json({640, 480}));
}

}  // namespace
}  // namespace relievo
