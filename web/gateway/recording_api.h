// SPDX-License-Identifier: Apache-2.0
// /api/recording/STREAM and /api/recordings: recordings started, stopped and listed. `control` may be null:
// nothing is recorded here.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <string_view>

#include "web/gateway/recording_control.h"
#include "web/gateway/routes.h"

namespace relievo {

/// GET: what the recording of `stream` is doing, as JSON.
HttpReply recording_state(std::string_view stream, const RecordingControl* control);

/// POST of {"action":"start"} or "stop": the same, afterwards.
HttpReply order_recording(std::string_view stream, const HttpRequest& request, RecordingControl* control);

/// GET: the files, the newest first, a thousand of them at most; of one that is being written, what is whole.
HttpReply list_recordings(const RecordingControl* control);

/// Whether an MCAP file ends as its writer ends it: else it was cut short, or is being written. May wait for
/// the disk.
bool has_end(const std::filesystem::path& file);

/// The file of that name in the folder, which may not be there; nothing where no recording has such a name.
std::optional<std::filesystem::path> recording_file(const std::string& name, const RecordingControl& control);

}  // namespace relievo
