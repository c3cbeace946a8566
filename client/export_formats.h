// SPDX-License-Identifier: Apache-2.0
// What `relievo export` can write, each a row of a table.
#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <span>
#include <string>

#include "base/frame3d.h"
#include "base/result.h"
#include "base/rig.h"

namespace relievo {

struct ExportTarget {
  std::filesystem::path out;  // the folder, which is made with the first frame, or the one file
  std::string stream;         // its name
  std::optional<Rig> rig;     // nothing where the recording has no description
  double depth_unit_m = 1e-3;
  bool reencode = false;  // of video: even what could be copied
  bool draco = false;     // of formats that have it
};

/// One thread.
class ExportWriter {
 public:
  virtual ~ExportWriter() = default;
  /// Frames in the order of their times, each with the bytes that it was decoded from.
  virtual Status add(const Frame3D& frame, std::span<const std::uint8_t> bytes) = 0;
  /// After the last frame; at least one was added. What is one file appears now.
  virtual Status finish() { return {}; }
};

struct ExportFormat {
  const char* name;
  bool is_one_file;
  bool has_draco;
  Result<std::unique_ptr<ExportWriter>> (*make)(const ExportTarget& target);
};
std::span<const ExportFormat> export_formats();

}  // namespace relievo
