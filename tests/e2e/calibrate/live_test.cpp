// SPDX-License-Identifier: Apache-2.0
// Calibration from a live source, as a whole: captures are taken, kept and calibrated.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <signal.h>

#include <filesystem>
#include <nlohmann/json.hpp>

#include "tests/support/process.h"
#include "tests/support/temp_folder.h"

namespace relievo::test {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;
using testing::HasSubstr;

const std::string kBoard = "chessboard:7x5:40mm";

std::string source(int poses) {
  return "sim:board:" + kBoard + ",width=320,height=240,scan=progressive,stripes=40,distortion=1,period=" +
         std::to_string(20 * poses);
}

std::vector<std::string> command(const std::string& folder, const std::string& rig, int poses, int views) {
  return {program("relievo-server").string(),
          "calibrate",
          "geometry",
          folder,
          "--source",
          source(poses),
          "--views",
          std::to_string(views),
          "--board",
          kBoard,
          "--out",
          rig,
          "--json"};
}

TEST(LiveCalibration, ViewsAreTakenKeptAndCalibrated) {
  const TempFolder folder;
  const std::string views = (folder / "views").string(), rig = (folder / "rig.yaml").string();
  const Finished done = run(command(views, rig, 6, 4));
  ASSERT_EQ(done.status, 0) << done.err;
  EXPECT_THAT(done.err, HasSubstr("view_03 taken (4 of 4): 35 corners"));
  EXPECT_THAT(done.err, HasSubstr("still missing: "));
  const json report = json::parse(done.out, nullptr, false);
  ASSERT_FALSE(report.is_discarded()) << done.out;
  EXPECT_EQ(report.at("views_used"), 4);
  EXPECT_LT(report.at("stereo_rms_px").get<double>(), 0.2);
  EXPECT_TRUE(fs::exists(views + "/view_03/rows_slide2_complement.png"));
  EXPECT_TRUE(fs::exists(rig));

  // What was kept gives the same rig without the source.
  const Finished again = run({program("relievo-server").string(), "calibrate", "geometry", views, "--board",
                              kBoard, "--projector", "1024x768", "--out", rig, "--json"});
  ASSERT_EQ(again.status, 0) << again.err;
  EXPECT_EQ(json::parse(again.out).at("stereo_rms_px"), report.at("stereo_rms_px"));
}

TEST(LiveCalibration, InterruptedItKeepsWhatItTook) {
  const TempFolder folder;
  const std::string views = (folder / "views").string(), rig = (folder / "rig.yaml").string();
  Process live(command(views, rig, 400, 300));
  ASSERT_TRUE(live.wait_for_text("view_00 taken")) << live.err();
  live.signal(SIGINT);
  ASSERT_EQ(live.wait(), 0) << live.err();
  EXPECT_THAT(live.err(), testing::ContainsRegex("view(s of this run are| of this run is) in " + views));
  EXPECT_TRUE(fs::exists(views + "/view_00/columns_slide1.png"));
  EXPECT_FALSE(fs::exists(rig));
}

TEST(LiveCalibration, AFullDiskLeavesNoPartOfAView) {
  const TempFolder folder;
  const std::string views = (folder / "views").string();
  // A limit on the size of files stands for a full disk: coverage.png fits in, a camera's picture does not.
  std::string script = "trap '' XFSZ; ulimit -f 64; exec";
  for (const std::string& word : command(views, (folder / "rig.yaml").string(), 6, 4))
    script += " '" + word + "'";
  const Finished done = run({"/bin/bash", "-c", script});
  EXPECT_EQ(done.status, 1);
  EXPECT_THAT(done.err, HasSubstr("view_00/columns_slide1.png"));
  EXPECT_TRUE(fs::exists(views + "/coverage.png"));
  EXPECT_FALSE(fs::exists(views + "/view_00"));
}

TEST(LiveCalibration, ColoursAreTakenAndCalibrated) {
  const TempFolder folder;
  const std::string captures = (folder / "captures").string();
  const Finished done =
      run({program("relievo-server").string(), "calibrate", "colour", captures, "--source",
           "sim:sheet,width=320,height=240", "--out", (folder / "rig.yaml").string(), "--json"});
  ASSERT_EQ(done.status, 0) << done.err;
  EXPECT_LT(json::parse(done.out).at("residual").get<double>(), 3);
  EXPECT_TRUE(fs::exists(captures + "/110.png"));
}

TEST(LiveCalibration, SourcesThatShowNoBoardSayWhatIsNeeded) {
  const TempFolder folder;
  const auto refused = [&](std::vector<std::string> arguments, const std::string& words) {
    arguments.insert(arguments.begin(), {program("relievo-server").string(), "calibrate"});
    const Finished done = run(arguments);
    EXPECT_EQ(done.status, 1) << done.err;
    EXPECT_THAT(done.err, HasSubstr(words));
  };
  const std::string views = (folder / "views").string(), rig = (folder / "rig.yaml").string();
  const auto from = [&](const std::string& uri) {
    return std::vector<std::string>{"geometry", views, "--source", uri, "--board", kBoard, "--out", rig};
  };
  refused(from("sim:walk,width=160,height=120,frames=8"), "ended without a view");
  refused(from("sim:board:chess,width=160"), "is no board such as chessboard:9x7:75mm");
  refused(from("sim:board,width=160,height=120,stripes=20"), "holds views of another pattern");
  refused({"colour", views, "--source", "sim:walk,width=160,height=120,frames=8", "--out", rig},
          "ended without the captures");
  EXPECT_EQ(run({program("relievo-server").string(), "calibrate", "geometry", views, "--board", kBoard,
                 "--out", rig})
                .status,
            2);  // neither --projector nor --source
}

}  // namespace
}  // namespace relievo::test
