// SPDX-License-Identifier: Apache-2.0
// The latest frame of a live stream, for what may be slower than the camera: it leaves frames out.
#pragma once

#include <chrono>
#include <condition_variable>
#include <mutex>
#include <optional>

#include "base/frame3d.h"
#include "base/rig.h"
#include "cli/program.h"
#include "codec/frame3d_codec.h"
#include "idl/transport.h"

namespace relievo {

/// Must outlive the subscriber that has its callbacks.
class LatestFrame {
 public:
  struct Taken {
    Frame3D frame;
    Rig rig;
  };

  Subscriber::Callbacks callbacks();

  /// One that has not been taken; any thread. Nothing where none comes in time, or `stop` stopped.
  std::optional<Taken> take(std::chrono::duration<double> patience, StopSignal& stop);

 private:
  FrameDecoder decoder_;  // of the subscriber's thread alone
  std::mutex mutex_;
  std::condition_variable changed_;
  std::optional<Rig> rig_;
  std::optional<Frame3D> frame_;
};

}  // namespace relievo
