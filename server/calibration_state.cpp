// SPDX-License-Identifier: Apache-2.0
#include "server/calibration_state.h"

#include <nlohmann/json.hpp>

#include "base/json_text.h"

namespace relievo {
namespace {

std::string_view name_of(CalibrationPhase phase) {
  switch (phase) {
    case CalibrationPhase::kOff:
      return "off";
    case CalibrationPhase::kPausing:
      return "pausing";
    case CalibrationPhase::kWatching:
      return "watching";
    case CalibrationPhase::kBusy:
      return "busy";
    case CalibrationPhase::kSolved:
      return "solved";
  }
  return "off";
}

}  // namespace

std::string to_json(const CalibrationState& s) {
  using Json = nlohmann::ordered_json;
  Json views = Json::array();
  for (const TakenView& view : s.views)
    views.push_back({{"name", view.name}, {"used", view.used}, {"says", view.says}});
  const Json out{{"state", name_of(s.phase)},
                 {"stream", s.stream},
                 {"kind", s.kind},
                 {"board", s.board},
                 {"next", s.next},
                 {"message", s.message},
                 {"failed", s.failed},
                 {"at_rest", s.at_rest},
                 {"cycle", s.cycle},
                 {"armed", s.armed},
                 {"automatic", s.automatic},
                 {"can_calculate", s.can_solve},
                 {"enough", s.enough},
                 {"views", std::move(views)},
                 {"result", s.result.empty() ? Json() : Json::parse(s.result, nullptr, false)},
                 {"file", s.file},
                 {"file_before", s.old},
                 {"coverage", s.coverage != nullptr},
                 {"tilts", s.tilts}};
  return json_line(out);
}

}  // namespace relievo
