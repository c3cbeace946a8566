// SPDX-License-Identifier: Apache-2.0
// Frozen frames of geometry codecs 2 and 3 (tests/conformance/grid_v1, draco_grid_v1), which the viewer's
// decoder reads too: what was once written stays readable, and means the same.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <fstream>
#include <iterator>
#include <nlohmann/json.hpp>

#include "codec/frame3d_codec.h"

namespace relievo {
namespace {

using nlohmann::json;
struct Folder {
  std::string name;
  std::size_t sequences, refused;

  Bytes read(const std::string& file) const {
    std::ifstream in(std::string(RELIEVO_CONFORMANCE) + "/" + name + "/" + file, std::ios::binary);
    return Bytes(std::istreambuf_iterator<char>(in), {});
  }
  json expected() const { return json::parse(read("expected.json")); }
};

class GridVectors : public testing::TestWithParam<Folder> {};
INSTANTIATE_TEST_SUITE_P(Codecs, GridVectors,
                         testing::Values(Folder{"grid_v1", 10, 16}, Folder{"draco_grid_v1", 8, 16}),
                         [](const auto& test) { return test.param.name; });

std::uint32_t add(std::uint32_t hash, std::uint32_t value) {
  return (hash ^ value) * 16777619U;
}

TEST_P(GridVectors, AreReadAsTheyWereMeant) {
  const json vectors = GetParam().expected();
  ASSERT_EQ(vectors["sequences"].size(), GetParam().sequences);
  for (const json& sequence : vectors["sequences"]) {
    FrameDecoder decoder;
    for (const json& wanted : sequence) {
      SCOPED_TRACE(wanted["file"].get<std::string>());
      const Bytes bytes = GetParam().read(wanted["file"]);
      EXPECT_EQ(is_key_frame(bytes), wanted["key"].get<bool>());
      const auto frame = decoder.decode(bytes);
      ASSERT_TRUE(frame) << frame.error().message;
      const Surface& surface = frame->surface;
      EXPECT_EQ(frame->number, wanted["number"]);
      ASSERT_EQ(surface.positions.size(), wanted["vertices"]);
      EXPECT_EQ(surface.triangles.size(), wanted["triangles"]);
      std::uint32_t triangles = 2166136261U;
      for (const Triangle& t : surface.triangles)
        for (const std::uint32_t i : t) triangles = add(triangles, i);
      EXPECT_EQ(triangles, wanted["triangle_hash"]);
      std::uint32_t places = 2166136261U;
      for (const GridPoint& g : surface.grid)
        places = add(add(add(places, g.line), g.boundary),
                     static_cast<std::uint32_t>(static_cast<std::int32_t>(std::lround(g.column_px * 256))));
      EXPECT_EQ(places, wanted["place_hash"]);
      for (std::size_t k = 0; k < 3; ++k) {
        double low = 1e9, high = -1e9, sum = 0;
        for (const Vec3f& p : surface.positions) {
          low = std::min<double>(low, p[k]);
          high = std::max<double>(high, p[k]);
          sum += p[k];
        }
        EXPECT_NEAR(low, wanted["min"][k].get<double>(), 1e-4);
        EXPECT_NEAR(high, wanted["max"][k].get<double>(), 1e-4);
        EXPECT_NEAR(sum / static_cast<double>(surface.positions.size()), wanted["mean"][k].get<double>(),
                    1e-5);
      }
      for (std::size_t k = 0; k < 2; ++k) {
        double sum = 0;
        for (const Vec2f& c : surface.texture_coordinates) sum += c[k];
        EXPECT_NEAR(sum / static_cast<double>(surface.positions.size()),
                    wanted["mean_texture_coordinate"][k].get<double>(), 1e-5);
      }
      EXPECT_EQ(!surface.sigmas_m.empty(), wanted.contains("quality"));
      if (!wanted.contains("quality")) continue;
      double sum = 0;
      for (const float sigma : surface.sigmas_m) sum += sigma;
      EXPECT_NEAR(sum, wanted["quality"]["sum_sigma_m"].get<double>(), 1e-6);
      EXPECT_EQ(std::ranges::count_if(surface.sigmas_m, [](float s) { return s > 0; }),
                wanted["quality"]["known"].get<int>());
      EXPECT_EQ(std::ranges::count(surface.interpolated, 1), wanted["quality"]["interpolated"].get<int>());
    }
  }
}

TEST_P(GridVectors, OthersAreRefused) {
  const json vectors = GetParam().expected();
  ASSERT_EQ(vectors["refused"].size(), GetParam().refused);
  for (const json& file : vectors["refused"]) {
    const Bytes bytes = GetParam().read(file);
    EXPECT_GT(bytes.size(), 64U) << file;
    EXPECT_FALSE(decode_frame(bytes).ok()) << file;
  }
}

}  // namespace
}  // namespace relievo
