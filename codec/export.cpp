// SPDX-License-Identifier: Apache-2.0
#include "codec/export.h"

#include <array>
#include <charconv>
#include <string>

#include "base/whole_file.h"
#include "codec/byte_io.h"
#include "codec/surface_check.h"
#include "codec/texture_colour.h"
#include "codec/texture_png.h"

namespace relievo {
namespace {

void append_text(Bytes& out, std::string_view text) {
  out.insert(out.end(), text.begin(), text.end());
}

/// Shortest text that reads back as the same float.
void append_numbers(Bytes& out, std::string_view keyword, std::span<const float> numbers) {
  append_text(out, keyword);
  for (const float number : numbers) {
    std::array<char, 32> text{};
    const auto end = std::to_chars(text.data(), text.data() + text.size(), number).ptr;
    out.push_back(' ');
    append_text(out, {text.data(), end});
  }
  out.push_back('\n');
}

}  // namespace

Status write_ply(const std::filesystem::path& path, const Surface& surface, View8 texture) {
  if (auto status = check_surface(surface); !status) return status;
  const std::vector<Vec3f> derived =
      surface.normals.empty() ? surface_normals(surface) : std::vector<Vec3f>();
  const std::vector<Vec3f>& normals = surface.normals.empty() ? derived : surface.normals;
  Bytes out;
  const bool has_sigma = !surface.sigmas_m.empty();
  const bool has_marks = !surface.interpolated.empty();
  out.reserve(512 + surface.positions.size() * 32 + surface.triangles.size() * 13);
  append_text(out,
              "ply\nformat binary_little_endian 1.0\n"
              "comment relievo " RELIEVO_VERSION
              ": metres, camera frame: x right, y down, z forward\n"
              "element vertex " +
                  std::to_string(surface.positions.size()) +
                  "\nproperty float x\nproperty float y\nproperty float z\n"
                  "property float nx\nproperty float ny\nproperty float nz\n"
                  "property uchar red\nproperty uchar green\nproperty uchar blue\n" +
                  (has_sigma ? "property float sigma\n" : "") +
                  (has_marks ? "property uchar interpolated\n" : "") + "element face " +
                  std::to_string(surface.triangles.size()) +
                  "\nproperty list uchar int vertex_indices\nend_header\n");
  for (std::size_t i = 0; i < surface.positions.size(); ++i) {
    for (const float x : surface.positions[i]) append(out, x);
    for (const float x : normals[i]) append(out, x);
    append_bytes(out, vertex_colour(surface, texture, i));
    if (has_sigma) append(out, surface.sigmas_m[i]);
    if (has_marks) append(out, surface.interpolated[i]);
  }
  for (const Triangle& triangle : surface.triangles) {
    append(out, std::uint8_t{3});
    for (const std::uint32_t index : triangle) append(out, static_cast<std::int32_t>(index));
  }
  return write_whole_file(path, out);
}

Status write_obj(const std::filesystem::path& path, const Frame3D& frame) {
  const Surface& surface = frame.surface;
  if (auto status = check_surface(surface); !status) return status;
  const bool textured = !frame.texture.empty() && !surface.texture_coordinates.empty();
  const std::string name = path.stem().string();
  Bytes out;
  append_text(out, "# relievo " RELIEVO_VERSION ": metres, x right, y up, z backward\n");
  if (textured) {
    std::filesystem::path picture = path;
    if (auto status = write_png(picture.replace_extension(".png"), frame.texture.view()); !status)
      return status;
    const std::string material =
        "newmtl texture\nKa 0 0 0\nKd 1 1 1\nKs 0 0 0\nillum 0\nmap_Kd " + name + ".png\n";
    std::filesystem::path library = path;
    if (auto status = write_whole_file(library.replace_extension(".mtl"), material); !status) return status;
    append_text(out, "mtllib " + name + ".mtl\nusemtl texture\n");
  }
  const auto turned = [](const Vec3f& v) { return Vec3f{v[0], -v[1], -v[2]}; };
  for (const Vec3f& p : surface.positions) append_numbers(out, "v", turned(p));
  if (textured)
    for (const Vec2f& c : surface.texture_coordinates) append_numbers(out, "vt", Vec2f{c[0], 1 - c[1]});
  for (const Vec3f& n : surface.normals.empty() ? surface_normals(surface) : surface.normals)
    append_numbers(out, "vn", turned(n));
  for (const Triangle& triangle : surface.triangles) {
    append_text(out, "f");
    for (const std::uint32_t index : triangle) {
      const std::string i = std::to_string(index + 1);
      append_text(out, " " + i + "/" + (textured ? i : "") + "/" + i);
    }
    out.push_back('\n');
  }
  return write_whole_file(path, out);
}

Status write_png(const std::filesystem::path& path, View8 picture) {
  Bytes out;
  if (auto status = append_png(picture, PngEffort::kSmall, out); !status)
    return status.error().in("cannot write " + path.string());
  return write_whole_file(path, out);
}

}  // namespace relievo
