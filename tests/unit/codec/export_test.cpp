// SPDX-License-Identifier: Apache-2.0
#include "codec/export.h"

#include <gtest/gtest.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <csignal>
#include <cstring>
#include <fstream>
#include <iterator>
#include <limits>
#include <nlohmann/json.hpp>
#include <set>

#include "base/lens.h"
#include "codec/draco_mesh.h"
#include "codec/jpeg_texture.h"
#include "codec/surface_check.h"
#include "tests/support/make_surface.h"
#include "tests/support/temp_folder.h"

namespace relievo {
namespace {

std::string read_file(const std::filesystem::path& file) {
  std::ifstream in(file, std::ios::binary);
  return {std::istreambuf_iterator<char>(in), {}};
}
template <typename T>
T at(const std::string& bytes, std::size_t offset) {
  T value{};
  std::memcpy(&value, bytes.data() + offset, sizeof(T));
  return value;
}

Image8 two_colours() {  // left column black, right column (200, 100, 50)
  Image8 image(2, 1, 3);
  image.row(0)[3] = 200;
  image.row(0)[4] = 100;
  image.row(0)[5] = 50;
  return image;
}

TEST(Export, PlyHoldsTheSurface) {
  const test::TempFolder folder;
  Surface surface;
  surface.positions = {{0, 0, 1}, {0, 0.5f, 1}, {0.5f, 0, 1}};
  surface.texture_coordinates = {{0, 0.5f}, {0.5f, 0.5f}, {1, 0.5f}};
  surface.triangles = {{0, 1, 2}};
  const Image8 texture = two_colours();
  ASSERT_TRUE(write_ply(folder / "a.ply", surface, texture.view()).ok());
  const std::string bytes = read_file(folder / "a.ply");
  const std::size_t body = bytes.find("end_header\n") + 11;
  EXPECT_EQ(bytes.substr(0, 37), "ply\nformat binary_little_endian 1.0\nc");
  EXPECT_NE(bytes.find("element vertex 3\n"), std::string::npos);
  EXPECT_NE(bytes.find("element face 1\n"), std::string::npos);
  ASSERT_EQ(bytes.size(), body + 3 * 27 + 13);
  EXPECT_EQ(at<float>(bytes, body + 27 + 4), 0.5f);
  EXPECT_EQ(at<float>(bytes, body + 20), -1) << "nz: towards the camera";
  EXPECT_EQ(at<std::uint8_t>(bytes, body + 24), 0);
  EXPECT_EQ(at<std::uint8_t>(bytes, body + 27 + 24), 100) << "half way between the two pixels";
  EXPECT_EQ(at<std::uint8_t>(bytes, body + 2 * 27 + 25), 100);
  EXPECT_EQ(at<std::uint8_t>(bytes, body + 81), 3);
  EXPECT_EQ(at<std::int32_t>(bytes, body + 82), 0);
  EXPECT_EQ(at<std::int32_t>(bytes, body + 90), 2);
  EXPECT_EQ(std::distance(std::filesystem::directory_iterator(folder.path()), {}), 1) << "nothing else left";
}

TEST(Export, QualityOfVerticesIsKept) {
  const test::TempFolder folder;
  Frame3D frame;
  frame.surface.positions = {{0, 0, 1}, {0, 0.5f, 1}, {0.5f, 0, 1}};
  frame.surface.triangles = {{0, 1, 2}};
  frame.surface.sigmas_m = {0.001f, 0, 0.25f};
  frame.surface.interpolated = {0, 1, 0};
  ASSERT_TRUE(write_ply(folder / "a.ply", frame.surface, {}).ok());
  const std::string ply = read_file(folder / "a.ply");
  const std::size_t body = ply.find("end_header\n") + 11;
  EXPECT_NE(ply.find("property uchar blue\nproperty float sigma\nproperty uchar interpolated\nelement face"),
            std::string::npos);
  ASSERT_EQ(ply.size(), body + 3 * 32 + 13);
  EXPECT_EQ(at<float>(ply, body + 2 * 32 + 27), 0.25f);
  EXPECT_EQ(at<std::uint8_t>(ply, body + 32 + 31), 1);

  ASSERT_TRUE(write_glb(folder / "a.glb", frame).ok());
  const std::string glb = read_file(folder / "a.glb");
  const auto json = nlohmann::json::parse(glb.substr(20, at<std::uint32_t>(glb, 12)));
  const auto& attributes = json["meshes"][0]["primitives"][0]["attributes"];
  const std::size_t binary = 20 + at<std::uint32_t>(glb, 12) + 8;
  const auto value = [&](const char* name, std::size_t vertex) {
    const auto& accessor = json["accessors"][attributes[name].get<std::size_t>()];
    EXPECT_EQ(accessor["type"], "SCALAR");
    EXPECT_EQ(accessor["count"], 3);
    const auto& view = json["bufferViews"][accessor["bufferView"].get<std::size_t>()];
    return at<float>(glb, binary + view["byteOffset"].get<std::size_t>() + 4 * vertex);
  };
  EXPECT_EQ(value("_SIGMA", 0), 0.001f);
  EXPECT_EQ(value("_SIGMA", 2), 0.25f);
  EXPECT_EQ(value("_INTERPOLATED", 1), 1);

  frame.surface.sigmas_m = {0.001f, -1, 0.25f};
  EXPECT_FALSE(write_ply(folder / "b.ply", frame.surface, {}).ok());
  frame.surface.sigmas_m = {0.001f};
  EXPECT_FALSE(write_glb(folder / "b.glb", frame).ok());
}

TEST(Export, PlyWithoutTextureOrPoints) {
  const test::TempFolder folder;
  EXPECT_TRUE(write_ply(folder / "empty.ply", {}, {}).ok());
  EXPECT_NE(read_file(folder / "empty.ply").find("element vertex 0\n"), std::string::npos);
  EXPECT_TRUE(write_ply(folder / "grey.ply", test::wavy_grid(5, 5), {}).ok());
}

TEST(Export, GlbDescribesItsBytes) {
  const test::TempFolder folder;
  const Frame3D frame = test::frame(12, 9);
  ASSERT_TRUE(write_glb(folder / "a.glb", frame).ok());
  const std::string bytes = read_file(folder / "a.glb");
  EXPECT_EQ(bytes.substr(0, 4), "glTF");
  EXPECT_EQ(at<std::uint32_t>(bytes, 4), 2u);
  EXPECT_EQ(at<std::uint32_t>(bytes, 8), bytes.size());
  const auto json_size = at<std::uint32_t>(bytes, 12);
  ASSERT_EQ(json_size % 4, 0u);
  const auto root = nlohmann::json::parse(bytes.substr(20, json_size));
  const std::size_t binary = 20 + json_size + 8;
  ASSERT_EQ(binary + at<std::uint32_t>(bytes, 20 + json_size), bytes.size());
  EXPECT_EQ(root["scenes"][0]["extras"]["frame"], 42);
  const auto& primitive = root["meshes"][0]["primitives"][0];
  const auto& positions = root["accessors"][primitive["attributes"]["POSITION"].get<std::size_t>()];
  EXPECT_EQ(positions["count"], frame.surface.positions.size());
  const std::size_t view = positions["bufferView"];
  const std::size_t start = binary + root["bufferViews"][view]["byteOffset"].get<std::size_t>();
  EXPECT_EQ(at<float>(bytes, start), frame.surface.positions[0][0]);
  EXPECT_EQ(at<float>(bytes, start + 4), -frame.surface.positions[0][1]) << "y up";
  EXPECT_EQ(at<float>(bytes, start + 8), -frame.surface.positions[0][2]) << "z backward";
  const std::size_t image = root["images"][0]["bufferView"];
  const auto& image_view = root["bufferViews"][image];
  const auto* jpeg = reinterpret_cast<const std::uint8_t*>(bytes.data()) + binary +
                     image_view["byteOffset"].get<std::size_t>();
  EXPECT_TRUE(decode_jpeg({jpeg, image_view["byteLength"].get<std::size_t>()}, 64, 48).ok());
}

TEST(Export, GlbOfPointsAndOfNothing) {
  const test::TempFolder folder;
  Frame3D frame = test::frame(5, 5);
  frame.surface.triangles.clear();
  EXPECT_TRUE(write_glb(folder / "points.glb", frame).ok());
  EXPECT_TRUE(write_glb(folder / "nothing.glb", Frame3D()).ok());
  EXPECT_FALSE(write_glb(folder / "bad.glb", frame, {.jpeg_quality = 101}).ok());
}

nlohmann::json json_of(const std::string& glb) {
  return nlohmann::json::parse(glb.substr(20, at<std::uint32_t>(glb, 12)));
}

/// The surface of the only mesh of a GLB with KHR_draco_mesh_compression, which its accessors must describe.
Surface draco_surface(const std::string& glb) {
  const auto root = json_of(glb);
  const auto& primitive = root["meshes"][0]["primitives"][0];
  const auto& extension = primitive["extensions"]["KHR_draco_mesh_compression"];
  const auto& view = root["bufferViews"][extension["bufferView"].get<std::size_t>()];
  const auto accessor = [&](const nlohmann::json& index) {
    return root["accessors"][index.get<std::size_t>()];
  };
  const auto positions = accessor(primitive["attributes"]["POSITION"]);
  const std::size_t vertices = positions["count"];
  for (const auto& [name, index] : primitive["attributes"].items()) {
    EXPECT_EQ(accessor(index)["count"], vertices) << name;
    EXPECT_FALSE(accessor(index).contains("bufferView")) << name;
    EXPECT_TRUE(extension["attributes"].contains(name)) << name;
  }
  const std::size_t start = 28 + at<std::uint32_t>(glb, 12) + view["byteOffset"].get<std::size_t>();
  const auto* bytes = reinterpret_cast<const std::uint8_t*>(glb.data()) + start;
  auto surface = decode_draco({bytes, view["byteLength"].get<std::size_t>()}, vertices,
                              accessor(primitive["indices"])["count"].get<std::uint32_t>() / 3);
  EXPECT_TRUE(surface) << surface.error().message;
  if (!surface) return {};
  for (std::size_t i = 0; i < 3; ++i) {
    const auto less = [i](const Vec3f& a, const Vec3f& b) { return a[i] < b[i]; };
    const auto [low, high] = std::ranges::minmax_element(surface->positions, less);
    EXPECT_EQ(positions["min"][i], (*low)[i]);
    EXPECT_EQ(positions["max"][i], (*high)[i]);
  }
  return *std::move(surface);
}

std::string glb_of(const Frame3D& frame, const GlbOptions& options) {
  const auto bytes = encode_glb(frame, options);
  EXPECT_TRUE(bytes) << bytes.error().message;
  return bytes ? std::string(bytes->begin(), bytes->end()) : std::string();
}

TEST(Export, DracoGlbHoldsTheSurface) {
  Frame3D frame = test::frame(60, 45);
  Surface& surface = frame.surface;
  surface.positions.push_back({0, 0, 1});  // of no triangle
  surface.texture_coordinates.push_back({0, 0});
  surface.sigmas_m.assign(surface.positions.size(), 0.001f);
  const std::string glb = glb_of(frame, {.draco = true});
  const auto root = json_of(glb);
  EXPECT_EQ(root["extensionsRequired"], nlohmann::json({"KHR_draco_mesh_compression"}));
  EXPECT_EQ(root["extensionsUsed"].size(), 2U) << "and the unlit material";
  EXPECT_LT(glb.size(), glb_of(frame, {}).size() / 3);

  const Surface decoded = draco_surface(glb);
  EXPECT_EQ(decoded.triangles.size(), surface.triangles.size());
  EXPECT_EQ(decoded.normals.size(), decoded.positions.size());
  std::vector<std::uint8_t> used(surface.positions.size(), 0);
  for (const Triangle& corners : surface.triangles)
    for (const std::uint32_t corner : corners) used[corner] = 1;
  ASSERT_EQ(decoded.positions.size(), static_cast<std::size_t>(std::ranges::count(used, 1)));
  const auto normals = surface_normals(surface);
  for (std::size_t i = 0; i < decoded.positions.size(); ++i) {
    // Which vertex it was is told by its place in the picture.
    const Vec2f& uv = decoded.texture_coordinates[i];
    const auto column = std::lround(60 * uv[0] - 0.5f), row = std::lround(45 * uv[1] - 0.5f);
    const auto from = static_cast<std::size_t>(60 * row + column);
    ASSERT_EQ(used.at(from), 1);
    used[from] = 0;
    const Vec3f &p = surface.positions[from], &n = normals[from];
    const float half_step_m = 1.1f / 16'000;  // 1.1 m is its longest edge
    EXPECT_NEAR(decoded.positions[i][0], p[0], half_step_m);
    EXPECT_NEAR(decoded.positions[i][1], -p[1], half_step_m) << "y up";
    EXPECT_NEAR(decoded.positions[i][2], -p[2], half_step_m) << "z backward";
    const Vec3f& d = decoded.normals[i];
    EXPECT_GT(d[0] * n[0] - d[1] * n[1] - d[2] * n[2], 0.99996f);  // half a degree
  }
}

/// So that what stands still does, whatever else moves.
TEST(Export, DracoGlbHasPositionsOnTheSameGridInEachFrame) {
  Frame3D frame = test::frame(20, 15);
  for (const float moved_m : {0.0f, 0.0137f}) {
    for (std::size_t i = 0; i < 40; ++i) frame.surface.positions[i][0] -= moved_m;
    const Surface decoded = draco_surface(glb_of(frame, {.draco = true}));
    ASSERT_FALSE(decoded.positions.empty());
    for (const Vec3f& p : decoded.positions)
      for (const float x : p) {
        const double steps = x / 64e-6;  // 1.0 m of at most 16,381 steps
        EXPECT_NEAR(steps, std::round(steps), 0.01);
      }
  }
}

TEST(Export, DracoGlbOfOddSurfaces) {
  Frame3D frame = test::frame(5, 5);
  frame.surface.triangles = {{0, 0, 1}};
  EXPECT_FALSE(json_of(glb_of(frame, {.draco = true})).contains("extensionsRequired")) << "nothing left";
  frame.surface.triangles.clear();
  EXPECT_EQ(glb_of(frame, {.draco = true}), glb_of(frame, {})) << "Draco is of triangles alone";
  EXPECT_EQ(glb_of({}, {.draco = true}), glb_of({}, {}));

  frame.texture = {};
  frame.surface.triangles = {{0, 1, 2}};
  frame.surface.positions[0] = frame.surface.positions[1] = frame.surface.positions[2] = {3, 3, 3};
  const Surface at_one_place = draco_surface(glb_of(frame, {.draco = true}));
  ASSERT_EQ(at_one_place.positions.size(), 3U);
  EXPECT_NEAR(at_one_place.positions[0][0], 3, 1e-4);
  frame.surface.positions[0][0] = std::numeric_limits<float>::max();
  EXPECT_FALSE(encode_glb(frame, {.draco = true}));
}

TEST(Export, DracoAnimationHasAStreamAFrame) {
  GlbAnimation animation;
  Frame3D frame = test::frame(8, 6);
  for (int i = 0; i < 2; ++i, frame.time_ns += 100'000'000)
    ASSERT_TRUE(animation.add(frame, {.draco = true}).ok());
  const auto bytes = animation.finish();
  ASSERT_TRUE(bytes);
  const auto root = json_of({bytes->begin(), bytes->end()});
  EXPECT_EQ(root["extensionsUsed"].size(), 2U) << "each once";
  EXPECT_EQ(root["animations"][0]["channels"].size(), 2U);
  const auto stream = [&](int mesh) {
    return root["meshes"][mesh]["primitives"][0]["extensions"]["KHR_draco_mesh_compression"]["bufferView"];
  };
  EXPECT_NE(stream(0), stream(1));
}

/// Frames of one triangle each, the middle one empty, at 0, 0.1 and 0.25 s.
Result<Bytes> small_animation() {
  GlbAnimation animation;
  for (int i = 0; i < 3; ++i) {
    Frame3D frame;
    frame.number = 10 + static_cast<std::uint64_t>(i);
    frame.time_ns = 1'700'000'000'000'000'000 + (i == 0 ? 0 : i == 1 ? 100'000'000 : 250'000'000);
    const auto x = static_cast<float>(i);
    if (i != 1) {
      frame.surface.positions = {{x, 0, 1}, {x, 1, 1}, {x + 1, 0, 1}};
      frame.surface.triangles = {{0, 1, 2}};
    }
    if (auto status = animation.add(frame); !status) return status.error();
  }
  return animation.finish();
}

/// The viewer's tests play the same file with three.js's loader.
TEST(Export, AnimationIsTheFileThatOthersPlay) {
  const auto bytes = small_animation();
  ASSERT_TRUE(bytes) << bytes.error().message;
  const std::string made(bytes->begin(), bytes->end());
  const std::string frozen = read_file(RELIEVO_CONFORMANCE "/animation/small.glb");
  auto root = json_of(made), expected = json_of(frozen);
  root["asset"].erase("generator");
  expected["asset"].erase("generator");
  EXPECT_EQ(root, expected);
  const auto binary = [](const std::string& glb) { return glb.substr(28 + at<std::uint32_t>(glb, 12)); };
  EXPECT_EQ(binary(made), binary(frozen));
  EXPECT_EQ(root["nodes"].size(), 2U) << "nothing of an empty surface";
}

TEST(Export, AnimationOfOneFrameIsAStill) {
  GlbAnimation animation;
  ASSERT_TRUE(animation.add(test::frame(8, 6)).ok());
  const auto bytes = animation.finish();
  ASSERT_TRUE(bytes);
  EXPECT_FALSE(json_of({bytes->begin(), bytes->end()}).contains("animations"));
}

TEST(Export, AnimationRefusesTimesThatDoNotRise) {
  GlbAnimation animation;
  Frame3D frame = test::frame(8, 6);
  ASSERT_TRUE(animation.add(frame).ok());
  EXPECT_FALSE(animation.add(frame).ok());
  frame.time_ns += 1'000'000;
  EXPECT_TRUE(animation.add(frame).ok());
}

TEST(Export, StraightenedPictureIsWhatThePinholeSees) {
  PinholeModel camera{64, 48, {60, 0, 31, 0, 62, 23, 0, 0, 1}, {-0.2, 0.05, 0.001, -0.002, 0}};
  Image8 picture(64, 48, 3);  // red: the column, green: the row
  for (int row = 0; row < 48; ++row)
    for (int column = 0; column < 64; ++column) {
      picture.row(row)[3 * column] = static_cast<std::uint8_t>(3 * column);
      picture.row(row)[3 * column + 1] = static_cast<std::uint8_t>(5 * row);
    }
  EXPECT_EQ(std::memcmp(straightened(picture.view(), pinhole_of(camera)).data(), picture.data(), 64 * 48 * 3),
            0);
  const Image8 straight = straightened(picture.view(), camera);
  int seen = 0;
  for (int row = 0; row < 48; ++row)
    for (int column = 0; column < 64; ++column) {
      const auto from = distort(camera, (column - 31) / 60.0, (row - 23) / 62.0);
      if (from[0] < 0 || from[0] > 63 || from[1] < 0 || from[1] > 47) continue;
      ASSERT_NEAR(straight.row(row)[3 * column], 3 * from[0], 0.51);
      ASSERT_NEAR(straight.row(row)[3 * column + 1], 5 * from[1], 0.51);
      ++seen;
    }
  EXPECT_GT(seen, 2000);
}

TEST(Export, DepthRefusesAUnitThatIsNone) {
  const test::TempFolder folder;
  const PinholeModel camera{64, 48, {60, 0, 31, 0, 62, 23, 0, 0, 1}, {}};
  EXPECT_FALSE(write_depth_png(folder / "a.png", test::frame(8, 6).surface, camera, 0).ok());
  EXPECT_FALSE(std::filesystem::exists(folder / "a.png"));
}

TEST(Export, ObjNamesItsMaterialAndPicture) {
  const test::TempFolder folder;
  ASSERT_TRUE(write_obj(folder / "a.obj", test::frame(4, 3)).ok());
  const std::string text = read_file(folder / "a.obj");
  EXPECT_NE(text.find("mtllib a.mtl\nusemtl texture\n"), std::string::npos);
  EXPECT_NE(text.find("\nf 1/1/1 5/5/5 2/2/2\n"), std::string::npos);
  EXPECT_NE(read_file(folder / "a.mtl").find("map_Kd a.png"), std::string::npos);
  EXPECT_EQ(read_file(folder / "a.png").substr(1, 3), "PNG");
}

TEST(Export, BadSurfacesAreRefused) {
  const test::TempFolder folder;
  Frame3D frame = test::frame(4, 4);
  frame.surface.triangles.push_back({0, 1, 99});
  EXPECT_FALSE(write_ply(folder / "a.ply", frame.surface, {}).ok());
  EXPECT_FALSE(write_glb(folder / "a.glb", frame).ok());
  EXPECT_FALSE(write_obj(folder / "a.obj", frame).ok());
  EXPECT_FALSE(write_png(folder / "a.png", {}).ok());
  EXPECT_TRUE(std::filesystem::is_empty(folder.path()));
}

TEST(Export, AFileThatCannotBeWrittenLeavesNothingAndKeepsTheOldOne) {
  const test::TempFolder folder;
  ASSERT_TRUE(write_ply(folder / "a.ply", test::wavy_grid(2, 2), {}).ok());
  const std::string old = read_file(folder / "a.ply");
  const auto status = write_ply(folder / "none/a.ply", {}, {});
  ASSERT_FALSE(status.ok());
  EXPECT_NE(status.error().message.find("no such folder"), std::string::npos);
  const pid_t child = fork();
  if (child == 0) {
    std::signal(SIGXFSZ, SIG_IGN);
    const rlimit size{5000, 5000};
    setrlimit(RLIMIT_FSIZE, &size);
    _exit(write_ply(folder / "a.ply", test::wavy_grid(40, 40), {}).ok() ? 1 : 0);
  }
  int exit_status = 0;
  ASSERT_EQ(waitpid(child, &exit_status, 0), child);
  EXPECT_EQ(WEXITSTATUS(exit_status), 0);
  EXPECT_EQ(read_file(folder / "a.ply"), old);
  EXPECT_EQ(std::distance(std::filesystem::directory_iterator(folder.path()), {}), 1);
}

TEST(SurfaceNormals, AreUnitAndTowardsTheCamera) {
  const Surface surface = test::wavy_grid(30, 30, 0, false);
  const auto normals = surface_normals(surface);
  ASSERT_EQ(normals.size(), surface.positions.size());
  for (std::size_t i = 0; i < normals.size(); ++i) {
    const Vec3f& n = normals[i];
    const Vec3f& p = surface.positions[i];
    ASSERT_NEAR(std::hypot(n[0], n[1], n[2]), 1, 1e-5);
    ASSERT_LT(n[0] * p[0] + n[1] * p[1] + n[2] * p[2], 0);
  }
  EXPECT_EQ(surface_normals(Surface{.positions = {{0, 0, 2}},
                                    .normals = {},
                                    .texture_coordinates = {},
                                    .grid = {},
                                    .triangles = {}})[0],
            (Vec3f{0, 0, -1}))
      << "a loose point looks to the camera";
}

}  // namespace
}  // namespace relievo
