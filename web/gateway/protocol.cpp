// SPDX-License-Identifier: Apache-2.0
#include "web/gateway/protocol.h"

#include <algorithm>
#include <nlohmann/json.hpp>

#include "base/json_text.h"
#include "base/time.h"

namespace relievo {
namespace {

using Json = nlohmann::ordered_json;

// Names and messages come from other processes; bytes that are no UTF-8 must not throw.
std::string text_of(const Json& json) {
  return json_line(json);
}

Json pinhole_json(const PinholeModel& model) {
  return {{"width", model.width},
          {"height", model.height},
          {"fx", model.fx()},
          {"fy", model.fy()},
          {"cx", model.cx()},
          {"cy", model.cy()},
          {"distortion", model.distortion}};
}

Json rig_json(const StreamInfo& info) {
  Json json = {{"scan", to_string(info.rig.scan)},
               {"frame_rate", info.rig.frame_rate},
               {"stripes", info.pattern.stripes()},
               {"slides", info.pattern.slides},
               {"camera", pinhole_json(info.rig.camera)},
               {"projector", pinhole_json(info.rig.projector)},
               {"projector_from_camera_rotation", info.rig.projector_from_camera_rotation},
               {"projector_from_camera_translation", info.rig.projector_from_camera_translation}};
  if (info.rig.stereo_rms_px > 0) json["stereo_rms_px"] = info.rig.stereo_rms_px;
  if (info.rig.scale_error > 0) json["scale_error"] = info.rig.scale_error;
  if (const auto& pose = info.rig.world_from_camera) {
    json["world_from_camera_rotation"] = pose->rotation;
    json["world_from_camera_translation"] = pose->translation;
  }
  return json;
}

Json status_json(const ServerStatus& status) {
  Json filters;
  for (const Filter& filter : kFilters) filters[std::string(filter.name)] = status.filters.*filter.count;
  Json rungs = Json::array();
  for (const RungStatus& rung : status.rungs)
    rungs.push_back({{"quality", to_string(rung.rung)},
                     {"readers", rung.readers},
                     {"frames", rung.frames},
                     {"drops", rung.drops},
                     {"encode_ms", rung.encode_ms},
                     {"bit_rate", rung.bit_rate}});
  Json step = {{"mixed", status.step.mixed},
               {"regrouped", status.step.regrouped},
               {"phase", nullptr},
               {"drift_fields_s", nullptr}};
  if (status.step.phase) step["phase"] = *status.step.phase;
  if (status.step.drift_fields_s) step["drift_fields_s"] = *status.step.drift_fields_s;
  return {{"time_ns", status.time_ns},
          {"state", to_string(status.state)},
          {"message", status.message},
          {"frame_rate", status.frame_rate},
          {"frames_captured", status.frames_captured},
          {"frames_published", status.frames_published},
          {"drops_capture", status.drops_capture},
          {"drops_reconstruct", status.drops_reconstruct},
          {"drops_encode", status.drops_encode},
          {"drops_publish", status.drops_publish},
          {"reconstruct_ms", status.reconstruct_ms},
          {"encode_ms", status.encode_ms},
          {"latency_ms", status.latency_ms},
          {"bit_rate", status.bit_rate},
          {"rate_level", status.rate_level},
          {"rungs", rungs},
          {"filters", filters},
          {"step", step}};
}

Json recording_json(const RecordingState& state) {
  return {{"state", to_string(state.activity)},
          {"file", state.file},
          {"frames", state.frames},
          {"lost", state.lost},
          {"bytes", state.bytes},
          {"whole_bytes", state.whole_bytes},
          {"started_ns", state.started_ns},
          {"pre_roll_s", state.pre_roll_s},
          {"message", state.message}};
}

void put_u64(std::uint8_t* at, std::uint64_t value) {
  for (int i = 0; i < 8; ++i) at[i] = static_cast<std::uint8_t>(value >> (8 * i));
}

}  // namespace

std::string info_message(const StreamInfo& info) {
  Json json = {
      {"type", "info"}, {"stream", info.stream}, {"source", info.source}, {"started_ns", info.started_ns}};
  json.update(rig_json(info));
  // All there is to know, so that a page can write a recording.
  json["field_order"] = to_string(info.rig.field_order);
  json["colour_matrix"] = info.rig.colour_matrix;
  json["camera_gamma"] = info.rig.camera_gamma;
  json["pattern"] = {{"base", info.pattern.base},
                     {"slides", info.pattern.slides},
                     {"palette", info.pattern.palette},
                     {"sequence", info.pattern.sequence},
                     {"scheme", to_string(info.pattern.scheme)}};
  return text_of(json);
}

std::string status_message(const ServerStatus& status) {
  Json json = {{"type", "status"}};
  json.update(status_json(status));
  return text_of(json);
}

std::string waiting_message(const std::string& hint) {
  return text_of({{"type", "waiting"}, {"hint", hint}});
}

std::string gone_message() {
  return R"({"type":"gone"})";
}

std::string quality_message(Rung now, const std::vector<Rung>& lower) {
  Json of = Json::array({to_string(Rung::kFull)});
  for (const Rung rung : lower) of.push_back(to_string(rung));
  return text_of({{"type", "quality"}, {"now", to_string(now)}, {"of", std::move(of)}});
}

std::string time_message(double t0, std::optional<std::int64_t> now_ns) {
  return text_of(
      {{"type", "time"}, {"t0", t0}, {"server_ms", now_ns ? Json(milliseconds(*now_ns)) : Json()}});
}

std::array<std::uint8_t, kFramePrefixBytes> frame_prefix(const FrameMessage& frame, std::uint64_t drops,
                                                         std::int64_t sent_time_ns) {
  std::array<std::uint8_t, kFramePrefixBytes> out{};
  put_u64(out.data(), kFramePrefixBytes);  // u32 length, u32 reserved
  put_u64(out.data() + 8, frame.sequence);
  put_u64(out.data() + 16, static_cast<std::uint64_t>(frame.capture_time_ns));
  put_u64(out.data() + 24, static_cast<std::uint64_t>(frame.publish_time_ns));
  put_u64(out.data() + 32, static_cast<std::uint64_t>(sent_time_ns));
  put_u64(out.data() + 40, drops);
  return out;
}

Result<ClientMessage> parse_client_message(std::string_view text) {
  // Nesting is bounded by the caller's message size limit of a few kilobytes.
  const auto json = nlohmann::json::parse(text, nullptr, false);
  if (!json.is_object()) return Error{"not a JSON object"};
  const auto type = json.find("type");
  if (type == json.end() || !type->is_string()) return Error{"no \"type\""};
  ClientMessage message;
  if (*type == "credit") {
    const auto n = json.find("n");
    if (n == json.end() || !n->is_number_integer()) return Error{"credit without an integer \"n\""};
    const bool in_range =
        n->is_number_unsigned() && n->get<std::uint64_t>() >= 1 && n->get<std::uint64_t>() <= kMaxCredit;
    if (!in_range) return Error{"credit must be 1.." + std::to_string(kMaxCredit)};
    message.type = ClientMessage::Type::kCredit;
    message.credit = n->get<int>();
  } else if (*type == "time") {
    const auto t0 = json.find("t0");
    if (t0 == json.end() || !t0->is_number()) return Error{"time without a number \"t0\""};
    message.type = ClientMessage::Type::kTime;
    message.t0 = t0->get<double>();
  } else if (*type == "quality") {
    const auto want = json.find("want");
    const std::string name = want != json.end() && want->is_string() ? want->get<std::string>() : "";
    for (const Rung rung : kWebRungs)
      if (to_string(rung) == name) message.want = rung;
    if (!message.want && name != "auto")
      return Error{"quality without a \"want\" of auto, full, reduced or texture"};
    if (const auto textures = json.find("textures"); textures != json.end()) {
      if (!textures->is_array()) return Error{"quality whose \"textures\" are no list of codecs"};
      message.video = std::find(textures->begin(), textures->end(), "h264") != textures->end();
    }
    message.type = ClientMessage::Type::kQuality;
  }
  return message;
}

std::string recording_message(const RecordingState& state) {
  return text_of(recording_json(state));
}

std::string recording_event(const RecordingState& state) {
  Json json = {{"type", "recording"}};
  json.update(recording_json(state));
  return text_of(json);
}

std::string streams_json(const std::vector<StreamSnapshot>& streams, const std::string& hint) {
  Json list = Json::array();
  for (const auto& s : streams) {
    Json clients_of;
    for (const Rung rung : kWebRungs)
      clients_of[std::string(to_string(rung))] = s.watchers_of[static_cast<std::size_t>(rung)];
    list.push_back(
        {{"name", s.info.stream},
         {"source", s.info.source},
         {"started_ns", s.info.started_ns},
         {"state", s.status ? to_string(s.status->state) : to_string(StreamState::kStarting)},
         {"frame_rate", s.status ? s.status->frame_rate : 0.0},
         {"rig", rig_json(s.info)},
         {"status", s.status ? status_json(*s.status) : Json()},
         {"recording", s.recording.readable() ? Json("recordings/" + s.info.stream + ".mcap") : Json()},
         {"growing_bytes", s.recording.growing_bytes() ? Json(*s.recording.growing_bytes()) : Json()},
         {"recorder", s.recorded ? recording_json(*s.recorded) : Json()},
         {"camera", s.looked_at},
         {"clients", s.watchers},
         {"clients_of", std::move(clients_of)},
         {"frames", s.published}});
  }
  return text_of(
      {{"version", RELIEVO_VERSION}, {"hint", streams.empty() ? hint : ""}, {"streams", std::move(list)}});
}

}  // namespace relievo
