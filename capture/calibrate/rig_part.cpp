// SPDX-License-Identifier: Apache-2.0
#include "capture/calibrate/rig_part.h"

#include <algorithm>
#include <cstdio>
#include <opencv2/core.hpp>

#include "capture/rig_file.h"
#include "capture/storage_text.h"

namespace relievo {

Result<RigPart> read_rig_part(const std::filesystem::path& file) {
  const std::string name = file.string();
  const auto text = read_storage_text(file, StorageForm::kYaml);
  if (!text) return text.error();
  RigPart part;
  try {
    const cv::FileStorage storage(*text, cv::FileStorage::READ | cv::FileStorage::MEMORY);
    if (!storage.isOpened()) return Error{name + " is empty"};
    if (!storage["camera_matrix"].empty() || !storage["projector_matrix"].empty()) {
      auto rig = read_rig(file);
      if (!rig) return rig.error();
      return RigPart{*rig, rig->scan, rig->frame_rate, rig->colour_matrix};
    }
    if (const cv::FileNode colour = storage["colour_matrix"]; !colour.empty()) {
      cv::Mat matrix = colour.mat();
      if (matrix.rows != 3 || matrix.cols != 3 || matrix.channels() != 1) {
        return Error{name + ": colour_matrix must be a 3 x 3 !!opencv-matrix"};
      }
      matrix.convertTo(matrix, CV_64F);
      part.colour_matrix.emplace();
      std::copy(matrix.begin<double>(), matrix.end<double>(), part.colour_matrix->begin());
    }
  } catch (const cv::Exception& e) {
    return Error{name + " is no valid YAML: " + e.err};
  } catch (const std::exception& e) {
    return Error{name + " cannot be read: " + e.what()};
  }
  if (!part.colour_matrix)
    return Error{name + " is no rig.yaml: it has neither camera_matrix nor colour_matrix"};
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
