// SPDX-License-Identifier: Apache-2.0
#include "web/gateway/sign_in.h"

#include <algorithm>
#include <string>
#include <string_view>

#include "base/html.h"
#include "web/gateway/request_target.h"

namespace relievo {
namespace {

constexpr std::string_view kForm =
    "<!doctype html><html lang=\"en\"><meta charset=\"utf-8\"><title>Relievo</title>"
    "<meta name=\"viewport\" content=\"width=device-width\"><h1>Relievo</h1>"
    "<p>Whoever runs this server lets you watch with a token: it is in the link they gave you, or in their "
    "token file.</p>"
    "<form action=\"{path}\">{query}<label>Token <input name=\"token\" type=\"password\" required "
    "autofocus></label> "
    "<button>Watch</button></form></html>";

// Other servers on this host, on other ports, get the same cookies: each has a name of its own.
std::string cookie_name(std::uint16_t port) {
  return "relievo_token_" + std::to_string(port);
}

std::string_view cookie_value(std::string_view cookies, std::string_view name) {
  while (!cookies.empty()) {
    const auto end = cookies.find(';');
    std::string_view one = cookies.substr(0, end);
    one.remove_prefix(std::min(one.find_first_not_of(' '), one.size()));
    if (one.starts_with(name) && one.substr(name.size(), 1) == "=") return one.substr(name.size() + 1);
    cookies = end == std::string_view::npos ? std::string_view() : cookies.substr(end + 1);
  }
  return {};
}

std::string_view bearer(std::string_view authorization) {
  constexpr std::string_view kScheme = "bearer ";  // in any case: RFC 9110, 11.1
  if (!begins_with(authorization, kScheme)) return {};
  authorization.remove_prefix(kScheme.size());
  return authorization.substr(std::min(authorization.find_first_not_of(' '), authorization.size()));
}

/// The token of "/?stream=a&token=T", and the target without it.
struct TokenInTarget {
  std::string_view token;
  std::string rest;
};

TokenInTarget token_in(std::string_view target) {
  TokenInTarget out{{}, std::string(target.substr(0, target.find('?')))};
  std::string_view query = query_of(target);
  char joint = '?';
  while (!query.empty()) {
    const auto end = query.find('&');
    const std::string_view one = query.substr(0, end);
    query = end == std::string_view::npos ? std::string_view() : query.substr(end + 1);
    if (one.starts_with("token=")) {
      out.token = one.substr(6);
    } else {
      out.rest += joint;
      out.rest += one;
      joint = '&';
    }
  }
  return out;
}

HttpReply keep_as_cookie(const TokenInTarget& asked, bool tls, std::uint16_t port) {
  HttpReply reply;
  reply.status = 303;
  reply.headers.emplace_back("Cache-Control", "no-store");
  reply.headers.emplace_back("Location", asked.rest);
  // Lax: with Strict it would not come along on the way here from a link in somebody's mail. What other sites
  // could do with it needs a WebSocket, which their pages are refused.
  reply.headers.emplace_back("Set-Cookie", cookie_name(port) + "=" + std::string(asked.token) +
                                               "; Path=/; Max-Age=31536000; HttpOnly; SameSite=Lax" +
                                               (tls ? "; Secure" : ""));
  return reply;
}

/// What a form sends along, since it puts a query of its own in place of its action's.
std::string hidden_inputs(std::string_view target) {
  std::string out;
  for (auto query = query_of(target); !query.empty();) {
    const std::string_view one = query.substr(0, query.find('&'));
    query.remove_prefix(std::min(one.size() + 1, query.size()));
    const auto equals = std::min(one.find('='), one.size());
    const std::string_view value = one.substr(std::min(equals + 1, one.size()));
    if (equals == 0) continue;
    out += "<input type=\"hidden\" name=\"" + html_escaped(percent_decoded(one.substr(0, equals))) +
           "\" value=\"" + html_escaped(percent_decoded(value)) + "\">";
  }
  return out;
}

/// The form, which leads to what was asked for: `target` without a token.
std::string form(std::string_view target) {
  std::string out(kForm);
  const auto put = [&](std::string_view mark, std::string_view text) {
    out.replace(out.find(mark), mark.size(), text);
  };
  put("{query}", hidden_inputs(target));
  put("{path}", target.substr(0, target.find('?')));
  return out;
}

HttpReply token_needed(bool is_page, std::string_view target) {
  HttpReply reply;
  reply.status = 401;
  reply.refusal = Refusal::kToken;
  reply.headers.emplace_back("Cache-Control", "no-store");
  reply.headers.emplace_back("WWW-Authenticate", "Bearer realm=\"relievo\"");
  if (!is_page) {
    reply.body = "a token is needed: send Authorization: Bearer TOKEN, or add ?token=TOKEN\n";
    return reply;
  }
  reply.content_type = "text/html; charset=utf-8";
  reply.body = form(target);
  reply.headers.emplace_back(
      "Content-Security-Policy",
      "default-src 'none'; base-uri 'none'; form-action 'self'; frame-ancestors 'self'");
  return reply;
}

}  // namespace

std::optional<HttpReply> sign_in(const HttpRequest& request, const Tokens& tokens, std::uint16_t port) {
  if (!tokens.needed()) return std::nullopt;
  const TokenInTarget asked = token_in(request.target);
  const std::string_view path = request.target.substr(0, request.target.find('?'));
  const bool is_page = path == "/" || path == "/rig";
  if (tokens.accepts(asked.token))
    return is_page ? std::optional(keep_as_cookie(asked, request.tls, port)) : std::nullopt;
  if (tokens.accepts(bearer(request.authorization)) ||
      tokens.accepts(cookie_value(request.cookie, cookie_name(port))))
    return std::nullopt;
  return token_needed(is_page, asked.rest);
}

}  // namespace relievo
