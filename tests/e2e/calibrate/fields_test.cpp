// SPDX-License-Identifier: Apache-2.0
// Proves: cameras that scan in any way calibrate, from views and live, and rig.yaml says how they scan.
#include <gmock/gmock.h>

#include <algorithm>
#include <filesystem>
#include <sstream>

#include "capture/calibrate/pictures.h"
#include "capture/calibrate/stripe_stack.h"
#include "capture/field_order_file.h"
#include "capture/pattern/schedule.h"
#include "capture/picture_file.h"
#include "capture/rig_file.h"
#include "tests/e2e/calibrate/calibrate_report.h"
#include "tests/support/temp_folder.h"

namespace relievo::test {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;
using testing::HasSubstr;

const std::string kBoard = "chessboard:7x5:40mm";

/// Leaves a view's whole pictures as the frames of an interlaced camera.
void interlace(const fs::path& view, FieldOrder first) {
  const auto whole = stripe_view_names(2, Scan::kProgressive),
             frames = stripe_view_names(2, Scan::kInterlaced);
  for (std::size_t i = 0; i < frames.size(); ++i) {
    const fs::path lit = view / (whole[2 * i] + ".png"), complement = view / (whole[2 * i + 1] + ".png");
    auto frame = read_rgb(lit);
    const auto other = read_rgb(complement);
    ASSERT_TRUE(frame.ok() && other.ok()) << view;
    for (int y = first_row(first, 1); y < frame->height(); y += 2)
      std::copy_n(other->row(y), other->stride(), frame->row(y));
    fs::remove(lit);
    fs::remove(complement);
    ASSERT_TRUE(write_png(view / (frames[i] + ".png"), *frame).ok());
  }
}

class FieldOrders : public testing::Test {
 protected:
  void make_example(const std::string& rig, int views) {
    report({"calibrate", "example", "--rig", "object,width=320,height=240,stripes=40" + rig, "--board",
            kBoard, "--views", std::to_string(views), "--out", example_, "--json"});
  }
  std::vector<std::string> geometry(const std::vector<std::string>& more) const {
    std::vector<std::string> out{"calibrate", "geometry", example_ + "/views", "--board",
                                 kBoard,      "--json",   "--projector",       "1024x768"};
    out.insert(out.end(), more.begin(), more.end());
    return out;
  }
  Rig written() const {
    const auto rig = read_rig(rig_);
    EXPECT_TRUE(rig.ok()) << rig.error().message;
    return rig.ok() ? *rig : Rig{};
  }

  const TempFolder folder_;
  const std::string example_ = folder_ / "example", rig_ = folder_ / "rig.yaml";
};

TEST_F(FieldOrders, ViewsWhoseBottomFieldComesFirstCalibrate) {
  make_example("", 5);
  for (const auto& view : fs::directory_iterator(example_ + "/views"))
    if (view.is_directory()) interlace(view.path(), FieldOrder::kBottom);
  EXPECT_THAT(server(geometry({"--out", rig_})).err, HasSubstr("--field-order bottom"));
  EXPECT_THAT(server(geometry({"--scan", "progressive", "--out", rig_})).err,
              HasSubstr("say --scan interlaced"));
  const json flagged = report(geometry({"--field-order", "bottom", "--out", rig_}));
  EXPECT_EQ(flagged.at("assumed"), json({"--frame-rate"})) << "frames of two fields tell the scan";
  EXPECT_LT(flagged.at("stereo_rms_px").get<double>(), 0.3);
  EXPECT_EQ(written().field_order, FieldOrder::kBottom);
  // The rig knows it from now on.
  EXPECT_EQ(report(geometry({"--update", rig_})).at("stereo_rms_px"), flagged.at("stereo_rms_px"));
  EXPECT_EQ(written().field_order, FieldOrder::kBottom);
}

TEST_F(FieldOrders, TheFlagIsWrittenWhereViewsAreWholePictures) {
  make_example("", 3);
  report(geometry({"--out", rig_}));
  EXPECT_EQ(written().field_order, FieldOrder::kTop);
  EXPECT_FALSE(states_field_order(rig_)) << "it was assumed: a driver may know better";
  report(geometry({"--update", rig_, "--field-order", "bottom"}));
  EXPECT_EQ(written().field_order, FieldOrder::kBottom);
  report(geometry({"--update", rig_}));
  EXPECT_EQ(written().field_order, FieldOrder::kBottom);
  report(geometry({"--update", rig_, "--field-order", "top"}));
  EXPECT_EQ(written().field_order, FieldOrder::kTop);
  EXPECT_TRUE(states_field_order(rig_));
  report(geometry({"--update", rig_}));
  report({"calibrate", "colour", example_ + "/colours", "--update", rig_, "--json"});
  EXPECT_TRUE(states_field_order(rig_));
}

TEST_F(FieldOrders, ALiveSourceSaysItsOwn) {
  report(
      {"calibrate", "geometry", folder_ / "views", "--source",
       "sim:board:" + kBoard + ",width=320,height=240,field_order=bottom,stripes=40,distortion=1,period=120",
       "--views", "3", "--board", kBoard, "--out", rig_, "--json"});
  EXPECT_EQ(written().scan, Scan::kInterlaced);
  EXPECT_EQ(written().field_order, FieldOrder::kBottom);
}

/// The words of the command that an example prints last, with our own rig.yaml.
std::vector<std::string> next_command(const std::string& printed, const std::string& rig) {
  std::istringstream words(printed.substr(printed.rfind("calibrate geometry")));
  std::vector<std::string> out;
  for (std::string word; words >> word;) out.push_back(word == "rig.yaml" ? rig : word);
  return out;
}

TEST_F(FieldOrders, WhatAnExampleOffersNextSaysHowItsCameraScans) {
  for (const auto& [keys, scan, order, rate] :
       {std::tuple(",scan=progressive,rate=60", Scan::kProgressive, FieldOrder::kTop, 60.0),
        std::tuple(",field_order=bottom,rate=25", Scan::kInterlaced, FieldOrder::kBottom, 25.0)}) {
    fs::remove_all(example_);
    const Finished made =
        server({"calibrate", "example", "--rig", "object,width=320,height=240,stripes=40" + std::string(keys),
                "--board", kBoard, "--views", "3", "--out", example_});
    ASSERT_EQ(made.status, 0) << made.err;
    report({"calibrate", "colour", example_ + "/colours", "--out", rig_, "--json"});
    const Finished done = server(next_command(made.out, rig_));
    ASSERT_EQ(done.status, 0) << done.err;
    EXPECT_THAT(done.out, testing::Not(testing::AnyOf(HasSubstr(", not "), HasSubstr("as usual"))));
    EXPECT_EQ(written().scan, scan);
    EXPECT_EQ(written().field_order, order);
    EXPECT_EQ(written().frame_rate, rate);
  }
}

TEST_F(FieldOrders, WhatIsAssumedAndWhatDiffersIsSaid) {
  make_example(",scan=progressive,rate=60", 3);
  const std::vector<std::string> more{"--out", rig_, "--compare", example_ + "/truth.yaml"};
  const json silent = report(geometry(more));
  EXPECT_EQ(silent.at("scan"), "interlaced");
  EXPECT_EQ(silent.at("assumed"), json({"--scan", "--frame-rate"}));
  EXPECT_EQ(silent.at("compare").at("scanning"),
            json({"scan: interlaced, not progressive", "frame rate: 29.97, not 60"}));
  std::vector<std::string> in_words = geometry(more);
  std::erase(in_words, "--json");
  const Finished done = server(in_words);
  EXPECT_THAT(done.out,
              HasSubstr("scan       interlaced, top field first, 29.97 frames a second\n"
                        "           as usual, since nothing says it: give --scan and --frame-rate"));
  EXPECT_THAT(done.out, HasSubstr("           scan: interlaced, not progressive\n"));
  // The rig that was written so is mended by saying it.
  const json said = report(geometry({"--update", rig_, "--scan", "progressive", "--frame-rate", "60",
                                     "--compare", example_ + "/truth.yaml"}));
  EXPECT_EQ(said.at("assumed"), json::array());
  EXPECT_EQ(said.at("compare").at("scanning"), json::array());
}

}  // namespace
}  // namespace relievo::test
