// SPDX-License-Identifier: Apache-2.0
// Proves: a rig.yaml that is written anew is whole or as it was, and the one before stays beside it.
#include "server/keep_rig.h"

#include <gtest/gtest.h>
#include <unistd.h>

#include <fstream>
#include <sstream>

#include "base/whole_file.h"
#include "tests/support/temp_folder.h"
#include "tests/unit/server/fakes.h"

namespace relievo {
namespace {

using namespace test;
namespace fs = std::filesystem;

constexpr std::int64_t kNow_ns = 1'769'860'800'000'000'000;  // 2026-01-31 12:00:00

std::string text_of(const fs::path& file) {
  std::ostringstream out;
  out << std::ifstream(file).rdbuf();
  return out.str();
}

class KeepRig : public testing::Test {
 protected:
  const TempFolder folder_;
  const fs::path file_ = folder_ / "rig.yaml";
  const Pattern pattern_ = striped_scene().pattern;
};

TEST_F(KeepRig, WhatCannotBeWrittenIsSaidBefore) {
  EXPECT_TRUE(can_keep_rig(file_));
  EXPECT_TRUE(can_keep_rig("rig.yaml")) << "in the folder where the server runs";
  const Status missing = can_keep_rig(folder_ / "none" / "rig.yaml");
  ASSERT_FALSE(missing);
  EXPECT_NE(missing.error().message.find("make the folder " + (folder_ / "none").string()), std::string::npos)
      << missing.error().message;
  const Status no_file = can_keep_rig(folder_.path());
  ASSERT_FALSE(no_file);
  EXPECT_NE(no_file.error().message.find("it is no file"), std::string::npos) << no_file.error().message;
  if (::geteuid() == 0) return;  // may write everywhere
  fs::permissions(folder_.path(), fs::perms::owner_read | fs::perms::owner_exec);
  const Status closed = can_keep_rig(file_);
  ASSERT_FALSE(closed);
  EXPECT_NE(closed.error().message.find("let the server write"), std::string::npos) << closed.error().message;
}

TEST_F(KeepRig, TheFirstOneHasItsPatternBesideIt) {
  const auto old = keep_rig(file_, "first", pattern_, kNow_ns);
  ASSERT_TRUE(old) << old.error().message;
  EXPECT_EQ(*old, "");
  EXPECT_EQ(text_of(file_), "first");
  EXPECT_EQ(text_of(folder_ / "pattern.yaml"), to_yaml(pattern_));
}

TEST_F(KeepRig, WhatWasThereStaysEachTime) {
  ASSERT_TRUE(write_whole_file(folder_ / "pattern.yaml", "own"));
  ASSERT_TRUE(keep_rig(file_, "first", pattern_, kNow_ns));
  const auto second = keep_rig(file_, "second", pattern_, kNow_ns);
  const auto third = keep_rig(file_, "third", pattern_, kNow_ns);
  ASSERT_TRUE(second && third);
  EXPECT_EQ(*second, "rig.before-20260131T120000.yaml");
  EXPECT_EQ(*third, "rig.before-20260131T120000-2.yaml");
  EXPECT_EQ(text_of(folder_ / *second), "first");
  EXPECT_EQ(text_of(folder_ / *third), "second");
  EXPECT_EQ(text_of(file_), "third");
  EXPECT_EQ(text_of(folder_ / "pattern.yaml"), "own") << "a pattern that is there is another's";
}

TEST_F(KeepRig, AFieldOrderThatSomebodyStatedStays) {
  ASSERT_TRUE(
      write_whole_file(file_, "%YAML:1.0\n---\nscan: interlaced\nfield_order: top\nframe_rate: 25\n"));
  ASSERT_TRUE(keep_rig(file_, "%YAML:1.0\n---\nscan: interlaced\nframe_rate: 29.97\n", pattern_, kNow_ns));
  EXPECT_EQ(text_of(file_), "%YAML:1.0\n---\nscan: interlaced\nfield_order: top\nframe_rate: 29.97\n");
}

TEST_F(KeepRig, WhereItCannotBeWrittenItSaysSo) {
  const auto kept = keep_rig(folder_ / "missing" / "rig.yaml", "text", pattern_, kNow_ns);
  ASSERT_FALSE(kept);
  EXPECT_FALSE(kept.error().message.empty());
}

}  // namespace
}  // namespace relievo
