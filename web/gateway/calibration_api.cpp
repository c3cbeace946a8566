// SPDX-License-Identifier: Apache-2.0
#include "web/gateway/calibration_api.h"

#include <algorithm>
#include <array>
#include <nlohmann/json.hpp>
#include <string>

namespace relievo {
namespace {

constexpr std::array<std::string_view, 8> kActions{"start",     "take", "automatic", "manual",
                                                   "calculate", "more", "keep",      "cancel"};

HttpReply no_rig() {
  return text_reply(404, "there is no camera here: ask the relievo-server that captures the stream");
}

}  // namespace

HttpReply calibration_state(CalibrationControl* control) {
  return control == nullptr ? no_rig() : json_reply(control->report());
}

HttpReply calibration_picture(std::string_view name, CalibrationControl* control) {
  if (control == nullptr) return no_rig();
  constexpr std::string_view kEnding = ".jpg";
  if (name.ends_with(kEnding)) name.remove_suffix(kEnding.size());
  if (name != "camera" && name != "coverage")
    return text_reply(400, "there is no such picture: ask for camera or coverage");
  const auto jpeg = control->picture(std::string(name));
  if (jpeg == nullptr) {
    HttpReply reply = text_reply(503, "there is no picture yet: ask again");
    reply.headers.emplace_back("Retry-After", "1");
    return reply;
  }
  HttpReply reply = text_reply(200, {});
  reply.content_type = "image/jpeg";
  reply.body.assign(jpeg->begin(), jpeg->end());
  return reply;
}

HttpReply order_calibration(const HttpRequest& request, CalibrationControl* control) {
  if (control == nullptr) return no_rig();
  if (!is_json(request)) return text_reply(415, "send application/json");
  const auto order = nlohmann::json::parse(request.body, nullptr, false);
  const auto text = [&](const char* key) {
    const auto value = order.is_object() ? order.value(key, nlohmann::json()) : nlohmann::json();
    return value.is_string() ? value.get<std::string>() : "";
  };
  const CalibrationOrder wanted{text("action"), text("stream"), text("kind"), text("board")};
  const bool known = std::find(kActions.begin(), kActions.end(), wanted.action) != kActions.end();
  const bool whole = wanted.action != "start" ||
                     (!wanted.stream.empty() && (wanted.kind == "colour" || wanted.kind == "geometry"));
  if (!known || !whole)
    return text_reply(
        400, R"(send {"action":"start","stream":"NAME","kind":"colour"}, or kind "geometry" with )"
             R"("board":"chessboard:9x7:25mm"; then action take, automatic, manual, calculate, more, )"
             R"(keep or cancel)");
  const Status done = control->order(wanted);
  return done ? calibration_state(control) : text_reply(409, done.error().message);
}

}  // namespace relievo
