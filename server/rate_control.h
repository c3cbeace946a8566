// SPDX-License-Identifier: Apache-2.0
// Keeps a stream's bit rate, the time that its frames take, and its quality: texture quality, geometry step,
// sigmas and lines move together along a measured table. Nothing is queued for it and nothing dropped: a
// frame is made smaller before it is encoded, and one that became larger than its share is paid back by those
// after it.
#pragma once

#include <array>
#include <cstddef>
#include <optional>
#include <span>

#include "codec/frame3d_codec.h"

namespace relievo {

/// A place of the table: the finest is 0.
struct RateLevel {
  int texture_quality;
  int step_bits;
  bool sigmas;        // of each vertex, where the stream has them
  bool every_line;    // else every second one
  double size;        // of a whole frame, level 0 being 1: measured, as what follows
  double time;        // to encode it, level 0 being 1
  double texture_db;  // PSNR of the texture
};
std::span<const RateLevel> rate_levels();

/// What a stream is to keep; each 0 where it is not asked for. Rate and deadline go before quality.
struct RateTargets {
  double bit_rate = 0;     // bits a second, of all that is sent
  double deadline_ms = 0;  // from the begin of encoding to the end of publishing, of 99 frames in 100
  double texture_db = 0;   // PSNR of the texture: no finer than that needs

  bool operator==(const RateTargets&) const = default;
  bool any() const { return bit_rate > 0 || deadline_ms > 0 || texture_db > 0; }
};

/// One thread. Pure: the same sizes and times give the same levels.
class RateControl {
 public:
  /// Frames in which one that was larger than its share has been paid back, up to ten times that.
  static constexpr int kPayback = 30;

  /// The rate is that of the camera's frames, and those that are missing only make the stream smaller.
  /// `asked`: the finest that there may be.
  RateControl(const RateTargets& targets, double frames_per_s, const EncodeOptions& asked);

  /// Sets quality, step, sigmas and lines for the next frame, none finer than was asked for.
  void apply(EncodeOptions& options) const;
  /// What the frame became for which apply() was called last. Key frames are larger: they count with their
  /// share, 1 of `key_interval`.
  void add(std::size_t bytes, bool is_key, int key_interval);
  /// How long a frame took that was encoded at place(). May come some frames later.
  void took(double ms, double place);
  /// The PSNR of a frame's texture that was encoded at place(), now and then.
  void looked(double texture_db, double place);

  /// Where between the levels the next frame is: 2.5 halfway from 2 to 3.
  double place() const { return place_; }
  /// 0: as fine as asked for, else a level of the table.
  int level() const;

 private:
  double key_share(int key_interval) const;
  double place_for_rate(int key_interval);
  double place_for_deadline() const;
  void move();

  const RateTargets targets_;
  const EncodeOptions asked_;
  const double share_;                 // bytes a frame
  const double finest_;                // place above which `asked` lies
  std::optional<double> key_, delta_;  // smoothed sizes of such frames, as they would be at level 0
  double debt_ = 0;                    // bytes that were sent beyond the shares of the frames so far
  int since_key_ = 0;                  // frames
  std::array<float, 512> times_{};     // the last ones, as they would be at level 0
  std::size_t times_seen_ = 0;
  double for_rate_, for_deadline_, for_quality_;  // places: the coarsest counts
  double place_;
  int form_;  // level whose step, sigmas and lines are used
};

}  // namespace relievo
