// SPDX-License-Identifier: Apache-2.0
#include "base/new_folder.h"

#include <gtest/gtest.h>

#include <fstream>

#include "tests/support/temp_folder.h"

namespace relievo {
namespace {

namespace fs = std::filesystem;

TEST(NewFolder, StaysWhereSomethingWasPutIntoIt) {
  const test::TempFolder folder;
  const fs::path out = folder / "a" / "b" / "";
  {
    auto made = NewFolder::create(out);
    ASSERT_TRUE(made.ok());
    const NewFolder moved = *std::move(made);
    std::ofstream(out / "file") << "x";
  }
  EXPECT_TRUE(fs::exists(out / "file"));
}

TEST(NewFolder, GoesAsFarAsItWasMadeWhereNothingWas) {
  const test::TempFolder folder;
  fs::create_directory(folder / "a");
  ASSERT_TRUE(NewFolder::create(folder / "a" / "b" / "c" / "").ok());
  EXPECT_TRUE(fs::is_empty(folder / "a"));
  ASSERT_TRUE(NewFolder::create(folder / "a").ok());
  EXPECT_TRUE(fs::exists(folder / "a")) << "which was there before";
  EXPECT_FALSE(NewFolder::create(folder / "a" / "b" / std::string(300, 'x')).ok());
  EXPECT_TRUE(fs::is_empty(folder / "a"));
}

TEST(NewFolder, NeverRemovesALink) {
  const test::TempFolder folder;
  fs::create_symlink("nowhere", folder / "link");
  EXPECT_FALSE(NewFolder::create(folder / "link").ok());
  EXPECT_TRUE(fs::is_symlink(folder / "link"));
}

}  // namespace
}  // namespace relievo
