// SPDX-License-Identifier: Apache-2.0
// Proves: a look asks for the pictures that its query names, escaped or not, and for no other.
#include "web/gateway/rig_api.h"

#include <gtest/gtest.h>

namespace relievo::test {
namespace {

/// Has one stream, "face", and remembers what it was asked for.
class OneRig final : public RigControl {
 public:
  bool has(const std::string& stream) const override { return stream == "face"; }
  std::optional<std::shared_ptr<const RigView>> look(const std::string& stream,
                                                     const std::vector<std::string>& pictures) override {
    asked = pictures;
    return has(stream) ? std::optional(std::shared_ptr<const RigView>()) : std::nullopt;
  }
  ProjectorState projector() const override { return {}; }
  Status project(const std::string&, const std::string&) override { return {}; }
  Status stop_projecting() override { return {}; }

  std::vector<std::string> asked;
};

HttpReply look(OneRig& rig, const std::string& query) {
  const std::string target = "/api/rig/face" + query;
  return rig_look("face", {.method = "GET", .target = target}, &rig);
}

TEST(RigApi, PicturesMayBeEscaped) {
  OneRig rig;
  const std::vector<std::string> both{"camera", "coverage"};
  for (const char* query : {"?pictures=camera,coverage", "?pictures=camera%2Ccoverage",
                            "?x=1&pictures=c%61mera%2ccoverage&pictures=order"}) {
    EXPECT_EQ(look(rig, query).status, 200) << query;
    EXPECT_EQ(rig.asked, both) << query;
  }
  EXPECT_EQ(look(rig, "").status, 200);
  EXPECT_EQ(rig.asked, std::vector<std::string>());
}

TEST(RigApi, AnyBytesAreRefusedInPlainText) {
  for (const char* query : {"?pictures=camera%00", "?pictures=%0d%0aSet-Cookie:%20a=b", "?pictures=%2e%2e%2f",
                            "?pictures=%", "?pictures=%2", "?pictures=%zz", "?pictures=,", "?pictures=%2C%2C",
                            "?pictures=camera%252Ccoverage", "?pictures=%ff%fe", "?pictures=camera+"}) {
    OneRig rig;
    const HttpReply reply = look(rig, query);
    EXPECT_EQ(reply.status, 400) << query;
    EXPECT_TRUE(rig.asked.empty()) << query;
    EXPECT_NE(reply.body.find("ask for camera, "), std::string::npos) << reply.body;
    for (const char c : reply.body.substr(0, reply.body.size() - 1))
      EXPECT_TRUE(c >= ' ' && c <= '~') << query;
  }
}

}  // namespace
}  // namespace relievo::test
