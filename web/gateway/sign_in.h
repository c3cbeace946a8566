// SPDX-License-Identifier: Apache-2.0
// How a token reaches a gateway: in an Authorization header, in a cookie, or once in the address, which
// becomes the cookie. Pure.
#pragma once

#include <cstdint>
#include <optional>

#include "web/gateway/routes.h"

namespace relievo {

/// Nothing where the request may go on. Else what it is answered: the way to the same address without a right
/// token, which a cookie holds from then on, over one that tells whether the browser kept it; or 401, to a
/// browser with a form for the token.
std::optional<HttpReply> sign_in(const HttpRequest& request, const Tokens& tokens, std::uint16_t port);

}  // namespace relievo
