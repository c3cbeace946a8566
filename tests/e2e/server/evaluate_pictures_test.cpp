// SPDX-License-Identifier: Apache-2.0
// A take from simulate to evaluate's pictures and figures, and to the properties of a PLY: through the
// programs.
#include <gtest/gtest.h>

#include <algorithm>
#include <csignal>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <map>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "capture/picture_file.h"

#include "tests/support/process.h"
#include "tests/support/temp_folder.h"

namespace relievo::test {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;

std::string text_of(const fs::path& file) {
  std::ifstream in(file, std::ios::binary);
  return {std::istreambuf_iterator<char>(in), {}};
}

/// Width and height, from a PNG's first chunk.
std::pair<int, int> png_size(const fs::path& file) {
  const std::string png = text_of(file);
  if (png.size() < 24 || png.compare(1, 3, "PNG") != 0) return {};
  const auto number = [&](std::size_t at) {
    int n = 0;
    for (std::size_t i = 0; i < 4; ++i) n = n * 256 + static_cast<unsigned char>(png[at + i]);
    return n;
  };
  return {number(16), number(20)};
}

json json_of(const std::vector<std::string>& arguments) {
  std::vector<std::string> command = {program("relievo-server").string()};
  command.insert(command.end(), arguments.begin(), arguments.end());
  command.emplace_back("--json");
  const Finished done = run(command, kLongPatience);
  EXPECT_EQ(done.status, 0) << done.err;
  const json parsed = json::parse(done.out, nullptr, false);
  EXPECT_TRUE(parsed.is_object()) << done.out;
  return parsed.is_object() ? parsed : json::object();
}

class SmallTake : public ::testing::Test {
 protected:
  void SetUp() override {
    const Finished made =
        run({program("relievo-server").string(), "simulate", "--scene",
             "object,width=320,height=240,stripes=45", "--frames", "4", "--out", take_.string()},
            kLongPatience);
    ASSERT_EQ(made.status, 0) << made.err;
  }
  json server_json(const std::vector<std::string>& arguments) const { return json_of(arguments); }

  const TempFolder folder_;
  const fs::path take_ = folder_.path() / "take";
};

TEST_F(SmallTake, EvaluationShowsEveryStageOnOnePage) {
  const fs::path pictures = folder_.path() / "deep" / "pictures";
  const json score = server_json({"evaluate", take_.string(), "--pictures", pictures.string()});
  EXPECT_EQ(score.value("frames", 0), 3);
  const std::string page = text_of(pictures / "index.html");
  int shown = 0;
  for (const auto& entry : fs::directory_iterator(pictures)) {
    if (entry.path().extension() != ".png") continue;
    ++shown;
    const auto [width, height] = png_size(entry.path());
    EXPECT_EQ(width, 320) << entry.path();
    EXPECT_TRUE(height == 240 || (height > 240 && height < 320)) << entry.path();  // with or without a legend
    EXPECT_NE(page.find("src=\"" + entry.path().filename().string() + "\""), std::string::npos)
        << entry.path();
  }
  EXPECT_EQ(shown, 3 * 10);
  EXPECT_NE(text_of(pictures / "000001-depth.png"), text_of(pictures / "000001-sigma.png"));
  EXPECT_NE(page.find(">Frame 3<"), std::string::npos);
  EXPECT_NE(page.find("completeness"), std::string::npos);
  // The pictures change nothing of the figures.
  EXPECT_EQ(server_json({"evaluate", take_.string()}), score);
}

// Stamps of a clock that began before, or half way between two frames, and of other frame rates than the
// rig's.
TEST_F(SmallTake, IsScoredWhateverItsStampsAre) {
  const json score = server_json({"evaluate", take_.string()});
  EXPECT_EQ(score.value("of", 0), 3);
  constexpr double kPeriod_s = 1 / 29.97;
  for (const auto& [name, stamps_s] : std::map<std::string, std::vector<double>>{
           {"before", {-100, -100 + kPeriod_s, -100 + 2 * kPeriod_s, -100 + 3 * kPeriod_s}},
           {"half way", {kPeriod_s / 2, 1.6 * kPeriod_s, 2.4 * kPeriod_s, 3.6 * kPeriod_s}},
           {"half as fast", {0, 2 * kPeriod_s, 4 * kPeriod_s, 6 * kPeriod_s}},
           {"far too fast", {0, 0.0001, 0.0002, 0.0003}}}) {
    std::ofstream csv(take_ / "timestamps.csv");
    csv << "frame,time_s\n";
    for (std::size_t i = 0; i < stamps_s.size(); ++i) csv << i << ',' << stamps_s[i] << '\n';
    csv.close();
    const json again = server_json({"evaluate", take_.string()});
    EXPECT_EQ(again.value("frames", 0), 3) << name;
    EXPECT_EQ(again.value("of", 0), 3) << name;
    EXPECT_NEAR(again.value("completeness", 0.0), score.value("completeness", 1.0), 0.002) << name;
  }
}

TEST_F(SmallTake, AnEvaluationThatIsBrokenOffLeavesThePageOfItsPictures) {
  const auto shown = [](const fs::path& pictures) {
    const std::string page = text_of(pictures / "index.html");
    EXPECT_NE(page.find("000001-texture.png"), std::string::npos) << page.substr(0, 300);
    EXPECT_NE(page.find("broken off"), std::string::npos) << page.substr(0, 300);
  };
  const fs::path pictures = folder_.path() / "pictures";
  // By a frame that cannot be read.
  fs::resize_file(take_ / "frames" / "000003.png", 100);
  const Finished failed =
      run({program("relievo-server").string(), "evaluate", take_.string(), "--pictures", pictures.string()},
          kLongPatience);
  EXPECT_EQ(failed.status, 1);
  EXPECT_EQ(failed.out, "") << "a score of a part";
  shown(pictures);
  // By a signal.
  const fs::path longer = folder_.path() / "longer", others = folder_.path() / "others";
  ASSERT_EQ(run({program("relievo-server").string(), "simulate", "--scene",
                 "object,width=320,height=240,stripes=45", "--frames", "100", "--out", longer.string()},
                kLongPatience)
                .status,
            0);
  Process stopped(
      {program("relievo-server").string(), "evaluate", longer.string(), "--pictures", others.string()});
  ASSERT_TRUE(eventually([&] { return fs::exists(others / "000001-texture.png"); }));
  stopped.signal(SIGTERM);
  ASSERT_EQ(stopped.wait(), 0) << stopped.err();
  EXPECT_NE(stopped.err().find("stopped: there is no score"), std::string::npos) << stopped.err();
  EXPECT_EQ(stopped.out(), "");
  shown(others);
}

TEST_F(SmallTake, PicturesThatCannotBeWrittenAreSaid) {
  std::ofstream(folder_.path() / "file") << "in the way";
  const Finished done = run({program("relievo-server").string(), "evaluate", take_.string(), "--pictures",
                             (folder_.path() / "file" / "pictures").string()},
                            kLongPatience);
  EXPECT_EQ(done.status, 1);
  EXPECT_NE(done.err.find("cannot make the folder"), std::string::npos) << done.err;
}

TEST_F(SmallTake, DenseSurfacesAreMarkedAndCounted) {
  const auto reconstruct = [&](const char* name, std::vector<std::string> more) {
    more.insert(more.begin(), {"reconstruct", take_.string(), "--out", (folder_.path() / name).string()});
    return server_json(more);
  };
  const json plain = reconstruct("plain", {});
  const json dense = reconstruct("dense", {"--dense"});
  const json filled = reconstruct("filled", {"--fill-holes", "4"});
  EXPECT_EQ(plain["filters"].value("interpolated", 9), 0);
  EXPECT_EQ(plain["filters"].value("filled", 9), 0);
  EXPECT_GT(dense["filters"].value("interpolated", 0), 3 * plain.value("decoded", 1 << 30));
  EXPECT_GT(dense.value("vertices_per_frame", 0.0), 4 * plain.value("vertices_per_frame", 1e9));
  EXPECT_GT(filled["filters"].value("filled", 0), 0);
  EXPECT_GT(filled.value("vertices_per_frame", 0.0), plain.value("vertices_per_frame", 1e9));
  const std::string ply = text_of(folder_.path() / "dense" / "000001.ply").substr(0, 600);
  EXPECT_NE(ply.find("property float sigma\nproperty uchar interpolated\n"), std::string::npos) << ply;
  const Finished wrong = run({program("relievo-server").string(), "reconstruct", take_.string(), "--out",
                              (folder_.path() / "no").string(), "--fill-holes", "17"},
                             kLongPatience);
  EXPECT_EQ(wrong.status, 2);
}

bool same(const Result<Image8>& a, const Result<Image8>& b) {
  return a && b && a->size() == b->size() && std::equal(a->data(), a->data() + a->size(), b->data());
}

TEST(ProjectorAFieldAhead, IsScoredAndShownByTheExposuresThatWereDecoded) {
  const TempFolder folder;
  for (const std::string scan : {"interlaced", "progressive"}) {
    SCOPED_TRACE(scan);
    json scores[2];
    for (const int phase : {0, 1}) {
      const std::string name = scan + std::to_string(phase);
      const std::string take = (folder / name).string();
      json_of({"simulate", "--scene",
               "walk,width=320,height=240,stripes=40,scan=" + scan + ",phase=" + std::to_string(phase),
               "--frames", "6", "--out", take});
      scores[phase] = json_of({"evaluate", take, "--pictures", (folder / (name + "_pictures")).string()});
      EXPECT_EQ(scores[phase].value("frames", 0), 5 - phase);  // the first pair takes two frames then
      EXPECT_EQ(scores[phase].value("of", 0), 5 - phase);
    }
    EXPECT_GT(scores[1].value("completeness", 0.0), scores[0].value("completeness", 1.0) - 0.02);
    if (scan == "progressive") continue;  // its truth of that time is a mean, which outlines are not in
    EXPECT_LT(scores[1].value("rms_um_per_m", 1e9), 1.15 * scores[0].value("rms_um_per_m", 0.0));
    EXPECT_LT(scores[1].value("outliers", 1.0), scores[0].value("outliers", 1.0) + 0.003);
  }
  const auto picture = [&](const char* file) { return read_rgb(folder / file); };
  EXPECT_TRUE(
      same(picture("progressive1_pictures/000003-slide.png"), picture("progressive1/frames/000005.png")));
  EXPECT_TRUE(same(picture("progressive1_pictures/000003-complement.png"),
                   picture("progressive1/frames/000006.png")));
}

}  // namespace
}  // namespace relievo::test
