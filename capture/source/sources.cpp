// SPDX-License-Identifier: Apache-2.0
// The table of sources: a new one is a pair of files, a row here and an instance of the compliance suite.
#include <string>
#include <string_view>

#include "capture/calibrate/board_source.h"
#include "capture/source/field_source.h"
#include "capture/source/sim/sim_source.h"
#include "capture/source/take_source.h"
#include "capture/source/v4l2/camera_source.h"

namespace relievo {
namespace {

struct SourceKind {
  std::string_view prefix;
  std::string_view usage;
  Result<std::unique_ptr<FieldSource>> (*make)(const std::string& rest, const SourceOptions& options);
  Status (*check)(const std::string& rest);
};

/// What a folder or a device is called can only be told by looking.
Status check_nothing(const std::string&) {
  return {};
}

constexpr SourceKind kSources[] = {
    {"sim:board", "sim:board[:BOARD]", open_board, check_board},
    {"sim:sheet", "sim:sheet", open_sheet, check_sheet},
    {"sim:", "sim:SCENE", open_sim, check_sim},
    {"take:", "take:DIR", open_take, check_nothing},
    {"v4l2:", "v4l2:DEVICE", v4l2::open_camera, check_nothing},
};

Result<const SourceKind*> kind_of(const std::string& uri) {
  std::string usages;
  for (const SourceKind& kind : kSources) {
    if (uri.starts_with(kind.prefix)) return &kind;
    usages += (usages.empty() ? "" : " or ") + std::string(kind.usage);
  }
  return Error{"source \"" + uri + "\" is of no known kind: give " + usages};
}

}  // namespace

Result<std::unique_ptr<FieldSource>> open_source(const std::string& uri, const SourceOptions& options) {
  const auto kind = kind_of(uri);
  return kind ? (*kind)->make(uri.substr((*kind)->prefix.size()), options) : kind.error();
}

Status check_source(const std::string& uri) {
  const auto kind = kind_of(uri);
  return kind ? (*kind)->check(uri.substr((*kind)->prefix.size())) : kind.error();
}

}  // namespace relievo
