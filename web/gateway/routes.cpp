// SPDX-License-Identifier: Apache-2.0
#include "web/gateway/routes.h"

#include <algorithm>
#include <cctype>

#include "web/gateway/assets.h"
#include "web/gateway/calibration_api.h"
#include "web/gateway/entity_tag.h"
#include "web/gateway/foxglove_feed.h"
#include "web/gateway/recording_api.h"
#include "web/gateway/recording_route.h"
#include "web/gateway/request_target.h"
#include "web/gateway/rig_api.h"
#include "web/gateway/sign_in.h"

namespace relievo {

HttpReply text_reply(int status, std::string line) {
  HttpReply reply;
  reply.status = status;
  reply.body = std::move(line) + "\n";
  reply.headers.emplace_back("Cache-Control", "no-store");
  return reply;
}

HttpReply json_reply(std::string body) {
  HttpReply reply;
  reply.content_type = "application/json";
  reply.body = std::move(body);
  reply.headers.emplace_back("Cache-Control", "no-store");
  return reply;
}

HttpReply reply_from_disk(std::function<HttpReply()> make) {
  HttpReply reply;
  reply.from_disk = std::move(make);
  return reply;
}

bool is_json(const HttpRequest& request) {
  std::string type(request.content_type.substr(0, request.content_type.find(';')));
  while (!type.empty() && type.back() == ' ') type.pop_back();
  std::transform(type.begin(), type.end(), type.begin(),
                 [](char c) { return static_cast<char>(std::tolower(static_cast<unsigned char>(c))); });
  return type == "application/json";
}

namespace {

HttpReply refused(Refusal why, int status, std::string line) {
  HttpReply reply = text_reply(status, std::move(line));
  reply.refusal = why;
  return reply;
}

HttpReply asset_reply(const Asset& asset, const HttpRequest& request) {
  HttpReply reply;
  reply.content_type = asset.media_type;
  reply.headers.emplace_back("ETag", asset.etag);
  // Vite puts a hash of the content into every name under /assets/.
  const bool hashed = asset.path.substr(0, 8) == "/assets/";
  reply.headers.emplace_back("Cache-Control", hashed ? "public, max-age=31536000, immutable" : "no-cache");
  if (const auto failed = failed_condition(request.if_match, request.if_none_match, asset.etag)) {
    reply.status = *failed;
  } else {
    reply.fixed_body = asset.bytes;
  }
  return reply;
}

// "host:port", "[v6]:port" or without the port.
std::string_view without_port(std::string_view host) {
  if (!host.empty() && host.front() == '[') return host.substr(0, host.find(']') + 1);
  return host.substr(0, host.find(':'));
}

std::string lower(std::string_view text_in) {
  std::string out(text_in);
  std::transform(out.begin(), out.end(), out.begin(),
                 [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  return out;
}

bool listed_origin(std::string_view origin, const RouteContext& context) {
  const auto& listed = context.options.origins;
  return std::any_of(listed.begin(), listed.end(),
                     [&](const std::string& one) { return lower(one) == lower(origin); });
}

// A proxy that speaks for a listed site may send that site's name.
bool listed_host(std::string_view host, const RouteContext& context) {
  const auto& listed = context.options.origins;
  return std::any_of(listed.begin(), listed.end(),
                     [&](const std::string& one) { return same_origin(one, host); });
}

/// A program that sends no Origin is not a page.
bool may_act(const HttpRequest& request, const RouteContext& context) {
  return request.origin.empty() || same_origin(request.origin, request.host) ||
         listed_origin(request.origin, context);
}

/// Upgrades to `target`, unless something speaks against it.
HttpReply websocket(const HttpRequest& request, WsTarget target, const RouteContext& context) {
  if (!may_act(request, context))
    return refused(Refusal::kOrigin, 403, "a page of another site may not open this stream");
  const int places = context.options.max_clients.value_or(kClients);
  if (context.counts.clients >= places) {
    HttpReply reply = refused(Refusal::kClients, 503, "all " + std::to_string(places) + " places are taken");
    reply.headers.emplace_back("Retry-After", "5");
    return reply;
  }
  // Behind what speaks against it: browsers do not tell pages why, so these ask for it without an upgrade.
  if (!request.upgrade) {
    HttpReply reply = text_reply(426, "this address speaks WebSocket only");
    reply.headers.emplace_back("Upgrade", "websocket");
    return reply;
  }
  HttpReply reply;
  reply.status = 101;
  reply.websocket = std::move(target);
  return reply;
}

HttpReply stream_socket(const std::string& stream, const HttpRequest& request, const RouteContext& context) {
  if (!valid_stream_name(stream)) {
    return text_reply(400, "no stream has such a name: 1 to 64 of A-Z a-z 0-9 _ . - and no dot first");
  }
  return websocket(request, {.stream = stream, .subprotocol = {}}, context);
}

bool offers(std::string_view subprotocols, std::string_view wanted) {
  while (!subprotocols.empty()) {
    const auto end = subprotocols.find(',');
    std::string_view one = subprotocols.substr(0, end);
    one.remove_prefix(std::min(one.find_first_not_of(' '), one.size()));
    one = one.substr(0, one.find_last_not_of(' ') + 1);
    if (one == wanted) return true;
    subprotocols = end == std::string_view::npos ? std::string_view() : subprotocols.substr(end + 1);
  }
  return false;
}

HttpReply foxglove_socket(const HttpRequest& request, const RouteContext& context) {
  if (!context.foxglove) return text_reply(404, "nothing here");
  const auto agreed = std::find_if(kFoxgloveProtocols.begin(), kFoxgloveProtocols.end(),
                                   [&](auto name) { return offers(request.subprotocols, name); });
  if (request.upgrade && agreed == kFoxgloveProtocols.end())
    return text_reply(400,
                      "this address speaks the subprotocols foxglove.sdk.v1 and foxglove.websocket.v1 only");
  const std::string name(agreed == kFoxgloveProtocols.end() ? "" : *agreed);
  return websocket(request, {.stream = {}, .subprotocol = name}, context);
}

}  // namespace

const std::vector<std::pair<std::string, std::string>>& security_headers() {
  static const std::vector<std::pair<std::string, std::string>> headers = {
      {"Content-Security-Policy",
       "default-src 'none'; script-src 'self' 'wasm-unsafe-eval'; worker-src 'self'; style-src 'self'; "
       "img-src 'self' data:; manifest-src 'self'; connect-src 'self'; font-src 'self'; base-uri 'none'; "
       "form-action 'none'; frame-ancestors 'self'"},
      {"X-Content-Type-Options", "nosniff"},
      {"Referrer-Policy", "no-referrer"},
      {"Cross-Origin-Opener-Policy", "same-origin"},
      {"Cross-Origin-Resource-Policy", "same-origin"},
      {"Permissions-Policy", "camera=(), microphone=(), geolocation=()"},
  };
  return headers;
}

bool same_origin(std::string_view origin, std::string_view host) {
  const auto scheme = origin.find("://");
  if (scheme == std::string_view::npos || host.empty()) return false;
  const std::string_view name = origin.substr(0, scheme);
  if (name != "http" && name != "https") return false;
  return lower(origin.substr(scheme + 3)) == lower(host);
}

bool loopback_host(std::string_view host) {
  if (host.empty()) return true;
  const std::string name = lower(without_port(host));
  if (name.empty()) return false;  // a port alone
  if (name == "localhost" || (name.size() > 10 && name.ends_with(".localhost"))) return true;
  if (name.front() == '[') return true;
  // A last label of digits only makes a name an IPv4 address to every browser.
  return std::all_of(name.begin(), name.end(),
                     [](unsigned char c) { return std::isdigit(c) != 0 || c == '.'; });
}

namespace {

HttpReply page(std::string_view path, const HttpRequest& request) {
  const std::string_view wanted = path == "/" ? "/index.html" : path == "/rig" ? "/rig.html" : path;
  for (const Asset& asset : assets()) {
    if (asset.path == wanted) return asset_reply(asset, request);
  }
  return text_reply(404, "nothing here");
}

HttpReply ready(const RouteContext& context) {
  const std::size_t streams = context.hub.snapshot().size();
  if (streams == 0) return text_reply(503, "there is no stream yet");
  return text_reply(200, "ready: " + std::to_string(streams) + (streams == 1 ? " stream" : " streams"));
}

/// With what others than the hub know of them.
std::vector<StreamSnapshot> all_streams(const RouteContext& context) {
  std::vector<StreamSnapshot> streams = context.hub.snapshot();
  for (StreamSnapshot& s : streams) {
    if (context.recordings != nullptr) s.recorded = context.recordings->state(s.info.stream);
    if (context.stages != nullptr) s.stages = context.stages->stages(s.info.stream);
    s.looked_at = context.rigs != nullptr && context.rigs->has(s.info.stream);
  }
  return streams;
}

HttpReply metrics(const RouteContext& context) {
  HttpReply reply = text_reply(200, "");
  reply.content_type = "text/plain; version=0.0.4; charset=utf-8";
  reply.body = metrics_text(all_streams(context), context.counts,
                            context.refused_peers ? context.refused_peers() : RefusedPeers());
  return reply;
}

/// One address, or, ending in a name in braces, all below it; or in two, all with a '/' below it.
/// web/gateway/openapi.json describes each.
struct Route {
  std::string_view path;
  bool needs_token;
  HttpReply (*answer)(std::string_view name, const HttpRequest& request, const RouteContext& context);
  // To POST, where that is not refused.
  HttpReply (*order)(std::string_view name, const HttpRequest& request,
                     const RouteContext& context) = nullptr;
};

constexpr Route kRoutes[] = {
    {"/healthz", false, [](auto, auto&, auto&) { return text_reply(200, "ok"); }},
    {"/readyz", false, [](auto, auto&, const RouteContext& context) { return ready(context); }},
    {"/metrics", true, [](auto, auto&, const RouteContext& context) { return metrics(context); }},
    {"/api/streams", true,
     [](auto, auto&, const RouteContext& context) {
       return json_reply(streams_json(all_streams(context), context.hub.empty_hint()));
     }},
    {"/api/openapi.json", true,
     [](auto, auto&, auto&) { return json_reply(std::string(openapi_document())); }},
    {"/foxglove", true,
     [](auto, const HttpRequest& request, const RouteContext& context) {
       return foxglove_socket(request, context);
     }},
    {"/recordings/{recording}", true,
     [](std::string_view name, const HttpRequest& request, const RouteContext& context) {
       return recording_reply(name, request, context);
     }},
    {"/api/recordings", true,
     [](auto, auto&, const RouteContext& context) { return list_recordings(context.recordings); }},
    {"/api/recording/{stream}", true,
     [](std::string_view name, auto&, const RouteContext& context) {
       return recording_state(name, context.recordings);
     },
     [](std::string_view name, const HttpRequest& request, const RouteContext& context) {
       return order_recording(name, request, context.recordings);
     }},
    {"/api/rig/{stream}/{picture}", true,
     [](std::string_view names, auto&, const RouteContext& context) {
       return rig_picture(names, context.rigs);
     }},
    {"/api/rig/{stream}", true,
     [](std::string_view name, const HttpRequest& request, const RouteContext& context) {
       return rig_look(name, request, context.rigs);
     }},
    {"/api/projector", true,
     [](auto, auto&, const RouteContext& context) { return projector_state(context.rigs); },
     [](auto, const HttpRequest& request, const RouteContext& context) {
       return order_projector(request, context.rigs);
     }},
    {"/api/calibration/{picture}", true,
     [](std::string_view name, auto&, const RouteContext& context) {
       return calibration_picture(name, context.calibrations);
     }},
    {"/api/calibration", true,
     [](auto, auto&, const RouteContext& context) { return calibration_state(context.calibrations); },
     [](auto, const HttpRequest& request, const RouteContext& context) {
       return order_calibration(request, context.calibrations);
     }},
    {"/ws/{stream}", true,
     [](std::string_view name, const HttpRequest& request, const RouteContext& context) {
       return stream_socket(std::string(name), request, context);
     }},
};

/// What `path` has in place of the braces, empty where there are none; nothing where the route is another's.
std::optional<std::string_view> match(const Route& route, std::string_view path) {
  const auto brace = route.path.find('{');
  if (brace == std::string_view::npos) return path == route.path ? std::optional("") : std::nullopt;
  const std::string_view before = route.path.substr(0, brace);
  if (!path.starts_with(before)) return std::nullopt;
  const std::string_view names = path.substr(before.size());
  const bool two = route.path.find('/', brace) != std::string_view::npos;
  return two && names.find('/') == std::string_view::npos ? std::nullopt : std::optional(names);
}

HttpReply wrong_method(std::string allowed) {
  HttpReply reply = text_reply(405, "only " + allowed);
  reply.headers.emplace_back("Allow", std::move(allowed));
  return reply;
}

HttpReply answer_at(const Route& route, std::string_view name, const HttpRequest& request,
                    const RouteContext& context) {
  const bool is_order = request.method == "POST";
  if (is_order && route.order == nullptr) return wrong_method("GET, HEAD");
  if (is_order && !may_act(request, context))
    return refused(Refusal::kOrigin, 403, "a page of another site may not do this");
  if (route.needs_token) {
    if (auto wait = sign_in(request, context.tokens, context.port)) return *std::move(wait);
  }
  return is_order ? route.order(name, request, context) : route.answer(name, request, context);
}

/// Pages of a listed site may read what they are answered.
void share_with_origin(const HttpRequest& request, const RouteContext& context, HttpReply& reply) {
  if (context.options.origins.empty()) return;
  reply.headers.emplace_back("Vary", "Origin");
  if (request.origin.empty() || !listed_origin(request.origin, context)) return;
  reply.headers.emplace_back("Access-Control-Allow-Origin", std::string(request.origin));
  reply.headers.emplace_back("Access-Control-Allow-Credentials", "true");
  reply.headers.emplace_back("Access-Control-Expose-Headers", "Content-Range, ETag");  // of recordings
  reply.headers.emplace_back("Cross-Origin-Resource-Policy", "cross-origin");
}

HttpReply preflight() {
  HttpReply reply;
  reply.status = 204;
  reply.headers.emplace_back("Access-Control-Allow-Methods", "GET, HEAD, POST");
  reply.headers.emplace_back("Access-Control-Allow-Headers",
                             "Authorization, Content-Type, If-Match, If-None-Match, If-Range, Range");
  reply.headers.emplace_back("Access-Control-Max-Age", "600");
  return reply;
}

HttpReply answer_by_method(const HttpRequest& request, const RouteContext& context) {
  if (request.method == "OPTIONS" && listed_origin(request.origin, context)) return preflight();
  const bool is_get = request.method == "GET" || request.method == "HEAD";
  const std::string_view path = request.target.substr(0, request.target.find('?'));
  for (const Route& route : kRoutes) {
    const auto name = match(route, path);
    if (!name) continue;
    if (!is_get && request.method != "POST")
      return wrong_method(route.order == nullptr ? "GET, HEAD" : "GET, HEAD, POST");
    return answer_at(route, unescaped(*name), request, context);
  }
  if (!is_get) return wrong_method("GET, HEAD");
  if (auto wait = sign_in(request, context.tokens, context.port)) return *std::move(wait);
  return page(path, request);
}

}  // namespace

std::vector<std::string_view> route_paths() {
  std::vector<std::string_view> paths;
  for (const Route& route : kRoutes) paths.push_back(route.path);
  return paths;
}

HttpReply answer(const HttpRequest& request, const RouteContext& context) {
  if (context.loopback && !loopback_host(request.host) && !listed_host(request.host, context)) {
    return refused(Refusal::kHost, 421,
                   "this server answers to localhost only: open it as http://localhost or by its address, "
                   "or start it with --allow-origin and the name it has");
  }
  const bool is_https = !context.options.tls_cert.empty();
  if (is_https && !request.tls) {
    if (request.host.empty()) return text_reply(400, "this server speaks https");
    HttpReply reply = text_reply(308, "this server speaks https");
    reply.headers.emplace_back("Location",
                               "https://" + std::string(request.host) + std::string(request.target));
    return reply;
  }
  HttpReply reply = answer_by_method(request, context);
  // Browsers keep this for a year for every port of a name: none of localhost's business.
  if (request.tls && !loopback_host(request.host))
    reply.headers.emplace_back("Strict-Transport-Security", "max-age=31536000");
  share_with_origin(request, context, reply);
  return reply;
}

}  // namespace relievo
