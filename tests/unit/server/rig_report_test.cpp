// SPDX-License-Identifier: Apache-2.0
// Proves: what a look at a rig advises is of the rig's state, in sentences, in the words of the page.
#include "server/rig_report.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cctype>

namespace relievo {
namespace {

using testing::AllOf;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::Not;

/// Decoded, well exposed, lit all over, with as many of 100 pixels covered.
struct Looked {
  explicit Looked(std::size_t covered_px) {
    frame.decoded.emplace();
    for (auto& channel : check.exposure.histogram) channel[50] = 100;
    check.cover = Image8(10, 10, 1);
    check.lit_px = 100;
    check.covered_px = covered_px;
    check.margins = {{.colour = 1, .stripes = 10, .low = 5}, {.colour = 6, .stripes = 10, .low = 50}};
    check.neighbours = 10;
  }
  TappedFrame frame;
  RigCheck check;
};

TEST(RigAdvice, NamesColoursAsTheTableDoes) {
  const Looked looked(100);
  EXPECT_THAT(rig_advice(looked.frame, looked.check),
              ElementsAre(AllOf(HasSubstr("told: red;"), Not(HasSubstr("relievo-server")))));
}

TEST(RigAdvice, IsInSentences) {
  Looked looked(13);
  looked.frame.step_advice = "exposures end 20 % after the slide has changed: shorten them";
  looked.check.order_errors.resize(9);
  const auto advice = rig_advice(looked.frame, looked.check);
  EXPECT_EQ(advice.size(), 4U);
  for (const std::string& line : advice) {
    EXPECT_FALSE(std::islower(static_cast<unsigned char>(line.front()))) << line;
    EXPECT_EQ(line.back(), '.') << line;
  }
}

TEST(RigAdvice, LampsThatFlickerAreSaid) {
  Looked looked(100);
  looked.check.margins.clear();
  looked.frame.report.slide_excess = -0.02;
  EXPECT_THAT(rig_advice(looked.frame, looked.check), testing::IsEmpty());
  looked.frame.report.slide_excess = -0.08;
  EXPECT_THAT(rig_advice(looked.frame, looked.check),
              ElementsAre(HasSubstr("is 8.0 % brighter than the other")));
}

TEST(RigAdvice, ARigThatIsNotCalibratedIsToBeCalibratedNotFocused) {
  Looked looked(13);
  looked.frame.calibrated = false;
  EXPECT_THAT(rig_advice(looked.frame, looked.check), ElementsAre(HasSubstr("is not calibrated")));
  looked.check.exposure.clipped = 0.5;
  EXPECT_THAT(rig_advice(looked.frame, looked.check),
              ElementsAre(HasSubstr("is not calibrated"), HasSubstr("clipped")));
}

}  // namespace
}  // namespace relievo
