// SPDX-License-Identifier: Apache-2.0
// The lower rungs of a stream's quality ladder: made of the frames that the stream itself has sent, on a
// thread of their own, and only while somebody reads them.
#pragma once

#include <array>
#include <atomic>
#include <cstdint>
#include <functional>
#include <memory>
#include <thread>
#include <vector>

#include "base/bounded_queue.h"
#include "base/pattern.h"
#include "base/result.h"
#include "base/rig.h"
#include "base/rung.h"
#include "codec/frame3d_codec.h"
#include "server/pipeline.h"
#include "server/stats.h"
#include "server/working_volume.h"

namespace relievo {

/// What a rung of this stream is encoded with: coarser than `full` where that pays, finer nowhere.
EncodeOptions rung_options(const EncodeOptions& full, Rung rung);

class Ladder final : public LowerRungs {
 public:
  /// `encode` and `depth_resolution`: the stream's own, see PipelineOptions.
  Ladder(const Rig& rig, const Pattern& pattern, const EncodeOptions& encode, double depth_resolution);
  Ladder(const Ladder&) = delete;
  Ladder& operator=(const Ladder&) = delete;
  ~Ladder() override;

  struct Output {
    Rung rung;
    std::function<int()> readers;                        // now; any thread
    std::function<Status(const FrameMessage&)> publish;  // on the ladder's thread
  };
  /// Before the first take(), best rung first. What fails to be published is logged once, and the rung goes
  /// on.
  void add(Output output);
  /// The next frame of each rung decodes alone. Any thread, also before add().
  void request_key_frame() { key_wanted_ = true; }

  bool wanted() override;
  /// A frame that comes before the one before is done takes its place, which is counted.
  void take(Frame3D frame, std::int64_t capture_time_ns) override;
  void end() override;
  std::vector<RungStatus> status() const override;

 private:
  struct Step;
  struct Item {
    Frame3D frame;
    std::int64_t capture_time_ns;
  };
  void run();
  void encode(Step& step, Item& item, Image8& half);

  const Rig rig_;
  const Pattern pattern_;
  const EncodeOptions encode_;
  const double depth_resolution_;
  std::vector<std::unique_ptr<Step>> steps_;
  WorkingVolume volume_;  // of surfaces that are no grid; of the ladder's thread
  std::atomic<bool> key_wanted_{false};
  std::atomic<bool> ending_{false};
  BoundedQueue<Item> queue_{1};
  std::thread thread_;
};

}  // namespace relievo
