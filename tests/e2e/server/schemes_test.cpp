// SPDX-License-Identifier: Apache-2.0
// Each projection scheme from the simulator over a take on disk to surfaces scored against the truth.
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <iterator>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "capture/rig_file.h"
#include "capture/upright.h"
#include "server_process.h"

namespace relievo::test {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;

struct Case {
  const char* name;
  const char* keys;  // of the simulated scene
  const char* scheme;
  int surfaces;            // of 9 frames, the first of which is not scored
  int plys;                // written by `reconstruct`
  int textures;            // of the 9 frames
  double median_um_per_m;  // at most
};

class ServerSchemes : public ::testing::TestWithParam<Case> {
 protected:
  static json run_json(const std::vector<std::string>& command) {
    const Finished done = run(server(command), kLongPatience);
    EXPECT_EQ(done.status, 0) << done.err;
    const json parsed = json::parse(done.out, nullptr, false);
    EXPECT_FALSE(parsed.is_discarded()) << done.out;
    return parsed.is_discarded() ? json::object() : parsed;
  }
  const TempFolder folder_;
};

TEST_P(ServerSchemes, TakeEvaluatesAndReconstructs) {
  const Case& c = GetParam();
  const std::string take = (folder_.path() / "take").string();
  run_json({"simulate", "--scene", std::string("object,width=480,height=360,stripes=60") + c.keys, "--scheme",
            c.scheme, "--frames", "9", "--out", take, "--json"});
  const json score = run_json({"evaluate", take, "--json"});
  std::printf("%s: %s\n", c.name, score.dump().c_str());
  EXPECT_EQ(score.value("frames", 0), c.surfaces);
  EXPECT_EQ(score.value("of", 0), c.surfaces);
  EXPECT_GE(score.value("completeness", 0.0), 0.96);
  EXPECT_LE(score.value("outliers", 1.0), 0.004);
  EXPECT_LE(score.value("median_um_per_m", 1e9), c.median_um_per_m);

  const fs::path out = folder_.path() / "plys";
  const json summary = run_json({"reconstruct", take, "--out", out.string(), "--json"});
  EXPECT_EQ(summary.value("scheme", ""), c.scheme);
  EXPECT_EQ(summary.value("reconstructed", 0), c.plys);
  EXPECT_EQ(summary.value("textures", 0), c.textures);
  int files = 0;
  for ([[maybe_unused]] const auto& entry : fs::directory_iterator(out)) ++files;
  EXPECT_EQ(files, c.plys);
}

INSTANTIATE_TEST_SUITE_P(
    , ServerSchemes,
    ::testing::Values(Case{"complementary", "", "complementary", 8, 8, 9, 150},
                      Case{"complementary_bottom", ",field_order=bottom", "complementary", 8, 8, 9, 150},
                      Case{"complementary_progressive", ",scan=progressive", "complementary", 8, 8, 9, 150},
                      Case{"complementary_upside_down", ",roll=180", "complementary", 8, 8, 9, 150},
                      Case{"white_field", "", "white-field", 15, 15, 9, 200},
                      Case{"white_field_bottom", ",field_order=bottom", "white-field", 15, 15, 9, 200},
                      Case{"white_frame", "", "white-frame", 5, 5, 3, 150},
                      Case{"white_frame_progressive", ",scan=progressive", "white-frame", 5, 5, 3, 150},
                      Case{"white_frame_a_frame_ahead", ",phase=2", "white-frame", 5, 5, 3, 150},
                      Case{"white_frame_two_frames_ahead", ",phase=4", "white-frame", 5, 5, 3, 150},
                      Case{"white_frame_upside_down", ",roll=-179", "white-frame", 5, 5, 3, 150},
                      Case{"one_slide", "", "one-slide", 8, 9, 9, 150},
                      Case{"one_slide_bottom", ",field_order=bottom", "one-slide", 8, 9, 9, 150}),
    [](const auto& p) { return p.param.name; });

TEST(SchemeOption, StreamsBothSurfacesOfAWhiteFieldFrame) {
  const Finished done = run(serve("sim:plane,width=96,height=64,stripes=20,period=4",
                                  {"--scheme", "white-field", "--frames", "6", "--fast"}),
                            kPatience);
  EXPECT_EQ(done.status, 0) << done.err;
  // The first frame gives none and the second its own: 1 + 4 x 2.
  EXPECT_NE(done.err.find("6 frames captured, 9 published"), std::string::npos) << done.err;
}

TEST(Stream, OfAnUpsideDownProjectorHasTheRigAndThePatternThatItsSurfacesAreOf) {
  const TempFolder folder;
  const std::string scene = "plane,width=96,height=64,stripes=20,period=4,frames=4,roll=180";
  const fs::path take = folder / "take", file = folder / "stream.mcap";
  ASSERT_EQ(run(server({"simulate", "--scene", scene, "--out", take.string()}), kPatience).status, 0);
  ASSERT_EQ(
      run(serve("sim:" + scene, {"--fast", "--frames", "4", "--record", file.string()}), kPatience).status,
      0);
  const auto rig = read_rig(take / "rig.yaml");
  const auto pattern = read_pattern(take / "pattern.yaml");
  ASSERT_TRUE(rig) << rig.error().message;
  ASSERT_TRUE(pattern) << pattern.error().message;
  const auto seen = upright(*rig, *pattern);
  ASSERT_TRUE(seen) << seen.error().message;
  std::ifstream recorded(file, std::ios::binary);
  const std::string bytes(std::istreambuf_iterator<char>(recorded), {});
  EXPECT_NE(bytes.find(to_yaml(seen->pattern)), std::string::npos);
  EXPECT_NE(bytes.find(to_yaml(seen->rig)), std::string::npos);
  EXPECT_EQ(bytes.find(to_yaml(*pattern)), std::string::npos);
}

TEST(SchemeOption, ASchemeOfASourceThatSaysItsOwnIsRefused) {
  expect_one_error(run(serve("take:somewhere", {"--scheme", "one-slide"}), kPatience),
                   "its pattern.yaml says");
  expect_one_error(run(serve("sim:plane,scheme=one-slide", {"--scheme", "white-field"}), kPatience),
                   "the scheme is said twice");
}

}  // namespace
}  // namespace relievo::test
