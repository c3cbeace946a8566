// SPDX-License-Identifier: Apache-2.0
// One stream of a server: a source, its pipeline, and all that its frames go to.
#pragma once

#include <atomic>
#include <memory>
#include <string>

#include "base/result.h"
#include "base/stream.h"
#include "server/config.h"
#include "server/recording_desk.h"
#include "server/rig_desk.h"
#include "server/sinks.h"
#include "server/stage_desk.h"
#include "web/gateway/gateway.h"
#include "web/gateway/key_frame_wishes.h"

namespace relievo {

/// What the streams of a server share; all of it outlives them.
struct Surroundings {
  const ServeConfig& config;  // of the server, not of one stream
  KeyFrameWishes& wishes;     // of DDS readers and browsers
  ServiceBoard& board;
  Gateway* gateway = nullptr;     // null: none
  RecordingDesk* desk = nullptr;  // null: nothing is recorded on request
  RigDesk* rigs = nullptr;        // null: nobody looks at the rigs
  StageDesk* stages = nullptr;    // null: nobody asks what stages take
};

DomainOptions domain_options(const ServeConfig& config);

/// Opened, run and destroyed on one thread; the other functions are for any.
class ServedStream {
 public:
  /// Opens the source and announces the stream on the network. Where `stop` is set meanwhile it fails soon.
  static Result<std::unique_ptr<ServedStream>> open(const StreamConfig& config,
                                                    const Surroundings& surroundings,
                                                    const std::atomic<bool>& stop);
  /// No longer announced; what is recorded on request is whole.
  virtual ~ServedStream() = default;

  /// Until the source ends, something fails, or stop(). Call once.
  virtual Status run() = 0;
  /// Ends run() soon.
  virtual void stop() = 0;
  virtual void request_key_frame() = 0;
};

}  // namespace relievo
