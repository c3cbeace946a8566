// SPDX-License-Identifier: Apache-2.0
// A take of a few small pictures in a temporary folder, and the folder itself.
#pragma once

#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <random>
#include <string>

#include "base/pattern.h"
#include "base/rig.h"
#include "capture/source/take_files.h"

namespace relievo::test {

/// Removed with all in it at the end.
class TempFolder {
 public:
  TempFolder() {
    static int count = 0;
    path_ = std::filesystem::temp_directory_path() /
            ("relievo-test-" + std::to_string(getpid()) + "-" + std::to_string(count++));
    std::filesystem::create_directories(path_);
  }
  TempFolder(const TempFolder&) = delete;
  TempFolder& operator=(const TempFolder&) = delete;
  ~TempFolder() {
    std::error_code code;
    std::filesystem::remove_all(path_, code);
  }
  const std::filesystem::path& path() const { return path_; }

 private:
  std::filesystem::path path_;
};

inline void write_text(const std::filesystem::path& file, const std::string& text) {
  std::ofstream(file, std::ios::binary) << text;
}

inline std::string read_text(const std::filesystem::path& file) {
  std::ifstream in(file, std::ios::binary);
  return {std::istreambuf_iterator<char>(in), {}};
}

inline Rig small_rig(Scan scan) {
  Rig rig;
  rig.scan = scan;
  rig.frame_rate = 29.97;
  rig.camera = {32, 16, {50, 0, 15.5, 0, 50, 7.5, 0, 0, 1}, {}};
  rig.projector = {64, 48, {90, 0, 31.5, 0, 90, 23.5, 0, 0, 1}, {}};
  rig.projector_from_camera_rotation = {1, 0, 0, 0, 1, 0, 0, 0, 1};
  rig.projector_from_camera_translation = {-0.2, 0, 0};
  rig.colour_matrix = {1.2, -0.1, 0, -0.2, 1.3, -0.1, 0, -0.2, 1.2};
  return rig;
}

inline Pattern small_pattern() {
  return {6, 2, {1, 2, 4, 6, 5, 3}, {0, 7, 14, 21, 28, 35, 0, 8, 15}};
}

/// The value that picture `index` holds at element `i`.
inline std::uint8_t small_pixel(std::size_t index, std::size_t i) {
  return static_cast<std::uint8_t>(index * 37 + i * 11 + i / 7);
}

/// `frames` frames 1 / 29.97 s apart.
inline void write_small_take(const std::filesystem::path& take, Scan scan, int frames) {
  std::filesystem::create_directories(take / "frames");
  const Rig rig = small_rig(scan);
  write_text(take / "rig.yaml", to_yaml(rig));
  write_text(take / "pattern.yaml", to_yaml(small_pattern()));
  std::string stamps = "frame,time_s\n";
  const int pictures = scan == Scan::kProgressive ? 2 : 1;
  for (int t = 0; t < frames; ++t) {
    stamps += std::to_string(t) + "," + std::to_string(t / 29.97) + "\n";
    for (int p = 0; p < pictures; ++p) {
      const auto index = static_cast<std::size_t>(t * pictures + p);
      Image8 image(rig.camera.width, rig.camera.height, 3);
      for (std::size_t i = 0; i < image.size(); ++i) image.data()[i] = small_pixel(index, i);
      ASSERT_TRUE(write_picture(take_picture(take, index), image));
    }
  }
  write_text(take / "timestamps.csv", stamps);
}

}  // namespace relievo::test
