// SPDX-License-Identifier: Apache-2.0
// Proves: of a query's escapes only whole ones are undone, whatever bytes come.
#include "web/gateway/request_target.h"

#include <gtest/gtest.h>

namespace relievo::test {
namespace {

TEST(RequestTarget, EscapesOfAQueryAreUndone) {
  EXPECT_EQ(percent_decoded("camera%2Ccoverage%2cbreaks"), "camera,coverage,breaks");
  EXPECT_EQ(percent_decoded("a+b%20c%2B"), "a b c+");
  EXPECT_EQ(percent_decoded("%00%ff"), std::string("\0\xff", 2));
  EXPECT_EQ(percent_decoded("%252C"), "%2C") << "once";
  for (const char* none : {"", "%", "%2", "%%", "%zz", "%-1", "%+1", "% 1", "%0x", "a%", "\xff%\xff\xff"})
    EXPECT_EQ(percent_decoded(none).size(), std::string_view(none).size()) << none;
}

TEST(RequestTarget, OfAPathOnlyEscapesThatChangeNothingAreUndone) {
  EXPECT_EQ(unescaped("fa%63e%2d1%2E%7emcap"), "face-1.~mcap");
  for (const char* kept : {"", "a+b", "%2f", "%00", "%20", "%c3%a9", "%", "%6", "%zz", "a%", "%%", "%25"})
    EXPECT_EQ(unescaped(kept), kept);
  EXPECT_EQ(unescaped("%2561"), "%2561") << "once";
}

TEST(RequestTarget, AQueryIsWhatIsBehindTheFirstMark) {
  EXPECT_EQ(query_of("/"), "");
  EXPECT_EQ(query_of("/?"), "");
  EXPECT_EQ(query_of("/a?b=c?d"), "b=c?d");
}

}  // namespace
}  // namespace relievo::test
