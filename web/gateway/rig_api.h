// SPDX-License-Identifier: Apache-2.0
// /api/rig/STREAM: what its camera sees, for whoever sets up the rig. `control` may be null: there is no
// camera here.
#pragma once

#include <string_view>

#include "web/gateway/rig_control.h"
#include "web/gateway/routes.h"

namespace relievo {

/// GET of "STREAM?pictures=camera,coverage": a look as JSON; those pictures can be had a moment later.
HttpReply rig_look(std::string_view stream, const HttpRequest& request, RigControl* control);

/// GET of "STREAM/NAME.jpg"; 503 until it was drawn.
HttpReply rig_picture(std::string_view stream_and_name, RigControl* control);

/// GET: what the projector is doing, as JSON.
HttpReply projector_state(const RigControl* control);

/// POST of {"action":"start","stream":"face","show":"pattern"} or {"action":"stop"}: the same, afterwards.
HttpReply order_projector(const HttpRequest& request, RigControl* control);

}  // namespace relievo
