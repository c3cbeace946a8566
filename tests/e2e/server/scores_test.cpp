// SPDX-License-Identifier: Apache-2.0
// Reconstructions of takes that nobody of this project rendered, scored by a program that shares no code with
// ours: it proves the decoder, the PLY files and `evaluate` at once.
#include <gtest/gtest.h>

#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>
#include <string_view>

#include "tests/support/process.h"
#include "tests/support/temp_folder.h"

namespace relievo::test {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;

constexpr const char* kPython = "/usr/bin/python3";

fs::path shared() {
  const char* set = std::getenv("RELIEVO_SHARED");
  return set != nullptr ? fs::path(set) : fs::path(RELIEVO_SOURCE_DIR) / ".." / "shared";
}

json run_json(const std::vector<std::string>& command) {
  const Finished done = run(command, kLongPatience);
  EXPECT_EQ(done.status, 0) << done.err;
  const json parsed = json::parse(done.out, nullptr, false);
  EXPECT_FALSE(parsed.is_discarded()) << done.out;
  return parsed.is_discarded() ? json::object() : parsed;
}

class Scores : public ::testing::TestWithParam<const char*> {
 protected:
  void SetUp() override {
    if (!fs::exists(shared() / "takes"))
      GTEST_SKIP() << "no takes at " << shared() / "takes"
                   << ": set RELIEVO_SHARED";
    if (run({kPython, "-c", "import numpy, cv2"}).status != 0)
      GTEST_SKIP() << "the scoring scripts need apt-get install python3-numpy python3-opencv";
  }

  /// None where the command's own choice is tested.
  std::vector<std::string> with_decoder(std::vector<std::string> command) const {
    if (*GetParam() != 0) {
      command.push_back("--decoder");
      command.push_back(GetParam());
    }
    return command;
  }

  json reconstruct(const fs::path& take) const {
    return run_json(with_decoder({program("relievo-server").string(), "reconstruct", take.string(), "--out",
                                  out_.path().string(), "--json"}));
  }
  bool as_published() const { return std::string_view(GetParam()) == "paper"; }
  std::size_t files() const {
    std::size_t n = 0;
    for ([[maybe_unused]] const auto& entry : fs::directory_iterator(out_.path())) ++n;
    return n;
  }

  const TempFolder out_;
};

TEST_P(Scores, BunnyAsWellAsThePapersDecoder) {
  const fs::path take = shared() / "takes" / "bunny";
  const json summary = reconstruct(take);
  // Every frame after the first gives one, also the one after the drop, whose slide repeats.
  EXPECT_EQ(summary.value("frames", 0), 12);
  EXPECT_EQ(summary.value("reconstructed", 0), 11);
  EXPECT_EQ(summary.value("same_slide", 0), 1);
  EXPECT_EQ(summary.value("most_excess", 1.0), 0) << "its exposures are of one brightness";
  EXPECT_EQ(files(), 11U);

  const json score = run_json({kPython, (shared() / "tools" / "score.py").string(), take.string(),
                               out_.path().string(), "--skip", "1"});
  EXPECT_EQ(score.value("frames", 0), score.value("of", 1));
  EXPECT_GE(score.value("completeness", 0.0), 0.98);
  EXPECT_LE(score.value("outliers", 1.0), 0.0025);
  EXPECT_LE(score.value("median_um_per_m", 1e9), 115);
  EXPECT_LE(score.value("rms_um_per_m", 1e9), 560);
  if (as_published()) {  // as another program of the paper's text has it
    EXPECT_NEAR(score.value("completeness", 0.0), 0.983, 0.003);
    EXPECT_NEAR(score.value("median_um_per_m", 0.0), 108, 5);
    EXPECT_NEAR(score.value("rms_um_per_m", 0.0), 550, 60);
  }

  // `evaluate` says the same, to the digits the script prints.
  const json own =
      run_json(with_decoder({program("relievo-server").string(), "evaluate", take.string(), "--json"}));
  EXPECT_EQ(own.value("frames", 0), score.value("frames", 1));
  EXPECT_EQ(own.value("of", 0), score.value("of", 1));
  EXPECT_NEAR(own.value("vertices_per_frame", 0.0), score.value("vertices_per_frame", -9.0), 0.51);
  EXPECT_NEAR(own.value("completeness", 0.0), score.value("completeness", 9.0), 1e-4);
  EXPECT_NEAR(own.value("outliers", 0.0), score.value("outliers", 9.0), 1e-5);
  EXPECT_NEAR(own.value("median_um_per_m", 0.0), score.value("median_um_per_m", 1e9), 0.1);
  EXPECT_NEAR(own.value("rms_um_per_m", 0.0), score.value("rms_um_per_m", 1e9), 0.1);
  EXPECT_NEAR(own.value("p95_um_per_m", 0.0), score.value("p95_um_per_m", 1e9), 0.1);
  std::printf("%s: %s\n", *GetParam() != 0 ? GetParam() : "default", score.dump().c_str());
}

TEST_P(Scores, ShellAsWellAsThePapersDecoder) {
  const fs::path take = shared() / "takes" / "shell";
  reconstruct(take);
  const json score = run_json(
      {kPython, (shared() / "tools" / "score_columns.py").string(), take.string(), out_.path().string()});
  EXPECT_EQ(score.value("frames", 0), static_cast<int>(files()));
  EXPECT_GE(score.value("completeness", 0.0), 0.88);
  EXPECT_LE(score.value("outliers", 1.0), 0.0045);
  EXPECT_LE(score.value("median_column_px", 9.0), 0.2);
  if (as_published()) {
    EXPECT_NEAR(score.value("completeness", 0.0), 0.893, 0.005);
    EXPECT_NEAR(score.value("outliers", 0.0), 0.0042, 0.0008);
    EXPECT_NEAR(score.value("median_column_px", 0.0), 0.18, 0.01);
  }
  std::printf("%s: %s\n", *GetParam() != 0 ? GetParam() : "default", score.dump().c_str());
}

INSTANTIATE_TEST_SUITE_P(Decoders, Scores, ::testing::Values("", "quick", "paper"),
                         [](const auto& p) { return *p.param == 0 ? "chosen" : p.param; });

}  // namespace
}  // namespace relievo::test
