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
};

constexpr SourceKind kSources[] = {
    {"sim:board", "sim:board[:BOARD]", open_board},
    {"sim:sheet", "sim:sheet", open_sheet},
    {"sim:", "sim:SCENE", open_sim},
    {"take:", "take:DIR", open_take},
    {"v4l2:", "v4l2:DEVICE", v4l2::open_camera},
};

}  // namespace

Result<std::unique_ptr<FieldSource>> open_source(const std::string& uri, const SourceOptions& options) {
  std::string usages;
  for (const SourceKind& kind : kSources) {
    if (uri.starts_with(kind.prefix)) return kind.make(uri.substr(kind.prefix.size()), options);
    usages += (usages.empty() ? "" : " or ") + std::string(kind.usage);
  }
  return Error{"source \"" + uri + "\" is of no known kind: give " + usages};
}

}  // namespace relievo
