// SPDX-License-Identifier: Apache-2.0
// docs/CALIBRATION.md's worked example, from nothing to a reconstruction, and how the commands refuse.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <signal.h>

#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>

#include "base/whole_file.h"
#include "capture/calibrate/pictures.h"
#include "capture/picture_file.h"
#include "capture/rig_file.h"
#include "tests/e2e/calibrate/calibrate_report.h"
#include "tests/support/patience.h"
#include "tests/support/process.h"
#include "tests/support/temp_folder.h"

namespace relievo::test {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;
using testing::HasSubstr;
using testing::Not;

TEST(CalibrationExample, FromNothingToAReconstruction) {
  const TempFolder folder;
  const std::string out = (folder / "example").string(), rig = (folder / "rig.yaml").string();
  const json example = report({"calibrate", "example", "--out", out, "--views", "6", "--json"});
  const json colour = report({"calibrate", "colour", out + "/colours", "--out", rig, "--json"});
  EXPECT_LT(colour.at("residual").get<double>(), 3);
  for (const json& c : colour.at("colours")) {
    if (c.contains("margin")) {
      EXPECT_GT(c.at("margin").get<double>(), 150) << c;
    }
  }
  const json geometry = report({"calibrate", "geometry", out + "/views", "--board", example.at("board"),
                                "--projector", example.at("projector"), "--update", rig, "--compare",
                                out + "/truth.yaml", "--pictures", (folder / "pictures").string(), "--json"});
  EXPECT_LT(geometry.at("stereo_rms_px").get<double>(), 0.08);
  EXPECT_EQ(geometry.at("views_used"), 6);
  EXPECT_LT(geometry.at("compare").at("camera_focal_percent").get<double>(), 0.3);
  EXPECT_LT(geometry.at("compare").at("projector_focal_percent").get<double>(), 0.3);
  EXPECT_LT(geometry.at("compare").at("baseline_mm").get<double>(), 2);
  EXPECT_LT(geometry.at("compare").at("depth_rms_mm").get<double>(), 1);
  EXPECT_GT(fs::file_size(folder / "pictures/residuals.png"), 10000u);
  const auto written = read_rig(rig);
  ASSERT_TRUE(written.ok()) << written.error().message;
  EXPECT_EQ(written->stereo_rms_px, geometry.at("stereo_rms_px").get<double>());
  EXPECT_GT(written->scale_error, geometry.at("scale_error").get<double>());
  EXPECT_LT(geometry.at("compare").at("depth_rms_mm").get<double>(),
            2 * geometry.at("depth_sigma_mm").get<double>());
  EXPECT_LT(written->scale_error, 0.001);

  // A take of the same rig, reconstructed with what was just calibrated instead of the truth.
  const std::string take = (folder / "take").string();
  ASSERT_EQ(server({"simulate", "--scene", "object,distortion=1", "--frames", "3", "--out", take}).status, 0);
  const json with_truth = report({"evaluate", take, "--json"});
  fs::copy_file(rig, take + "/rig.yaml", fs::copy_options::overwrite_existing);
  const json calibrated = report({"evaluate", take, "--json"});
  EXPECT_GT(calibrated.at("completeness").get<double>(), with_truth.at("completeness").get<double>() - 0.01);
  EXPECT_LT(calibrated.at("median_um_per_m").get<double>(), 1000);
}

// A camera whose gamma cannot be switched off: colours tell it, and what is decoded with them is as exact.
TEST(CalibrationExample, ACurvedCameraIsStraightened) {
  const TempFolder folder;
  const std::string out = (folder / "example").string(), rig = (folder / "rig.yaml").string();
  const json example =
      report({"calibrate", "example", "--rig", "object,gamma=2.2", "--out", out, "--views", "4", "--json"});
  const json colour = report({"calibrate", "colour", out + "/colours", "--out", rig, "--json"});
  EXPECT_NEAR(colour.at("camera_gamma").get<double>(), 2.2, 0.05);
  EXPECT_LT(colour.at("residual").get<double>(), 3);
  report({"calibrate", "geometry", out + "/views", "--board", example.at("board"), "--projector",
          example.at("projector"), "--update", rig, "--json"});
  const auto written = read_rig(rig);
  ASSERT_TRUE(written.ok()) << written.error().message;
  EXPECT_EQ(written->camera_gamma, colour.at("camera_gamma").get<double>());

  const std::string take = (folder / "take").string();
  ASSERT_EQ(server({"simulate", "--scene", "object,gamma=2.2", "--frames", "3", "--out", take}).status, 0);
  const json with_truth = report({"evaluate", take, "--json"});
  report({"calibrate", "colour", out + "/colours", "--update", take + "/rig.yaml", "--json"});
  const json told = report({"evaluate", take, "--json"});
  EXPECT_LT(told.at("rms_um_per_m").get<double>(), 1.1 * with_truth.at("rms_um_per_m").get<double>());

  const json as_is =
      report({"calibrate", "colour", out + "/colours", "--gamma", "1", "--out", rig, "--json"});
  EXPECT_EQ(as_is.at("camera_gamma"), 1);
  EXPECT_GT(as_is.at("residual").get<double>(), 10);
  EXPECT_NE(server({"calibrate", "colour", out + "/colours", "--gamma", "0.45", "--out", rig}).status, 0);
}

// What was calibrated before outlasts captures that cannot be right; those that may be are warned of.
TEST(CalibrationExample, SwappedCapturesReplaceNoColours) {
  const TempFolder folder;
  const std::string out = (folder / "example").string(), rig = (folder / "rig.yaml").string();
  report({"calibrate", "example", "--out", out, "--views", "3", "--json"});
  report({"calibrate", "colour", out + "/colours", "--out", rig, "--json"});
  const auto before = read_whole_file(rig, 10000);
  ASSERT_TRUE(before.ok()) << before.error().message;
  const auto exchange = [&](const std::string& a, const std::string& b) {
    fs::rename(out + "/colours/" + a, out + "/kept.png");
    fs::rename(out + "/colours/" + b, out + "/colours/" + a);
    fs::rename(out + "/kept.png", out + "/colours/" + b);
  };
  exchange("100.png", "011.png");
  const Finished swapped = server({"calibrate", "colour", out + "/colours", "--update", rig});
  EXPECT_EQ(swapped.status, 1);
  EXPECT_THAT(swapped.err, HasSubstr("the pictures of 100 and 011 seem to be swapped"));
  EXPECT_EQ(read_whole_file(rig, 10000).value(), *before);
  exchange("010.png", "011.png");  // all three in turn: too much to say which
  const Finished turned = server({"calibrate", "colour", out + "/colours", "--out", rig});
  EXPECT_EQ(turned.status, 0) << turned.err;
  EXPECT_THAT(turned.err, HasSubstr("the colours are far off"));
}

TEST(CalibrationExample, ExchangedChannelsAreWarnedOf) {
  const TempFolder folder;
  const std::string example = folder / "example", rig = folder / "rig.yaml";
  report({"calibrate", "example", "--rig", "object,width=160,height=120,stripes=20", "--board",
          "chessboard:7x5:40mm", "--views", "3", "--out", example, "--json"});
  const std::vector<std::string> calibrate{"calibrate", "colour", example + "/colours", "--out", rig};
  EXPECT_THAT(server(calibrate).err, Not(HasSubstr("exchanged")));
  for (const auto& file : fs::directory_iterator(example + "/colours")) {
    auto picture = read_rgb(file.path());
    ASSERT_TRUE(picture.ok()) << picture.error().message;
    for (int y = 0; y < picture->height(); ++y)
      for (int x = 0; x < picture->width(); ++x)
        std::swap(picture->row(y)[3 * x], picture->row(y)[3 * x + 2]);
    ASSERT_TRUE(write_png(file.path(), *picture).ok());
  }
  const Finished done = server(calibrate);
  EXPECT_EQ(done.status, 0) << done.err;
  EXPECT_THAT(done.err, HasSubstr("the camera sees red as blue, blue as red"));
}

TEST(CalibrationExample, WhatFailsBesidesTheRigLeavesTheRigOfBefore) {
  const TempFolder folder;
  const std::string out = (folder / "example").string(), rig = (folder / "rig.yaml").string();
  report({"calibrate", "example", "--out", out, "--views", "3", "--json"});
  fs::copy_file(out + "/truth.yaml", rig);
  const auto before = read_whole_file(rig, 10000);
  ASSERT_TRUE(before.ok()) << before.error().message;
  auto other = read_rig(rig);
  ASSERT_TRUE(other.ok()) << other.error().message;
  other->camera.width *= 2;
  const std::string wider = (folder / "wider.yaml").string(), no_folder = out + "/truth.yaml/pictures";
  ASSERT_TRUE(write_whole_file(wider, to_yaml(*other)).ok());
  fs::create_directories(folder / "taken/residuals.png");  // a folder of the picture's name
  const auto refused = [&](const std::string& flag, const std::string& value, const std::string& words) {
    const Finished done = server({"calibrate", "geometry", out + "/views", "--board", "chessboard:9x7:25mm",
                                  "--projector", "1024x768", "--update", rig, flag, value});
    EXPECT_EQ(done.status, 1) << done.err;
    EXPECT_THAT(done.err, HasSubstr(words));
    EXPECT_EQ(read_whole_file(rig, 10000).value(), *before) << flag << " " << value;
  };
  refused("--pictures", no_folder, "cannot make the folder");
  refused("--pictures", (folder / "taken").string(), "residuals.png");
  refused("--compare", wider, "differ in size");
}

TEST(CalibrationExample, CharucoBoardUnderGrayCode) {
  const TempFolder folder;
  const std::string out = (folder / "example").string(), rig = (folder / "rig.yaml").string();
  const std::string board = "charuco:12x9:25mm:18mm:5X5_100";
  report(
      {"calibrate", "example", "--out", out, "--views", "4", "--board", board, "--code", "gray", "--json"});
  const json geometry = report({"calibrate", "geometry", out + "/views", "--board", board, "--projector",
                                "1024x768", "--out", rig, "--compare", out + "/truth.yaml", "--json"});
  EXPECT_EQ(geometry.at("views_used"), 4);
  EXPECT_GT(geometry.at("corners_used"), 300);
  EXPECT_LT(geometry.at("stereo_rms_px").get<double>(), 0.25);
  EXPECT_LT(geometry.at("compare").at("depth_rms_mm").get<double>(), 3);

  // A damaged view is named and left out, the others do.
  fs::remove(out + "/views/view_01/gray_07.png");
  const Finished without = server(
      {"calibrate", "geometry", out + "/views", "--board", board, "--projector", "1024x768", "--out", rig});
  EXPECT_EQ(without.status, 0) << without.err;
  EXPECT_THAT(without.err, HasSubstr("view view_01 is left out"));
}

TEST(CalibrationExample, RaysThatMissEachOtherAreWarnedOf) {
  const TempFolder folder;
  report({"calibrate", "example", "--out", folder.path().string(), "--code", "gray", "--views", "3", "--rig",
          "plane,width=320,height=240", "--json"});
  const fs::path view = folder / "views" / "view_00";
  const auto warnings = [&] {
    const Finished done = server({"import", "gray", view.string(), "--calibration",
                                  (folder / "truth.yaml").string(), "--out", (folder / "maps").string()});
    EXPECT_EQ(done.status, 0) << done.err;
    return done.err;
  };
  EXPECT_THAT(warnings(), Not(HasSubstr("miss each other")));
  fs::rename(view / "gray_04.png", folder / "inverse.png");
  fs::rename(view / "gray_05.png", view / "gray_04.png");
  fs::rename(folder / "inverse.png", view / "gray_05.png");
  EXPECT_THAT(warnings(), HasSubstr("miss each other"));
}

TEST(CalibrationExample, BoardToPrintHasTheSizeAskedFor) {
  const TempFolder folder;
  const std::string file = (folder / "board.png").string();
  const json board = report(
      {"calibrate", "board", "--board", "charuco:6x5:30mm:20mm", "--dpi", "80", "--out", file, "--json"});
  EXPECT_NEAR(board.at("width_mm").get<double>(), 240, 3);
  EXPECT_GT(fs::file_size(file), 1000u);
  EXPECT_EQ(
      server({"calibrate", "board", "--board", "charuco:6x5:1mm:0.5mm", "--dpi", "80", "--out", file}).status,
      1);
}

TEST(CalibrationExample, SlidesOfBothAxesAreWrittenInOrder) {
  const TempFolder folder;
  const std::string slides = (folder / "slides").string();
  const json written =
      report({"pattern", "--both-axes", "--stripes", "16", "--size", "256x192", "--out", slides, "--json"});
  EXPECT_EQ(written.at("slides"), 8);
  EXPECT_EQ(written.at("row_stripes"), 12);
  EXPECT_TRUE(fs::exists(slides + "/rows_slide2_complement.png"));
  EXPECT_TRUE(fs::exists(slides + "/pattern.yaml"));
}

TEST(CalibrationExample, GraySlidesAreImportedBack) {
  const TempFolder folder;
  const std::string slides = (folder / "slides").string();
  const json written = report({"pattern", "--gray", "--size", "128x96", "--out", slides, "--json"});
  EXPECT_EQ(written.at("slides"), 30);
  const json imported = report(
      {"import", "gray", slides, "--projector", "128x96", "--out", (folder / "maps").string(), "--json"});
  EXPECT_EQ(imported.at("decoded_pixels"), 128 * 96);
  EXPECT_TRUE(fs::exists(folder / "maps/columns.npy"));
}

TEST(CalibrationExample, InterruptedSlidesAreNoFailure) {
  const TempFolder folder;
  const std::string out = (folder / "gray").string();
  Process pattern(
      {program("relievo-server").string(), "pattern", "--gray", "--size", "4096x2160", "--out", out});
  ASSERT_TRUE(eventually([&] { return fs::exists(out + "/gray_00.png"); })) << pattern.err();
  pattern.signal(SIGINT);
  EXPECT_EQ(pattern.wait(), 0) << pattern.err();
  EXPECT_THAT(pattern.err(), HasSubstr(" of 50 slides are in " + out));
}

TEST(CalibrationExample, AnImportMayWriteAmongThePicturesAgainAndAgain) {
  const TempFolder folder;
  const std::string slides = (folder / "slides").string();
  report({"pattern", "--gray", "--size", "128x96", "--out", slides, "--json"});
  const std::vector<std::string> import{"import", "gray",  slides, "--projector",
                                        "128x96", "--out", slides, "--json"};
  const json first = report(import);
  EXPECT_EQ(first.at("decoded_pixels"), 128 * 96);
  EXPECT_EQ(report(import), first);
  EXPECT_TRUE(fs::exists(slides + "/picture.png"));
  // One of that name which no import wrote is a capture.
  for (const std::string ours : {"columns.npy", "rows.npy", "picture.png"}) fs::remove(slides + "/" + ours);
  fs::rename(slides + "/gray_29.png", slides + "/picture.png");
  const auto before = read_whole_file(slides + "/picture.png", 100000);
  ASSERT_TRUE(before.ok()) << before.error().message;
  const Finished refused = server(import);
  EXPECT_EQ(refused.status, 1);
  EXPECT_THAT(refused.err, HasSubstr("give --out another folder"));
  EXPECT_EQ(read_whole_file(slides + "/picture.png", 100000).value(), *before);
}

TEST(CalibrationExample, ViewsThatDoNotBelongAreNamedAndASizeThatCannotBeIsWarnedOf) {
  const TempFolder folder;
  const std::string out = (folder / "example").string(), other = (folder / "other").string();
  report({"calibrate", "example", "--out", out, "--views", "5", "--json"});
  report({"calibrate", "example", "--out", other, "--views", "3", "--rig", "object,width=320,height=240",
          "--json"});
  const auto calibrate = [&](const std::string& views, const std::string& projector) {
    return server({"calibrate", "geometry", views, "--board", "chessboard:9x7:25mm", "--projector", projector,
                   "--out", (folder / "rig.yaml").string()});
  };
  const Finished parent = calibrate(out, "1024x768");
  EXPECT_EQ(parent.status, 1);
  EXPECT_THAT(parent.err, HasSubstr("holds a folder of views: give " + out + "/views"));

  const Finished wrong_size = calibrate(out + "/views", "1280x720");
  EXPECT_EQ(wrong_size.status, 0) << wrong_size.err;
  EXPECT_THAT(wrong_size.err, HasSubstr("was the projector's size 1280x720"));

  fs::copy(other + "/views/view_00", out + "/views/a_smaller_one", fs::copy_options::recursive);
  const Finished mixed = calibrate(out + "/views", "1024x768");
  EXPECT_EQ(mixed.status, 0) << mixed.err;
  EXPECT_THAT(mixed.err,
              HasSubstr("view a_smaller_one is left out: its pictures are 320x240, others 640x480"));
  EXPECT_THAT(mixed.err, testing::Not(HasSubstr("projector's size")));

  for (int i = 0; i < 5; ++i) {
    const fs::path view = out + "/views/view_0" + std::to_string(i);
    for (const auto& file : fs::directory_iterator(view))  // nothing but light
      fs::copy_file(out + "/colours/111.png", file.path(), fs::copy_options::overwrite_existing);
  }
  const Finished none = calibrate(out + "/views", "1024x768");
  EXPECT_EQ(none.status, 1);
  EXPECT_EQ(none.err.find("view_03"), none.err.rfind("view_03")) << none.err;
}

TEST(CalibrationExample, PicturesThatAreNotWhatTheyShouldBeAreWarnedOf) {
  const TempFolder folder;
  const fs::path slides = folder / "slides", turned = folder / "turned";
  report({"pattern", "--gray", "--size", "128x96", "--out", slides.string(), "--json"});
  const auto warnings = [&](const fs::path& pictures) {
    const Finished done = server(
        {"import", "gray", pictures.string(), "--projector", "128x96", "--out", (folder / "maps").string()});
    EXPECT_EQ(done.status, 0) << done.err;
    return done.err;
  };
  fs::create_directories(turned);
  for (int i = 0; i < 28; ++i)  // without white and black
    fs::copy_file(slides / (std::string(i < 10 ? "gray_0" : "gray_") + std::to_string(i) + ".png"),
                  turned / (std::to_string(27 - i) + ".png"));
  EXPECT_EQ(warnings(slides), "");
  EXPECT_THAT(warnings(turned), HasSubstr("are the pictures in the order of projection"));
  fs::copy_file(slides / "gray_02.png", slides / "gray_03.png", fs::copy_options::overwrite_existing);
  EXPECT_THAT(warnings(slides), HasSubstr("the pictures of column bit 5 and of its inverse hardly differ"));
}

TEST(CalibrationExample, DarkPicturesAreToldFromWronglyOrderedOnes) {
  const TempFolder folder;
  const fs::path slides = folder / "slides";
  report({"pattern", "--gray", "--size", "64x48", "--out", slides.string(), "--json"});
  for (const auto& slide : fs::directory_iterator(slides)) {
    if (slide.path().extension() != ".png") continue;
    auto picture = read_rgb(slide.path());
    ASSERT_TRUE(picture) << picture.error().message;
    for (std::size_t i = 0; i < picture->size(); ++i) picture->data()[i] /= 16;
    ASSERT_TRUE(write_png(slide.path(), *picture));
  }
  const Finished dark = server(
      {"import", "gray", slides.string(), "--projector", "64x48", "--out", (folder / "maps").string()});
  EXPECT_EQ(dark.status, 1);
  EXPECT_THAT(dark.err, HasSubstr("15 of 255 at their brightest")) << dark.err;
}

TEST(CalibrationExample, CloudsToCompareAreOfTheSameUnit) {
  const TempFolder folder;
  const std::string out = (folder / "example").string(), maps = (folder / "maps").string();
  report({"calibrate", "example", "--out", out, "--views", "3", "--code", "gray", "--json"});
  std::vector<std::string> import{
      "import", "gray",     out + "/views/view_00", "--calibration", out + "/truth.yaml", "--out", maps,
      "--json", "--compare"};
  const auto refused = [&](const std::string& cloud, const std::string& words) {
    std::vector<std::string> arguments = import;
    arguments.push_back(cloud);
    const Finished done = server(arguments);
    EXPECT_EQ(done.status, 1) << done.err;
    EXPECT_THAT(done.err, HasSubstr(words));
  };
  refused(out + "/truth.yaml", "it is no PLY file");
  EXPECT_FALSE(fs::exists(maps));
  report({import.begin(), import.end() - 1});
  refused(maps + "/points.ply",
          "points.ply is 1000 times smaller than what these pictures show: --compare-unit m?");
  import.insert(import.end(), {maps + "/points.ply", "--compare-unit", "m"});
  EXPECT_EQ(report(import).at("compare").at("nearest_mm").at("median"), 0);
}

TEST(CalibrationExample, AnImportLeavesItsCalibrationAsItIs) {
  const TempFolder folder;
  const std::string view = (folder / "views" / "view_00").string(), rig = (folder / "rig.yaml").string();
  report({"calibrate", "example", "--out", folder.path().string(), "--code", "gray", "--views", "3", "--rig",
          "plane,width=320,height=240", "--json"});
  fs::rename(folder / "truth.yaml", rig);
  std::ofstream(rig, std::ios::app) << "# of the bench by the window\n";
  const auto before = read_whole_file(rig, 10000);
  report({"import", "gray", view, "--calibration", rig, "--out", folder.path().string(), "--json"});
  EXPECT_EQ(read_whole_file(rig, 10000).value(), *before);
  EXPECT_TRUE(fs::exists(folder / "points.ply"));
}

TEST(CalibrationExample, RefusalsAreOneLineAndExitOne) {
  const TempFolder folder;
  const auto refused = [](const std::vector<std::string>& arguments, const std::string& words) {
    const Finished done = server(arguments);
    EXPECT_EQ(done.status, 1) << done.err;
    EXPECT_THAT(done.err, HasSubstr(words));
    EXPECT_EQ(done.out, "");
  };
  const std::string rig = (folder / "rig.yaml").string(), empty = folder.path().string();
  refused({"calibrate", "colour", empty, "--out", rig},
          "has no captures: name each picture by the projected colour");
  refused({"calibrate", "geometry", empty, "--board", "chessboard:9x7:25mm", "--projector", "1024x768",
           "--out", rig},
          "has no folders");
  refused({"calibrate", "colour", empty, "--update", rig}, "--out " + rig + " begins a new one");
  refused({"calibrate", "geometry", empty, "--board", "chessboard:9x7:25mm", "--projector", "1024x768",
           "--update", rig},
          "--out " + rig + " begins a new one");
  refused({"import", "gray", empty, "--out", empty + "/o", "--projector", "64x48"}, "has 0 pictures");
  fs::create_directory(folder / "view_00");
  for (const std::string pictures : {"/view_00", "/residuals", "/view_00/../view_01/"})
    refused({"calibrate", "geometry", empty, "--board", "chessboard:9x7:25mm", "--projector", "1024x768",
             "--out", rig, "--pictures", empty + pictures},
            "is among the views");
  EXPECT_EQ(std::distance(fs::directory_iterator(folder.path()), {}), 1);
  EXPECT_FALSE(fs::exists(rig));
}

TEST(CalibrationExample, WrongUsageExitsTwo) {
  EXPECT_EQ(server({"calibrate"}).status, 2);
  EXPECT_EQ(server({"calibrate", "colour", "somewhere"}).status, 2);  // neither --out nor --update
  EXPECT_EQ(server({"import", "gray", "somewhere", "--out", "o", "--projector", "12"}).status, 2);
  EXPECT_EQ(server({"import", "gray", "somewhere", "--out", "o", "--compare", "c.ply"}).status, 2);
  const auto wrong = [](const std::vector<std::string>& arguments, const std::string& words) {
    const Finished done = server(arguments);
    EXPECT_EQ(done.status, 2) << done.err;
    EXPECT_THAT(done.err, HasSubstr(words));
  };
  wrong({"import", "gray", "somewhere", "--out", "o"}, "--projector or --calibration");
  for (const std::string verb : {"geometry", "board", "example"})
    wrong({"calibrate", verb, "--out", "o", "--board", "circles:9x7"},
          "is no board such as chessboard:9x7:75mm");
  wrong({"pattern", "--out", "o", "--stripes", "1"}, "at least 2 stripes");
  wrong({"pattern", "--out", "o", "--base", "7"}, "use a base of 3 to 6");
  for (const std::string out : {"slides.mp4", "slides.png"})
    wrong({"pattern", "--out", out}, "a video's name that ends in .mkv");
  wrong({"calibrate", "board", "--board", "chessboard:9x7:25mm", "--out", "b.pdf"}, "must end in .png");
  wrong({"plan", "--base", "7"}, "use a base of 3 to 6");
  wrong({"project", "--base", "7"}, "use a base of 3 to 6");
  wrong({"project", "--still", "foo"}, "there is no picture foo");
  wrong({"project", "--still", "white", "--pictures", "3"}, "--pictures excludes --still");
  wrong({"project", "--still", "white", "--cycle", "colours"}, "--cycle excludes --still");
  for (const std::string no_number : {"nan", "-1", "inf"}) {
    const Finished gamma = server({"calibrate", "colour", "c", "--out", "o", "--gamma", no_number});
    const Finished rate = server({"calibrate", "geometry", "v", "--board", "chessboard:9x7:25mm",
                                  "--projector", "1024x768", "--out", "o", "--frame-rate", no_number});
    const Finished gap =
        server({"import", "gray", "f", "--out", "o", "--projector", "64x48", "--max-gap", no_number});
    for (const Finished& done : {gamma, rate, gap}) {
      EXPECT_EQ(done.status, 2) << done.err;
      EXPECT_THAT(done.err, HasSubstr("'" + no_number + "' is no number"));
      EXPECT_LT(done.err.size(), 200u) << done.err;
    }
  }
  EXPECT_EQ(server({"calibrate", "geometry", "--help"}).status, 0);
}

}  // namespace
}  // namespace relievo::test
