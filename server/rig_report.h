// SPDX-License-Identifier: Apache-2.0
// A look at a rig as JSON (docs/WEB.md), with what a person should do.
#pragma once

#include <string>
#include <vector>

#include "base/rig.h"
#include "capture/evaluate/rig_check.h"
#include "server/frame_tap.h"
#include "web/gateway/rig_control.h"

namespace relievo {

/// `made` has the pictures that are there.
std::string rig_report(const std::string& stream, const TappedFrame& frame, const RigCheck& check,
                       const RigView& made, const Rig& rig);

/// What is wrong and how to mend it, in sentences, the worst first; empty where nothing is.
std::vector<std::string> rig_advice(const TappedFrame& frame, const RigCheck& check);

}  // namespace relievo
