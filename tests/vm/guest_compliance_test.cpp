// SPDX-License-Identifier: Apache-2.0
// In the guest: the suite that every source must pass, over a V4L2 camera.
#include "tests/unit/capture/source_compliance.h"
#include "vivid.h"

namespace relievo::test {
namespace {

std::string camera(const std::filesystem::path& folder) {
  write_small_take(folder, Scan::kInterlaced, 1);  // for its pattern
  return "v4l2:" + kVivid;
}

CameraOptions pictures(const char* field, const char* format) {
  CameraOptions options{.pattern = "FOLDER/pattern.yaml",
                        .projector_width = 64,
                        .projector_height = 48,
                        .input = "2",
                        .standard = "NTSC-M",
                        .format = format,
                        .field = field,
                        .controls = still("100_colorbar")};
  if (options.field == "progressive") {
    options.input = "0";
    options.standard = "";
    options.width = 320;
    options.height = 180;
    options.rate = 60;
  }
  return options;
}

const SourceCase kCases[] = {
    {"V4l2Progressive", false, camera, pictures("progressive", "UYVY")},
    {"V4l2Interlaced", false, camera, pictures("interlaced", "RGB24")},
    {"V4l2Sequential", false, camera, pictures("seq-tb", "YUYV")},
    {"V4l2Alternate", false, camera, pictures("alternate", "RGB24")},
};

INSTANTIATE_TEST_SUITE_P(Cameras, SourceCompliance, testing::ValuesIn(kCases),
                         [](const auto& test) { return std::string(test.param.name); });

}  // namespace
}  // namespace relievo::test
