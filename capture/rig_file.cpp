// SPDX-License-Identifier: Apache-2.0
#include "capture/rig_file.h"

#include <algorithm>
#include <cmath>
#include <span>
#include <string>

#include "base/lens.h"
#include "capture/camera_response.h"
#include "capture/pattern/pattern_check.h"
#include "capture/storage_file.h"

namespace relievo {
namespace {

constexpr int kMaxPixels = 16384;  // a side

/// What was wrong with a file, thrown only between the functions of this file.
struct Refused {
  std::string message;
};

[[noreturn]] void refuse(const std::string& message) {
  throw Refused{message};
}

std::string text(double value) {
  char out[32];
  std::snprintf(out, sizeof out, "%g", value);
  return out;
}

double number(const StorageFile& file, const std::string& key, double low, double high) {
  if (!file.has(key)) refuse("key " + key + " is missing");
  const std::optional<double> value = file.number(key);
  if (!value) refuse(key + " must be a number");
  if (!(*value >= low && *value <= high)) {
    refuse(key + " is " + text(*value) + ", must be " + text(low) + " to " + text(high));
  }
  return *value;
}

int integer(const StorageFile& file, const std::string& key, int low, int high) {
  const double value = number(file, key, low, high);
  if (value != std::floor(value)) refuse(key + " is " + text(value) + ", must be a whole number");
  return static_cast<int>(value);
}

void matrix(const StorageFile& file, const std::string& key, int rows, int cols, std::span<double> out) {
  if (!file.has(key)) refuse("key " + key + " is missing");
  if (const Status read = file.matrix(key, rows, cols, out); !read) refuse(read.error().message);
}

double determinant(const std::array<double, 9>& m) {
  return m[0] * (m[4] * m[8] - m[5] * m[7]) - m[1] * (m[3] * m[8] - m[5] * m[6]) +
         m[2] * (m[3] * m[7] - m[4] * m[6]);
}

PinholeModel pinhole(const StorageFile& file, const std::string& name) {
  PinholeModel model;
  model.width = integer(file, name + "_width", 8, kMaxPixels);
  model.height = integer(file, name + "_height", 8, kMaxPixels);
  matrix(file, name + "_matrix", 3, 3, model.matrix);
  matrix(file, name + "_distortion", 1, 5, model.distortion);
  return model;
}

void check_size(std::span<const double> values, const std::string& key) {
  for (const double value : values)
    if (!fits_rig(value)) refuse(key + " holds " + text(value) + ", must be below a million");
}

void check_lens(const PinholeModel& model, const std::string& name) {
  check_size(model.matrix, name + "_matrix");
  check_size(model.distortion, name + "_distortion");
  const auto& m = model.matrix;
  if (m[1] != 0 || m[3] != 0 || m[6] != 0 || m[7] != 0 || m[8] != 1) {
    refuse(name + "_matrix must be [fx 0 cx; 0 fy cy; 0 0 1]");
  }
  if (!has_focal_lengths(model)) refuse(name + "_matrix has a focal length that is not above a pixel");
}

void check_rotation(const std::array<double, 9>& rotation, const std::string& key) {
  if (!is_rotation(rotation)) {
    refuse(key + " is no rotation (its rows must be orthonormal and right-handed)");
  }
}

void check_colour_matrix(const std::array<double, 9>& m) {
  double norm = 0;
  for (const double v : m) norm += v * v;
  norm = std::sqrt(norm / 3);  // 1 for a rotation
  if (!(std::abs(determinant(m)) > 1e-6 * norm * norm * norm)) {
    refuse("colour_matrix is singular, so projected colours cannot be told apart");
  }
}

void check_parts(const Rig& rig) {
  check_lens(rig.camera, "camera");
  check_lens(rig.projector, "projector");
  check_rotation(rig.projector_from_camera_rotation, "projector_from_camera_rotation");
  if (rig.world_from_camera) check_rotation(rig.world_from_camera->rotation, "world_from_camera_rotation");
  const auto& t = rig.projector_from_camera_translation;
  check_size(t, "projector_from_camera_translation, metres,");
  if (std::hypot(t[0], t[1], t[2]) < 1e-6) {
    refuse("projector_from_camera_translation is zero: depth needs a baseline");
  }
  check_colour_matrix(rig.colour_matrix);
}

Rig rig_of(const StorageFile& file) {
  Rig rig;
  if (!file.has("scan")) refuse("key scan is missing");
  const std::string name = file.text("scan").value_or("");
  if (name != to_string(Scan::kInterlaced) && name != to_string(Scan::kProgressive)) {
    refuse("scan must be interlaced or progressive");
  }
  rig.scan = name == to_string(Scan::kInterlaced) ? Scan::kInterlaced : Scan::kProgressive;
  if (file.has("field_order")) {
    const std::string which = file.text("field_order").value_or("");
    if (which != to_string(FieldOrder::kTop) && which != to_string(FieldOrder::kBottom)) {
      refuse("field_order must be top or bottom: the field of an interlaced frame that is exposed first");
    }
    rig.field_order = which == to_string(FieldOrder::kTop) ? FieldOrder::kTop : FieldOrder::kBottom;
  }
  rig.frame_rate = number(file, "frame_rate", 0.001, 10000);
  rig.camera = pinhole(file, "camera");
  rig.projector = pinhole(file, "projector");
  matrix(file, "projector_from_camera_rotation", 3, 3, rig.projector_from_camera_rotation);
  matrix(file, "projector_from_camera_translation", 3, 1, rig.projector_from_camera_translation);
  matrix(file, "colour_matrix", 3, 3, rig.colour_matrix);
  if (file.has("camera_gamma"))
    rig.camera_gamma = number(file, "camera_gamma", 1, CameraResponse::kMostGamma);
  if (file.has("stereo_rms_px")) rig.stereo_rms_px = number(file, "stereo_rms_px", 0, kMaxPixels);
  if (file.has("scale_error")) rig.scale_error = number(file, "scale_error", 0, 1);
  if (file.has("world_from_camera_rotation") || file.has("world_from_camera_translation")) {
    CameraPose& pose = rig.world_from_camera.emplace();
    matrix(file, "world_from_camera_rotation", 3, 3, pose.rotation);
    matrix(file, "world_from_camera_translation", 3, 1, pose.translation);
  }
  check_parts(rig);
  return rig;
}

std::string missing_or(const StorageFile& file, const std::string& key, const std::string& wrong) {
  return file.has(key) ? key + " " + wrong : "key " + key + " is missing";
}

/// "100" is red: digits R, G, B.
Primary primary(const std::string& name, std::size_t index) {
  if (name.size() != 3 || name.find_first_not_of("01") != std::string::npos) {
    refuse("palette colour " + std::to_string(index) +
           " must be a quoted string of digits R, G, B such as \"100\"");
  }
  return static_cast<Primary>((name[0] - '0') | (name[1] - '0') << 1 | (name[2] - '0') << 2);
}

Pattern pattern_of(const StorageFile& file) {
  Pattern pattern;
  pattern.base = integer(file, "base", 3, 6);
  if (file.has("scheme")) {
    const auto named = scheme_named(file.text("scheme").value_or(""));
    if (!named) refuse("scheme must be " + scheme_names());
    pattern.scheme = *named;
  }
  pattern.slides = integer(file, "slides", 1, 12);
  const auto palette = file.texts("palette");
  if (!palette) refuse(missing_or(file, "palette", "must be a list of strings such as \"100\""));
  for (const auto& colour : *palette)
    pattern.palette.push_back(primary(colour.value_or(""), pattern.palette.size()));
  const auto sequence = file.whole_numbers("sequence");
  if (!sequence) refuse(missing_or(file, "sequence", "must be a list of numbers, one a stripe"));
  for (const auto& stripe : *sequence) {
    if (!stripe)
      refuse("sequence stripe " + std::to_string(pattern.sequence.size()) + " must be a whole number");
    pattern.sequence.push_back(*stripe);
  }
  if (const Status valid = check_pattern(pattern); !valid) refuse(valid.error().message);
  return pattern;
}

/// What `parse` makes of the file; every failure becomes one line naming the file.
template <typename T>
Result<T> read(const std::filesystem::path& path, T (*parse)(const StorageFile&)) {
  const auto file = StorageFile::open(path, StorageForm::kYaml);
  if (!file) return file.error();
  try {
    return parse(*file);
  } catch (const Refused& refused) {
    return Error{path.string() + ": " + refused.message};
  }
}

}  // namespace

Result<Rig> read_rig(const std::filesystem::path& file) {
  return read<Rig>(file, rig_of);
}

Status check_rig(const Rig& rig) {
  try {
    check_parts(rig);
    return {};
  } catch (const Refused& refused) {
    return Error{refused.message};
  }
}

Result<Pattern> read_pattern(const std::filesystem::path& file) {
  return read<Pattern>(file, pattern_of);
}

}  // namespace relievo
