// SPDX-License-Identifier: Apache-2.0
// What each HTTP request is answered, sockets apart: of the hub's snapshot, and of what those say who record,
// see the cameras and calibrate, and are told to do.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "base/web_options.h"
#include "web/gateway/access.h"
#include "web/gateway/calibration_control.h"
#include "web/gateway/hub.h"
#include "web/gateway/protocol.h"
#include "web/gateway/recording_control.h"
#include "web/gateway/rig_control.h"

namespace relievo {

struct HttpRequest {
  std::string_view method;  // "GET"
  std::string_view target;  // "/api/streams?x"
  std::string_view host;    // header values, empty where absent
  std::string_view origin;
  std::string_view if_match;
  std::string_view if_none_match;
  std::string_view authorization;
  std::string_view cookie;
  std::string_view range;
  std::string_view if_range;
  std::string_view content_type;
  std::string_view subprotocols;  // Sec-WebSocket-Protocol: "a, b"
  std::string_view body;
  bool upgrade = false;  // asks for a WebSocket
  bool tls = false;      // came over TLS
};

/// What a WebSocket serves.
struct WsTarget {
  std::string stream;       // empty: all of them, by the Foxglove protocol
  std::string subprotocol;  // of those the client offered; empty: none
};

class CutRecordings;  // web/gateway/cut_recordings.h
class FilePart;       // web/gateway/recording_route.h

struct HttpReply {
  int status = 200;
  std::string content_type = "text/plain; charset=utf-8";
  std::string body;
  std::string_view fixed_body;           // instead of `body`: bytes that live as long as the program
  std::shared_ptr<const FilePart> file;  // instead of both
  // Makes the reply instead of all that is above, on a thread that may wait for a disk; not called where
  // empty. What it makes may be one to be made so, in turn.
  std::function<HttpReply()> from_disk;
  bool takes_long = false;  // that, as long as reading a long file: one of these at a time
  std::vector<std::pair<std::string, std::string>> headers;  // in place of, or beside, those of every reply
  std::optional<WsTarget> websocket;                         // no reply: upgrade
  std::optional<Refusal> refusal;                            // to be counted

  std::string_view bytes() const { return fixed_body.empty() ? std::string_view(body) : fixed_body; }
};

/// A line of text, or a document, that nobody is to keep.
HttpReply text_reply(int status, std::string line);
HttpReply json_reply(std::string body);

/// What `make` says: any thread, which may wait for a disk.
HttpReply reply_from_disk(std::function<HttpReply()> make);

/// "application/json; charset=utf-8" too. Pages of other sites cannot send it without being asked about.
bool is_json(const HttpRequest& request);

constexpr int kClients = 64;  // where the options do not say how many

struct RouteContext {
  const Hub& hub;
  const GatewayCounts& counts;
  const Tokens& tokens;
  const WebOptions& options;
  CutRecordings& cuts;
  RecordingControl* recordings = nullptr;         // none: nothing is recorded here
  RigControl* rigs = nullptr;                     // none: no camera is here
  CalibrationControl* calibrations = nullptr;     // likewise
  const StageReport* stages = nullptr;            // none: no stream is made here
  std::function<RefusedPeers()> refused_peers{};  // empty: none come here
  bool foxglove = false;                          // there is an encoder for it
  std::uint16_t port = 0;
  bool loopback = true;  // bound to a loopback address only
};

HttpReply answer(const HttpRequest& request, const RouteContext& context);

/// Of all but the viewer's files, as in the OpenAPI document: "/ws/{stream}".
std::vector<std::string_view> route_paths();

/// Headers of every reply (FACTS: a policy that lets the page load only from here, wasm included).
const std::vector<std::pair<std::string, std::string>>& security_headers();

/// A page may open a WebSocket only where it came from; a program that sends no Origin is not a page.
bool same_origin(std::string_view origin, std::string_view host);

/// True where `host` (a Host header) cannot be a foreign name that was pointed at this machine's loopback
/// address (DNS rebinding): an IP address, localhost, or absent.
bool loopback_host(std::string_view host);

}  // namespace relievo
