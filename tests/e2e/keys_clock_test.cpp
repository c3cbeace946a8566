// SPDX-License-Identifier: Apache-2.0
// Proves: keys out of their time, or a clock that is wrong, are said as that; and who has the authority can
// make and revoke keys for as long as that is valid, and renew their own.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>

#include "tests/support/own_domain.h"
#include "tests/support/process.h"
#include "tests/support/temp_folder.h"

namespace relievo {
namespace {

namespace fs = std::filesystem;
using test::program;
using testing::AllOf;
using testing::HasSubstr;
using testing::Not;

const std::string kDomain = std::to_string(test::own_domain());
constexpr long kDay_s = 24 * 3600;
constexpr long kYear_s = 365 * kDay_s;

/// An authority and keys of a viewer; programs run when the clock says another time.
class KeysInTime : public testing::Test {
 protected:
  /// DDS, whose waits are by the system's clock, would stand still in the future: keys are made in the past.
  void make_keys_before(long s) const {
    set_clock_by(-s);
    ASSERT_EQ(relievo({"keys", "init", "--keys", authority_}).status, 0);
    ASSERT_EQ(add("viewer").status, 0);
    set_clock_by(0);
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
  nlohmann::json list() const {
    const auto done = relievo({"keys", "list", "--json", "--keys", authority_});
    EXPECT_EQ(done.status, 0) << done.err;
    return done.status == 0 ? nlohmann::json::parse(done.out) : nlohmann::json::object();
  }
  /// Publishes with the authority's own keys, and reads with `keys`.
  void expect_stream_with(const std::string& keys) const {
    auto variables = environment();
    variables.push_back("RELIEVO_KEYS=" + authority_);
    test::Process server({program("test_publisher"), "face", kDomain, "0", "20", "1000000"}, variables);
    ASSERT_TRUE(server.wait_for_text("live")) << server.err();
    fs::remove(folder_ / "a.mcap");
    const auto done = relievo({"record", "face", "--out", folder_ / "a.mcap", "--frames", "5", "--domain",
                               kDomain, "--interface", "lo", "--keys", keys, "--wait", "60"});
    EXPECT_EQ(done.status, 0) << done.err;
  }

  const test::TempFolder folder_;
  const std::string clock_ = folder_ / "clock", authority_ = folder_ / "authority",
                    viewer_ = folder_ / "viewer";
};

TEST_F(KeysInTime, AClockThatIsBehindIsSaid) {
  make_keys_before(0);
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

TEST_F(KeysInTime, AnAuthorityWhoseOwnKeysHaveExpiredGoesOn) {
  make_keys_before(11 * kYear_s);
  EXPECT_THAT(streams(viewer_).err, AllOf(HasSubstr("expired"), HasSubstr("add-client")));
  EXPECT_THAT(streams(authority_).err, AllOf(HasSubstr("expired"), HasSubstr("relievo keys renew")));
  EXPECT_EQ(list()["holders"].size(), 2U);
  EXPECT_EQ(add("second").status, 0);
  EXPECT_EQ(add("viewer").status, 1) << "that folder is there";
  fs::remove_all(viewer_);
  const auto anew = add("viewer");
  EXPECT_EQ(anew.status, 0) << anew.err;
  EXPECT_EQ(relievo({"keys", "revoke", "second", "--keys", authority_}).status, 0);
  EXPECT_EQ(list()["holders"].size(), 4U) << "whoever has had keys";

  const auto renewed = relievo({"keys", "renew", "--keys", authority_});
  ASSERT_EQ(renewed.status, 0) << renewed.err;
  expect_stream_with(viewer_);
}

TEST_F(KeysInTime, AnAuthorityThatHasExpiredSaysSo) {
  make_keys_before(21 * kYear_s);
  for (const char* verb : {"list", "renew"}) {
    const auto refused = relievo({"keys", verb, "--keys", authority_});
    EXPECT_EQ(refused.status, 1) << verb;
    EXPECT_THAT(refused.err, AllOf(HasSubstr("expired"), HasSubstr("relievo keys init"))) << verb;
  }
  EXPECT_THAT(streams(authority_).err, AllOf(HasSubstr("expired"), HasSubstr("relievo keys init")));
}

TEST_F(KeysInTime, RenewedKeysTakeThePlaceOfThoseBefore) {
  make_keys_before(0);
  const auto name = list()["name"].get<std::string>();
  ASSERT_EQ(relievo({"keys", "renew", "--keys", authority_}).status, 0);
  expect_stream_with(viewer_);
  const auto refused = relievo({"keys", "renew", "--keys", viewer_});
  EXPECT_EQ(refused.status, 1);
  EXPECT_THAT(refused.err, HasSubstr("is no authority"));
  EXPECT_EQ(add(name).status, 1) << "that name has valid keys";

  // Those of before, which somebody may have, are revoked with the others of that name.
  ASSERT_EQ(relievo({"keys", "revoke", name, "--keys", authority_}).status, 0);
  std::size_t revoked = 0;
  const auto all = list();
  for (const auto& holder : all["holders"]) revoked += holder["name"] == name && holder["revoked"];
  EXPECT_EQ(revoked, 2U);
  ASSERT_EQ(relievo({"keys", "renew", "--keys", authority_}).status, 0);
  expect_stream_with(viewer_);
}

TEST_F(KeysInTime, WhoseKeysWereRevokedCanHaveNewOnes) {
  make_keys_before(0);
  ASSERT_EQ(relievo({"keys", "revoke", "viewer", "--keys", authority_}).status, 0);
  fs::remove_all(viewer_);
  ASSERT_EQ(add("viewer").status, 0);
  expect_stream_with(viewer_);
  std::size_t revoked = 0;
  const auto all = list();
  for (const auto& holder : all["holders"]) revoked += holder["name"] == "viewer" && holder["revoked"];
  EXPECT_EQ(revoked, 1U) << "the others stay so";
}

}  // namespace
}  // namespace relievo
