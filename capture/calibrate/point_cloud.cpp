// SPDX-License-Identifier: Apache-2.0
#include "capture/calibrate/point_cloud.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <cstring>
#include <iterator>
#include <limits>
#include <numeric>
#include <sstream>
#include <string>

#include "base/whole_file.h"

namespace relievo {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t kMostBytes = std::size_t{1} << 33;  // of hundreds of millions of points

struct Property {
  std::string type, name;
  std::size_t offset = 0;  // in a binary vertex
};

std::size_t bytes_of(const std::string& type) {
  if (type == "char" || type == "uchar" || type == "int8" || type == "uint8") return 1;
  if (type == "short" || type == "ushort" || type == "int16" || type == "uint16") return 2;
  if (type == "int" || type == "uint" || type == "int32" || type == "uint32" || type == "float" ||
      type == "float32") {
    return 4;
  }
  return type == "double" || type == "float64" ? 8 : 0;
}

struct Header {
  bool ascii = false;
  std::size_t vertices = 0;
  std::size_t stride = 0;
  std::vector<Property> properties;
};

/// Reads up to end_header. The vertices must be the first element.
Result<Header> read_header(std::istream& in) {
  Header header;
  std::string line, element;
  bool first = true, ended = false;
  for (int lines = 0; lines < 1000 && std::getline(in, line); ++lines) {
    if (!line.empty() && line.back() == '\r') line.pop_back();
    std::istringstream words(line);
    std::string word, type, name;
    words >> word;
    if (first && word != "ply") return Error{"it is no PLY file"};
    first = false;
    if (word == "format") {
      words >> type;
      if (type != "ascii" && type != "binary_little_endian")
        return Error{"the format " + type + " is not read"};
      header.ascii = type == "ascii";
    } else if (word == "element") {
      words >> type;
      if (element.empty() && type != "vertex") return Error{"its first element must be the vertices"};
      element = type;
      if (type == "vertex") words >> header.vertices;
    } else if (word == "property" && element == "vertex") {
      words >> type >> name;
      if (bytes_of(type) == 0) return Error{"a vertex property of type " + type + " is not read"};
      header.properties.push_back({type, name, header.stride});
      header.stride += bytes_of(type);
    } else if (word == "end_header") {
      ended = true;
      break;
    }
  }
  if (!ended) return Error{"its header does not end"};
  return header;
}

double number_at(const char* bytes, const std::string& type) {
  const auto as = [&](auto value) {
    std::memcpy(&value, bytes, sizeof value);
    return static_cast<double>(value);
  };
  if (type == "float" || type == "float32") return as(float{});
  if (type == "double" || type == "float64") return as(double{});
  if (type == "uchar" || type == "uint8") return as(std::uint8_t{});
  if (type == "char" || type == "int8") return as(std::int8_t{});
  if (type == "short" || type == "int16") return as(std::int16_t{});
  if (type == "ushort" || type == "uint16") return as(std::uint16_t{});
  if (type == "int" || type == "int32") return as(std::int32_t{});
  return as(std::uint32_t{});
}

/// Also "nan", as programs write of points that are none, which >> takes for no number.
void read_number(std::istream& in, double& value) {
  std::string word;
  if (!(in >> word)) return;
  char* end = nullptr;
  value = std::strtod(word.c_str(), &end);
  if (*end != '\0') in.setstate(std::ios::failbit);
}

Result<PointCloud> read_points(std::istream& in) {
  auto header = read_header(in);
  if (!header) return header.error();
  std::array<std::size_t, 6> index;
  static constexpr std::array kNames = {"x", "y", "z", "red", "green", "blue"};
  for (std::size_t n = 0; n < kNames.size(); ++n) {
    const auto& all = header->properties;
    const auto at =
        std::find_if(all.begin(), all.end(), [&](const Property& p) { return p.name == kNames[n]; });
    index[n] = static_cast<std::size_t>(at - all.begin());
  }
  const std::size_t properties = header->properties.size();
  if (index[0] == properties || index[1] == properties || index[2] == properties) {
    return Error{"its vertices have no x, y, z"};
  }
  const bool coloured = index[3] < properties && index[4] < properties && index[5] < properties;
  PointCloud cloud;
  std::vector<double> values(properties);
  std::string vertex(header->stride, '\0');
  for (std::size_t i = 0; i < header->vertices; ++i) {
    if (header->ascii) {
      for (double& value : values) read_number(in, value);
    } else {
      in.read(vertex.data(), static_cast<std::streamsize>(vertex.size()));
      for (std::size_t p = 0; p < properties; ++p) {
        values[p] = number_at(vertex.data() + header->properties[p].offset, header->properties[p].type);
      }
    }
    if (!in)
      return Error{"it ends after " + std::to_string(i) + " of " + std::to_string(header->vertices) +
                   " vertices"};
    const Vec3f position{static_cast<float>(values[index[0]]), static_cast<float>(values[index[1]]),
                         static_cast<float>(values[index[2]])};
    if (!std::all_of(position.begin(), position.end(), [](float x) { return std::isfinite(x); })) continue;
    cloud.positions.push_back(position);
    if (coloured) {
      const auto byte = [&](std::size_t n) {
        return static_cast<std::uint8_t>(std::clamp(values[index[n]], 0.0, 255.0));
      };
      cloud.colours.push_back({byte(3), byte(4), byte(5)});
    }
  }
  return cloud;
}

/// A balanced k-d tree over indices: the middle of a range is its node, axes in turn.
class Tree {
 public:
  explicit Tree(const std::vector<Vec3f>& points) : points_(points), order_(points.size()) {
    std::iota(order_.begin(), order_.end(), 0u);
    build(0, order_.size(), 0);
    for (const Vec3f& p : points) {
      for (std::size_t axis = 0; axis < 3; ++axis) {
        least_[axis] = std::min(least_[axis], p[axis]);
        most_[axis] = std::max(most_[axis], p[axis]);
      }
    }
  }

  float nearest_squared(const Vec3f& query) const {
    float best = std::numeric_limits<float>::infinity();
    Vec3f off{};  // to the box around all: without it a query from afar would see no part as too far
    for (std::size_t axis = 0; axis < 3; ++axis)
      off[axis] = std::max({0.0f, least_[axis] - query[axis], query[axis] - most_[axis]});
    search(0, order_.size(), 0, query, off, best);
    return best;
  }

 private:
  void build(std::size_t begin, std::size_t end, std::size_t axis) {
    if (end - begin < 2) return;
    const std::size_t middle = (begin + end) / 2;
    const auto at = [&](std::size_t i) { return order_.begin() + static_cast<std::ptrdiff_t>(i); };
    std::nth_element(at(begin), at(middle), at(end),
                     [&](std::uint32_t a, std::uint32_t b) { return points_[a][axis] < points_[b][axis]; });
    build(begin, middle, (axis + 1) % 3);
    build(middle + 1, end, (axis + 1) % 3);
  }

  static float squared(const Vec3f& v) { return v[0] * v[0] + v[1] * v[1] + v[2] * v[2]; }

  /// `off`: from the query to the box in which the range lies, along each axis.
  void search(std::size_t begin, std::size_t end, std::size_t axis, const Vec3f& query, const Vec3f& off,
              float& best) const {
    if (begin >= end) return;
    const std::size_t middle = (begin + end) / 2;
    const Vec3f& p = points_[order_[middle]];
    best = std::min(best, squared({p[0] - query[0], p[1] - query[1], p[2] - query[2]}));
    const float beyond = query[axis] - p[axis];
    const std::size_t next = (axis + 1) % 3;
    Vec3f beyond_off = off;
    beyond_off[axis] = std::max(off[axis], std::fabs(beyond));
    if (beyond < 0) {
      search(begin, middle, next, query, off, best);
      if (squared(beyond_off) < best) search(middle + 1, end, next, query, beyond_off, best);
    } else {
      search(middle + 1, end, next, query, off, best);
      if (squared(beyond_off) < best) search(begin, middle, next, query, beyond_off, best);
    }
  }

  const std::vector<Vec3f>& points_;
  std::vector<std::uint32_t> order_;
  static constexpr float kFar = std::numeric_limits<float>::infinity();
  Vec3f least_{kFar, kFar, kFar}, most_{-kFar, -kFar, -kFar};
};

float median(std::vector<float> values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

}  // namespace

Result<PointCloud> read_ply_points(const fs::path& file) {
  auto content = read_whole_file(file, kMostBytes);
  if (!content) return content.error();
  std::istringstream in(*std::move(content));
  auto cloud = read_points(in);
  if (!cloud) return cloud.error().in(file.string());
  return cloud;
}

Status write_ply_points(const fs::path& file, const PointCloud& cloud) {
  const bool coloured = !cloud.colours.empty();
  std::string out = "ply\nformat binary_little_endian 1.0\nelement vertex " +
                    std::to_string(cloud.positions.size()) +
                    "\nproperty float x\nproperty float y\nproperty float z\n";
  if (coloured) out += "property uchar red\nproperty uchar green\nproperty uchar blue\n";
  out += "end_header\n";
  for (std::size_t i = 0; i < cloud.positions.size(); ++i) {
    char bytes[15];
    std::memcpy(bytes, cloud.positions[i].data(), 12);
    if (coloured) std::memcpy(bytes + 12, cloud.colours[i].data(), 3);
    out.append(bytes, coloured ? 15 : 12);
  }
  return write_whole_file(file, out);
}

float spread_of(const std::vector<Vec3f>& points) {
  if (points.empty()) return 0;
  std::vector<float> along(points.size()), away(points.size(), 0);
  for (std::size_t axis = 0; axis < 3; ++axis) {
    std::transform(points.begin(), points.end(), along.begin(), [&](const Vec3f& p) { return p[axis]; });
    const float middle = median(along);
    for (std::size_t i = 0; i < points.size(); ++i) away[i] = std::hypot(away[i], along[i] - middle);
  }
  return median(std::move(away));
}

std::vector<float> nearest_distances(const std::vector<Vec3f>& points, const std::vector<Vec3f>& reference) {
  const Tree tree(reference);
  std::vector<float> out;
  out.reserve(points.size());
  for (const Vec3f& p : points) out.push_back(std::sqrt(tree.nearest_squared(p)));
  return out;
}

}  // namespace relievo
