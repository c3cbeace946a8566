// SPDX-License-Identifier: Apache-2.0
// The simulated rig: options, truth, fields in time, loops, repeatability.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <cmath>
#include <condition_variable>
#include <cstddef>
#include <cstdint>
#include <mutex>
#include <thread>
#include <vector>

#include "capture/pattern/bcsl.h"
#include "capture/source/sim/render_ahead.h"
#include "capture/source/sim/renderer.h"
#include "capture/source/sim/scene.h"
#include "capture/source/sim/sim_options.h"
#include "capture/source/sim/sim_source.h"

namespace relievo {
namespace {

using testing::HasSubstr;

std::unique_ptr<SimSource> open(const std::string& spec, const SimRun& run) {
  auto source = make_sim(spec, run);
  EXPECT_TRUE(source) << source.error().message;
  return source ? *std::move(source) : nullptr;
}

CapturedFrame take(SimSource& source) {
  auto frame = source.next();
  EXPECT_TRUE(frame && *frame);
  return std::move(**frame);
}

template <typename Picture>
bool same(const Picture& a, const Picture& b) {
  return a.size() == b.size() && std::equal(a.data(), a.data() + a.size(), b.data());
}

TEST(SimOptions, DefaultsAreThePapersSystem) {
  const auto source = open("face,frames=1", {});
  const SourceInfo& info = source->info();
  EXPECT_EQ(info.name, "sim:face,frames=1");
  EXPECT_EQ(info.rig.camera.width, 640);
  EXPECT_EQ(info.rig.scan, Scan::kInterlaced);
  EXPECT_EQ(info.rig.frame_rate, 29.97);
  EXPECT_EQ(info.pattern.stripes(), 90);
  EXPECT_EQ(info.pattern.base, 6);
  EXPECT_EQ(info.pattern.slides, 2);
}

// Proves: a surface that the camera's ray grazes exactly, as one pixel of these frames does, is drawn.
TEST(SimSource, ARayAlongTheSurfaceIsNoCrash) {
  const auto source = open("walk,width=1920,height=1080,stripes=300,rate=60,frames=16", {});
  for (int i = 0; i < 16; ++i) EXPECT_EQ(take(*source).picture.width(), 1920);
}

// The projector's primaries meet the surface before the camera mixes them, so that the colour matrix (Eq. 1)
// gives back the projected primaries times the surface's colour, on surfaces that have one, too.
TEST(SimSource, TheColourMatrixUndoesTheCameraOnColouredSurfaces) {
  const auto source = open("object,scan=progressive,noise=0,chroma=0,ambient=0,frames=1", {});
  const CapturedFrame frame = take(*source);
  const std::array<double, 9>& m = source->info().rig.colour_matrix;
  std::vector<double> off;
  for (int y = 0; y < frame.picture.height(); ++y) {
    for (int x = 0; x < frame.picture.width(); ++x) {
      const std::uint8_t* slide = frame.picture.row(y) + 3 * x;
      const std::uint8_t* complement = frame.complement.row(y) + 3 * x;
      const double red = slide[0] + complement[0], blue = slide[2] + complement[2];
      if (red < 80 || red < 1.5 * blue) continue;  // the ball alone
      double worst = 0;
      for (std::size_t q = 0; q < 3; ++q) {
        double difference = 0, sum = 0;
        for (std::size_t c = 0; c < 3; ++c) {
          difference += m[3 * q + c] * (slide[c] - complement[c]);
          sum += m[3 * q + c] * (slide[c] + complement[c]);
        }
        worst = std::max(worst, std::fabs(std::fabs(difference / sum) - 1));
      }
      off.push_back(worst);
    }
  }
  ASSERT_GT(off.size(), 5000U);
  // Half of the pixels and more are of one stripe alone.
  std::nth_element(off.begin(), off.begin() + static_cast<std::ptrdiff_t>(off.size() / 2), off.end());
  EXPECT_LT(off[off.size() / 2], 0.03);
}

TEST(SimOptions, EveryRefusalSaysWhatIsValid) {
  const std::pair<const char*, const char*> refusals[] = {
      {"cave", "unknown scene \"cave\": give one of plane, object, face, walk, mesh:FILE"},
      {"", "unknown scene"},
      {"face,slides=3", "slides=3: give a whole number 1 to 2"},
      {"face,loud=1", "unknown key \"loud\": give one of scan, width"},
      {"face,noise", "\"noise\" is no key=value"},
      {"face,noise=much", "noise=much: give a number 0 to 100"},
      {"face,noise=-1", "noise=-1: give a number"},
      {"face,noise=nan", "noise=nan: give a number"},
      {"face,width=320.5", "width=320.5: give a whole number"},
      {"face,scan=woven", "give interlaced or progressive"},
      {"face,period=7", "period=7: give an even number"},
      {"face,height=241", "height=241: an interlaced picture has an even height"},
      {"face,drop=1", "drop=1 loses every frame"},
      {"face,stripes=900", "stripes=900: give at most half"},
      {"face,stripes=500,first=600", "900"},
      {"face,path=short", "give clear or paper"},
      {"face,width=320,noise=1,width=640", "width is given twice"},
      {"face,scheme=one-slide,scheme=one-slide", "scheme is given twice"},
      {"mesh:nothing.ply", "nothing.ply is missing"},
      {"mesh:nothing.stl", "give a .ply or .obj file"},
  };
  for (const auto& [spec, message] : refusals) {
    const auto source = make_sim(spec, {});
    ASSERT_FALSE(source) << spec;
    EXPECT_THAT(source.error().message, HasSubstr(message));
  }
  EXPECT_THAT(sim::sim_options_help(), HasSubstr("stripes=2..8192 (90)"));
}

TEST(Simulator, TheSameOnAnyNumberOfThreadsAndAnotherWithAnotherSeed) {
  const std::string spec = "face,width=96,height=72,frames=5,stripes=30";
  const auto one = open(spec, {.threads = 1}), four = open(spec, {.threads = 4});
  const auto other = open(spec + ",seed=2", {});
  for (int i = 0; i < 5; ++i) {
    const CapturedFrame a = take(*one), b = take(*four), c = take(*other);
    EXPECT_TRUE(same(a.picture, b.picture)) << i;
    EXPECT_FALSE(same(a.picture, c.picture)) << i;
  }
}

TEST(Simulator, ALoopRepeatsThePeriodAndGoesOnInTime) {
  for (const char* scene : {"face", "walk"}) {
    const std::string spec = std::string(scene) + ",width=64,height=48,period=6,stripes=20";
    const auto loop = open(spec, {.loop = true}), once = open(spec, {});
    EXPECT_EQ(once->info().frames, 6u);
    std::vector<CapturedFrame> pass;
    for (int i = 0; i < 6; ++i) pass.push_back(take(*once));
    EXPECT_FALSE(*once->next());
    for (std::uint64_t i = 0; i < 15; ++i) {
      const CapturedFrame frame = take(*loop);
      EXPECT_EQ(frame.number, i);
      EXPECT_EQ(frame.time_ns, std::llround(static_cast<double>(i) * 1e9 / 29.97));
      EXPECT_TRUE(same(frame.picture, pass[i % 6].picture)) << i;
    }
  }
}

TEST(Simulator, ALoopTooLargeForMemoryIsRenderedAnewAndStillRepeats) {
  const auto loop = open("plane,width=1024,height=1024,period=400,noise=0", {.loop = true});
  const CapturedFrame first = take(*loop), second = take(*loop), third = take(*loop);
  EXPECT_FALSE(same(first.picture, second.picture));  // the other slide
  EXPECT_TRUE(same(first.picture, third.picture));
}

TEST(Simulator, LostFramesLeaveAGapInTimeAlone) {
  const auto source = open("plane,width=64,height=48,stripes=20,drop=4,frames=7", {});
  const std::uint64_t taken[] = {0, 1, 2, 4, 5, 6, 8};
  for (std::uint64_t i = 0; i < 7; ++i) {
    const CapturedFrame frame = take(*source);
    EXPECT_EQ(frame.number, i);
    EXPECT_EQ(frame.time_ns, std::llround(static_cast<double>(taken[i]) * 1e9 / 29.97));
  }
  EXPECT_FALSE(*source->next());
}

TEST(Simulator, EachFieldIsSeenAtItsOwnTime) {
  // Frame 1 of a period of 8: its first field at 1/8 of the period, its second at 1.5/8.
  const std::string spec = "object,width=160,height=120,stripes=40,noise=0,frames=8";
  const auto source = open(spec + ",period=8", {.truth = true});
  take(*source);
  take(*source);
  const ImageF& truth = source->truth();
  const auto bottom_first = open(spec + ",period=8,field_order=bottom", {.truth = true});
  take(*bottom_first);
  take(*bottom_first);
  // A progressive camera exposes every row of its first picture at the frame's start.
  const auto progressive = open(spec + ",period=8,scan=progressive", {.truth = true});
  take(*progressive);
  take(*progressive);
  const ImageF& first = progressive->truth();
  double worst_first = 0, moved = 0;
  for (int y = 0; y < 120; ++y) {
    for (int x = 0; x < 160; ++x) {
      const double difference = std::abs(static_cast<double>(truth.row(y)[x] - first.row(y)[x]));
      if (y % 2 == 0) worst_first = std::max(worst_first, difference);
      if (y % 2 == 1) moved = std::max(moved, difference);
    }
  }
  EXPECT_EQ(worst_first, 0);  // even rows: exactly the scene at the frame's start
  EXPECT_GT(moved, 1e-4);     // odd rows: half a frame later
  // Whichever rows the first field has, the truth is of its time where lines of geometry lie.
  EXPECT_TRUE(same(bottom_first->truth(), truth));
}

TEST(Simulator, TruthIsAlongTheBentRayOfItsPixel) {
  const auto source = open("plane,distortion=1,frames=1", {.truth = true});
  take(*source);
  const Rig& rig = source->info().rig;
  const auto& k = rig.camera.distortion;
  ASSERT_NE(k[0], 0);
  for (int v = 5; v < 480; v += 47) {
    for (int u = 5; u < 640; u += 53) {
      // Undistort by Newton's method on differences, unlike the renderer's fixed point.
      const double tx = (u - rig.camera.cx()) / rig.camera.fx(), ty = (v - rig.camera.cy()) / rig.camera.fy();
      const auto bend = [&](double x, double y) {
        const double r2 = x * x + y * y, radial = 1 + k[0] * r2 + k[1] * r2 * r2 + k[4] * r2 * r2 * r2;
        return std::pair(x * radial + 2 * k[2] * x * y + k[3] * (r2 + 2 * x * x),
                         y * radial + k[2] * (r2 + 2 * y * y) + 2 * k[3] * x * y);
      };
      double x = tx, y = ty;
      for (int i = 0; i < 20; ++i) {
        const double h = 1e-6;
        const auto [fx, fy] = bend(x, y);
        const auto [ax, ay] = bend(x + h, y);
        const auto [bx, by] = bend(x, y + h);
        const double j00 = (ax - fx) / h, j10 = (ay - fy) / h, j01 = (bx - fx) / h, j11 = (by - fy) / h;
        const double det = j00 * j11 - j01 * j10;
        x -= (j11 * (fx - tx) - j01 * (fy - ty)) / det;
        y -= (j00 * (fy - ty) - j10 * (fx - tx)) / det;
      }
      EXPECT_NEAR(static_cast<double>(source->truth().row(v)[u]), -1.0 / (0.2 * x - 0.1 * y - 1.0), 2e-6);
    }
  }
}

TEST(Simulator, ShadowsFallWhereTheProjectorIsHidden) {
  // The projector stands to the camera's right, so an object's shadow lies to its left: wall beside the cube,
  // which the camera sees and the projector does not, has the ambient light alone.
  const auto source = open("object,scan=progressive,noise=0,chroma=0,ambient=0,frames=1", {.truth = true});
  const CapturedFrame frame = take(*source);
  int dark_wall = 0, lit_wall = 0;
  for (int y = 260; y < 340; ++y) {
    for (int x = 330; x < 600; ++x) {
      if (source->truth().row(y)[x] < 1.24f) continue;  // not the wall
      const int light = frame.picture.row(y)[3 * x] + frame.picture.row(y)[3 * x + 1] +
                        frame.picture.row(y)[3 * x + 2] + frame.complement.row(y)[3 * x] +
                        frame.complement.row(y)[3 * x + 1] + frame.complement.row(y)[3 * x + 2];
      (light < 6 ? dark_wall : lit_wall) += 1;
    }
  }
  EXPECT_GT(dark_wall, 500);
  EXPECT_GT(lit_wall, 500);
}

/// A wall that lets nobody past its first ray until it is opened, and counts the rays.
class Barrier : public sim::Shape, public sim::Scene {
 public:
  bool hit(sim::Vec3, sim::Hit&) const override {
    std::unique_lock lock(mutex_);
    ++rays_;
    changed_.notify_all();
    changed_.wait(lock, [&] { return open_; });
    return false;
  }
  sim::Material material(sim::Vec3, const sim::Hit&) const override { return {}; }
  bool blocks(sim::Vec3, sim::Vec3) const override { return false; }
  sim::Shapes at(double, double) const override { return {{std::shared_ptr<void>(), this}}; }

  void wait_for_a_ray() const {
    std::unique_lock lock(mutex_);
    changed_.wait(lock, [&] { return rays_ > 0; });
  }
  void open() const {
    std::lock_guard lock(mutex_);
    open_ = true;
    changed_.notify_all();
  }
  int rays() const {
    std::lock_guard lock(mutex_);
    return rays_;
  }

 private:
  mutable std::mutex mutex_;
  mutable std::condition_variable changed_;
  mutable int rays_ = 0;
  mutable bool open_ = false;
};

// Proves: a stop does not wait for the frame in the making, which takes seconds on a slow machine.
// Proves: pixels where shapes meet are a mixture of what is around them, all others stay as they are.
TEST(Simulator, PixelsOfManyRaysMixWhereShapesMeet) {
  const std::string plain = "object,scan=progressive,noise=0,chroma=0,defocus=0,frames=1";
  const Image8 one = take(*open(plain, {})).picture, mixed = take(*open(plain + ",rays=4", {})).picture;
  int changed = 0, strange = 0;
  for (int y = 1; y + 1 < one.height(); ++y) {
    for (int i = 3; i < 3 * (one.width() - 1); ++i) {
      if (mixed.row(y)[i] == one.row(y)[i]) continue;
      ++changed;
      int least = 255, most = 0;
      for (int dy = -1; dy <= 1; ++dy) {
        for (int dx = -3; dx <= 3; dx += 3) {
          least = std::min<int>(least, one.row(y + dy)[i + dx]);
          most = std::max<int>(most, one.row(y + dy)[i + dx]);
        }
      }
      if (mixed.row(y)[i] < least - 2 || mixed.row(y)[i] > most + 2) ++strange;
    }
  }
  EXPECT_GT(changed, 1000);
  EXPECT_LT(changed, one.width() * one.height() * 3 / 40);
  EXPECT_LT(strange, changed / 50);  // stripes narrower than a pixel there
}

TEST(RenderAhead, AStopLeavesTheFrameInTheMaking) {
  auto options = sim::parse_sim_options("plane,frames=2");
  ASSERT_TRUE(options);
  const auto barrier = std::make_shared<const Barrier>();
  const Rig rig = sim::make_rig(*options, barrier->view());
  auto pattern =
      make_pattern(options->base, options->slides, options->first, options->stripes, options->path);
  ASSERT_TRUE(pattern);
  {
    sim::RenderAhead frames(std::make_shared<const sim::Renderer>(*options, rig, *pattern, barrier),
                            {.count = 2, .ahead = 2});
    barrier->wait_for_a_ray();
    frames.stop();
    barrier->open();
  }
  EXPECT_LE(barrier->rays(), rig.camera.width) << "of one row";
}

}  // namespace
}  // namespace relievo
