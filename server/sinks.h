// SPDX-License-Identifier: Apache-2.0
// Where a serving pipeline's frames go.
#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <string>

#include "base/time.h"
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
/// failing recording is logged once and does not end the stream. `key_frame_wanted` is called where it wants
/// one. To be called about ten times a second, by one thread, which waits for the disk; `recorder` must
/// outlive it.
std::function<void()> recorder_care(Recorder& recorder, std::function<void()> key_frame_wanted);

/// Calls that with each frame and status.
std::unique_ptr<FrameSink> make_calling_sink(std::function<void()> call);

/// What the service manager is told of all streams together. Any thread.
class ServiceBoard {
 public:
  /// The stream does that; `alive` where nothing needs a restart. To be said again within kHeardWithin_ns.
  void say(const std::string& stream, const std::string& line, bool alive);
  /// It has ended.
  void forget(const std::string& stream);

  static constexpr std::int64_t kHeardWithin_ns = 10 * kNanosecondsPerSecond;

 private:
  struct Entry {
    std::string line;
    bool alive = true;
    std::int64_t heard_ns = 0;
  };
  std::mutex mutex_;
  std::map<std::string, Entry> streams_;
};

/// Puts on the board, which must outlive it, that the stream lives, and what it does; not alive is one that
/// gives up frames before a stage while nothing comes out of the last one.
std::unique_ptr<FrameSink> make_service_sink(ServiceBoard& board, const std::string& stream);

}  // namespace relievo
