// SPDX-License-Identifier: Apache-2.0
#include "cli/listen_address.h"

#include <gtest/gtest.h>

#include <string>

namespace relievo {
namespace {

TEST(ListenAddress, Good) {
  struct Case {
    const char* text;
    const char* host;
    int port;
  };
  for (const Case& c : {Case{"127.0.0.1:8080", "127.0.0.1", 8080}, Case{"[::1]:80", "::1", 80},
                        Case{":8080", "", 8080}, Case{"localhost:0", "localhost", 0},
                        Case{"[::]:65535", "::", 65535}, Case{"a-host.example:1", "a-host.example", 1}}) {
    const auto got = parse_listen_address(c.text);
    ASSERT_TRUE(got) << c.text << ": " << got.error().message;
    EXPECT_EQ(got->host, c.host);
    EXPECT_EQ(got->port, c.port);
  }
}

TEST(ListenAddress, ABrowserOfThisMachineFindsIt) {
  EXPECT_EQ(browser_address({"", 8080}, false, ""), "http://127.0.0.1:8080/");
  EXPECT_EQ(browser_address({"0.0.0.0", 80}, true, "t"), "https://127.0.0.1:80/?token=t");
  EXPECT_EQ(browser_address({"::", 80}, false, ""), "http://[::1]:80/");
}

TEST(ListenAddress, Wrong) {
  for (const char* text : {"", "8080", "localhost", "localhost:", "localhost:80a", "localhost:-1",
                           "localhost:65536", "localhost: 80", "::1:8080", "[::1]", "[::1]8080", "[]:80",
                           "[::1:80", "::1]:80", "host:80:90", "localhost:+80"}) {
    const auto got = parse_listen_address(text);
    ASSERT_FALSE(got) << text << " gave " << got->host << " and " << got->port;
    EXPECT_NE(got.error().message.find("'" + std::string(text) + "'"), std::string::npos);
    EXPECT_NE(got.error().message.find("127.0.0.1:8080"), std::string::npos);
  }
}

}  // namespace
}  // namespace relievo
