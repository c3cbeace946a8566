// SPDX-License-Identifier: Apache-2.0
// Frozen frames of version 1 (tests/conformance/frame_v1), which the viewer's decoder reads too: what was
// once written stays readable, and means the same.
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
const std::string kFolder = RELIEVO_VECTORS;

Bytes read_file(const std::string& name) {
  std::ifstream in(kFolder + "/" + name, std::ios::binary);
  return Bytes(std::istreambuf_iterator<char>(in), {});
}

json expected() {
  std::ifstream in(kFolder + "/expected.json");
  return json::parse(in);
}

double area_m2(const Surface& surface) {
  double area = 0;
  for (const Triangle& t : surface.triangles) {
    const Vec3f& a = surface.positions[t[0]];
    double u[3];
    double v[3];
    for (std::size_t k = 0; k < 3; ++k) {
      u[k] = surface.positions[t[1]][k] - a[k];
      v[k] = surface.positions[t[2]][k] - a[k];
    }
    area += 0.5 * std::hypot(u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]);
  }
  return area;
}

void expect_positions(const Surface& surface, const json& wanted) {
  for (std::size_t k = 0; k < 3; ++k) {
    double low = 1e9;
    double high = -1e9;
    double sum = 0;
    for (const Vec3f& p : surface.positions) {
      low = std::min<double>(low, p[k]);
      high = std::max<double>(high, p[k]);
      sum += p[k];
    }
    EXPECT_NEAR(low, wanted["min"][k].get<double>(), 1e-4);
    EXPECT_NEAR(high, wanted["max"][k].get<double>(), 1e-4);
    EXPECT_NEAR(sum / static_cast<double>(surface.positions.size()), wanted["mean"][k].get<double>(), 1e-4);
  }
  EXPECT_NEAR(area_m2(surface), wanted["area_m2"].get<double>(), 1e-4);
}

void expect_pixel(const Image8& texture, int x, int y, const json& wanted) {
  for (int c = 0; c < 3; ++c)
    EXPECT_NEAR(texture.row(y)[3 * x + c], wanted[static_cast<std::size_t>(c)].get<int>(), 4);
}

TEST(FrameVectors, AreReadAsTheyWereMeant) {
  const json vectors = expected();
  ASSERT_EQ(vectors["frames"].size(), 6u);
  for (const json& wanted : vectors["frames"]) {
    SCOPED_TRACE(wanted["file"].get<std::string>());
    const Bytes bytes = read_file(wanted["file"]);
    const auto header = read_frame_header(bytes);
    ASSERT_TRUE(header.ok()) << header.error().message;
    const auto frame = decode_frame(bytes);
    ASSERT_TRUE(frame.ok()) << frame.error().message;
    const Surface& surface = frame->surface;
    EXPECT_EQ(frame->number, wanted["number"]);
    EXPECT_EQ(std::to_string(frame->time_ns), wanted["time_ns"]);
    EXPECT_EQ(surface.positions.size(), wanted["vertices"]);
    EXPECT_EQ(surface.triangles.size(), wanted["triangles"]);
    EXPECT_EQ(header->volume.size_m, wanted["volume_size"]);
    EXPECT_EQ(!surface.normals.empty(), wanted["has_normals"]);
    EXPECT_EQ(!surface.texture_coordinates.empty(), wanted["has_texture_coordinates"]);
    EXPECT_EQ(frame->texture.width(), wanted["texture"][0]);
    EXPECT_EQ(frame->texture.height(), wanted["texture"][1]);
    if (!surface.positions.empty()) expect_positions(surface, wanted);
    for (std::size_t k = 0; k < 2 && !surface.texture_coordinates.empty(); ++k) {
      double sum = 0;
      for (const Vec2f& c : surface.texture_coordinates) sum += c[k];
      EXPECT_NEAR(sum / static_cast<double>(surface.positions.size()),
                  wanted["mean_texture_coordinate"][k].get<double>(), 1e-4);
    }
    EXPECT_EQ(!surface.sigmas_m.empty(), wanted.contains("quality"));
    if (wanted.contains("quality")) {
      double sum = 0;
      for (const float sigma : surface.sigmas_m) sum += sigma;
      EXPECT_NEAR(sum, wanted["quality"]["sum_sigma_m"].get<double>(), 1e-6);
      EXPECT_EQ(std::ranges::count_if(surface.sigmas_m, [](float s) { return s > 0; }),
                wanted["quality"]["known"].get<int>());
      EXPECT_EQ(std::ranges::count(surface.interpolated, 1), wanted["quality"]["interpolated"].get<int>());
    }
    if (frame->texture.empty()) continue;
    expect_pixel(frame->texture, 0, 0, wanted["first_pixel"]);
    expect_pixel(frame->texture, frame->texture.width() / 2, frame->texture.height() / 2,
                 wanted["middle_pixel"]);
  }
}

TEST(FrameVectors, OthersAreRefused) {
  const json vectors = expected();
  ASSERT_EQ(vectors["refused"].size(), 7u);
  for (const json& file : vectors["refused"]) {
    const Bytes bytes = read_file(file);
    EXPECT_GT(bytes.size(), 64u) << file;
    EXPECT_FALSE(decode_frame(bytes).ok()) << file;
  }
}

}  // namespace
}  // namespace relievo
