// SPDX-License-Identifier: Apache-2.0
#include "base/json_text.h"

#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

namespace relievo {
namespace {

// Names of files are bytes, which need not be UTF-8; nlohmann's own dump() throws then.
TEST(JsonText, NamesThatAreNoUtf8AreWrittenAllTheSame) {
  const nlohmann::ordered_json json = {{"file", "a\xffz"}, {"bytes", 3}};
  EXPECT_EQ(json_text(json), "{\n  \"file\": \"a\xef\xbf\xbdz\",\n  \"bytes\": 3\n}");
  EXPECT_EQ(json_line(json), "{\"file\":\"a\xef\xbf\xbdz\",\"bytes\":3}");
}

}  // namespace
}  // namespace relievo
