// SPDX-License-Identifier: Apache-2.0
// Proves: cameras that scan in any way calibrate, from views and live, and rig.yaml says how they scan.
#include <gmock/gmock.h>

#include <algorithm>
#include <filesystem>

#include "capture/calibrate/pictures.h"
#include "capture/calibrate/stripe_stack.h"
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
  const json flagged = report(geometry({"--field-order", "bottom", "--out", rig_}));
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
  report(geometry({"--update", rig_, "--field-order", "bottom"}));
  EXPECT_EQ(written().field_order, FieldOrder::kBottom);
  report(geometry({"--update", rig_}));
  EXPECT_EQ(written().field_order, FieldOrder::kBottom);
  report(geometry({"--update", rig_, "--field-order", "top"}));
  EXPECT_EQ(written().field_order, FieldOrder::kTop);
}

TEST_F(FieldOrders, ALiveSourceSaysItsOwn) {
  report(
      {"calibrate", "geometry", folder_ / "views", "--source",
       "sim:board:" + kBoard + ",width=320,height=240,field_order=bottom,stripes=40,distortion=1,period=120",
       "--views", "3", "--board", kBoard, "--out", rig_, "--json"});
  EXPECT_EQ(written().scan, Scan::kInterlaced);
  EXPECT_EQ(written().field_order, FieldOrder::kBottom);
}

}  // namespace
}  // namespace relievo::test
