// SPDX-License-Identifier: Apache-2.0
#include "web/gateway/sign_in.h"

#include <openssl/evp.h>

#include <algorithm>
#include <array>
#include <string>
#include <string_view>
#include <utility>

#include "base/html.h"
#include "web/gateway/assets.h"
#include "web/gateway/request_target.h"

namespace relievo {
namespace {

// The mark is the viewer's (web/viewer/index.html). A form without an action is sent to the page's own
// address, and what that has behind '#', the view of a link, stays there.
constexpr std::string_view kPage = R"html(<!doctype html>
<html lang="en">
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<title>Relievo: token</title>
<style>{style}</style>
<main>
<h1><svg viewBox="0 0 32 32" aria-hidden="true"><path d="M4 8h24"/><path d="M4 14h5c4 0 4-4 7-4s3 4 7 4h5"/>
<path d="M4 20h4c5 0 4-7 8-7s3 7 8 7h4"/><path d="M4 26h3c6 0 5-9 9-9s3 9 9 9h3"/></svg>Relievo</h1>
<p>Whoever runs this server lets you watch with a token: it is in the link they gave you, behind <code>token=</code>,
or in their token file.</p>
<form>{query}
{refusal}<label for="token">Token</label>
<input id="token" name="token" type="password" autocomplete="current-password" required autofocus{described}>
<button>Watch</button>
</form>
</main>
</html>
)html";

/// The token that came, where that is none here.
enum class Unknown { kNone, kSent, kKept, kNotKept };

/// Of the address that a browser with a right token is sent to: the next request shows whether it keeps
/// cookies.
constexpr std::string_view kSignedIn = "signed-in";

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

/// Who pastes a token pastes spaces along.
std::string trimmed(const std::string& text) {
  constexpr std::string_view kSpaces = " \t\r\n";
  const auto first = std::min(text.find_first_not_of(kSpaces), text.size());
  return text.substr(first, text.find_last_not_of(kSpaces) + 1 - first);
}

/// The token of "/?stream=a&token=T", and the target without it and without kSignedIn.
struct TokenInTarget {
  std::string token;
  std::string rest;
  bool signed_in = false;
};

TokenInTarget token_in(std::string_view target) {
  TokenInTarget out{.token = {}, .rest = std::string(target.substr(0, target.find('?')))};
  std::string_view query = query_of(target);
  char joint = '?';
  while (!query.empty()) {
    const auto end = query.find('&');
    const std::string_view one = query.substr(0, end);
    query = end == std::string_view::npos ? std::string_view() : query.substr(end + 1);
    if (one.starts_with("token=")) {
      out.token = trimmed(percent_decoded(one.substr(6)));
    } else if (one == kSignedIn) {
      out.signed_in = true;
    } else {
      out.rest += joint;
      out.rest += one;
      joint = '&';
    }
  }
  return out;
}

HttpReply see(std::string address) {
  HttpReply reply;
  reply.status = 303;
  reply.headers.emplace_back("Cache-Control", "no-store");
  reply.headers.emplace_back("Location", std::move(address));
  return reply;
}

HttpReply keep_as_cookie(const TokenInTarget& asked, bool tls, std::uint16_t port) {
  const char joint = asked.rest.find('?') == std::string::npos ? '?' : '&';
  HttpReply reply = see(asked.rest + joint + std::string(kSignedIn));
  // Lax: with Strict it would not come along on the way here from a link in somebody's mail. What other sites
  // could do with it needs a WebSocket, which their pages are refused.
  reply.headers.emplace_back("Set-Cookie", cookie_name(port) + "=" + asked.token +
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

std::string_view refusal(Unknown unknown) {
  switch (unknown) {
    case Unknown::kNone:
      return "";
    case Unknown::kSent:
      return "This token is not known here: please check it.";
    case Unknown::kKept:
      return "The token that this browser kept is not known here any more.";
    case Unknown::kNotKept:
      return "The token is right, but this browser did not keep it: allow cookies for this address, and "
             "enter it again.";
  }
  return "";
}

/// The page with the form, which leads to what was asked for: `target` without a token.
std::string page(std::string_view target, Unknown unknown) {
  std::string out(kPage);
  const auto put = [&](std::string_view mark, std::string_view text) {
    out.replace(out.find(mark), mark.size(), text);
  };
  const bool refused = unknown != Unknown::kNone;
  put("{style}", sign_in_style());
  put("{described}", refused ? R"( aria-invalid="true" aria-describedby="refusal")" : "");
  put("{refusal}",
      refused ? R"(<p id="refusal" role="alert">)" + std::string(refusal(unknown)) + "</p>\n" : "");
  put("{query}", hidden_inputs(target));  // the last one: it is what was sent, and may have such marks
  return out;
}

/// What a Content-Security-Policy has of a style that it lets a page have.
std::string hash_of(std::string_view style) {
  std::array<unsigned char, EVP_MAX_MD_SIZE> hash{};
  std::array<unsigned char, 2 * EVP_MAX_MD_SIZE> base64{};
  unsigned size = 0;
  EVP_Digest(style.data(), style.size(), hash.data(), &size, EVP_sha256(), nullptr);
  const int length = EVP_EncodeBlock(base64.data(), hash.data(), static_cast<int>(size));
  return "'sha256-" + std::string(base64.begin(), base64.begin() + length) + "'";
}

HttpReply token_needed(bool is_page, std::string_view target, Unknown unknown) {
  HttpReply reply;
  reply.status = 401;
  reply.refusal = Refusal::kToken;
  reply.headers.emplace_back("Cache-Control", "no-store");
  reply.headers.emplace_back("WWW-Authenticate", "Bearer realm=\"relievo\"");
  if (!is_page) {
    reply.body = unknown == Unknown::kNone
                     ? "a token is needed: send Authorization: Bearer TOKEN, or add ?token=TOKEN\n"
                     : "this token is not known here: it must be one of the server's token file, or the one "
                       "that it prints when it starts\n";
    return reply;
  }
  static const std::string policy = "default-src 'none'; style-src " + hash_of(sign_in_style()) +
                                    "; base-uri 'none'; form-action 'self'; frame-ancestors 'self'";
  reply.content_type = "text/html; charset=utf-8";
  reply.body = page(target, unknown);
  reply.headers.emplace_back("Content-Security-Policy", policy);
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
  const std::string_view sent = bearer(request.authorization);
  const std::string_view kept = cookie_value(request.cookie, cookie_name(port));
  if (tokens.accepts(sent) || tokens.accepts(kept))
    return is_page && asked.signed_in ? std::optional(see(asked.rest)) : std::nullopt;
  const Unknown unknown = !asked.token.empty() || !sent.empty() ? Unknown::kSent
                          : is_page && asked.signed_in          ? Unknown::kNotKept
                          : !kept.empty()                       ? Unknown::kKept
                                                                : Unknown::kNone;
  return token_needed(is_page, asked.rest, unknown);
}

}  // namespace relievo
