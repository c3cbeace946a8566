// SPDX-License-Identifier: Apache-2.0
#include "capture/calibrate/rig_import.h"

#include <algorithm>
#include <cmath>
#include <opencv2/core.hpp>
#include <span>

#include "capture/rig_file.h"
#include "capture/storage_text.h"

namespace relievo {
namespace {

namespace fs = std::filesystem;

constexpr double kMetresPerMillimetre = 0.001;

/// A program's names for the parts of a rig.
struct Keys {
  const char* format;
  const char *camera_size, *camera_matrix, *camera_distortion;
  const char *projector_size, *projector_matrix, *projector_distortion;
  const char *rotation, *translation, *rms;
  bool height_first;
};
constexpr Keys kSltk = {"sltk",   "cam_size", "cam_K", "cam_kc",     "pro_size", "pro_K",
                        "pro_kc", "R",        "T",     "stereo_rms", false};
// "roration" is that program's own spelling.
constexpr Keys kProcam = {"procam-calibration", "img_shape", "cam_int",     "cam_dist", nullptr, "proj_int",
                          "proj_dist",          "roration",  "translation", "rms",      true};

struct Refused {
  std::string message;
};

void values(const cv::FileStorage& storage, const char* key, std::span<double> out) {
  cv::Mat found;
  try {
    found = storage[key].mat();
  } catch (const std::exception&) {  // reported just below
  }
  if (found.total() != out.size() || found.channels() != 1) {
    throw Refused{std::string(key) + " must be a matrix of " + std::to_string(out.size()) + " numbers"};
  }
  found.convertTo(found, CV_64F);
  std::copy(found.begin<double>(), found.end<double>(), out.begin());
  if (!std::all_of(out.begin(), out.end(), [](double v) { return std::isfinite(v); })) {
    throw Refused{std::string(key) + " holds a value that is no finite number"};
  }
}

void size_of(const cv::FileStorage& storage, const char* key, bool height_first, PinholeModel& model) {
  std::array<double, 2> size{};
  values(storage, key, size);
  if (height_first) std::swap(size[0], size[1]);
  if (!(size[0] >= 8 && size[1] >= 8 && size[0] <= 16384 && size[1] <= 16384)) {
    throw Refused{std::string(key) + " is no picture's size"};
  }
  model.width = static_cast<int>(size[0]);
  model.height = static_cast<int>(size[1]);
}

void lens(const cv::FileStorage& storage, const char* matrix, const char* distortion, PinholeModel& model) {
  values(storage, matrix, model.matrix);
  values(storage, distortion, model.distortion);
  if (!(model.fx() > 0 && model.fy() > 0))
    throw Refused{std::string(matrix) + " has a focal length not above 0"};
}

ImportedRig foreign(const cv::FileStorage& storage, const Keys& keys) {
  ImportedRig out;
  out.format = keys.format;
  Rig& rig = out.rig;
  rig.scan = Scan::kProgressive;
  rig.frame_rate = 29.97;
  rig.colour_matrix = {1, 0, 0, 0, 1, 0, 0, 0, 1};
  size_of(storage, keys.camera_size, keys.height_first, rig.camera);
  lens(storage, keys.camera_matrix, keys.camera_distortion, rig.camera);
  if (keys.projector_size != nullptr) size_of(storage, keys.projector_size, keys.height_first, rig.projector);
  lens(storage, keys.projector_matrix, keys.projector_distortion, rig.projector);
  values(storage, keys.rotation, rig.projector_from_camera_rotation);
  values(storage, keys.translation, rig.projector_from_camera_translation);
  for (double& t : rig.projector_from_camera_translation) t *= kMetresPerMillimetre;
  if (storage[keys.rms].isReal()) out.stereo_rms = storage[keys.rms].real();
  return out;
}

Status settle_projector(PinholeModel& projector, int width, int height) {
  const std::string given = std::to_string(width) + "x" + std::to_string(height);
  if (projector.width == 0) {
    if (width == 0) return Error{"it does not say the projector's size: give it with --projector WxH"};
    projector.width = width;
    projector.height = height;
  } else if (width != 0 && (projector.width != width || projector.height != height)) {
    return Error{"its projector is " + std::to_string(projector.width) + "x" +
                 std::to_string(projector.height) + ", not " + given};
  }
  return {};
}

}  // namespace

Result<ImportedRig> import_rig(const fs::path& file, int projector_width, int projector_height) {
  const std::string name = file.string();
  const auto text = read_storage_text(file, StorageForm::kYamlOrXml);
  if (!text) return text.error();
  ImportedRig out;
  try {
    const cv::FileStorage storage(*text, cv::FileStorage::READ | cv::FileStorage::MEMORY);
    if (!storage.isOpened()) return Error{name + " is empty"};
    if (!storage["camera_matrix"].empty()) {
      auto rig = read_rig(file);
      if (!rig) return rig.error();
      out = {*rig, "rig.yaml", 0};
    } else if (!storage[kSltk.camera_matrix].empty()) {
      out = foreign(storage, kSltk);
    } else if (!storage[kProcam.camera_matrix].empty()) {
      out = foreign(storage, kProcam);
    } else {
      return Error{name +
                   " is no calibration known here: a rig.yaml, sltk's (cam_K ...) or procam-calibration's "
                   "(cam_int ...)"};
    }
  } catch (const Refused& refused) {
    return Error{name + ": " + refused.message};
  } catch (const cv::Exception& e) {
    return Error{name + " is no valid YAML or XML: " + e.err};
  } catch (const std::exception& e) {
    return Error{name + " cannot be read: " + e.what()};
  }
  if (const Status settled = settle_projector(out.rig.projector, projector_width, projector_height);
      !settled) {
    return settled.error().in(name);
  }
  return out;
}

}  // namespace relievo
