// SPDX-License-Identifier: Apache-2.0
// A rig out of step: what is dropped is counted, and a person is told why and what to do.
#include <gtest/gtest.h>

#include <memory>

#include "capture/pattern/schedule.h"
#include "capture/source/field_source.h"
#include "server/pipeline.h"
#include "server/step_watch.h"
#include "tests/unit/server/fakes.h"

namespace relievo {
namespace {

using namespace test;

Rig rig_at_rate() {
  Rig rig;
  rig.frame_rate = 29.97;
  return rig;
}

ReconstructReport at(float phase, bool mixed) {
  ReconstructReport report;
  report.step = {.phase = phase, .mixed = mixed};
  return report;
}

TEST(StepWatch, SpeaksOnceManyAreDroppedAndNoMoreWhenFewAre) {
  StepWatch watch(Pattern{}, rig_at_rate());
  std::int64_t frame = 0;
  const auto add = [&](int count, float phase, bool mixed) {
    for (int i = 0; i < count; ++i) watch.add(frame++ * 33'366'700, at(phase, mixed));
  };
  add(100, 0, false);
  EXPECT_EQ(watch.message(), "");
  EXPECT_EQ(watch.advice(), "");
  add(8, 0.3F, true);
  EXPECT_EQ(watch.message(), "");
  add(20, 0.3F, true);
  EXPECT_NE(watch.message().find("% of frames are dropped for mixed exposures: "), std::string::npos);
  EXPECT_EQ(watch.status().mixed, 28U);
  add(200, 0, false);
  EXPECT_EQ(watch.message(), "");
  EXPECT_NE(watch.advice(), "");
  EXPECT_EQ(watch.status().mixed, 28U);
}

TEST(StepWatch, SpeaksWhereNoFrameIsWhiteThatShouldBe) {
  Pattern pattern;
  pattern.slides = 2;
  pattern.scheme = Scheme::kWhiteFrame;
  StepWatch watch(pattern, rig_at_rate());
  const auto add = [&](bool white) {
    ReconstructReport report;
    report.white = white;
    watch.add(0, report);
  };
  for (int i = 0; i < 11; ++i) add(false);
  EXPECT_EQ(watch.message(), "");
  add(false);
  EXPECT_NE(watch.message().find("no frame is white, as one of 3 must be"), std::string::npos)
      << watch.message();
  add(true);
  EXPECT_EQ(watch.message(), "");
}

TEST(StepWatch, SpeaksWhileExposuresAreTheOtherWayRound) {
  Rig rig = rig_at_rate();
  rig.field_order = FieldOrder::kBottom;
  StepWatch watch(Pattern{}, rig);
  ReconstructReport report;
  report.matched = 100;
  watch.add(0, report);
  EXPECT_EQ(watch.message(), "");
  report.exchanged = true;
  watch.add(1, report);
  EXPECT_NE(watch.message().find("field_order: top"), std::string::npos) << watch.message();
  watch.add(2, ReconstructReport{});  // of which nothing was decoded
  EXPECT_EQ(watch.exchanged(), 1U);
  report.exchanged = false;
  watch.add(3, report);
  EXPECT_EQ(watch.message(), "");
}

struct Served {
  Status done;
  ServerStatus status;
};

Served serve(FieldSource& source) {
  CollectingSink sink;
  PipelineOptions options;
  options.stream = "test";
  options.paced = false;
  options.lossless = true;
  auto pipeline = Pipeline::create(source, {&sink}, options);
  EXPECT_TRUE(pipeline) << pipeline.error().message;
  Served out{(*pipeline)->run(), {}};
  out.status = sink.statuses().back();
  return out;
}

Served serve(const std::string& more, bool loop = false) {
  auto source = open_source("sim:plane,width=192,height=144,stripes=30" + more, {.loop = loop});
  EXPECT_TRUE(source) << source.error().message;
  return serve(**source);
}

TEST(ServedOutOfStep, DriftIsCountedAndSaid) {
  const Served served = serve(",frames=90,phase=0.1,drift=2");
  ASSERT_TRUE(served.done) << served.done.error().message;
  EXPECT_EQ(served.status.frames_captured, 90U);
  EXPECT_GT(served.status.frames_published, 20U);
  EXPECT_GT(served.status.drops_capture, 30U);
  EXPECT_LE(served.status.frames_published + served.status.drops_capture, 90U);
  EXPECT_GT(served.status.step.mixed, 30U);
  EXPECT_LE(served.status.step.mixed, served.status.drops_capture);
  EXPECT_GT(served.status.step.regrouped, 5U);
  ASSERT_TRUE(served.status.step.phase);
  ASSERT_TRUE(served.status.step.drift_fields_s);
  EXPECT_NEAR(*served.status.step.drift_fields_s, 2, 0.1);
  EXPECT_NE(served.status.message.find("they drift by 2.0"), std::string::npos) << served.status.message;
}

TEST(ServedOutOfStep, InStepNothingIsSaid) {
  const Served served = serve(",frames=40");
  ASSERT_TRUE(served.done) << served.done.error().message;
  EXPECT_EQ(served.status.drops_capture, 0U);
  EXPECT_EQ(served.status.message, "");
}

TEST(ServedOutOfStep, WhiteFrameThatShowsNoWhiteIsSaid) {
  const Served in_step = serve(",frames=18,scheme=white-frame");
  ASSERT_TRUE(in_step.done) << in_step.done.error().message;
  EXPECT_EQ(in_step.status.message, "");
  const Served out_of_step = serve(",frames=18,scheme=white-frame,phase=0.5");
  EXPECT_NE(out_of_step.status.message.find("no frame is white"), std::string::npos)
      << out_of_step.status.message;
}

/// A source whose rig says that the other field is exposed first.
class OtherFieldFirst final : public FieldSource {
 public:
  explicit OtherFieldFirst(std::unique_ptr<FieldSource> source)
      : source_(std::move(source)), info_(source_->info()) {
    info_.rig.field_order = other(info_.rig.field_order);
  }
  const SourceInfo& info() const override { return info_; }
  Result<std::optional<CapturedFrame>> next() override {
    auto frame = source_->next();
    if (frame && *frame) (*frame)->field_order = info_.rig.field_order;
    return frame;
  }
  void request_stop() override { source_->request_stop(); }

 private:
  const std::unique_ptr<FieldSource> source_;
  SourceInfo info_;
};

TEST(ServedOutOfStep, AnotherFieldOrderThanTheRigsIsSaid) {
  auto source = open_source("sim:object,width=320,height=240,stripes=60,frames=12", {});
  ASSERT_TRUE(source) << source.error().message;
  OtherFieldFirst other(*std::move(source));
  const Served served = serve(other);
  ASSERT_TRUE(served.done) << served.done.error().message;
  EXPECT_NE(served.status.message.find("is the top field exposed first?"), std::string::npos)
      << served.status.message;
}

TEST(ServedOutOfStep, ALoopOfMixedExposuresAloneEndsWithAdvice) {
  const Served served = serve(",period=12,phase=0.5", true);
  ASSERT_FALSE(served.done);
  EXPECT_NE(served.done.error().message.find("exposures "), std::string::npos) << served.done.error().message;
}

}  // namespace
}  // namespace relievo
