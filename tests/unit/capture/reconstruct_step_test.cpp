// SPDX-License-Identifier: Apache-2.0
// A projector without genlock: the phase that was simulated is found, mixed exposures are dropped and nothing
// else, frames a field off are regrouped, and what is reconstructed lies where the scene is.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <string>
#include <utility>
#include <vector>

#include "capture/reconstruct/reconstructor.h"
#include "capture/reconstruct/step_keeping.h"
#include "capture/source/sim/sim_source.h"

namespace relievo {
namespace {

const std::string kSmall = ",width=320,height=240,stripes=45";
const std::string kSmaller = ",width=192,height=144,stripes=30";  // where nothing is measured in millimetres

struct Kept {
  std::vector<StepReport> reports;
  std::vector<bool> given;
};

/// `stamped` false: as from a camera whose time stamps do not tell of lost frames.
Kept keep(const std::string& spec, bool stamped = true) {
  auto source = make_sim(spec, {.threads = 1});
  EXPECT_TRUE(source) << source.error().message;
  StepKeeper keeper((*source)->info().pattern, (*source)->info().rig);
  Kept out;
  while (true) {
    auto frame = (*source)->next();
    if (!frame || !*frame) break;
    if (!stamped) (*frame)->time_ns = static_cast<std::int64_t>((*frame)->number) * 33'366'700;
    out.given.push_back(keeper.read(**frame) != nullptr);
    out.reports.push_back(keeper.report());
  }
  return out;
}

/// Between phases, which go round at 2.
double apart(double a, double b) {
  return std::fabs(std::remainder(a - b, 2));
}

TEST(StepKeeper, FindsThePhase) {
  for (const std::string more : {"", ",scan=progressive", ",field_order=bottom", ",scheme=white-field",
                                 ",noise=5,ambient=0.5", ",albedo=0.3"}) {
    for (const double phase : {0.0, 0.15, 0.4, 0.75, 1.0, 1.3, 1.9, 3.1}) {
      const Kept kept = keep("object,frames=3,phase=" + std::to_string(phase) + more + kSmaller);
      ASSERT_EQ(kept.reports.size(), 3U);
      EXPECT_FALSE(kept.reports[0].phase);  // a phase takes two frames
      for (std::size_t i = 1; i < 3; ++i) {
        ASSERT_TRUE(kept.reports[i].phase) << phase << more;
        EXPECT_LT(apart(*kept.reports[i].phase, phase), 0.02) << phase << more;
      }
    }
  }
}

TEST(StepKeeper, AShortExposureFitsIntoASlide) {
  for (const double phase : {0.0, 0.2, 0.4}) {
    const Kept kept = keep("object,frames=3,shutter=0.5,phase=" + std::to_string(phase) + kSmall);
    EXPECT_LT(apart(*kept.reports[2].phase, 0), 0.02) << phase;
    EXPECT_TRUE(kept.given[2]);
  }
  const Kept kept = keep("object,frames=3,shutter=0.5,phase=0.7" + kSmall);
  EXPECT_LT(apart(*kept.reports[2].phase, 0.4), 0.02);  // of the exposure: 0.2 of its 0.5 fields
  EXPECT_FALSE(kept.given[2]);
}

TEST(StepKeeper, MotionIsNoMixture) {
  const Kept kept = keep("walk,frames=8" + kSmall);
  for (std::size_t i = 0; i < kept.given.size(); ++i) {
    EXPECT_TRUE(kept.given[i]) << i;
    EXPECT_FALSE(kept.reports[i].regrouped) << i;
  }
}

TEST(StepKeeper, LostFramesThatNoTimeStampTellsOfCostNoOthers) {
  for (const std::string scene : {"walk", "object", "face"}) {
    for (const std::string more : {"", ",scheme=white-field", ",scan=progressive"}) {
      const Kept kept = keep(scene + ",frames=20,drop=5" + more + kSmaller, false);
      for (std::size_t i = 0; i < kept.given.size(); ++i) {
        EXPECT_TRUE(kept.given[i]) << scene << more << " " << i;
        EXPECT_FALSE(kept.reports[i].regrouped) << scene << more << " " << i;
      }
    }
  }
}

TEST(StepKeeper, OtherSchemesAreTakenAsTheyAre) {
  for (const std::string scheme : {"white-frame", "one-slide"}) {
    const Kept kept = keep("object,frames=4,phase=0.4,scheme=" + scheme + kSmaller);
    for (const bool given : kept.given) EXPECT_TRUE(given);
  }
}

TEST(StepDrift, IsTheSimulatedOne) {
  for (const double drift : {1.5, -0.8}) {
    const Kept kept = keep("plane,frames=40,phase=6,drift=" + std::to_string(drift) + kSmaller);
    StepDrift measured;
    int mixed = 0;
    int truly_mixed = 0;
    for (std::size_t i = 1; i < kept.reports.size(); ++i) {
      const double time_s = static_cast<double>(i) / 29.97;
      ASSERT_TRUE(kept.reports[i].phase) << i;
      measured.add(std::llround(time_s * 1e9), *kept.reports[i].phase);
      mixed += kept.reports[i].mixed;
      const double phase = 6 + drift * time_s;
      truly_mixed += std::fabs(phase - std::round(phase)) > 0.2;
      EXPECT_EQ(kept.given[i] || kept.reports[i].mixed || kept.reports[i].restarted, true) << i;
    }
    ASSERT_TRUE(measured.per_second());
    EXPECT_NEAR(*measured.per_second(), drift, 0.05 * std::fabs(drift));
    EXPECT_GT(truly_mixed, 5);
    // The phase is that of two frames' middle: a frame or two at each end of a stretch may differ.
    EXPECT_NEAR(mixed, truly_mixed, 4);
  }
}

TEST(StepDrift, KnowsNothingFromLittle) {
  StepDrift drift;
  for (int i = 0; i < 11; ++i) drift.add(i * 33'000'000, 0.1F);
  EXPECT_FALSE(drift.per_second());
  for (int i = 11; i < 40; ++i) drift.add(i * 33'000'000, 0.1F);
  ASSERT_TRUE(drift.per_second());
  EXPECT_NEAR(*drift.per_second(), 0, 1e-6);
}

TEST(StepAdvice, SaysWhatToDo) {
  EXPECT_NE(step_advice(0.3F, std::nullopt, 29.97).find("shorten them to 70 %"), std::string::npos);
  EXPECT_NE(step_advice(1.7F, 0.001, 29.97).find("begin them later"), std::string::npos);
  const std::string drifts = step_advice(0.3F, -0.5, 29.97);
  EXPECT_NE(drifts.find("-0.50 fields a second, so every 2.0 s"), std::string::npos) << drifts;
  EXPECT_NE(drifts.find("genlock"), std::string::npos);
}

struct Surfaces {
  std::size_t count = 0;
  std::size_t vertices = 0;
  std::size_t wrong = 0;  // more than 5 mm off the plane
  std::size_t mixed = 0;
  std::size_t regrouped = 0;

  double vertices_each() const { return static_cast<double>(vertices) / static_cast<double>(count); }
  double wrong_share() const { return static_cast<double>(wrong) / static_cast<double>(vertices); }
};

/// Of the plane scene, which stands still.
Surfaces reconstruct(const std::string& more, Decoder decoder = Decoder::kOrdered) {
  auto source = make_sim("plane" + more + kSmall, {.threads = 1});
  EXPECT_TRUE(source) << source.error().message;
  auto reconstructor = Reconstructor::create((*source)->info().rig, (*source)->info().pattern,
                                             {.decoder = decoder, .texture = true});
  EXPECT_TRUE(reconstructor);
  Surfaces out;
  const double length = std::sqrt(0.2 * 0.2 + 0.1 * 0.1 + 1);
  while (true) {
    auto frame = (*source)->next();
    if (!frame || !*frame) break;
    auto made = reconstructor->add(**frame);
    EXPECT_TRUE(made) << made.error().message;
    out.mixed += reconstructor->report().step.mixed;
    out.regrouped += reconstructor->report().step.regrouped;
    for (std::optional<Frame3D> surface = *std::move(made); surface; surface = reconstructor->next()) {
      ++out.count;
      EXPECT_LE(surface->time_ns, (*frame)->time_ns);
      EXPECT_FALSE(surface->texture.empty());
      for (const Vec3f& p : surface->surface.positions) {
        ++out.vertices;
        const double off = (0.2 * static_cast<double>(p[0]) - 0.1 * static_cast<double>(p[1]) -
                            (static_cast<double>(p[2]) - 1)) /
                           length;
        out.wrong += std::fabs(off) > 0.005;
      }
    }
  }
  return out;
}

TEST(StepKeeping, FramesAFieldOffGiveTheSameSurface) {
  for (const std::string more : {"", ",scan=progressive", ",field_order=bottom", ",scheme=white-field"}) {
    const Surfaces in_step = reconstruct(",frames=8" + more);
    const Surfaces off = reconstruct(",frames=8,phase=1" + more);
    const Surfaces other = reconstruct(",frames=8,phase=3.1" + more);
    EXPECT_EQ(in_step.mixed + off.mixed + other.mixed, 0U) << more;
    EXPECT_EQ(in_step.regrouped, 0U) << more;
    // Of 8 all but the first, whose exposures are told from the second's.
    EXPECT_EQ(off.regrouped, 7U) << more;
    EXPECT_EQ(other.regrouped, 7U) << more;
    ASSERT_GT(off.count, 0U) << more;
    EXPECT_GT(off.vertices_each(), 0.97 * in_step.vertices_each()) << more;
    EXPECT_GT(other.vertices_each(), 0.97 * in_step.vertices_each()) << more;
    for (const Surfaces& s : {in_step, off, other}) EXPECT_LT(s.wrong_share(), 0.005) << more;
  }
}

TEST(StepKeeping, MixedExposuresGiveNothing) {
  for (const std::string phase : {"0.35", "0.5", "0.65", "1.5"}) {
    const Surfaces s = reconstruct(",frames=6,phase=" + phase);
    EXPECT_EQ(s.count, 0U) << phase;
    EXPECT_EQ(s.mixed, 5U) << phase;  // all of which a phase is known
  }
}

TEST(StepKeeping, ADriftingRigGivesSurfacesInBetweenAndNoWrongOnes) {
  const Surfaces s = reconstruct(",frames=60,drift=2,phase=0.1");
  EXPECT_GT(s.mixed, 20U);
  EXPECT_GT(s.count, 12U);
  EXPECT_GT(s.regrouped, 8U);
  EXPECT_LT(s.wrong_share(), 0.01);
}

TEST(StepKeeping, LostFramesAreNotRegroupedAcross) {
  const Surfaces s = reconstruct(",frames=12,phase=1,drop=4");
  EXPECT_EQ(s.mixed, 0U);
  EXPECT_GT(s.count, 3U);
  EXPECT_LT(s.wrong_share(), 0.01);
}

TEST(ExposureOrder, ASingleSlideShownSecondIsFoundAndRegrouped) {
  for (const Decoder decoder : {Decoder::kOrdered, Decoder::kQuick}) {
    for (const std::string more : {"", ",scan=progressive", ",field_order=bottom"}) {
      const std::string spec = ",frames=8,scheme=one-slide" + more;
      const Surfaces in_step = reconstruct(spec, decoder);
      const Surfaces off = reconstruct(spec + ",phase=1", decoder);
      EXPECT_EQ(in_step.regrouped, 0U) << more;
      EXPECT_EQ(in_step.count, 8U) << more;
      EXPECT_EQ(off.regrouped, 7U) << more;  // the first tells
      EXPECT_EQ(off.count, 7U) << more;
      EXPECT_GT(off.vertices_each(), 0.97 * in_step.vertices_each()) << more;
      for (const Surfaces& s : {in_step, off}) EXPECT_LT(s.wrong_share(), 0.005) << more;
    }
  }
}

TEST(ExposureOrder, ADriftAcrossASlideChangeIsFoundWithinAFewFrames) {
  // At 15 and 45 of 60 frames both exposures are alike; it takes some contrast again to tell.
  const Surfaces s = reconstruct(",frames=60,drift=1,scheme=one-slide");
  EXPECT_GT(s.regrouped, 20U);
  EXPECT_LT(s.regrouped, 40U);
  EXPECT_GT(s.count, 50U);
  EXPECT_LT(s.wrong_share(), 0.15);
}

/// How many of a scene's frames are said to have their exposures the other way round, where they are
/// `exchanged` from a frame on.
std::vector<bool> told(const std::string& spec, Decoder decoder, std::uint64_t exchanged_from) {
  auto source = make_sim(spec, {.threads = 1});
  EXPECT_TRUE(source) << source.error().message;
  auto reconstructor =
      Reconstructor::create((*source)->info().rig, (*source)->info().pattern, {.decoder = decoder});
  EXPECT_TRUE(reconstructor);
  std::vector<bool> out;
  while (true) {
    auto frame = (*source)->next();
    if (!frame || !*frame) break;
    CapturedFrame& f = **frame;
    if (f.number >= exchanged_from && f.scan == Scan::kProgressive) std::swap(f.picture, f.complement);
    if (f.number >= exchanged_from && f.scan == Scan::kInterlaced) {
      for (int y = 0; y + 1 < f.picture.height(); y += 2)  // a picture of the camera's other field order
        std::swap_ranges(f.picture.row(y), f.picture.row(y) + 3 * f.picture.width(), f.picture.row(y + 1));
    }
    EXPECT_TRUE(reconstructor->add(f));
    out.push_back(reconstructor->report().exchanged);
  }
  return out;
}

constexpr std::uint64_t kNever = 1000;

TEST(ExposureDoubt, FramesTheOtherWayRoundAreFound) {
  for (const Decoder decoder : {Decoder::kOrdered, Decoder::kQuick, Decoder::kPaper}) {
    for (const std::string more : {"", ",scan=progressive", ",field_order=bottom", ",scheme=white-frame"}) {
      const std::string spec = "object,frames=9" + more + kSmall;
      EXPECT_TRUE(told(spec, decoder, 0)[7]) << more;
      const std::vector<bool> as_is = told(spec, decoder, kNever);
      EXPECT_EQ(std::count(as_is.begin(), as_is.end(), true), 0) << more;
    }
  }
}

TEST(ExposureDoubt, AChangeInTheMiddleIsFound) {
  const std::vector<bool> seen = told("object,frames=16" + kSmall, Decoder::kOrdered, 6);
  EXPECT_EQ(std::count(seen.begin(), seen.begin() + 8, true), 0);
  EXPECT_EQ(std::count(seen.begin() + 10, seen.end(), true), 6);
}

TEST(ExposureDoubt, APictureThatHardlyDecodesEitherWayIsNone) {
  for (const std::string more : {",defocus=5,stripes=60", ",exposure=0.05,noise=8", ",gloss=20,ambient=3"}) {
    const std::vector<bool> seen =
        told("face,frames=12,width=320,height=240" + more, Decoder::kOrdered, kNever);
    EXPECT_EQ(std::count(seen.begin(), seen.end(), true), 0) << more;
  }
}

}  // namespace
}  // namespace relievo
