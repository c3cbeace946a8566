// SPDX-License-Identifier: Apache-2.0
#include "capture/calibrate/rig_part.h"

#include <cstdio>

#include "capture/rig_file.h"
#include "capture/storage_file.h"

namespace relievo {

Result<RigPart> read_rig_part(const std::filesystem::path& path) {
  const auto file = StorageFile::open(path, StorageForm::kYaml);
  if (!file) return file.error();
  if (file->has("camera_matrix") || file->has("projector_matrix")) {
    auto rig = read_rig(path);
    if (!rig) return rig.error();
    return RigPart{*rig, rig->scan, rig->frame_rate, rig->colour_matrix};
  }
  if (!file->has("colour_matrix"))
    return Error{path.string() + " is no rig.yaml: it has neither camera_matrix nor colour_matrix"};
  RigPart part;
  if (const Status read = file->matrix("colour_matrix", 3, 3, part.colour_matrix.emplace()); !read)
    return read.error().in(path.string());
  return part;
}

std::string colour_yaml(const std::array<double, 9>& colour_matrix) {
  std::string out =
      "%YAML:1.0\n---\n# Colour only: relievo-server calibrate geometry --update this-file adds the rest.\n"
      "colour_matrix: !!opencv-matrix\n   rows: 3\n   cols: 3\n   dt: d\n   data: [ ";
  for (std::size_t i = 0; i < colour_matrix.size(); ++i) {
    char number[40];
    std::snprintf(number, sizeof number, "%s%.17e", i ? ", " : "", colour_matrix[i]);
    out += number;
  }
  return out + " ]\n";
}

}  // namespace relievo
