// SPDX-License-Identifier: Apache-2.0
// Proves: a pipeline's frames are copied for a look only where one was asked for, whoever looks never holds
// it up, and a look says what is to be done.
#include "server/rig_probe.h"

#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "tests/support/patience.h"
#include "tests/unit/server/fakes.h"

namespace relievo {
namespace {

using namespace test;
using Json = nlohmann::json;

PipelineOptions with_tap(FrameTap& tap) {
  PipelineOptions options;
  options.stream = "test";
  options.paced = false;
  options.lossless = true;
  options.tap = &tap;
  return options;
}

class RigProbeTest : public testing::Test {
 protected:
  void run(FrameTap& tap, ScriptedSource::Script script) {
    ScriptedSource source(scene_, std::move(script));
    auto pipeline = Pipeline::create(source, {&sink_}, with_tap(tap));
    ASSERT_TRUE(pipeline);
    const Status done = (*pipeline)->run();
    EXPECT_TRUE(done) << done.error().message;
  }

  const StripedScene scene_ = striped_scene();
  const Frames frames_{scene_};
  CollectingSink sink_;
};

TEST_F(RigProbeTest, NobodyAskedNothingIsCopied) {
  struct Counts final : FrameTap {
    bool wants(bool has_surface) override {
      ++asked;
      with_surface += has_surface;
      return false;
    }
    void put(TappedFrame&&) override { FAIL() << "not wanted"; }
    int asked = 0, with_surface = 0;
  } counts;
  run(counts, count_to(frames_, 10));
  EXPECT_EQ(counts.asked, 10);
  EXPECT_EQ(counts.with_surface, 9) << "the first frame completes none";
}

TEST_F(RigProbeTest, ALookIsOfTheNextFrameWithASurface) {
  RigProbe probe("test", scene_.rig, scene_.pattern, {scene_.rig, scene_.pattern});
  EXPECT_EQ(probe.look({"camera", "order"}), nullptr) << "asks, and there is none yet";
  run(probe, count_to(frames_, 6));
  ASSERT_TRUE(eventually([&] { return probe.look({}) != nullptr; }));
  const auto view = probe.look({});
  const Json report = Json::parse(view->report);
  EXPECT_EQ(report["state"], "measured");
  EXPECT_EQ(report["frame"], 1);
  EXPECT_GT(report["coverage"]["share"], 0.95);
  EXPECT_EQ(report["boundaries"]["order_errors"], 0);
  EXPECT_EQ(report["pictures"], Json({"camera", "order"}));
  EXPECT_TRUE(report["advice"].empty()) << report["advice"];
  ASSERT_EQ(view->pictures.size(), 2U);
  for (const auto& [name, jpeg] : view->pictures) EXPECT_EQ(jpeg[0], 0xff) << name;
}

TEST_F(RigProbeTest, ACameraThatGivesNoSurfaceIsLookedAtToo) {
  RigProbe probe("test", scene_.rig, scene_.pattern, {scene_.rig, scene_.pattern});
  EXPECT_EQ(probe.look({}), nullptr);
  run(probe, [&](ScriptedSource&, std::uint64_t n) -> ScriptedSource::Next {
    if (n >= 20) return ScriptedSource::end();
    CapturedFrame dark = frames_(0);  // always the same slide
    dark.number = n;
    std::fill_n(dark.picture.data(), dark.picture.size(), std::uint8_t{20});
    return std::optional(std::move(dark));
  });
  ASSERT_TRUE(eventually([&] { return probe.look({}) != nullptr; }));
  const Json report = Json::parse(probe.look({})->report);
  EXPECT_EQ(report["coverage"]["share"], 0);
  EXPECT_TRUE(report["margins"][0]["low"].is_null());
  EXPECT_EQ(report["advice"].size(), 2U) << report["advice"];  // too dark, and no stripes
}

}  // namespace
}  // namespace relievo
