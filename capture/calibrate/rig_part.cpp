// SPDX-License-Identifier: Apache-2.0
#include "capture/calibrate/rig_part.h"

#include <cstdio>

#include "capture/camera_response.h"
#include "capture/rig_file.h"
#include "capture/storage_file.h"

namespace relievo {
namespace {

std::string colour_yaml(const CameraColours& colours) {
  const std::array<double, 9>& m = colours.matrix;
  std::string out =
      "%YAML:1.0\n---\n# Colour only: relievo-server calibrate geometry --update this-file adds the rest.\n"
      "colour_matrix: !!opencv-matrix\n   rows: 3\n   cols: 3\n   dt: d\n   data: [ ";
  char number[48];
  for (std::size_t i = 0; i < m.size(); ++i) {
    std::snprintf(number, sizeof number, "%s%.17e", i ? ", " : "", m[i]);
    out += number;
  }
  out += " ]\n";
  if (colours.gamma == 1) return out;
  std::snprintf(number, sizeof number, "camera_gamma: %.17e\n", colours.gamma);
  return out + number;
}

}  // namespace

Result<RigPart> read_rig_part(const std::filesystem::path& path) {
  const auto file = StorageFile::open(path, StorageForm::kYaml);
  if (!file) return file.error();
  if (file->has("camera_matrix") || file->has("projector_matrix")) {
    auto rig = read_rig(path);
    if (!rig) return rig.error();
    return RigPart{*rig, rig->scan, rig->frame_rate, colours_of(*rig)};
  }
  if (!file->has("colour_matrix"))
    return Error{path.string() + " is no rig.yaml: it has neither camera_matrix nor colour_matrix"};
  RigPart part;
  CameraColours& colours = part.colours.emplace();
  if (const Status read = file->matrix("colour_matrix", 3, 3, colours.matrix); !read)
    return read.error().in(path.string());
  if (file->has("camera_gamma")) {
    const auto gamma = file->number("camera_gamma");
    if (!gamma || !(*gamma >= 1 && *gamma <= CameraResponse::kMostGamma))
      return Error{path.string() + ": camera_gamma must be a number from 1 to 3"};
    colours.gamma = *gamma;
  }
  return part;
}

std::string to_yaml(const RigPart& part) {
  if (!part.whole) return colour_yaml(*part.colours);
  Rig rig = *part.whole;
  set_colours(*part.colours, rig);
  return to_yaml(rig);
}

}  // namespace relievo
