// SPDX-License-Identifier: Apache-2.0
#include "capture/rig_file.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <opencv2/core.hpp>
#include <span>
#include <string>

#include "capture/pattern/pattern_check.h"
#include "capture/storage_text.h"

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

cv::FileNode node(const cv::FileStorage& storage, const std::string& key) {
  const cv::FileNode found = storage[key];
  if (found.empty() || found.isNone()) refuse("key " + key + " is missing");
  return found;
}

double number(const cv::FileStorage& storage, const std::string& key, double low, double high) {
  const cv::FileNode found = node(storage, key);
  if (!found.isInt() && !found.isReal()) refuse(key + " must be a number");
  const double value = found.real();
  if (!(value >= low && value <= high)) {
    refuse(key + " is " + text(value) + ", must be " + text(low) + " to " + text(high));
  }
  return value;
}

int integer(const cv::FileStorage& storage, const std::string& key, int low, int high) {
  const double value = number(storage, key, low, high);
  if (value != std::floor(value)) refuse(key + " is " + text(value) + ", must be a whole number");
  return static_cast<int>(value);
}

void matrix(const cv::FileStorage& storage, const std::string& key, int rows, int cols,
            std::span<double> out) {
  const cv::FileNode found = node(storage, key);
  const std::string shape = std::to_string(rows) + " x " + std::to_string(cols);
  const auto wrong = [&] { refuse(key + " must be a " + shape + " !!opencv-matrix"); };
  if (!found.isMap() || !found["rows"].isInt() || !found["cols"].isInt()) wrong();
  const int r = static_cast<int>(found["rows"]);
  const int c = static_cast<int>(found["cols"]);
  const bool vector = rows == 1 || cols == 1;  // a vector may lie either way
  if (!((r == rows && c == cols) || (vector && r == cols && c == rows))) {
    refuse(key + " is " + std::to_string(r) + " x " + std::to_string(c) + ", must be " + shape);
  }
  cv::Mat values;
  try {
    values = found.mat();
  } catch (const std::exception&) {
    wrong();
  }
  if (values.channels() != 1 || values.total() != out.size()) wrong();
  values.convertTo(values, CV_64F);
  std::copy(values.begin<double>(), values.end<double>(), out.begin());
  if (!std::all_of(out.begin(), out.end(), [](double v) { return std::isfinite(v); })) {
    refuse(key + " holds a value that is no finite number");
  }
}

double determinant(const std::array<double, 9>& m) {
  return m[0] * (m[4] * m[8] - m[5] * m[7]) - m[1] * (m[3] * m[8] - m[5] * m[6]) +
         m[2] * (m[3] * m[7] - m[4] * m[6]);
}

PinholeModel pinhole(const cv::FileStorage& storage, const std::string& name) {
  PinholeModel model;
  model.width = integer(storage, name + "_width", 8, kMaxPixels);
  model.height = integer(storage, name + "_height", 8, kMaxPixels);
  matrix(storage, name + "_matrix", 3, 3, model.matrix);
  matrix(storage, name + "_distortion", 1, 5, model.distortion);
  const auto& m = model.matrix;
  if (m[1] != 0 || m[3] != 0 || m[6] != 0 || m[7] != 0 || m[8] != 1) {
    refuse(name + "_matrix must be [fx 0 cx; 0 fy cy; 0 0 1]");
  }
  if (!(m[0] > 0 && m[4] > 0)) refuse(name + "_matrix has a focal length that is not above 0");
  return model;
}

void check_rotation(const std::array<double, 9>& r) {
  double worst = 0;
  for (std::size_t i = 0; i < 3; ++i) {
    for (std::size_t j = 0; j < 3; ++j) {
      const double dot = r[3 * i] * r[3 * j] + r[3 * i + 1] * r[3 * j + 1] + r[3 * i + 2] * r[3 * j + 2];
      worst = std::max(worst, std::abs(dot - (i == j ? 1.0 : 0.0)));
    }
  }
  if (worst > 1e-4 || determinant(r) < 0) {
    refuse("projector_from_camera_rotation is no rotation (its rows must be orthonormal and right-handed)");
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

Rig rig_of(const cv::FileStorage& storage) {
  Rig rig;
  const cv::FileNode scan = node(storage, "scan");
  const std::string name = scan.isString() ? scan.string() : "";
  if (name != to_string(Scan::kInterlaced) && name != to_string(Scan::kProgressive)) {
    refuse("scan must be interlaced or progressive");
  }
  rig.scan = name == to_string(Scan::kInterlaced) ? Scan::kInterlaced : Scan::kProgressive;
  if (const cv::FileNode order = storage["field_order"]; !order.empty()) {
    const std::string which = order.isString() ? order.string() : "";
    if (which != to_string(FieldOrder::kTop) && which != to_string(FieldOrder::kBottom)) {
      refuse("field_order must be top or bottom: the field of an interlaced frame that is exposed first");
    }
    rig.field_order = which == to_string(FieldOrder::kTop) ? FieldOrder::kTop : FieldOrder::kBottom;
  }
  rig.frame_rate = number(storage, "frame_rate", 0.001, 10000);
  rig.camera = pinhole(storage, "camera");
  rig.projector = pinhole(storage, "projector");
  matrix(storage, "projector_from_camera_rotation", 3, 3, rig.projector_from_camera_rotation);
  matrix(storage, "projector_from_camera_translation", 3, 1, rig.projector_from_camera_translation);
  matrix(storage, "colour_matrix", 3, 3, rig.colour_matrix);
  if (!storage["stereo_rms_px"].empty()) rig.stereo_rms_px = number(storage, "stereo_rms_px", 0, kMaxPixels);
  if (!storage["scale_error"].empty()) rig.scale_error = number(storage, "scale_error", 0, 1);
  check_rotation(rig.projector_from_camera_rotation);
  const auto& t = rig.projector_from_camera_translation;
  if (std::hypot(t[0], t[1], t[2]) < 1e-6) {
    refuse("projector_from_camera_translation is zero: depth needs a baseline");
  }
  check_colour_matrix(rig.colour_matrix);
  return rig;
}

/// "100" is red: digits R, G, B.
Primary primary(const cv::FileNode& entry, int index) {
  const std::string name = entry.isString() ? entry.string() : "";
  if (name.size() != 3 || name.find_first_not_of("01") != std::string::npos) {
    refuse("palette colour " + std::to_string(index) +
           " must be a quoted string of digits R, G, B such as \"100\"");
  }
  return static_cast<Primary>((name[0] - '0') | (name[1] - '0') << 1 | (name[2] - '0') << 2);
}

Pattern pattern_of(const cv::FileStorage& storage) {
  Pattern pattern;
  pattern.base = integer(storage, "base", 3, 6);
  if (const cv::FileNode scheme = storage["scheme"]; !scheme.empty()) {
    const auto named = scheme_named(scheme.isString() ? scheme.string() : "");
    if (!named) refuse("scheme must be " + scheme_names());
    pattern.scheme = *named;
  }
  pattern.slides = integer(storage, "slides", 1, 12);
  const cv::FileNode palette = node(storage, "palette");
  if (!palette.isSeq()) refuse("palette must be a list of strings such as \"100\"");
  for (const cv::FileNode entry : palette) {
    pattern.palette.push_back(primary(entry, static_cast<int>(pattern.palette.size())));
  }
  const cv::FileNode sequence = node(storage, "sequence");
  if (!sequence.isSeq()) refuse("sequence must be a list of numbers, one a stripe");
  for (const cv::FileNode entry : sequence) {
    if (!entry.isInt()) {
      refuse("sequence stripe " + std::to_string(pattern.sequence.size()) + " must be a whole number");
    }
    pattern.sequence.push_back(static_cast<int>(entry));
  }
  if (const Status valid = check_pattern(pattern); !valid) refuse(valid.error().message);
  return pattern;
}

/// Reads the file as FileStorage and hands it to `parse`; every failure becomes one line naming the file.
template <typename T>
Result<T> read(const std::filesystem::path& file, const std::function<T(const cv::FileStorage&)>& parse) {
  const std::string name = file.string();
  const auto content = read_storage_text(file, StorageForm::kYaml);
  if (!content) return content.error();
  try {
    const cv::FileStorage storage(*content, cv::FileStorage::READ | cv::FileStorage::MEMORY);
    if (!storage.isOpened()) return Error{name + " is empty"};
    return parse(storage);
  } catch (const Refused& refused) {
    return Error{name + ": " + refused.message};
  } catch (const cv::Exception& e) {
    return Error{name + " is no valid YAML: " + e.err};
  } catch (const std::exception& e) {
    return Error{name + " cannot be read: " + e.what()};
  }
}

}  // namespace

Result<Rig> read_rig(const std::filesystem::path& file) {
  return read<Rig>(file, rig_of);
}

Result<Pattern> read_pattern(const std::filesystem::path& file) {
  return read<Pattern>(file, pattern_of);
}

}  // namespace relievo
