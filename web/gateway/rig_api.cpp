// SPDX-License-Identifier: Apache-2.0
#include "web/gateway/rig_api.h"

#include <algorithm>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "base/json_text.h"
#include "web/gateway/request_target.h"

namespace relievo {
namespace {

HttpReply no_rig() {
  return text_reply(404, "there is no camera here: ask the relievo-server that captures the stream");
}

HttpReply no_stream() {
  return text_reply(404, "there is no such stream here");
}

HttpReply no_picture(std::string_view name) {
  std::string names;
  for (const RigPicture& picture : kRigPictures)
    names += (names.empty() ? "" : ", ") + std::string(picture.name);
  const bool plain = std::all_of(name.begin(), name.end(), [](char c) { return c >= ' ' && c <= '~'; });
  return text_reply(400, "there is no " +
                             (plain ? "picture '" + std::string(name.substr(0, 64)) + "'" : "such picture") +
                             ": ask for " + names);
}

bool is_picture(std::string_view name) {
  return std::any_of(kRigPictures.begin(), kRigPictures.end(),
                     [&](const RigPicture& p) { return p.name == name; });
}

/// The value of pictures= in a target's query, empty where there is none.
std::string pictures_in(std::string_view target) {
  constexpr std::string_view kName = "pictures=";
  for (auto query = query_of(target); !query.empty();) {
    const std::string_view one = query.substr(0, query.find('&'));
    if (one.starts_with(kName)) return percent_decoded(one.substr(kName.size()));
    query.remove_prefix(std::min(one.size() + 1, query.size()));
  }
  return {};
}

}  // namespace

HttpReply rig_look(std::string_view stream, const HttpRequest& request, RigControl* control) {
  if (control == nullptr) return no_rig();
  std::vector<std::string> wanted;
  const std::string pictures = pictures_in(request.target);
  for (std::string_view list = pictures; !list.empty();) {
    const std::string_view name = list.substr(0, list.find(','));
    if (!is_picture(name)) return no_picture(name);
    wanted.emplace_back(name);
    list = list.substr(std::min(name.size() + 1, list.size()));
  }
  const auto view = control->look(std::string(stream), wanted);
  if (!view) return no_stream();
  return json_reply(*view ? (*view)->report : R"({"state":"waiting"})");
}

HttpReply rig_picture(std::string_view stream_and_name, RigControl* control) {
  if (control == nullptr) return no_rig();
  constexpr std::string_view kEnding = ".jpg";
  const auto slash = stream_and_name.find('/');
  std::string_view name = stream_and_name.substr(slash + 1);
  if (name.ends_with(kEnding)) name.remove_suffix(kEnding.size());
  if (!is_picture(name)) return no_picture(name);
  const auto view = control->look(std::string(stream_and_name.substr(0, slash)), {std::string(name)});
  if (!view) return no_stream();
  const auto drawn = *view ? (*view)->pictures.find(name) : decltype((*view)->pictures.end()){};
  if (!*view || drawn == (*view)->pictures.end()) {
    HttpReply reply = text_reply(503, "the picture is made of the next frame: ask again");
    reply.headers.emplace_back("Retry-After", "1");
    return reply;
  }
  HttpReply reply = text_reply(200, {});
  reply.content_type = "image/jpeg";
  reply.body.assign(drawn->second.begin(), drawn->second.end());
  return reply;
}

HttpReply projector_state(const RigControl* control) {
  if (control == nullptr) return no_rig();
  const ProjectorState state = control->projector();
  const nlohmann::ordered_json out{{"state", to_string(state.activity)},
                                   {"output", state.output},
                                   {"stream", state.stream},
                                   {"show", state.shows},
                                   {"message", state.message}};
  return json_reply(json_line(out));
}

HttpReply order_projector(const HttpRequest& request, RigControl* control) {
  if (control == nullptr) return no_rig();
  if (!is_json(request)) return text_reply(415, "send application/json");
  const auto order = nlohmann::json::parse(request.body, nullptr, false);
  const auto text = [&](const char* key, const char* otherwise) {
    const auto value = order.is_object() ? order.value(key, nlohmann::json()) : nlohmann::json();
    return value.is_string() ? value.get<std::string>() : value.is_null() ? otherwise : "";
  };
  const std::string action = text("action", ""), stream = text("stream", "");
  if ((action != "start" || stream.empty()) && action != "stop")
    return text_reply(400,
                      R"(send {"action":"start","stream":"NAME","show":"pattern"} or {"action":"stop"})");
  if (control->projector().activity == ProjectorActivity::kNone)
    return text_reply(404, control->projector().message);
  const Status done =
      action == "start" ? control->project(stream, text("show", "pattern")) : control->stop_projecting();
  return done ? projector_state(control) : text_reply(409, done.error().message);
}

}  // namespace relievo
