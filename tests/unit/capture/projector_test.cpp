// SPDX-License-Identifier: Apache-2.0
// What is on the screen at each refresh, and what is counted, on a display whose refreshes the test decides.
#include <gtest/gtest.h>

#include <set>
#include <utility>

#include "capture/pattern/bcsl.h"
#include "capture/pattern/schedule.h"
#include "capture/pattern/slides.h"
#include "capture/projector/refresh_count.h"
#include "capture/projector/show_slides.h"

namespace relievo {
namespace {

constexpr double kHz = 60;
constexpr std::int64_t kInterval_ns = 16'666'667;

bool same(const Image8& a, const Image8& b) {
  return a.size() == b.size() && std::equal(a.data(), a.data() + a.size(), b.data());
}

/// Refreshes go by when a picture is shown; at some, nothing is ready.
class TestDisplay final : public Display {
 public:
  bool counts = true;              // refreshes itself
  std::set<std::uint64_t> missed;  // refreshes at which the picture does not make it
  std::vector<std::pair<std::uint64_t, std::size_t>> shown;  // refresh, picture

  const DisplayOutput& output() const override { return output_; }
  Status load(const std::vector<Image8>& pictures) override {
    for (const Image8& picture : pictures) loaded.push_back(picture.clone());
    return {};
  }
  Result<Flip> show(std::size_t picture, int refreshes) override {
    refresh_ += static_cast<std::uint64_t>(refreshes);
    while (missed.contains(refresh_)) ++refresh_;
    shown.emplace_back(refresh_, picture);
    Flip flip{static_cast<std::int64_t>(refresh_) * kInterval_ns, std::nullopt};
    if (counts) flip.refresh = refresh_;
    return flip;
  }
  bool closed() override { return false; }

  std::vector<Image8> loaded;

 private:
  DisplayOutput output_{"test", true, {96, 4, kHz}, {}};
  std::uint64_t refresh_ = 1000;
};

Pattern pattern_of(Scheme scheme) {
  Pattern pattern = *make_pattern(6, 2, 0, 24);
  pattern.scheme = scheme;
  return pattern;
}

TEST(ShowSlides, EachRefreshHasItsPlaceInTheSchedule) {
  for (const bool counts : {true, false}) {
    TestDisplay display;
    display.counts = counts;
    display.missed = {1050, 1051, 1077};
    const Pattern pattern = pattern_of(Scheme::kComplementary);
    const auto report = show_slides(display, pattern, {.pictures = 100});
    ASSERT_TRUE(report);
    EXPECT_EQ(report->pictures, 100U);
    EXPECT_EQ(report->missed, 3U);
    EXPECT_EQ(report->refreshes, 102U);
    EXPECT_TRUE(report->synchronised);
    EXPECT_EQ(report->counted, counts);
    EXPECT_NEAR(report->refresh_hz, kHz, 0.01);
    const std::size_t warm_up = display.shown.size() - 100;
    const std::uint64_t first = display.shown[warm_up].first;
    int late = 0;
    for (std::size_t i = warm_up; i < display.shown.size(); ++i) {
      const auto [refresh, picture] = display.shown[i];
      if (picture == (refresh - first) % 4) continue;
      ++late;  // a picture that came after its refresh, never one out of step afterwards
      EXPECT_TRUE(display.missed.contains(refresh - 1)) << refresh;
    }
    EXPECT_EQ(late, 2);  // two runs of missed refreshes
  }
}

TEST(ShowSlides, PicturesAreTheSchemes) {
  for (const Scheme scheme : {Scheme::kComplementary, Scheme::kWhiteField, Scheme::kWhiteFrame}) {
    TestDisplay display;
    const Pattern pattern = pattern_of(scheme);
    ASSERT_TRUE(show_slides(display, pattern, {.pictures = 1}));
    ASSERT_EQ(display.loaded.size(), 2 * static_cast<std::size_t>(cycle_frames(pattern)));
    for (std::size_t i = 0; i < display.loaded.size(); ++i) {
      const Exposure exposure = relievo::shown(pattern, i / 2, static_cast<int>(i % 2));
      EXPECT_TRUE(same(display.loaded[i], draw_field(pattern, exposure, 96, 4))) << i;
    }
    TestDisplay interlaced;
    ASSERT_TRUE(show_slides(interlaced, pattern,
                            {.interlaced = true, .field_order = FieldOrder::kBottom, .pictures = 1}));
    ASSERT_EQ(interlaced.loaded.size(), static_cast<std::size_t>(cycle_frames(pattern)));
    for (std::size_t i = 0; i < interlaced.loaded.size(); ++i)
      EXPECT_TRUE(same(interlaced.loaded[i],
                       draw_interlaced(pattern, static_cast<int>(i), FieldOrder::kBottom, 96, 4)));
  }
}

TEST(ShowSlides, PicturesStayForSeveralRefreshes) {
  TestDisplay display;
  display.missed = {1041};
  const auto report =
      show_slides(display, pattern_of(Scheme::kComplementary), {.refreshes_each = 2, .pictures = 50});
  ASSERT_TRUE(report);
  EXPECT_EQ(report->missed, 1U);
  EXPECT_EQ(report->refreshes, 99U);
}

TEST(ShowSlides, EndsWhenAsked) {
  TestDisplay display;
  int asked = 0;
  const auto report =
      show_slides(display, pattern_of(Scheme::kComplementary), {.stopped = [&asked] { return ++asked > 7; }});
  ASSERT_TRUE(report);
  EXPECT_EQ(report->pictures, 7U);
}

TEST(RefreshCount, KnowsADisplayThatDoesNotWait) {
  RefreshCount count(kHz, 1);
  for (int i = 0; i < 200; ++i) count.flip({i * 300'000, std::nullopt});
  EXPECT_FALSE(count.synchronised());
  EXPECT_EQ(count.pictures(), 200U);
  EXPECT_EQ(count.refreshes(), 199U);
  EXPECT_EQ(count.missed(), 0U);
  EXPECT_EQ(count.refresh_hz(), kHz);
}

// Pictures that the clock paces from then on come as if the display waited: no sign that it does.
TEST(RefreshCount, ADisplayThatDoesNotWaitIsNotTakenForOneThatDoesOncePaced) {
  constexpr std::int64_t kPaced_ns = 16'666'667;
  RefreshCount count(kHz, 1);
  std::int64_t now_ns = 0;
  for (int i = 0; i < 20; ++i) count.flip({now_ns += 300'000, std::nullopt});
  ASSERT_FALSE(count.synchronised());
  for (int i = 0; i < 300; ++i) {
    count.flip({now_ns += kPaced_ns, std::nullopt});
    ASSERT_FALSE(count.synchronised()) << i;
  }
}

TEST(RefreshCount, MeasuresTheRateThroughJitter) {
  constexpr std::int64_t kNtsc_ns = 16'683'333;
  RefreshCount count(kHz, 1);
  for (int i = 0; i < 300; ++i) count.flip({i * kNtsc_ns + (i % 7 - 3) * 1'500'000, std::nullopt});
  EXPECT_TRUE(count.synchronised());
  EXPECT_EQ(count.missed(), 0U);
  EXPECT_NEAR(count.refresh_hz(), 59.94, 0.3);
}

}  // namespace
}  // namespace relievo
