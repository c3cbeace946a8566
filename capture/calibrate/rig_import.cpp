// SPDX-License-Identifier: Apache-2.0
#include "capture/calibrate/rig_import.h"

#include <algorithm>
#include <cmath>
#include <span>

#include "capture/rig_file.h"
#include "capture/storage_file.h"

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

void values(const StorageFile& file, const char* key, int rows, int cols, std::span<double> out) {
  if (const Status read = file.matrix(key, rows, cols, out); !read) throw Refused{read.error().message};
}

void size_of(const StorageFile& file, const char* key, bool height_first, PinholeModel& model) {
  std::array<double, 2> size{};
  values(file, key, 1, 2, size);
  if (height_first) std::swap(size[0], size[1]);
  if (!(size[0] >= 8 && size[1] >= 8 && size[0] <= 16384 && size[1] <= 16384)) {
    throw Refused{std::string(key) + " is no picture's size"};
  }
  model.width = static_cast<int>(size[0]);
  model.height = static_cast<int>(size[1]);
}

void lens(const StorageFile& file, const char* matrix, const char* distortion, PinholeModel& model) {
  values(file, matrix, 3, 3, model.matrix);
  values(file, distortion, 1, 5, model.distortion);
}

ImportedRig foreign(const StorageFile& file, const Keys& keys) {
  ImportedRig out;
  out.format = keys.format;
  Rig& rig = out.rig;
  rig.scan = Scan::kProgressive;
  rig.frame_rate = 29.97;
  rig.colour_matrix = {1, 0, 0, 0, 1, 0, 0, 0, 1};
  size_of(file, keys.camera_size, keys.height_first, rig.camera);
  lens(file, keys.camera_matrix, keys.camera_distortion, rig.camera);
  if (keys.projector_size != nullptr) size_of(file, keys.projector_size, keys.height_first, rig.projector);
  lens(file, keys.projector_matrix, keys.projector_distortion, rig.projector);
  values(file, keys.rotation, 3, 3, rig.projector_from_camera_rotation);
  values(file, keys.translation, 3, 1, rig.projector_from_camera_translation);
  for (double& t : rig.projector_from_camera_translation) t *= kMetresPerMillimetre;
  const double rms = file.number(keys.rms).value_or(0);
  if (rms >= 0 && std::isfinite(rms)) out.stereo_rms = rms;
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

Result<ImportedRig> import_rig(const fs::path& path, int projector_width, int projector_height) {
  const std::string name = path.string();
  const auto file = StorageFile::open(path, StorageForm::kYamlOrXml);
  if (!file) return file.error();
  ImportedRig out;
  try {
    if (file->has("camera_matrix")) {
      auto rig = read_rig(path);
      if (!rig) return rig.error();
      out = {*rig, "rig.yaml", 0};
    } else if (file->has(kSltk.camera_matrix)) {
      out = foreign(*file, kSltk);
    } else if (file->has(kProcam.camera_matrix)) {
      out = foreign(*file, kProcam);
    } else {
      return Error{name +
                   " is no calibration known here: a rig.yaml, sltk's (cam_K ...) or procam-calibration's "
                   "(cam_int ...)"};
    }
  } catch (const Refused& refused) {
    return Error{name + ": " + refused.message};
  }
  if (const Status settled = settle_projector(out.rig.projector, projector_width, projector_height);
      !settled) {
    return settled.error().in(name);
  }
  if (const Status sound = check_rig(out.rig); !sound) return sound.error().in(name);
  return out;
}

}  // namespace relievo
