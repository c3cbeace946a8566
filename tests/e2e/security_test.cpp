// SPDX-License-Identifier: Apache-2.0
// Secured streams as people meet them: keys made by `relievo keys`, a publisher in a process of its own, and
// who may and may not read it. Documents are held against openssl(1).
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <nlohmann/json.hpp>

#include "tests/support/own_domain.h"
#include "tests/support/patience.h"
#include "tests/support/process.h"
#include "tests/support/replace_in.h"
#include "tests/support/temp_folder.h"

namespace relievo {
namespace {

namespace fs = std::filesystem;
using test::program;
using test::replace_in;
using testing::AllOf;
using testing::HasSubstr;
using testing::Not;

const std::string kDomain = std::to_string(test::own_domain());

test::Finished relievo(std::vector<std::string> arguments) {
  arguments.insert(arguments.begin(), program("relievo"));
  return test::run(arguments);
}

/// An authority, keys of a viewer and of a second publisher.
class Security : public testing::Test {
 protected:
  void SetUp() override {
    ASSERT_EQ(relievo({"keys", "init", "--keys", authority()}).status, 0);
    add("viewer");
  }
  std::string authority() const { return folder_ / "authority"; }
  std::string keys_of(const std::string& name) const { return folder_ / name; }
  void add(const std::string& name, const std::vector<std::string>& more = {}) {
    std::vector<std::string> arguments = {"keys",      "add-client", name,         "--keys",
                                          authority(), "--out",      keys_of(name)};
    arguments.insert(arguments.end(), more.begin(), more.end());
    const auto done = relievo(arguments);
    ASSERT_EQ(done.status, 0) << done.err;
  }
  /// Publishes real frames until the test is over.
  std::unique_ptr<test::Process> publish(const std::string& keys) {
    return std::make_unique<test::Process>(
        std::vector<std::string>{program("test_publisher"), "face", kDomain, "0", "20", "1000000"},
        std::vector<std::string>{"RELIEVO_KEYS=" + keys});
  }
  test::Finished record(const std::string& keys, const std::string& seconds) {
    return relievo({"record", "face", "--out", folder_ / "a.mcap", "--frames", "5", "--domain", kDomain,
                    "--interface", "lo", "--keys", keys, "--wait", seconds});
  }
  test::Finished streams(const std::string& keys) {
    return relievo({"streams", "--domain", kDomain, "--interface", "lo", "--keys", keys, "--wait", "2"});
  }
  /// Looks until it prints or logs `text`, since discovery takes as long as it takes.
  test::Finished streams_until(const std::string& keys, const std::string& text) {
    test::Finished seen;
    test::eventually([&] {
      seen = streams(keys);
      return (seen.out + seen.err).find(text) != std::string::npos;
    });
    return seen;
  }
  test::TempFolder folder_;
};

TEST_F(Security, HoldersOfKeysReadTheStream) {
  auto server = publish(authority());
  ASSERT_TRUE(server->wait_for_text("live")) << server->err();
  const auto done = record(keys_of("viewer"), "60");
  ASSERT_EQ(done.status, 0) << done.err;
  const auto info = relievo({"info", folder_ / "a.mcap", "--json"});
  EXPECT_EQ(nlohmann::json::parse(info.out)["frames"], 5) << info.out;
}

TEST_F(Security, WhoCannotReadIsToldWhy) {
  ASSERT_EQ(relievo({"keys", "init", "--keys", folder_ / "foreign"}).status, 0);
  add("former");
  ASSERT_EQ(relievo({"keys", "revoke", "former", "--keys", authority()}).status, 0);
  auto server = publish(authority());
  ASSERT_TRUE(server->wait_for_text("live")) << server->err();
  const std::pair<std::string, std::string> cases[] = {{"none", "has no keys"},
                                                       {folder_ / "foreign", "another authority"},
                                                       {keys_of("former"), "were revoked"}};
  for (const auto& [keys, why] : cases) {
    const auto seen = streams_until(keys, why);
    EXPECT_EQ(seen.out, "") << keys;
    EXPECT_THAT(seen.err, AllOf(HasSubstr("stream 'face'"), HasSubstr(why))) << keys;
  }
  const auto welcome = streams_until(keys_of("viewer"), "face");
  EXPECT_THAT(welcome.out, HasSubstr("face")) << welcome.err;
}

TEST_F(Security, WithKeysAPlainStreamIsNamedAndNotRead) {
  auto server = publish("none");
  ASSERT_TRUE(server->wait_for_text("live")) << server->err();
  const auto seen = streams_until(keys_of("viewer"), "is not secured");
  EXPECT_EQ(seen.out, "");
  EXPECT_THAT(seen.err, HasSubstr("is not secured"));
}

TEST_F(Security, WatchersDoNotPublish) {
  auto watcher = publish(keys_of("viewer"));
  EXPECT_EQ(watcher->wait(), 1);
  EXPECT_THAT(watcher->err(), HasSubstr("watch streams, not publish them"));
  add("second", {"--publish"});
  auto server = publish(keys_of("second"));
  ASSERT_TRUE(server->wait_for_text("live")) << server->err();
  EXPECT_THAT(streams_until(keys_of("viewer"), "face").out, HasSubstr("face"));
}

TEST_F(Security, DamagedKeysAreNamed) {
  const fs::path keys = keys_of("viewer");
  replace_in(keys / "permissions.p7s", "watcher", "wotcher");
  EXPECT_THAT(streams(keys).err,
              AllOf(HasSubstr("permissions.p7s"), HasSubstr("not as the authority signed")));
  EXPECT_EQ(streams(keys).status, 1);
  add("second");
  fs::copy_file(fs::path(keys_of("second")) / "identity.key", keys / "identity.key",
                fs::copy_options::overwrite_existing);
  EXPECT_THAT(streams(keys).err, HasSubstr("does not belong to identity.pem"));
  ASSERT_TRUE(test::make_pipe(keys / "identity.pem"));
  EXPECT_THAT(streams(keys).err, HasSubstr("identity.pem: it is a pipe"));
  fs::remove(keys / "governance.p7s");
  EXPECT_THAT(streams(keys).err, HasSubstr("governance.p7s is missing"));
  EXPECT_EQ(streams(folder_ / "nowhere").status, 1);
}

TEST_F(Security, ASecretThatEverybodyCanReadIsSaid) {
  const fs::path secret = fs::path(keys_of("viewer")) / "identity.key";
  EXPECT_THAT(streams(keys_of("viewer")).err, Not(HasSubstr("can read")));
  fs::permissions(secret, fs::perms::others_read, fs::perm_options::add);
  EXPECT_THAT(streams(keys_of("viewer")).err,
              AllOf(HasSubstr("every user of this machine can read the secret in " + secret.string()),
                    HasSubstr("chmod 600")));
}

TEST_F(Security, NoneIsNoFolderOfKeys) {
  const std::string home = folder_ / "home";
  const auto keys = [&](std::vector<std::string> arguments, const std::string& variable) {
    arguments.insert(arguments.begin(), {program("relievo"), "keys"});
    return test::run(arguments, test::kPatience,
                     {"HOME=" + home, "XDG_CONFIG_HOME=" + home, "RELIEVO_KEYS=" + variable});
  };
  for (const auto& refused :
       {keys({"init", "--keys", "none"}, ""), keys({"init"}, "none"), keys({"list"}, "none")}) {
    EXPECT_EQ(refused.status, 2);
    EXPECT_THAT(refused.err, HasSubstr("without keys"));
  }
  EXPECT_FALSE(fs::exists("none"));
  EXPECT_FALSE(fs::exists(home));
  EXPECT_EQ(keys({"init"}, folder_ / "other").status, 0);
  EXPECT_TRUE(fs::exists(folder_ / "other" / "identity.pem")) << "where servers look for them";
  EXPECT_EQ(keys({"init"}, "").status, 0);
  EXPECT_TRUE(fs::exists(fs::path(home) / "relievo" / "keys" / "identity.pem"));
}

TEST_F(Security, KeysAreMadeWholeAndOnce) {
  const auto again = relievo({"keys", "init", "--keys", authority()});
  EXPECT_EQ(again.status, 1);
  EXPECT_THAT(again.err, HasSubstr("exists already"));
  const auto twice = relievo({"keys", "add-client", "viewer", "--keys", authority(), "--out", folder_ / "b"});
  EXPECT_THAT(twice.err, HasSubstr("has keys already"));
  EXPECT_FALSE(fs::exists(folder_ / "b"));
  EXPECT_THAT(relievo({"keys", "add-client", "../up", "--keys", authority()}).err,
              HasSubstr("cannot name keys"));
  EXPECT_THAT(relievo({"keys", "add-client", "x", "--keys", keys_of("viewer")}).err,
              HasSubstr("is no authority"));
  EXPECT_THAT(relievo({"keys", "revoke", "nobody", "--keys", authority()}).err,
              HasSubstr("nobody named 'nobody'"));
  EXPECT_EQ(relievo({"keys", "revoke", "viewer", "--keys", authority()}).status, 0);
  EXPECT_THAT(relievo({"keys", "revoke", "viewer", "--keys", authority()}).err, HasSubstr("revoked already"));
  for (const fs::path& secret :
       {fs::path(authority()) / "identity.key", fs::path(authority()) / "authority.key",
        fs::path(keys_of("viewer")) / "identity.key"}) {
    EXPECT_EQ(fs::status(secret).permissions(), fs::perms::owner_read | fs::perms::owner_write) << secret;
  }
  const auto list = relievo({"keys", "list", "--json", "--keys", authority()});
  const auto j = nlohmann::json::parse(list.out);
  ASSERT_EQ(j["holders"].size(), 2u) << list.out;
  for (const auto& holder : j["holders"]) EXPECT_EQ(holder["revoked"], holder["name"] == "viewer") << holder;
  EXPECT_EQ(j["may_publish"], true);
  EXPECT_THAT(relievo({"keys", "list", "--keys", keys_of("viewer")}).out,
              AllOf(HasSubstr("may watch"), Not(HasSubstr("HOLDER"))));
}

TEST_F(Security, OpensslAgrees) {
  if (!fs::exists("/usr/bin/openssl")) GTEST_SKIP() << "no openssl(1) here: apt-get install openssl";
  const std::string ca = fs::path(authority()) / "authority.pem";
  const fs::path keys = keys_of("viewer");
  EXPECT_EQ(
      test::run({"/usr/bin/openssl", "verify", "-x509_strict", "-CAfile", ca, keys / "identity.pem"}).status,
      0);
  for (const char* document : {"governance.p7s", "permissions.p7s"}) {
    const auto checked =
        test::run({"/usr/bin/openssl", "smime", "-verify", "-text", "-CAfile", ca, "-in", keys / document});
    EXPECT_EQ(checked.status, 0) << checked.err;
    EXPECT_THAT(checked.out, HasSubstr("</dds>"));
  }
  ASSERT_EQ(relievo({"keys", "revoke", "viewer", "--keys", authority()}).status, 0);
  const auto refused = test::run({"/usr/bin/openssl", "verify", "-crl_check", "-CAfile", ca, "-CRLfile",
                                  fs::path(authority()) / "revoked.pem", keys / "identity.pem"});
  EXPECT_NE(refused.status, 0);
  EXPECT_THAT(refused.err, HasSubstr("revoked"));
}

}  // namespace
}  // namespace relievo
