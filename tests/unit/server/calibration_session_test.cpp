// SPDX-License-Identifier: Apache-2.0
// Proves: a calibration from a page has the stream paused, says what to do and why something is not used, and
// lets the stream go on however it ends: kept, cancelled, unwatched, or unable to begin.
#include "server/calibration_session.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <atomic>
#include <filesystem>

#include "capture/rig_file.h"
#include "tests/support/patience.h"
#include "tests/support/temp_folder.h"

namespace relievo {
namespace {

using namespace test;
using testing::HasSubstr;
using testing::MatchesRegex;

class FakeStreams final : public StreamPauses {
 public:
  std::optional<StreamConfig> config_of(const std::string&) const override { return std::nullopt; }
  Status pause(const std::string&) override {
    ++paused;
    return refused.empty() ? Status() : Status(Error{refused});
  }
  void resume(const std::string&) override { ++resumed; }

  std::atomic<int> paused{0}, resumed{0};
  std::string refused;
};

class CalibrationSessionTest : public testing::Test {
 protected:
  std::unique_ptr<CalibrationSession> start(const std::string& kind, const std::string& keys = ",rate=60") {
    StreamConfig config;
    config.source = "sim:object,width=160,height=120,scan=progressive,stripes=24" + keys;
    config.camera.rig = rig_.string();
    return std::make_unique<CalibrationSession>(
        place_, config, CalibrationOrder{"start", "face", kind, "chessboard:5x4:50mm"});
  }
  static bool reaches(CalibrationSession& session, CalibrationPhase phase) {
    return eventually([&] { return session.state().phase == phase; });
  }
  static bool ends(CalibrationSession& session) {
    return eventually([&] { return session.ended(); });
  }

  const TempFolder folder_;
  const std::filesystem::path rig_ = folder_ / "rig.yaml";
  const ProjectorConfig config_;
  FakeStreams streams_;
  ProjectorDriver projector_{config_};
  CalibrationPlace place_{.streams = streams_, .projector = projector_, .config = config_};
};

TEST_F(CalibrationSessionTest, ColoursAreTakenAndKept) {
  const auto session = start("colour");
  ASSERT_TRUE(reaches(*session, CalibrationPhase::kWatching));
  EXPECT_THAT(session->state().next, HasSubstr("white sheet"));
  EXPECT_FALSE(session->order("keep")) << "there is nothing to keep";
  ASSERT_TRUE(session->order("take"));
  ASSERT_TRUE(reaches(*session, CalibrationPhase::kSolved)) << session->state().message;
  EXPECT_NE(session->picture("camera"), nullptr);
  EXPECT_EQ(streams_.resumed, 0);
  ASSERT_TRUE(session->order("keep"));
  ASSERT_TRUE(ends(*session));
  EXPECT_EQ(session->state().file, "rig.yaml");
  EXPECT_FALSE(session->state().failed);
  EXPECT_EQ(streams_.paused, 1);
  EXPECT_EQ(streams_.resumed, 1);
  const auto part = read_rig_part(rig_);
  ASSERT_TRUE(part && part->colours);
  EXPECT_NEAR(part->colours->matrix[0], 1.19, 0.6);
  EXPECT_FALSE(session->order("take")) << "it is over";
}

TEST_F(CalibrationSessionTest, TooMuchLightIsSaid) {
  const auto session = start("colour", ",rate=60,exposure=4");
  ASSERT_TRUE(reaches(*session, CalibrationPhase::kWatching));
  ASSERT_TRUE(session->order("take"));
  ASSERT_TRUE(eventually([&] { return !session->state().views.empty(); }));
  const CalibrationState state = session->state();
  EXPECT_FALSE(state.views[0].used);
  EXPECT_THAT(state.views[0].says, HasSubstr("exposure"));
  EXPECT_FALSE(std::filesystem::exists(rig_));
}

TEST_F(CalibrationSessionTest, TooFewViewsAreNotCalculated) {
  const auto session = start("geometry");
  ASSERT_TRUE(reaches(*session, CalibrationPhase::kWatching));
  const Status refused = session->order("calculate");
  ASSERT_FALSE(refused);
  EXPECT_THAT(refused.error().message, HasSubstr("too few views"));
}

TEST_F(CalibrationSessionTest, InTheDarkNothingIsTaken) {
  place_.rest_within = std::chrono::milliseconds(300);
  const auto session = start("geometry", ",rate=60,exposure=0.02");
  ASSERT_TRUE(reaches(*session, CalibrationPhase::kWatching));
  ASSERT_TRUE(session->order("take"));
  ASSERT_TRUE(eventually([&] { return !session->state().message.empty(); }));
  EXPECT_THAT(session->state().message, HasSubstr("of the projector's 4 slides were seen"));
  EXPECT_FALSE(session->state().armed);
}

TEST_F(CalibrationSessionTest, WhereFramesComeSlowlyTimeAloneRefusesNothing) {
  place_.rest_within = std::chrono::nanoseconds(1);
  const auto session = start("colour", ",rate=4");  // eight frames are needed
  ASSERT_TRUE(reaches(*session, CalibrationPhase::kWatching));
  ASSERT_TRUE(session->order("take"));
  ASSERT_TRUE(eventually([&] {
    const CalibrationState state = session->state();
    return state.phase == CalibrationPhase::kSolved || !state.message.empty();
  }));
  EXPECT_EQ(session->state().message, "");
}

TEST_F(CalibrationSessionTest, AnOverexposedBoardIsNotUsed) {
  const auto session = start("geometry", ",rate=60,exposure=6");
  ASSERT_TRUE(reaches(*session, CalibrationPhase::kWatching));
  ASSERT_TRUE(session->order("take"));
  ASSERT_TRUE(eventually([&] { return !session->state().views.empty(); }));
  EXPECT_FALSE(session->state().views[0].used);
  EXPECT_THAT(session->state().views[0].says, HasSubstr("shorten the exposure"));
}

TEST_F(CalibrationSessionTest, CancelledNothingIsWritten) {
  const auto session = start("colour");
  ASSERT_TRUE(reaches(*session, CalibrationPhase::kWatching));
  ASSERT_TRUE(session->order("cancel"));
  ASSERT_TRUE(ends(*session));
  EXPECT_THAT(session->state().message, HasSubstr("Given up"));
  EXPECT_EQ(streams_.resumed, 1);
  EXPECT_FALSE(std::filesystem::exists(rig_));
}

TEST_F(CalibrationSessionTest, UnwatchedItIsGivenUp) {
  place_.unwatched_for = std::chrono::milliseconds(300);
  const auto session = start("colour");
  ASSERT_TRUE(ends(*session));
  EXPECT_THAT(session->state().message, HasSubstr("no page watched it"));
  EXPECT_TRUE(session->state().failed);
  EXPECT_EQ(streams_.resumed, 1);
}

TEST_F(CalibrationSessionTest, AStreamThatCannotPauseGoesOn) {
  streams_.refused = "the stream has ended";
  const auto session = start("colour");
  ASSERT_TRUE(ends(*session));
  EXPECT_EQ(session->state().message, "the stream has ended");
  EXPECT_EQ(streams_.resumed, 1);
}

TEST_F(CalibrationSessionTest, ABoardThatDoesNotFitGivesTheStreamBack) {
  StreamConfig config;
  config.source = "sim:object,width=160,height=120,scan=progressive,stripes=24";
  config.camera.rig = rig_.string();
  CalibrationSession session(place_, config, {"start", "face", "geometry", "chessboard:9x7:900mm"});
  ASSERT_TRUE(ends(session));
  EXPECT_EQ(session.state().message,
            "chessboard:9x7:900mm does not fit before the rig: give a smaller board");
  EXPECT_EQ(streams_.resumed, 1);
}

}  // namespace
}  // namespace relievo
