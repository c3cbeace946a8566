// SPDX-License-Identifier: Apache-2.0
// Surfaces and clouds that others made: the first byte says which file of a sound textured mesh, or which
// other file, the rest is.
#include "capture/source/sim/mesh_file.h"

#include <array>
#include <cmath>
#include <fstream>

#include "capture/calibrate/point_cloud.h"
#include "capture/source/take_files.h"
#include "fuzz/fuzz.h"
#include "fuzz/memory_file.h"
#include "tests/support/temp_folder.h"

namespace relievo {
namespace {

constexpr std::array kFiles{"mesh.obj", "mesh.mtl", "texture.png", "mesh.ply", "cloud.ply"};
constexpr std::size_t kMostGrowth = 64;  // vertices and corners of a byte; more were never in the file

void write(const std::filesystem::path& file, std::span<const std::uint8_t> bytes) {
  std::ofstream(file, std::ios::binary)
      .write(reinterpret_cast<const char*>(bytes.data()), static_cast<std::streamsize>(bytes.size()));
}

class Folder {
 public:
  Folder() {
    std::ofstream(folder_ / "mesh.obj")
        << "mtllib mesh.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nf 1/1 2/1 3/1\n";
    std::ofstream(folder_ / "mesh.mtl") << "newmtl a\nmap_Kd texture.png\n";
    FUZZ_CHECK(write_picture(folder_ / "texture.png", Image8(4, 4, 3)).ok());
  }
  void try_file(const std::string& name, std::span<const std::uint8_t> bytes) const {
    const std::filesystem::path file = folder_ / name, sound = folder_ / "sound";
    std::error_code none;
    std::filesystem::rename(file, sound, none);
    write(file, bytes);
    if (name == "cloud.ply")
      read_cloud(file, bytes.size());
    else
      read_mesh(name == "mesh.ply" ? file : folder_ / "mesh.obj", bytes.size());
    std::filesystem::rename(sound, file, none);
  }

 private:
  static void read_mesh(const std::filesystem::path& file, std::size_t bytes) {
    const auto mesh = sim::read_mesh(file);
    if (!mesh) return;
    const std::size_t count = mesh->positions.size();
    FUZZ_CHECK(!mesh->triangles.empty() && count <= bytes * kMostGrowth + 3);
    for (const auto& triangle : mesh->triangles)
      for (const std::uint32_t vertex : triangle) FUZZ_CHECK(vertex < count);
    FUZZ_CHECK(mesh->colours.empty() || mesh->colours.size() == count);
    FUZZ_CHECK(mesh->corner_texture.empty() || mesh->corner_texture.size() == 3 * mesh->triangles.size());
    FUZZ_CHECK(mesh->corner_texture.empty() || !mesh->texture.empty());
  }
  static void read_cloud(const std::filesystem::path& file, std::size_t bytes) {
    const auto cloud = read_ply_points(file);
    if (!cloud) return;
    FUZZ_CHECK(cloud->positions.size() <= bytes);
    FUZZ_CHECK(cloud->colours.empty() || cloud->colours.size() == cloud->positions.size());
    const auto nearest = nearest_distances({{0, 0, 0}}, cloud->positions);
    FUZZ_CHECK(nearest.size() == 1 && !std::isnan(nearest[0]));
  }

  const test::TempFolder folder_;
};

}  // namespace
}  // namespace relievo

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  static const int in_memory = ::setenv("TMPDIR", relievo::fuzz::folder_in_memory().c_str(), 0);
  static const relievo::Folder folder;
  FUZZ_CHECK(in_memory == 0);
  if (size == 0 || data[0] >= relievo::kFiles.size()) return 0;
  folder.try_file(relievo::kFiles[data[0]], {data + 1, size - 1});
  return 0;
}
