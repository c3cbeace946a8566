// SPDX-License-Identifier: Apache-2.0
#include "codec/foxglove.h"

#include <numbers>
#include <utility>

#include "base/lens.h"
#include "codec/export.h"
#include "codec/jpeg_texture.h"
#include "codec/message_cdr.h"

namespace relievo {
namespace {

constexpr int kJpegQuality = 90;

constexpr const char* kImageIdl = R"(module foxglove {
  struct Time { uint32 sec; uint32 nsec; };
  struct CompressedImage { Time timestamp; string frame_id; sequence<uint8> data; string format; };
};
)";

constexpr const char* kCalibrationIdl = R"(module foxglove {
  struct Time { uint32 sec; uint32 nsec; };
  struct CameraCalibration {
    Time timestamp; string frame_id; uint32 width; uint32 height; string distortion_model; sequence<double> D;
    double K[9]; double R[9]; double P[12];
  };
};
)";

constexpr const char* kTransformIdl = R"(module foxglove {
  struct Time { uint32 sec; uint32 nsec; };
  struct Vector3 { double x; double y; double z; };
  struct Quaternion { double x; double y; double z; double w; };
  struct FrameTransform {
    Time timestamp; string parent_frame_id; string child_frame_id; Vector3 translation; Quaternion rotation;
  };
};
)";

constexpr const char* kSceneIdl = R"(module foxglove {
  struct Time { uint32 sec; uint32 nsec; };
  struct Duration { int32 sec; uint32 nsec; };
  struct Vector3 { double x; double y; double z; };
  struct Point3 { double x; double y; double z; };
  struct Quaternion { double x; double y; double z; double w; };
  struct Pose { Vector3 position; Quaternion orientation; };
  struct Color { double r; double g; double b; double a; };
  struct KeyValuePair { string key; string value; };
  struct ArrowPrimitive {
    Pose pose; double shaft_length; double shaft_diameter; double head_length; double head_diameter; Color color;
  };
  struct CubePrimitive { Pose pose; Vector3 size; Color color; };
  struct SpherePrimitive { Pose pose; Vector3 size; Color color; };
  struct CylinderPrimitive { Pose pose; Vector3 size; double bottom_scale; double top_scale; Color color; };
  enum LineType { LINE_STRIP, LINE_LOOP, LINE_LIST };
  struct LinePrimitive {
    LineType type; Pose pose; double thickness; boolean scale_invariant; sequence<Point3> points; Color color;
    sequence<Color> colors; sequence<uint32> indices;
  };
  struct TriangleListPrimitive {
    Pose pose; sequence<Point3> points; Color color; sequence<Color> colors; sequence<uint32> indices;
  };
  struct TextPrimitive {
    Pose pose; boolean billboard; double font_size; boolean scale_invariant; Color color; string text;
  };
  struct ModelPrimitive {
    Pose pose; Vector3 scale; Color color; boolean override_color; string url; string media_type;
    sequence<uint8> data;
  };
  enum SceneEntityDeletionType { MATCHING_ID, ALL };
  struct SceneEntityDeletion { Time timestamp; SceneEntityDeletionType type; string id; };
  struct SceneEntity {
    Time timestamp; string frame_id; string id; Duration lifetime; boolean frame_locked;
    sequence<KeyValuePair> metadata; sequence<ArrowPrimitive> arrows; sequence<CubePrimitive> cubes;
    sequence<SpherePrimitive> spheres; sequence<CylinderPrimitive> cylinders; sequence<LinePrimitive> lines;
    sequence<TriangleListPrimitive> triangles; sequence<TextPrimitive> texts; sequence<ModelPrimitive> models;
  };
  struct SceneUpdate { sequence<SceneEntityDeletion> deletions; sequence<SceneEntity> entities; };
};
)";

std::string camera_frame(const std::string& stream) {
  return stream + "/camera";
}

Result<Bytes> image_message(const Frame3D& frame, const std::string& stream, std::int64_t time_ns) {
  Bytes jpeg;
  if (auto status = append_jpeg(frame.texture.view(), kJpegQuality, jpeg); !status) return status.error();
  MessageCdr cdr;
  cdr.time(time_ns);
  cdr.text(camera_frame(stream));
  cdr.octets(jpeg);
  cdr.text("jpeg");
  return cdr.take();
}

/// Of the image, which may be smaller than the camera's picture.
Bytes calibration_message(const Frame3D& frame, const PinholeModel& camera, const std::string& stream,
                          std::int64_t time_ns) {
  const PinholeModel shown = resized(camera, frame.texture.width(), frame.texture.height());
  MessageCdr cdr;
  cdr.time(time_ns);
  cdr.text(camera_frame(stream));
  cdr.put(static_cast<std::uint32_t>(shown.width));
  cdr.put(static_cast<std::uint32_t>(shown.height));
  cdr.calibration(shown);
  return cdr.take();
}

/// From the camera's coordinate frame to the surface's: a quarter of a turn about x.
Bytes transform_message(const std::string& stream, std::int64_t time_ns) {
  constexpr double kHalf = std::numbers::sqrt2 / 2;
  MessageCdr cdr;
  cdr.time(time_ns);
  cdr.text(stream);
  cdr.text(camera_frame(stream));
  cdr.numbers({0, 0, 0});
  cdr.numbers({-kHalf, 0, 0, kHalf});
  return cdr.take();
}

Result<Bytes> scene_message(const Frame3D& frame, const std::string& stream, std::int64_t time_ns) {
  const auto glb = encode_glb(frame, {.jpeg_quality = kJpegQuality});
  if (!glb) return glb.error();
  MessageCdr cdr;
  cdr.empty_sequences(1);  // deletions
  cdr.put(std::uint32_t{1});
  cdr.time(time_ns);
  cdr.text(stream);  // coordinate frame
  cdr.text("surface");
  cdr.put(std::int32_t{0});  // lives until the next of its name
  cdr.put(std::uint32_t{0});
  cdr.put(std::uint8_t{0});  // not locked to its coordinate frame
  cdr.empty_sequences(8);    // metadata and the other primitives
  cdr.put(std::uint32_t{1});
  cdr.numbers({0, 0, 0, 0, 0, 0, 1});  // no translation, no rotation
  cdr.numbers({1, 1, 1});              // scale
  cdr.numbers({1, 1, 1, 1});           // colour, not used:
  cdr.put(std::uint8_t{0});            // the model's own
  cdr.text("");                        // no address, but data
  cdr.text("model/gltf-binary");
  cdr.octets(*glb);
  return cdr.take();
}

}  // namespace

Result<FoxgloveChannels> FoxgloveChannels::add_to(RecordingWriter& writer, const std::string& stream) {
  FoxgloveChannels out;
  out.stream_ = stream;
  const auto add = [&](const char* name, const char* idl, const char* topic, std::uint16_t& id) -> Status {
    const auto channel =
        writer.add_channel({name, "omgidl", idl}, {topic, "cdr", name, {{"stream", stream}}});
    if (!channel) return channel.error();
    id = *channel;
    return {};
  };
  if (auto status = add("foxglove::CompressedImage", kImageIdl, "relievo/image", out.image_); !status)
    return status.error();
  if (auto status =
          add("foxglove::CameraCalibration", kCalibrationIdl, "relievo/calibration", out.calibration_);
      !status)
    return status.error();
  if (auto status = add("foxglove::FrameTransform", kTransformIdl, "relievo/transform", out.transform_);
      !status)
    return status.error();
  if (auto status = add("foxglove::SceneUpdate", kSceneIdl, "relievo/scene", out.scene_); !status)
    return status.error();
  return out;
}

Status FoxgloveChannels::write(RecordingWriter& writer, const Frame3D& frame, const PinholeModel* camera,
                               const Times& times) const {
  const auto add = [&](std::uint16_t channel, Result<Bytes> data) -> Status {
    if (!data) return data.error();
    const auto sequence = static_cast<std::uint32_t>(frame.number);
    return writer.write({channel, sequence, times.log_ns, times.publish_ns, *std::move(data)});
  };
  const std::int64_t time_ns = times.capture_ns;
  if (auto status = add(transform_, transform_message(stream_, time_ns)); !status) return status;
  if (!frame.texture.empty()) {
    if (camera != nullptr && camera->width > 0 && camera->height > 0)
      if (auto status = add(calibration_, calibration_message(frame, *camera, stream_, time_ns)); !status)
        return status;
    if (auto status = add(image_, image_message(frame, stream_, time_ns)); !status) return status;
  }
  return add(scene_, scene_message(frame, stream_, time_ns));
}

}  // namespace relievo
