// SPDX-License-Identifier: Apache-2.0
// /metrics. Pure.
#include <cmath>
#include <cstdio>

#include "base/time.h"
#include "web/gateway/protocol.h"

namespace relievo {

std::string_view to_string(Refusal refusal) {
  constexpr std::array<std::string_view, kRefusals> kNames{"places",    "address", "rate",   "clients",
                                                           "token",     "origin",  "host",   "tls",
                                                           "malformed", "slow",    "message"};
  return kNames[static_cast<std::size_t>(refusal)];
}

namespace {

/// Prometheus text format 0.0.4: a family is its HELP and TYPE line, then a line a sample.
class Exposition {
 public:
  void family(const char* name, std::string_view type, const char* help) {
    name_ = name;
    text_ += std::string("# HELP ") + name + ' ' + help + "\n# TYPE " + name + ' ' + std::string(type) + '\n';
  }
  void sample(const std::string& labels, double value) { line("", labels, value); }
  /// `labels` without braces.
  void histogram(const std::string& labels, const Histogram& h) {
    std::uint64_t below = 0;
    for (std::size_t i = 0; i < h.counts.size(); ++i) {
      below += h.counts[i];
      char bound[24] = "+Inf";
      if (i < Histogram::kBounds_s.size()) std::snprintf(bound, sizeof bound, "%g", Histogram::kBounds_s[i]);
      line("_bucket", "{" + labels + ",le=\"" + bound + "\"}", static_cast<double>(below));
    }
    line("_sum", "{" + labels + "}", h.sum_s);
    line("_count", "{" + labels + "}", static_cast<double>(below));
  }
  std::string take() { return std::move(text_); }

 private:
  void line(const char* suffix, const std::string& labels, double value) {
    char number[40];
    std::snprintf(number, sizeof number, "%.17g", std::isfinite(value) ? value : 0.0);
    text_ += name_ + suffix + labels + ' ' + number + '\n';
  }

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

/// What clients over DDS told the server of themselves.
void write_clients(Exposition& out, const std::vector<StreamSnapshot>& streams) {
  const auto each = [&](const char* name, const char* type, const char* help, const auto& write) {
    out.family(name, type, help);
    for (const auto& s : streams) {
      if (!s.stages) continue;
      for (const ClientReport& client : s.stages->clients.clients) {
        char id[20];
        std::snprintf(id, sizeof id, "%016llx", static_cast<unsigned long long>(client.id));
        write("stream=" + label(s.info.stream) + ",client=" + label(client.client) + ",id=\"" + id + '"',
              client);
      }
    }
  };
  each("relievo_client_decode_seconds", "histogram", "What decoding a frame takes a client over DDS.",
       [&](const std::string& of, const ClientReport& client) { out.histogram(of, client.decode); });
  each(
      "relievo_client_latency_seconds", "histogram",
      "From a frame's capture until a client over DDS had decoded it, with the clocks' difference taken out.",
      [&](const std::string& of, const ClientReport& client) { out.histogram(of, client.decoded_after); });
  each("relievo_client_lost_total", "counter", "Frames lost on the way to a client over DDS.",
       [&](const std::string& of, const ClientReport& client) {
         out.sample("{" + of + "}", static_cast<double>(client.lost));
       });
  each("relievo_client_skipped_total", "counter",
       "Frames that a client over DDS could not decode, as those that build on a lost one.",
       [&](const std::string& of, const ClientReport& client) {
         out.sample("{" + of + "}", static_cast<double>(client.skipped));
       });
}

/// Of streams that are made in this process.
void write_stages(Exposition& out, const std::vector<StreamSnapshot>& streams) {
  const auto each = [&](const char* name, const char* type, const char* help, const auto& write) {
    out.family(name, type, help);
    for (const auto& s : streams)
      if (s.stages) write("stream=" + label(s.info.stream), *s.stages);
  };
  out.family("relievo_stream_info", "gauge", "1, for how the stream is projected and decoded.");
  for (const auto& s : streams)
    if (s.stages)
      out.sample("{stream=" + label(s.info.stream) + ",scheme=\"" +
                     std::string(to_string(s.info.pattern.scheme)) + "\",decoder=\"" +
                     std::string(s.stages->decoder) + "\"}",
                 1);
  each("relievo_stream_line_stride", "gauge",
       "Every so many of the camera's detection lines are reconstructed.",
       [&](const std::string& stream, const StageTimes& times) {
         out.sample("{" + stream + "}", static_cast<double>(times.line_stride));
       });
  each("relievo_stage_seconds", "histogram",
       "What each stage takes for a frame, without waiting for it; decode: at the clients over DDS.",
       [&](const std::string& stream, const StageTimes& times) {
         out.histogram(stream + ",stage=\"reconstruct\"", times.reconstruct);
         out.histogram(stream + ",stage=\"encode_geometry\"", times.encode_geometry);
         out.histogram(stream + ",stage=\"encode_texture\"", times.encode_texture);
         out.histogram(stream + ",stage=\"publish\"", times.publish);
         out.histogram(stream + ",stage=\"decode\"", times.clients.decode);
       });
  each("relievo_stage_waiting", "gauge", "Frames that wait before a stage.",
       [&](const std::string& stream, const StageTimes& times) {
         const auto depth = [&](const char* stage, std::size_t frames) {
           out.sample("{" + stream + ",stage=\"" + stage + "\"}", static_cast<double>(frames));
         };
         depth("reconstruct", times.waiting_reconstruct);
         depth("encode", times.waiting_encode);
         depth("publish", times.waiting_publish);
       });
  each("relievo_stream_sent_again_bytes_total", "counter",
       "Bytes of frames that DDS readers asked for again.",
       [&](const std::string& stream, const StageTimes& times) {
         out.sample("{" + stream + "}", static_cast<double>(times.sent_again_bytes));
       });
  write_clients(out, streams);
}

}  // namespace

std::string metrics_text(const std::vector<StreamSnapshot>& streams, const GatewayCounts& counts,
                         const RefusedPeers& peers) {
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

  out.family("relievo_gateway_certificate_expiry_seconds", "gauge",
             "Until when the certificate that browsers are shown is valid, as Unix time.");
  if (counts.certificate_expiry_s) out.sample("", static_cast<double>(*counts.certificate_expiry_s));

  out.family(
      "relievo_dds_refused_total", "counter",
      "DDS peers turned away: handshakes that failed (a peer tries again and again), and readers without "
      "keys of a secured stream.");
  out.sample("{reason=\"handshake\"}", static_cast<double>(peers.handshakes));
  out.sample("{reason=\"plain\"}", static_cast<double>(peers.plain));

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

  out.family(
      "relievo_gateway_latency_seconds", "histogram",
      "From a frame's capture until it was published, was here, was handed to a client's connection, and the "
      "client had taken it: asked for another in its place, as the viewer does when it draws it.");
  for (const auto& s : streams) {
    const std::string head = "stream=" + label(s.info.stream) + ",until=";
    out.histogram(head + "\"published\"", s.published_after);
    out.histogram(head + "\"here\"", s.here_after);
    out.histogram(head + "\"sent\"", s.sent_after);
    out.histogram(head + "\"taken\"", s.taken_after);
  }

  out.family("relievo_recording_state", "gauge", "1 for what the stream's recording on request is doing.");
  for (const auto& s : streams) {
    if (!s.recorded) continue;
    for (const auto a : {RecordingActivity::kOff, RecordingActivity::kRecording, RecordingActivity::kFailed})
      out.sample("{stream=" + label(s.info.stream) + ",state=\"" + std::string(to_string(a)) + "\"}",
                 s.recorded->activity == a ? 1 : 0);
  }
  const auto per_recording = [&](const char* name, const char* help, std::uint64_t RecordingState::*value) {
    out.family(name, "gauge", help);
    for (const auto& s : streams) {
      if (s.recorded)
        out.sample("{stream=" + label(s.info.stream) + "}", static_cast<double>((*s.recorded).*value));
    }
  };
  per_recording("relievo_recording_frames", "Frames in the recording, or in the last one.",
                &RecordingState::frames);
  per_recording("relievo_recording_lost_frames", "Frames that should be in it and are not.",
                &RecordingState::lost);
  per_recording("relievo_recording_bytes", "Of samples in it.", &RecordingState::bytes);
  per_recording("relievo_recording_room_bytes", "That the disk of recordings on request still takes.",
                &RecordingState::room_bytes);

  // What a recording says was counted then, and begins anew with each pass.
  const auto is_counting = [](const StreamSnapshot& s) { return s.status && s.recording.file.empty(); };
  const auto per_status = [&](const char* name, std::string_view type, const char* help, auto value) {
    out.family(name, type, help);
    for (const auto& s : streams) {
      if (!s.status || (type == "counter" && !is_counting(s))) continue;
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
             "How much coarser than asked for, to keep bit rate, deadline or PSNR; 0 not at all.",
             [](T s) { return s.rate_level; });

  const auto per_rung = [&](const char* name, std::string_view type, const char* help, auto value) {
    out.family(name, type, help);
    for (const auto& s : streams) {
      if (!s.status || (type == "counter" && !is_counting(s))) continue;
      for (const RungStatus& rung : s.status->rungs)
        out.sample(
            "{stream=" + label(s.info.stream) + ",quality=\"" + std::string(to_string(rung.rung)) + "\"}",
            static_cast<double>(value(rung)));
    }
  };
  using R = const RungStatus&;
  per_rung("relievo_stream_rung_readers", "gauge", "Who reads a lower quality of the stream at its server.",
           [](R r) { return r.readers; });
  per_rung("relievo_stream_rung_frames_total", "counter", "Frames published of it.",
           [](R r) { return r.frames; });
  per_rung("relievo_stream_rung_drops_total", "counter",
           "Frames not made of it, since one before took too long.", [](R r) { return r.drops; });
  per_rung("relievo_stream_rung_encode_seconds", "gauge", "Median time to make a frame of it.",
           [](R r) { return r.encode_ms * 1e-3; });
  per_rung("relievo_stream_rung_bits_per_second", "gauge", "Of its frames, over the last few seconds.",
           [](R r) { return r.bit_rate; });
  out.family("relievo_gateway_quality_clients", "gauge",
             "WebSocket clients on a quality of the stream, or on their way to it.");
  for (const auto& s : streams)
    for (const Rung rung : kWebRungs)
      out.sample("{stream=" + label(s.info.stream) + ",quality=\"" + std::string(to_string(rung)) + "\"}",
                 static_cast<double>(s.watchers_of[static_cast<std::size_t>(rung)]));
  out.family("relievo_gateway_clock_offset_seconds", "gauge",
             "How far the clock of the stream's server is ahead of the gateway's.");
  for (const auto& s : streams)
    if (s.clock_offset_ns) out.sample("{stream=" + label(s.info.stream) + "}", seconds(*s.clock_offset_ns));

  out.family("relievo_stream_drops_total", "counter", "Frames the server lost, by place.");
  for (const auto& s : streams) {
    if (!is_counting(s)) continue;
    const std::string head = "{stream=" + label(s.info.stream) + ",place=";
    out.sample(head + "\"capture\"}", static_cast<double>(s.status->drops_capture));
    out.sample(head + "\"reconstruct\"}", static_cast<double>(s.status->drops_reconstruct));
    out.sample(head + "\"encode\"}", static_cast<double>(s.status->drops_encode));
    out.sample(head + "\"publish\"}", static_cast<double>(s.status->drops_publish));
  }
  out.family("relievo_stream_filters_total", "counter",
             "What each filter of the reconstruction did: points, pixels or triangles.");
  for (const auto& s : streams) {
    if (!is_counting(s)) continue;
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
  write_stages(out, streams);
  return out.take();
}

}  // namespace relievo
