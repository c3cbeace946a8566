// SPDX-License-Identifier: Apache-2.0
// A stream of the hub by the messages of docs/WEB.md: credit, a latest-frame slot, the server's clock.
#pragma once

#include <memory>
#include <string>

#include "web/gateway/connection.h"
#include "web/gateway/hub.h"

namespace relievo {

/// `hub` must outlive it.
std::unique_ptr<WsFeed> make_stream_feed(Hub& hub, std::string stream);

}  // namespace relievo
