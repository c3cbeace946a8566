// SPDX-License-Identifier: Apache-2.0
// All streams of the hub by the Foxglove WebSocket protocol: a channel a stream, its frames as DDS carries
// them.
#pragma once

#include <array>
#include <memory>
#include <string>
#include <string_view>

#include "web/gateway/connection.h"
#include "web/gateway/gateway.h"
#include "web/gateway/hub.h"

namespace relievo {

/// Two names of one protocol: newer clients of Foxglove offer only the first, older ones only the second.
inline constexpr std::array<std::string_view, 2> kFoxgloveProtocols = {"foxglove.sdk.v1",
                                                                       "foxglove.websocket.v1"};

/// `hub` and `format` must outlive it. `session`: the same for all clients of a server, another one of each.
/// A frame follows as soon as the one before it was taken by the system, and those that come meanwhile are
/// dropped and counted as for want of credit.
std::unique_ptr<WsFeed> make_foxglove_feed(Hub& hub, const SampleFormat& format, std::string session);

}  // namespace relievo
