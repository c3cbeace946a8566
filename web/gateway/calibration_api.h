// SPDX-License-Identifier: Apache-2.0
// /api/calibration: calibrating a rig from the page /rig. `control` may be null: there is no camera here.
#pragma once

#include <string_view>

#include "web/gateway/calibration_control.h"
#include "web/gateway/routes.h"

namespace relievo {

/// GET: how far it is, as JSON.
HttpReply calibration_state(CalibrationControl* control);

/// GET of "NAME.jpg".
HttpReply calibration_picture(std::string_view name, CalibrationControl* control);

/// POST of {"action":"start","stream":"face","kind":"colour"} and so on: the same as GET, afterwards.
HttpReply order_calibration(const HttpRequest& request, CalibrationControl* control);

}  // namespace relievo
