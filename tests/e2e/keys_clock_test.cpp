// SPDX-License-Identifier: Apache-2.0
// Proves: a clock that is wrong is said as that.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>

#include "tests/support/own_domain.h"
#include "tests/support/process.h"
#include "tests/support/temp_folder.h"

namespace relievo {
namespace {

using test::program;
using testing::AllOf;
using testing::HasSubstr;
using testing::Not;

const std::string kDomain = std::to_string(test::own_domain());
constexpr long kDay_s = 24 * 3600;
constexpr long kYear_s = 365 * kDay_s;

/// An authority and keys of a viewer, made now; programs run when the clock says another time.
class KeysInTime : public testing::Test {
 protected:
  void SetUp() override {
    ASSERT_EQ(relievo({"keys", "init", "--keys", authority_}).status, 0);
    add("viewer");
  }
  void set_clock_by(long s) const { std::ofstream(clock_) << s; }
  std::vector<std::string> environment() const {
    return {std::string("LD_PRELOAD=") + RELIEVO_SET_CLOCK, "RELIEVO_CLOCK_SET=" + clock_};
  }
  test::Finished relievo(std::vector<std::string> arguments) const {
    arguments.insert(arguments.begin(), program("relievo"));
    return test::run(arguments, test::kPatience, environment());
  }
  test::Finished add(const std::string& name) const {
    return relievo({"keys", "add-client", name, "--keys", authority_, "--out", folder_ / name});
  }
  test::Finished streams(const std::string& keys) const {
    return relievo({"streams", "--domain", kDomain, "--interface", "lo", "--keys", keys, "--wait", "0.2"});
  }
  const test::TempFolder folder_;
  const std::string clock_ = folder_ / "clock", authority_ = folder_ / "authority",
                    viewer_ = folder_ / "viewer";
};

TEST_F(KeysInTime, AClockThatIsBehindIsSaid) {
  for (const long behind_s : {3 * kDay_s, 20 * kYear_s}) {
    set_clock_by(-behind_s);
    for (const std::string& keys : {viewer_, authority_}) {
      const auto refused = streams(keys);
      EXPECT_EQ(refused.status, 1);
      EXPECT_THAT(refused.err, AllOf(HasSubstr(" are valid from 20"), HasSubstr("this machine's clock says "),
                                     HasSubstr("set it"), Not(HasSubstr("signed"))));
    }
    const auto doctor = relievo({"doctor", "--domain", kDomain, "--interface", "lo", "--keys", viewer_,
                                 "--wait", "0.2", "--folder", folder_.path()});
    EXPECT_THAT(doctor.out, HasSubstr("this machine's clock says "));
    const auto refused = add("nobody");
    EXPECT_EQ(refused.status, 1) << "keys of that time would be too old for everybody";
    EXPECT_THAT(refused.err, HasSubstr("this machine's clock says "));
  }
  set_clock_by(-kDay_s / 2);
  EXPECT_EQ(streams(viewer_).status, 0) << "clocks differ";
}

}  // namespace
}  // namespace relievo
