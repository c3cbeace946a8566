// SPDX-License-Identifier: Apache-2.0
// Where a serving pipeline's frames go.
#pragma once

#include <memory>

#include "idl/recorder.h"
#include "idl/transport.h"
#include "server/pipeline.h"
#include "web/gateway/gateway.h"

namespace relievo {

/// Publishes on DDS; `publisher` must outlive it.
std::unique_ptr<FrameSink> make_dds_sink(Publisher& publisher);

/// Feeds browsers; `gateway` must outlive it.
std::unique_ptr<FrameSink> make_gateway_sink(Gateway& gateway, const std::string& stream);

/// Keeps `recorder`'s chunks short in time; it reads the frames themselves off DDS, as any recorder does. A
/// failing recording is logged once and does not end the stream. `recorder` must outlive it.
std::unique_ptr<FrameSink> make_recorder_sink(Recorder& recorder);

/// Tells the service manager that the stream lives, and what it does; not alive is one that gives up frames
/// before a stage while nothing comes out of the last one.
std::unique_ptr<FrameSink> make_service_sink();

}  // namespace relievo
