// SPDX-License-Identifier: Apache-2.0
#include "web/gateway/protocol.h"

#include <cmath>
#include <cstdio>
#include <functional>
#include <nlohmann/json.hpp>

#include "base/time.h"

namespace relievo {
namespace {

using Json = nlohmann::ordered_json;

// Names and messages come from other processes; bytes that are no UTF-8 must not throw.
std::string text_of(const Json& json) {
  return json.dump(-1, ' ', false, Json::error_handler_t::replace);
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
  return {{"scan", to_string(info.rig.scan)},
          {"frame_rate", info.rig.frame_rate},
          {"stripes", info.pattern.stripes()},
          {"slides", info.pattern.slides},
          {"camera", pinhole_json(info.rig.camera)},
          {"projector", pinhole_json(info.rig.projector)},
          {"projector_from_camera_rotation", info.rig.projector_from_camera_rotation},
          {"projector_from_camera_translation", info.rig.projector_from_camera_translation}};
}

Json status_json(const ServerStatus& status) {
  Json filters;
  for (const Filter& filter : kFilters) filters[std::string(filter.name)] = status.filters.*filter.count;
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
          {"filters", filters},
          {"step", step}};
}

void put_u64(std::uint8_t* at, std::uint64_t value) {
  for (int i = 0; i < 8; ++i) at[i] = static_cast<std::uint8_t>(value >> (8 * i));
}

}  // namespace

std::string info_message(const StreamInfo& info) {
  Json json = {
      {"type", "info"}, {"stream", info.stream}, {"source", info.source}, {"started_ns", info.started_ns}};
  json.update(rig_json(info));
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

std::string time_message(double t0, std::int64_t now_ns) {
  return text_of({{"type", "time"}, {"t0", t0}, {"server_ms", milliseconds(now_ns)}});
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
  }
  return message;
}

std::string_view to_string(Refusal refusal) {
  constexpr std::array<std::string_view, kRefusals> kNames{"places",    "address", "rate",   "clients",
                                                           "token",     "origin",  "host",   "tls",
                                                           "malformed", "slow",    "message"};
  return kNames[static_cast<std::size_t>(refusal)];
}

std::string streams_json(const std::vector<StreamSnapshot>& streams, const std::string& hint) {
  Json list = Json::array();
  for (const auto& s : streams) {
    list.push_back({{"name", s.info.stream},
                    {"source", s.info.source},
                    {"started_ns", s.info.started_ns},
                    {"state", s.status ? to_string(s.status->state) : to_string(StreamState::kStarting)},
                    {"frame_rate", s.status ? s.status->frame_rate : 0.0},
                    {"rig", rig_json(s.info)},
                    {"status", s.status ? status_json(*s.status) : Json()},
                    {"clients", s.watchers},
                    {"frames", s.published}});
  }
  return text_of({{"version", RELIEVO_VERSION}, {"hint", hint}, {"streams", std::move(list)}});
}

namespace {

/// Prometheus text format 0.0.4: a family is its HELP and TYPE line, then a line a sample.
class Exposition {
 public:
  void family(const char* name, const char* type, const char* help) {
    name_ = name;
    text_ += std::string("# HELP ") + name + ' ' + help + "\n# TYPE " + name + ' ' + type + '\n';
  }
  void sample(const std::string& labels, double value) {
    char number[40];
    std::snprintf(number, sizeof number, "%.17g", std::isfinite(value) ? value : 0.0);
    text_ += name_ + labels + ' ' + number + '\n';
  }
  std::string take() { return std::move(text_); }

 private:
  std::string name_, text_;
};

// Stream names are [A-Za-z0-9_.-] by contract, but they arrive over a network.
std::string label(const std::string& value) {
  std::string out;
  for (const char c : value) {
    if (c == '\n') {
      out += "\\n";
      continue;
    }
    if (c == '\\' || c == '"') out += '\\';
    out += c;
  }
  return "\"" + out + "\"";
}

}  // namespace

std::string metrics_text(const std::vector<StreamSnapshot>& streams, const GatewayCounts& counts) {
  Exposition out;
  out.family("relievo_gateway_clients", "gauge", "WebSocket clients connected.");
  out.sample("", counts.clients);
  out.family("relievo_gateway_connections_total", "counter", "TCP connections accepted.");
  out.sample("", static_cast<double>(counts.connections));
  out.family("relievo_gateway_requests_total", "counter", "HTTP requests answered.");
  out.sample("", static_cast<double>(counts.requests));
  out.family("relievo_gateway_refused_total", "counter", "Who was turned away, by the reason.");
  for (std::size_t i = 0; i < kRefusals; ++i) {
    out.sample("{reason=\"" + std::string(to_string(static_cast<Refusal>(i))) + "\"}",
               static_cast<double>(counts.refused[i]));
  }

  const auto per_stream = [&](const char* name, const char* type, const char* help, auto value) {
    out.family(name, type, help);
    for (const auto& s : streams) {
      out.sample("{stream=" + label(s.info.stream) + "}", static_cast<double>(value(s)));
    }
  };
  using S = const StreamSnapshot&;
  per_stream("relievo_gateway_stream_clients", "gauge", "WebSocket clients watching the stream.",
             [](S s) { return s.watchers; });
  per_stream("relievo_gateway_frames_total", "counter", "Frames that reached the gateway.",
             [](S s) { return s.published; });
  per_stream("relievo_gateway_frames_sent_total", "counter", "Frames sent to clients.",
             [](S s) { return s.sent; });
  per_stream("relievo_gateway_sent_bytes_total", "counter", "Bytes of frames sent to clients.",
             [](S s) { return s.sent_bytes; });
  per_stream("relievo_gateway_client_drops_total", "counter", "Frames a client had no credit for.",
             [](S s) { return s.client_drops; });
  per_stream("relievo_gateway_key_requests_total", "counter",
             "Key frames asked for, for clients that wait for one.", [](S s) { return s.key_requests; });

  const auto per_status = [&](const char* name, const char* type, const char* help, auto value) {
    out.family(name, type, help);
    for (const auto& s : streams) {
      if (!s.status) continue;
      out.sample("{stream=" + label(s.info.stream) + "}", static_cast<double>(value(*s.status)));
    }
  };
  using T = const ServerStatus&;
  per_status("relievo_stream_frame_rate", "gauge", "Frames published a second.",
             [](T s) { return s.frame_rate; });
  per_status("relievo_stream_frames_captured_total", "counter", "Frames captured.",
             [](T s) { return s.frames_captured; });
  per_status("relievo_stream_frames_published_total", "counter", "Frames published.",
             [](T s) { return s.frames_published; });
  per_status("relievo_stream_reconstruct_seconds", "gauge", "Median time to reconstruct a frame.",
             [](T s) { return s.reconstruct_ms * 1e-3; });
  per_status("relievo_stream_encode_seconds", "gauge", "Median time to encode a frame.",
             [](T s) { return s.encode_ms * 1e-3; });
  per_status("relievo_stream_latency_seconds", "gauge", "Median time from capture to publication.",
             [](T s) { return s.latency_ms * 1e-3; });
  per_status("relievo_stream_bits_per_second", "gauge", "Of frames, over the last few seconds.",
             [](T s) { return s.bit_rate; });
  per_status("relievo_stream_rate_level", "gauge",
             "How much coarser than asked for, to keep a bit rate; 0 not at all.",
             [](T s) { return s.rate_level; });

  out.family("relievo_stream_drops_total", "counter", "Frames the server lost, by place.");
  for (const auto& s : streams) {
    if (!s.status) continue;
    const std::string head = "{stream=" + label(s.info.stream) + ",place=";
    out.sample(head + "\"capture\"}", static_cast<double>(s.status->drops_capture));
    out.sample(head + "\"reconstruct\"}", static_cast<double>(s.status->drops_reconstruct));
    out.sample(head + "\"encode\"}", static_cast<double>(s.status->drops_encode));
    out.sample(head + "\"publish\"}", static_cast<double>(s.status->drops_publish));
  }
  out.family("relievo_stream_filters_total", "counter",
             "What each filter of the reconstruction did: points, pixels or triangles.");
  for (const auto& s : streams) {
    if (!s.status) continue;
    for (const Filter& filter : kFilters) {
      out.sample("{stream=" + label(s.info.stream) + ",filter=\"" + std::string(filter.name) + "\"}",
                 static_cast<double>(s.status->filters.*filter.count));
    }
  }
  per_status("relievo_stream_mixed_total", "counter",
             "Frames dropped because each exposure was under two slides; among the drops in capture.",
             [](T s) { return s.step.mixed; });
  per_status("relievo_stream_regrouped_total", "counter",
             "Frames made of one's second and the next one's first exposure.",
             [](T s) { return s.step.regrouped; });
  const auto per_step = [&](const char* name, const char* help, std::optional<double> StepStatus::*value) {
    out.family(name, "gauge", help);
    for (const auto& s : streams) {
      if (s.status && s.status->step.*value)
        out.sample("{stream=" + label(s.info.stream) + "}", *(s.status->step.*value));
    }
  };
  per_step("relievo_stream_step_phase", "Of the exposures in the slides' time, 0 to 2; 0 is in step.",
           &StepStatus::phase);
  per_step("relievo_stream_step_drift", "Fields a second that the projector gains on the camera.",
           &StepStatus::drift_fields_s);
  out.family("relievo_stream_state", "gauge", "1 for the state the stream is in.");
  for (const auto& s : streams) {
    if (!s.status) continue;
    for (const auto state :
         {StreamState::kStarting, StreamState::kRunning, StreamState::kStalled, StreamState::kEnded}) {
      out.sample("{stream=" + label(s.info.stream) + ",state=\"" + std::string(to_string(state)) + "\"}",
                 s.status->state == state ? 1 : 0);
    }
  }
  return out.take();
}

}  // namespace relievo
