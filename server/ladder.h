// SPDX-License-Identifier: Apache-2.0
// The lower rungs of a stream's quality ladder, and those with JPEG textures: made of the frames that the
// stream itself has sent, on a thread of their own, and only while somebody reads them.
#pragma once

#include <array>
#include <atomic>
#include <cstdint>
#include <functional>
#include <memory>
#include <thread>
#include <utility>
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

/// What a rung of this stream is encoded with: coarser than `full` where that pays, finer nowhere. Of the
/// JPEG rungs the texture is JPEG, whatever it is in `full`.
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
    // Whether the rung takes a frame now, which then decodes alone; empty: it takes each. Any thread.
    std::function<bool()> due{};
  };
  /// Before the first take(), best rung first. What fails to be published is logged once, and the rung goes
  /// on.
  void add(Output output);
  /// The next frame of each rung decodes alone. Any thread, also before add().
  void request_key_frame() { key_wanted_ = true; }

  bool wanted() override;
  /// A frame that comes before the one before is done takes its place, which is counted.
  void take(Frame3D frame, std::int64_t capture_time_ns, int line_stride) override;
  void give_back_to(std::function<void(Frame3D&&)> give_back) override { give_back_ = std::move(give_back); }
  void end() override;
  std::vector<RungStatus> status() const override;

 private:
  struct Step;
  /// Given back where it ends: encoded, dropped by the queue, or left in it.
  struct Item {
    Item(Frame3D frame_, std::int64_t time_ns, int stride, const std::function<void(Frame3D&&)>* give_back_)
        : frame(std::move(frame_)), capture_time_ns(time_ns), line_stride(stride), give_back(give_back_) {}
    Item(Item&& other) noexcept
        : frame(std::move(other.frame)),
          capture_time_ns(other.capture_time_ns),
          line_stride(other.line_stride),
          give_back(std::exchange(other.give_back, nullptr)) {}
    Item& operator=(Item&&) = delete;
    ~Item() {
      if (give_back != nullptr && *give_back) (*give_back)(std::move(frame));
    }
    Frame3D frame;
    std::int64_t capture_time_ns;
    int line_stride;
    const std::function<void(Frame3D&&)>* give_back;  // null: nobody
  };
  void run();
  void encode(Step& step, Item& item);

  const Rig rig_;
  const Pattern pattern_;
  const EncodeOptions encode_;
  const double depth_resolution_;
  std::vector<std::unique_ptr<Step>> steps_;
  Image8 half_;           // of the ladder's thread, as what follows
  WorkingVolume volume_;  // of surfaces that are no grid
  std::atomic<bool> key_wanted_{false};
  std::atomic<bool> ending_{false};
  std::function<void(Frame3D&&)> give_back_;
  BoundedQueue<Item> queue_{1};
  std::thread thread_;
};

}  // namespace relievo
