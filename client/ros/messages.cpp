// SPDX-License-Identifier: Apache-2.0
#include "client/ros/messages.h"

#include <Eigen/Geometry>
#include <cctype>
#include <cstdint>
#include <limits>
#include <string>
#include <utility>
#include <vector>

#include "base/lens.h"
#include "base/time.h"
#include "codec/jpeg_texture.h"
#include "codec/message_cdr.h"
#include "codec/surface_check.h"
#include "codec/texture_colour.h"

namespace relievo {
namespace {

constexpr int kJpegQuality = 90;

// The types' members alone: https://github.com/ros2/common_interfaces.
constexpr const char* kHeader =
    R"(================================================================================
MSG: std_msgs/Header
builtin_interfaces/Time stamp
string frame_id
================================================================================
MSG: builtin_interfaces/Time
int32 sec
uint32 nanosec
)";

constexpr const char* kPoints = R"(std_msgs/Header header
uint32 height
uint32 width
sensor_msgs/PointField[] fields
bool is_bigendian
uint32 point_step
uint32 row_step
uint8[] data
bool is_dense
================================================================================
MSG: sensor_msgs/PointField
uint8 INT8=1
uint8 UINT8=2
uint8 INT16=3
uint8 UINT16=4
uint8 INT32=5
uint8 UINT32=6
uint8 FLOAT32=7
uint8 FLOAT64=8
string name
uint32 offset
uint8 datatype
uint32 count
)";

constexpr const char* kImage = R"(std_msgs/Header header
string format
uint8[] data
)";

constexpr const char* kCameraInfo = R"(std_msgs/Header header
uint32 height
uint32 width
string distortion_model
float64[] d
float64[9] k
float64[9] r
float64[12] p
uint32 binning_x
uint32 binning_y
sensor_msgs/RegionOfInterest roi
================================================================================
MSG: sensor_msgs/RegionOfInterest
uint32 x_offset
uint32 y_offset
uint32 height
uint32 width
bool do_rectify
)";

constexpr const char* kTransforms = R"(geometry_msgs/TransformStamped[] transforms
================================================================================
MSG: geometry_msgs/TransformStamped
std_msgs/Header header
string child_frame_id
geometry_msgs/Transform transform
================================================================================
MSG: geometry_msgs/Transform
geometry_msgs/Vector3 translation
geometry_msgs/Quaternion rotation
================================================================================
MSG: geometry_msgs/Vector3
float64 x
float64 y
float64 z
================================================================================
MSG: geometry_msgs/Quaternion
float64 x 0
float64 y 0
float64 z 0
float64 w 1
)";

struct Field {
  const char* name;
  std::uint8_t datatype;
  std::uint32_t bytes;
};
constexpr std::uint8_t kUint8 = 2;
constexpr std::uint8_t kFloat32 = 7;

MessageCdr begin(const Frame3D& frame, const std::string& frame_id) {
  MessageCdr cdr;
  cdr.time(frame.time_ns);
  cdr.text(frame_id);
  return cdr;
}

Bytes points_message(const Frame3D& frame, const std::string& frame_id) {
  const Surface& surface = frame.surface;
  const bool has_sigma = !surface.sigmas_m.empty();
  const bool has_marks = !surface.interpolated.empty();
  std::vector<Field> fields;
  for (const char* name : {"x", "y", "z", "rgb"}) fields.push_back({name, kFloat32, 4});
  if (has_sigma) fields.push_back({"sigma", kFloat32, 4});
  if (has_marks) fields.push_back({"interpolated", kUint8, 1});

  const auto count = static_cast<std::uint32_t>(surface.positions.size());
  MessageCdr cdr = begin(frame, frame_id);
  cdr.put(std::uint32_t{1});  // one row: points are in no order
  cdr.put(count);
  cdr.put(static_cast<std::uint32_t>(fields.size()));
  std::uint32_t offset = 0;
  for (const Field& field : fields) {
    cdr.text(field.name);
    cdr.put(offset);
    cdr.put(field.datatype);
    cdr.put(std::uint32_t{1});
    offset += field.bytes;
  }
  const std::uint32_t padding = (4 - offset % 4) % 4;  // some readers take floats where they lie
  const std::uint32_t step = offset + padding;
  cdr.put(std::uint8_t{0});  // little endian
  cdr.put(step);
  cdr.put(count * step);
  Bytes data;
  data.reserve(std::size_t{count} * step);
  for (std::size_t i = 0; i < count; ++i) {
    for (const float x : surface.positions[i]) append(data, x);
    const auto [red, green, blue] = vertex_colour(surface, frame.texture.view(), i);
    append_bytes(data, std::array<std::uint8_t, 4>{blue, green, red, 0});
    if (has_sigma) append(data, surface.sigmas_m[i]);
    if (has_marks) append(data, surface.interpolated[i]);
    data.resize(data.size() + padding);
  }
  cdr.octets(data);
  cdr.put(std::uint8_t{1});  // every point is one
  return cdr.take();
}

Result<Bytes> image_message(const Frame3D& frame, const std::string& frame_id) {
  Bytes jpeg;
  if (auto status = append_jpeg(frame.texture.view(), kJpegQuality, jpeg); !status) return status.error();
  MessageCdr cdr = begin(frame, frame_id);
  cdr.text("jpeg");
  cdr.octets(jpeg);
  return cdr.take();
}

Bytes camera_info_message(const Frame3D& frame, const std::string& frame_id, const PinholeModel& camera) {
  const Image8& texture = frame.texture;  // of a lower quality it has fewer pixels
  const PinholeModel shown = texture.empty() ? camera : resized(camera, texture.width(), texture.height());
  MessageCdr cdr = begin(frame, frame_id);
  cdr.put(static_cast<std::uint32_t>(shown.height));
  cdr.put(static_cast<std::uint32_t>(shown.width));
  cdr.calibration(shown);
  for (int i = 0; i < 6; ++i) cdr.put(std::uint32_t{0});  // no binning, the whole picture
  cdr.put(std::uint8_t{0});
  return cdr.take();
}

Bytes transforms_message(const Frame3D& frame, const std::string& frame_id, const CameraPose& pose) {
  using Matrix = Eigen::Matrix<double, 3, 3, Eigen::RowMajor>;
  const Eigen::Quaterniond q(Eigen::Matrix3d(Eigen::Map<const Matrix>(pose.rotation.data())));
  MessageCdr cdr;
  cdr.put(std::uint32_t{1});
  cdr.time(frame.time_ns);
  cdr.text("world");
  cdr.text(frame_id);
  cdr.numbers(pose.translation);
  cdr.numbers({q.x(), q.y(), q.z(), q.w()});
  return cdr.take();
}

}  // namespace

const std::array<RosTopicType, 4>& ros_topic_types() {
  const auto with_header = [](const char* definition) { return std::string(definition) + kHeader; };
  static const std::array<RosTopicType, 4> kTypes{
      {{RosTopic::kPoints, "points", "sensor_msgs/msg/PointCloud2", with_header(kPoints)},
       {RosTopic::kImage, "image/compressed", "sensor_msgs/msg/CompressedImage", with_header(kImage)},
       {RosTopic::kCameraInfo, "camera_info", "sensor_msgs/msg/CameraInfo", with_header(kCameraInfo)},
       {RosTopic::kTransforms, "/tf", "tf2_msgs/msg/TFMessage", with_header(kTransforms)}}};
  return kTypes;
}

std::string ros_name(const std::string& stream) {
  std::string out;
  for (const char c : stream) {
    if (std::isalnum(static_cast<unsigned char>(c)) != 0) {
      out += c;
    } else if (!out.empty() && out.back() != '_') {
      out += '_';
    }
  }
  if (out.ends_with('_')) out.pop_back();
  if (out.empty()) return "stream";
  if (std::isdigit(static_cast<unsigned char>(out.front())) != 0) out.insert(0, "stream_");
  return out;
}

std::string ros_topic_name(const RosTopicType& type, const std::string& ros_name) {
  return type.topic == RosTopic::kTransforms ? type.name : "/" + ros_name + "/" + type.name;
}

Result<std::optional<Bytes>> ros_message(RosTopic topic, const Frame3D& frame, const std::string& ros_name,
                                         const Rig* rig) {
  using Message = std::optional<Bytes>;
  constexpr std::int64_t kLast_s = std::numeric_limits<std::int32_t>::max();  // of builtin_interfaces/Time
  if (frame.time_ns / kNanosecondsPerSecond > kLast_s)
    return Error{"frame " + std::to_string(frame.number) + " is of " + utc_text(frame.time_ns) +
                 ", and ROS 2 has no times after " + utc_text(kLast_s * kNanosecondsPerSecond)};
  switch (topic) {
    case RosTopic::kPoints:
      if (auto status = check_surface(frame.surface); !status) return status.error();
      return Message(points_message(frame, ros_name));
    case RosTopic::kImage: {
      if (frame.texture.empty()) return Message();
      auto image = image_message(frame, ros_name);
      return image ? Result<Message>(*std::move(image)) : image.error();
    }
    case RosTopic::kCameraInfo:
      return rig != nullptr ? Message(camera_info_message(frame, ros_name, rig->camera)) : Message();
    case RosTopic::kTransforms:
      return rig != nullptr && rig->world_from_camera
                 ? Message(transforms_message(frame, ros_name, *rig->world_from_camera))
                 : Message();
  }
  return Message();
}

}  // namespace relievo
