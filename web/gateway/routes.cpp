// SPDX-License-Identifier: Apache-2.0
#include "web/gateway/routes.h"

#include <algorithm>
#include <cctype>

#include "web/gateway/assets.h"

namespace relievo {
namespace {

HttpReply text(int status, std::string line) {
  HttpReply reply;
  reply.status = status;
  reply.body = std::move(line) + "\n";
  reply.headers.emplace_back("Cache-Control", "no-store");
  return reply;
}

HttpReply json(std::string body) {
  HttpReply reply;
  reply.content_type = "application/json";
  reply.body = std::move(body);
  reply.headers.emplace_back("Cache-Control", "no-store");
  return reply;
}

HttpReply asset_reply(const Asset& asset, std::string_view if_none_match) {
  HttpReply reply;
  reply.content_type = asset.media_type;
  reply.headers.emplace_back("ETag", asset.etag);
  // Vite puts a hash of the content into every name under /assets/.
  const bool hashed = asset.path.substr(0, 8) == "/assets/";
  reply.headers.emplace_back("Cache-Control", hashed ? "public, max-age=31536000, immutable" : "no-cache");
  if (if_none_match == asset.etag) {
    reply.status = 304;
  } else {
    reply.fixed_body = asset.bytes;
  }
  return reply;
}

HttpReply websocket(const HttpRequest& request, const std::string& stream, const RouteContext& context) {
  if (!valid_stream_name(stream)) {
    return text(400, "no stream has such a name: 1 to 64 of A-Z a-z 0-9 _ . - and no dot first");
  }
  if (!request.upgrade) {
    HttpReply reply = text(426, "this address speaks WebSocket only");
    reply.headers.emplace_back("Upgrade", "websocket");
    return reply;
  }
  if (!request.origin.empty() && !same_origin(request.origin, request.host)) {
    return text(403, "a page of another site may not open this stream");
  }
  if (context.counts.clients >= context.max_clients) {
    HttpReply reply = text(503, "all " + std::to_string(context.max_clients) + " places are taken");
    reply.headers.emplace_back("Retry-After", "5");
    return reply;
  }
  HttpReply reply;
  reply.status = 101;
  reply.websocket_stream = stream;
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

}  // namespace

const std::vector<std::pair<std::string, std::string>>& security_headers() {
  static const std::vector<std::pair<std::string, std::string>> headers = {
      {"Content-Security-Policy",
       "default-src 'none'; script-src 'self' 'wasm-unsafe-eval'; worker-src 'self'; style-src 'self'; "
       "img-src 'self' data:; connect-src 'self'; font-src 'self'; base-uri 'none'; form-action 'none'; "
       "frame-ancestors 'self'"},
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
  if (name == "localhost" || (name.size() > 10 && name.ends_with(".localhost"))) return true;
  if (name.front() == '[') return true;
  // A last label of digits only makes a name an IPv4 address to every browser.
  return !name.empty() && std::all_of(name.begin(), name.end(),
                                      [](unsigned char c) { return std::isdigit(c) != 0 || c == '.'; });
}

HttpReply answer(const HttpRequest& request, const RouteContext& context) {
  if (context.loopback && !loopback_host(request.host)) {
    return text(421, "this server answers to localhost only: open it as http://localhost or by its address");
  }
  if (request.method != "GET" && request.method != "HEAD") {
    HttpReply reply = text(405, "only GET and HEAD");
    reply.headers.emplace_back("Allow", "GET, HEAD");
    return reply;
  }
  const std::string_view path = request.target.substr(0, request.target.find('?'));
  if (path == "/healthz") return text(200, "ok");
  if (path == "/api/streams") return json(streams_json(context.hub.snapshot(), context.hub.empty_hint()));
  if (path == "/metrics") {
    HttpReply reply = text(200, "");
    reply.content_type = "text/plain; version=0.0.4; charset=utf-8";
    reply.body = metrics_text(context.hub.snapshot(), context.counts);
    return reply;
  }
  if (path.substr(0, 4) == "/ws/") return websocket(request, std::string(path.substr(4)), context);
  const std::string_view wanted = path == "/" ? "/index.html" : path;
  for (const Asset& asset : assets()) {
    if (asset.path == wanted) return asset_reply(asset, request.if_none_match);
  }
  return text(404, "nothing here");
}

}  // namespace relievo
