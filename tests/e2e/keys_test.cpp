// SPDX-License-Identifier: Apache-2.0
// Proves: keys that are there and cannot be used are never taken as none: nothing is sent or read in plain
// then.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/stat.h>
#include <unistd.h>

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

/// A user whose keys belong in where_.
class UserKeys : public testing::Test {
 protected:
  test::Finished run(std::vector<std::string> command) const {
    command.front() = program(command.front());
    command.insert(command.begin(), before_.begin(), before_.end());
    return test::run(command, test::kPatience,
                     {"HOME=" + home_.string(), "XDG_CONFIG_HOME=" + home_.string(), "RELIEVO_KEYS="});
  }
  test::Finished streams(const std::vector<std::string>& more = {}) const {
    std::vector<std::string> command = {"relievo",     "streams", "--domain", kDomain,
                                        "--interface", "lo",      "--wait",   "0.2"};
    command.insert(command.end(), more.begin(), more.end());
    return run(command);
  }
  nlohmann::json keys_as_doctor_finds_them() const {
    const auto found = run({"relievo", "doctor", "--json", "--domain", kDomain, "--interface", "lo", "--wait",
                            "0.2", "--folder", folder_.path()});
    for (const auto& finding : nlohmann::json::parse(found.out))
      if (finding["check"] == "keys") return finding;
    return {};
  }
  void make_keys(const fs::path& folder) const {
    const auto made = run({"relievo", "keys", "init", "--keys", folder});
    ASSERT_EQ(made.status, 0) << made.err;
  }
  /// By the server, the clients and doctor, with `why` and with what to do.
  void expect_refused(const std::string& why) const {
    const auto server = run({"relievo-server", "serve", "--source", "sim:face", "--frames", "1", "--web",
                             "127.0.0.1:0", "--domain", kDomain, "--interface", "lo"});
    for (const auto& done : {server, streams()}) {
      EXPECT_EQ(done.status, 1) << why;
      EXPECT_THAT(done.err, AllOf(HasSubstr(where_.string()), HasSubstr(why), HasSubstr("--keys none")));
    }
    const auto found = keys_as_doctor_finds_them();
    EXPECT_EQ(found["grade"], "trouble") << why;
    EXPECT_THAT(found["found"].get<std::string>(), HasSubstr(why));
    EXPECT_EQ(streams({"--keys", "none"}).status, 0) << "in plain on purpose";
  }

  const test::TempFolder folder_;
  const fs::path home_ = folder_ / "home";
  const fs::path where_ = home_ / "relievo" / "keys";
  std::vector<std::string> before_;  // a program that starts the others
};

TEST_F(UserKeys, NoFolderIsNoKeys) {
  EXPECT_EQ(streams().status, 0);
  EXPECT_THAT(keys_as_doctor_finds_them()["found"].get<std::string>(), HasSubstr("none"));
  std::ofstream(home_) << "no folder, as /dev/null is none\n";
  EXPECT_EQ(streams().status, 0);
}

TEST_F(UserKeys, HalfAFolderIsRefused) {
  fs::create_directories(where_);
  expect_refused("authority.pem is missing");
  fs::remove(where_);
  make_keys(where_);
  fs::remove(where_ / "identity.pem");
  expect_refused("identity.pem is missing");
}

TEST_F(UserKeys, WhatIsNoFolderIsRefused) {
  fs::create_directories(where_.parent_path());
  std::ofstream(where_) << "text\n";
  expect_refused("Not a directory");
  fs::remove(where_);
  fs::create_symlink(folder_ / "unplugged", where_);
  expect_refused("is missing");
  fs::remove(where_);
  fs::create_symlink(where_, where_);
  expect_refused("Too many levels of symbolic links");
}

TEST_F(UserKeys, WhatRootChangesStaysItsOwners) {
  if (::geteuid() != 0) GTEST_SKIP() << "root's commands";
  constexpr uid_t kNobody = 65534;
  make_keys(where_);
  ASSERT_EQ(::chown(where_.c_str(), kNobody, kNobody), 0);
  for (const auto& entry : fs::recursive_directory_iterator(where_))
    ASSERT_EQ(::chown(entry.path().c_str(), kNobody, kNobody), 0);
  const std::string umask = "umask 077; exec \"$0\" \"$@\"";
  for (const std::vector<std::string>& verb :
       {std::vector<std::string>{"add-client", "anna", "--out", folder_ / "anna"},
        {"revoke", "anna"},
        {"renew"}}) {
    std::vector<std::string> command = {"/bin/sh", "-c", umask, program("relievo"), "keys"};
    command.insert(command.end(), verb.begin(), verb.end());
    command.insert(command.end(), {"--keys", where_});
    const auto done = test::run(command);
    ASSERT_EQ(done.status, 0) << done.err;
  }
  for (const auto& entry : fs::recursive_directory_iterator(where_)) {
    struct stat info {};
    ASSERT_EQ(::stat(entry.path().c_str(), &info), 0);
    EXPECT_EQ(info.st_uid, kNobody) << entry.path();
  }
}

TEST_F(UserKeys, AFullDiskIsToldByTheNameAskedFor) {
  make_keys(where_);
  for (const std::vector<std::string>& verb :
       {std::vector<std::string>{"init", "--keys", folder_ / "new"},
        {"add-client", "anna", "--keys", where_, "--out", folder_ / "new"},
        {"renew", "--keys", where_}}) {
    // A limit on the size of files stands for a full disk; an identity is larger, its key is not.
    std::vector<std::string> command = {"/bin/bash", "-c", "trap '' XFSZ; ulimit -f 1; exec \"$0\" \"$@\"",
                                        program("relievo"), "keys"};
    command.insert(command.end(), verb.begin(), verb.end());
    const auto done = test::run(command);
    EXPECT_EQ(done.status, 1);
    EXPECT_THAT(done.err, AllOf(HasSubstr("cannot write " + verb.back() + "/"), Not(HasSubstr(".part"))));
    EXPECT_FALSE(fs::exists(folder_ / "new"));
  }
}

TEST_F(UserKeys, WhatIsInTheWayIsLeftWhereItIs) {
  fs::create_directory(folder_ / "new.part");
  std::ofstream(folder_ / "new.part" / "notes") << "mine\n";
  const auto done = run({"relievo", "keys", "init", "--keys", folder_ / "new"});
  EXPECT_EQ(done.status, 1);
  EXPECT_THAT(done.err, HasSubstr("new.part is in the way"));
  EXPECT_TRUE(fs::exists(folder_ / "new.part" / "notes"));
}

TEST_F(UserKeys, RenewingReplacesADamagedCertificate) {
  make_keys(where_);
  const fs::path identity = fs::path(where_) / "identity.pem";
  for (const bool gone : {false, true}) {
    gone ? static_cast<void>(fs::remove(identity)) : fs::resize_file(identity, 100);
    const auto renewed = run({"relievo", "keys", "renew", "--keys", where_});
    ASSERT_EQ(renewed.status, 0) << renewed.err;
    EXPECT_EQ(run({"relievo", "keys", "list", "--keys", where_}).status, 0);
  }
}

class ClosedKeys : public UserKeys {
 protected:
  void SetUp() override {
    make_keys(where_);
    if (::geteuid() != 0) return;
    before_ = {"/usr/bin/setpriv", "--bounding-set=-all",
               "--inh-caps=-all"};  // modes hold for root, too, then
    if (run({"relievo", "--version"}).status != 0) GTEST_SKIP() << "root may not give up its rights here";
  }
  void TearDown() override {
    for (const fs::path& closed : {where_.parent_path(), where_, where_ / "identity.key"})
      fs::permissions(closed, fs::perms::owner_all);
  }
};

TEST_F(ClosedKeys, AreRefused) {
  for (const fs::path& closed : {where_ / "identity.key", where_, where_.parent_path()}) {
    fs::permissions(closed, fs::perms::none);
    expect_refused("Permission denied");
    EXPECT_THAT(streams().err, AllOf(HasSubstr(closed == where_.parent_path() ? "chmod a+x" : "chown -R"),
                                     Not(HasSubstr("keys init"))))
        << closed;
    const auto given = streams({"--keys", where_});
    EXPECT_EQ(given.status, 1);
    EXPECT_THAT(given.err,
                AllOf(HasSubstr("Permission denied"), HasSubstr("chown"), Not(HasSubstr("missing"))));
    const auto listed = run({"relievo", "keys", "list"});
    EXPECT_EQ(listed.status, 1);
    EXPECT_THAT(listed.err, HasSubstr("Permission denied"));
    fs::permissions(closed, fs::perms::owner_all);
  }
  EXPECT_EQ(streams().status, 0) << "open again";
}

}  // namespace
}  // namespace relievo
