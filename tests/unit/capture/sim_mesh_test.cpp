// SPDX-License-Identifier: Apache-2.0
// Meshes as scenes: both formats, and files that are none.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstring>

#include "capture/source/sim/mesh_file.h"
#include "capture/source/sim/sim_source.h"
#include "small_take.h"

namespace relievo {
namespace {

using testing::HasSubstr;

constexpr char kHeader[] =
    "element vertex 4\nproperty float x\nproperty float y\nproperty float z\nproperty uchar red\nproperty "
    "uchar "
    "green\nproperty uchar blue\nelement face 1\nproperty list uchar int vertex_indices\nend_header\n";

std::string ascii_quad() {
  return std::string("ply\nformat ascii 1.0\n") + kHeader +
         "-3 -3 0 255 0 0\n3 -3 0 255 0 0\n3 3 0 0 255 0\n-3 3 0 0 255 0\n4 0 1 2 3\n";
}

std::string binary_quad() {
  std::string out = std::string("ply\nformat binary_little_endian 1.0\n") + kHeader;
  const float xy[4][2] = {{-3, -3}, {3, -3}, {3, 3}, {-3, 3}};
  for (int i = 0; i < 4; ++i) {
    const float p[3] = {xy[i][0], xy[i][1], 0};
    out.append(reinterpret_cast<const char*>(p), sizeof p);
    out.append(i < 2 ? std::string("\xff\0\0", 3) : std::string("\0\xff\0", 3));
  }
  const std::int32_t corners[4] = {0, 1, 2, 3};
  out += '\4';
  return out.append(reinterpret_cast<const char*>(corners), sizeof corners);
}

TEST(MeshFile, AsciiAndBinaryPlyReadAlike) {
  test::TempFolder folder;
  for (const std::string& content : {ascii_quad(), binary_quad()}) {
    test::write_text(folder.path() / "quad.ply", content);
    const auto mesh = sim::read_mesh(folder.path() / "quad.ply");
    ASSERT_TRUE(mesh) << mesh.error().message;
    ASSERT_EQ(mesh->positions.size(), 4u);
    ASSERT_EQ(mesh->triangles.size(), 2u);  // the polygon as a fan
    EXPECT_EQ(mesh->triangles[1], (std::array<std::uint32_t, 3>{0, 2, 3}));
    EXPECT_EQ(mesh->positions[2].x, 3);
    EXPECT_EQ(mesh->colours[0].x, 1);
    EXPECT_EQ(mesh->colours[3].y, 1);
  }
}

/// A mesh of others may name any file; reading this one would never end.
TEST(MeshFile, AMaterialThatIsNoFileIsNone) {
  test::TempFolder folder;
  test::write_text(folder.path() / "m.obj",
                   "mtllib /dev/zero\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nf 1/1 2/1 3/1\n");
  const auto mesh = sim::read_mesh(folder.path() / "m.obj");
  ASSERT_TRUE(mesh) << mesh.error().message;
  EXPECT_TRUE(mesh->texture.empty());
}

TEST(MeshFile, ObjWithATexture) {
  test::TempFolder folder;
  Image8 texture(2, 2, 3);
  texture.data()[0] = 200;
  ASSERT_TRUE(write_picture(folder.path() / "t.png", texture));
  test::write_text(folder.path() / "m.mtl", "newmtl a\nmap_Kd t.png\n");
  test::write_text(folder.path() / "m.obj",
                   "mtllib m.mtl\nv 0 0 0\nv 1 0 0\nv 1 1 0\nvt 0 0\nvt 1 0\nvt 1 1\nf 1/1 2/2 -1/-1\n");
  const auto mesh = sim::read_mesh(folder.path() / "m.obj");
  ASSERT_TRUE(mesh) << mesh.error().message;
  EXPECT_EQ(mesh->triangles[0], (std::array<std::uint32_t, 3>{0, 1, 2}));
  EXPECT_EQ(mesh->corner_texture[2], (std::array<float, 2>{1, 1}));
  EXPECT_EQ(mesh->texture.data()[0], 200);
}

TEST(MeshFile, RefusesWhatIsNone) {
  test::TempFolder folder;
  const std::string good = binary_quad();
  const auto changed = [](std::string text, const std::string& from, const std::string& to) {
    return text.replace(text.find(from), from.size(), to);
  };
  const std::pair<std::string, const char*> files[] = {
      {"", "is no PLY file"},
      {"ply\n", "is no PLY file"},
      {good.substr(0, good.size() - 3), "is cut short"},
      {changed(good, "element vertex 4", "element vertex 4000000"), "is cut short"},
      {changed(good, "element vertex 4", "element vertex 99999999999"), "without a sane count"},
      {changed(good, "float x", "quad x"), "unknown type quad"},
      {changed(ascii_quad(), "4 0 1 2 3", "4 0 1 2 9"), "impossible vertex"},
      {changed(ascii_quad(), "4 0 1 2 3", "2 0 1"), "has no triangle"},
      {changed(ascii_quad(), "4 0 1 2 3", "4 1 1 1 1"), "no triangle with an area"},
      {changed(ascii_quad(), "3 3 0 0 255 0\n-3 3", "9 -3 0 0 255 0\n30 -3"), "no triangle with an area"},
      {changed(ascii_quad(), "-3 -3 0 255", "-3 nan 0 255"), "no number"},
      {changed(ascii_quad(), "-3 -3 0 255", "-3 x 0 255"), "no number"},
  };
  for (const auto& [content, message] : files) {
    test::write_text(folder.path() / "bad.ply", content);
    const auto mesh = sim::read_mesh(folder.path() / "bad.ply");
    ASSERT_FALSE(mesh) << message;
    EXPECT_THAT(mesh.error().message, HasSubstr(message));
  }
  test::write_text(folder.path() / "bad.obj", "v 0 0 0\nf 1 2 3\n");
  EXPECT_THAT(sim::read_mesh(folder.path() / "bad.obj").error().message, HasSubstr("impossible index"));
}

TEST(MeshScene, AFlatMeshIsSeenAtItsDepthInItsColours) {
  test::TempFolder folder;
  test::write_text(folder.path() / "quad.ply", ascii_quad());
  auto source =
      make_sim("mesh:" + (folder.path() / "quad.ply").string() +
                   ",frames=1,width=160,height=120,stripes=30,scan=progressive,crosstalk=0,noise=0,chroma=0",
               {.truth = true});
  ASSERT_TRUE(source) << source.error().message;
  auto frame = (*source)->next();
  ASSERT_TRUE(frame && *frame);
  const ImageF& truth = (*source)->truth();
  EXPECT_NEAR(static_cast<double>(truth.row(60)[80]), 1.0, 1e-6);  // the quad, before the wall at 1.3 m
  EXPECT_NEAR(static_cast<double>(truth.row(5)[5]), 1.3, 1e-6);
  const auto white = [&](int y, int x, int c) {
    return (*frame)->picture.row(y)[3 * x + c] + (*frame)->complement.row(y)[3 * x + c];
  };
  // y up in the file: its green upper half is above, where the blend passes the middle.
  EXPECT_GT(white(45, 80, 1), white(45, 80, 0));
  EXPECT_LT(white(75, 80, 1), white(75, 80, 0));
  EXPECT_LT(white(60, 80, 2), 25);
}

TEST(MeshScene, AFileMayHaveCommasInItsName) {
  test::TempFolder folder;
  for (const char* name : {"a,b.ply", "a.b,period=3,.PLY"}) {
    const std::string file = (folder.path() / name).string();
    test::write_text(file, ascii_quad());
    for (const char* keys : {"", ",frames=1,width=96,height=64,stripes=20"}) {
      const auto source = make_sim("mesh:" + file + keys, {});
      EXPECT_TRUE(source) << (source ? "" : source.error().message);
    }
    EXPECT_THAT(make_sim("mesh:" + file + ",frame=1", {}).error().message,
                HasSubstr("unknown key \"frame\""));
  }
  EXPECT_THAT(make_sim("mesh:none,frames=1", {}).error().message, HasSubstr("none is no mesh"));
}

}  // namespace
}  // namespace relievo
