// SPDX-License-Identifier: Apache-2.0
#include "capture/source/sim/mesh_file.h"

#include <algorithm>
#include <bit>
#include <charconv>
#include <cmath>
#include <cstring>
#include <fstream>
#include <iterator>
#include <optional>
#include <sstream>

#include "base/whole_file.h"
#include "capture/picture_file.h"

namespace relievo::sim {
namespace {

constexpr std::size_t kMost = 100'000'000;  // vertices or triangles: more is a damaged count
constexpr std::size_t kMostBytes = std::size_t{1} << 35;

/// Thrown only within this file.
struct Bad {
  std::string message;
};

// ---- PLY

struct Property {
  std::string name;
  std::string type, count_type;  // count_type set: a list
};
struct Element {
  std::string name;
  std::size_t count = 0;
  std::vector<Property> properties;
};

std::size_t size_of(const std::string& type) {
  for (const char* t : {"char", "uchar", "int8", "uint8"}) {
    if (type == t) return 1;
  }
  for (const char* t : {"short", "ushort", "int16", "uint16"}) {
    if (type == t) return 2;
  }
  for (const char* t : {"int", "uint", "float", "int32", "uint32", "float32"}) {
    if (type == t) return 4;
  }
  if (type == "double" || type == "float64") return 8;
  throw Bad{"has a property of unknown type " + type};
}

/// Values one after another, ascii or binary.
class PlyReader {
 public:
  PlyReader(const std::string& body, bool ascii, bool big_endian)
      : at_(body.data()), end_(body.data() + body.size()), ascii_(ascii), swap_(big_endian) {}

  double value(const std::string& type) {
    if (ascii_) return text_value();
    unsigned char raw[8];
    const std::size_t size = size_of(type);
    if (static_cast<std::size_t>(end_ - at_) < size) throw Bad{"is cut short"};
    std::memcpy(raw, at_, size);
    at_ += size;
    if (swap_) std::reverse(raw, raw + size);
    const bool is_float = type[0] == 'f' || type[0] == 'd';
    const bool is_unsigned = type[0] == 'u';
    if (is_float) return size == 4 ? static_cast<double>(as<float>(raw)) : as<double>(raw);
    if (size == 1) return is_unsigned ? as<std::uint8_t>(raw) : as<std::int8_t>(raw);
    if (size == 2) return is_unsigned ? as<std::uint16_t>(raw) : as<std::int16_t>(raw);
    return is_unsigned ? as<std::uint32_t>(raw) : as<std::int32_t>(raw);
  }

 private:
  template <typename T>
  static T as(const unsigned char* raw) {
    T value;
    std::memcpy(&value, raw, sizeof value);
    return value;
  }
  double text_value() {
    while (at_ < end_ && std::isspace(static_cast<unsigned char>(*at_))) ++at_;
    double value = 0;
    const auto [next, code] = std::from_chars(at_, end_, value);
    if (code != std::errc{}) throw Bad{at_ == end_ ? "is cut short" : "holds something that is no number"};
    at_ = next;
    return value;
  }
  const char *at_, *end_;
  bool ascii_, swap_;
};

std::vector<Element> ply_header(const std::string& content, std::string& format, std::size_t& body) {
  const std::size_t end = content.find("end_header");
  const std::size_t line_end = end == std::string::npos ? end : content.find('\n', end);
  if (content.rfind("ply", 0) != 0 || line_end == std::string::npos) throw Bad{"is no PLY file"};
  body = line_end + 1;
  std::vector<Element> elements;
  std::istringstream lines(content.substr(0, end));
  for (std::string line; std::getline(lines, line);) {
    std::istringstream words(line);
    std::string word;
    words >> word;
    if (word == "format") words >> format;
    if (word == "element") {
      Element element;
      words >> element.name >> element.count;
      if (!words || element.count > kMost) throw Bad{"has an element without a sane count"};
      elements.push_back(element);
    }
    if (word == "property") {
      if (elements.empty()) throw Bad{"has a property before its first element"};
      Property property;
      words >> property.type;
      if (property.type == "list") words >> property.count_type >> property.type;
      words >> property.name;
      if (!words) throw Bad{"has a property that cannot be read"};
      size_of(property.type);
      elements.back().properties.push_back(property);
    }
  }
  return elements;
}

void add_polygon(MeshFile& mesh, const std::vector<std::uint32_t>& corners) {
  for (std::size_t i = 2; i < corners.size(); ++i)
    mesh.triangles.push_back({corners[0], corners[i - 1], corners[i]});
}

MeshFile read_ply(const std::string& content) {
  std::string format;
  std::size_t body = 0;
  const std::vector<Element> elements = ply_header(content, format, body);
  if (format != "ascii" && format != "binary_little_endian" && format != "binary_big_endian") {
    throw Bad{"has the unknown format " + format};
  }
  const std::string data = content.substr(body);
  PlyReader reader(data, format == "ascii", format == "binary_big_endian");
  MeshFile mesh;
  for (const Element& element : elements) {
    if (element.count > data.size()) throw Bad{"is cut short"};  // an item takes a byte at least
    for (std::size_t i = 0; i < element.count; ++i) {
      Vec3 p, c;
      bool coloured = false;
      std::vector<std::uint32_t> corners;
      for (const Property& property : element.properties) {
        if (!property.count_type.empty()) {
          const double count = reader.value(property.count_type);
          if (!(count >= 0 && count < 1e6)) throw Bad{"has a list without a sane length"};
          const bool indices = element.name == "face" && property.name.rfind("vert", 0) == 0;
          for (int k = 0; k < static_cast<int>(count); ++k) {
            const double value = reader.value(property.type);
            if (indices && !(value >= 0 && value < 4e9)) throw Bad{"has a face with an impossible vertex"};
            if (indices) corners.push_back(static_cast<std::uint32_t>(value));
          }
          continue;
        }
        const auto value = static_cast<float>(reader.value(property.type));
        const std::string& n = property.name;
        if (n == "x") p.x = value;
        if (n == "y") p.y = value;
        if (n == "z") p.z = value;
        const float scale = size_of(property.type) == 1 ? 1 / 255.0f : 1.0f;
        if (n == "red") c.x = value * scale, coloured = true;
        if (n == "green") c.y = value * scale;
        if (n == "blue") c.z = value * scale;
      }
      if (element.name == "vertex") {
        mesh.positions.push_back(p);
        if (coloured) mesh.colours.push_back(c);
      }
      if (element.name == "face") add_polygon(mesh, corners);
    }
  }
  return mesh;
}

// ---- OBJ

/// "7/3/2" or "-1": the position and texture indices, from 1; 0 where not given.
std::array<long, 2> obj_corner(const std::string& word) {
  std::array<long, 2> out{};
  const char* at = word.data();
  const char* end = at + word.size();
  for (long& index : out) {
    const auto [next, code] = std::from_chars(at, end, index);
    if (code != std::errc{} || next == end || *next != '/') break;
    at = next + 1;
  }
  return out;
}

std::size_t obj_index(long index, std::size_t count) {
  const long n = static_cast<long>(count);
  const long i = index > 0 ? index - 1 : n + index;
  if (index == 0 || i < 0 || i >= n) throw Bad{"has a face with an impossible index"};
  return static_cast<std::size_t>(i);
}

/// The first texture picture of a material library; none where there is none to be read. A mesh names any
/// file, also a device that never ends.
std::optional<std::filesystem::path> obj_texture(const std::filesystem::path& library) {
  std::error_code code;
  if (!std::filesystem::is_regular_file(library, code)) return std::nullopt;
  std::ifstream in(library);
  for (std::string line; std::getline(in, line);) {
    std::istringstream words(line);
    std::string word, name;
    if (words >> word >> name && word == "map_Kd") return library.parent_path() / name;
  }
  return std::nullopt;
}

MeshFile read_obj(const std::string& content, const std::filesystem::path& folder) {
  MeshFile mesh;
  std::vector<std::array<float, 2>> texture;
  bool all_textured = true;
  std::istringstream lines(content);
  for (std::string line; std::getline(lines, line);) {
    std::istringstream words(line);
    std::string word;
    words >> word;
    if (word == "v") {
      Vec3 p, c;
      words >> p.x >> p.y >> p.z;
      if (!words) throw Bad{"has a vertex that cannot be read: " + line.substr(0, 60)};
      mesh.positions.push_back(p);
      if (words >> c.x >> c.y >> c.z) mesh.colours.push_back(c);
    } else if (word == "vt") {
      std::array<float, 2> t{};
      words >> t[0] >> t[1];
      texture.push_back(t);
    } else if (word == "f") {
      std::vector<std::uint32_t> corners;
      std::vector<std::array<float, 2>> places;
      while (words >> word) {
        const auto [position, place] = obj_corner(word);
        corners.push_back(static_cast<std::uint32_t>(obj_index(position, mesh.positions.size())));
        if (place == 0) all_textured = false;
        places.push_back(place ? texture[obj_index(place, texture.size())] : std::array<float, 2>{});
      }
      add_polygon(mesh, corners);
      for (std::size_t i = 2; i < places.size(); ++i) {
        for (const std::size_t k : {std::size_t{0}, i - 1, i}) mesh.corner_texture.push_back(places[k]);
      }
    } else if (word == "mtllib" && words >> word && mesh.texture.empty()) {
      if (const auto file = obj_texture(folder / word)) {
        auto picture = read_rgb(*file);
        if (!picture) throw Bad{"names a texture: " + picture.error().message};
        mesh.texture = *std::move(picture);
      }
    }
  }
  if (!all_textured || mesh.texture.empty()) mesh.corner_texture.clear();
  return mesh;
}

/// False of corners in one place or on one line.
bool has_area(const MeshFile& mesh, const std::array<std::uint32_t, 3>& triangle) {
  constexpr float kLeastSine = 1e-6F;  // of the angle at its first corner
  const auto [a, b, c] = triangle;
  const Vec3 ab = mesh.positions[b] - mesh.positions[a];
  const Vec3 ac = mesh.positions[c] - mesh.positions[a];
  return length(cross(ab, ac)) > kLeastSine * length(ab) * length(ac);
}

void check(const MeshFile& mesh) {
  if (mesh.triangles.empty()) throw Bad{"has no triangle"};
  if (mesh.triangles.size() > kMost) throw Bad{"has too many triangles"};
  for (const Vec3& p : mesh.positions) {
    if (!(std::isfinite(p.x) && std::isfinite(p.y) && std::isfinite(p.z)))
      throw Bad{"has a vertex that is no number"};
  }
  for (const auto& triangle : mesh.triangles) {
    for (const std::uint32_t v : triangle) {
      if (v >= mesh.positions.size()) throw Bad{"has a face with an impossible vertex"};
    }
  }
  if (std::ranges::none_of(mesh.triangles, [&](const auto& t) { return has_area(mesh, t); }))
    throw Bad{"has no triangle with an area: the corners of each are in one place or on one line"};
}

}  // namespace

Result<MeshFile> read_mesh(const std::filesystem::path& file) {
  const std::string name = file.string();
  std::string extension = file.extension().string();
  std::transform(extension.begin(), extension.end(), extension.begin(),
                 [](unsigned char c) { return std::tolower(c); });
  if (extension != ".ply" && extension != ".obj")
    return Error{name + " is no mesh: give a .ply or .obj file"};
  const auto content = read_whole_file(file, kMostBytes);
  if (!content) return content.error();
  try {
    MeshFile mesh = extension == ".ply" ? read_ply(*content) : read_obj(*content, file.parent_path());
    if (mesh.colours.size() != mesh.positions.size()) mesh.colours.clear();
    check(mesh);
    return mesh;
  } catch (const Bad& bad) {
    return Error{name + " " + bad.message};
  } catch (const std::exception& e) {
    return Error{name + " cannot be read: " + e.what()};
  }
}

}  // namespace relievo::sim
