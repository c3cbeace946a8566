// SPDX-License-Identifier: Apache-2.0
// How much care frames are decoded with so that all of a camera's are (`--decoder auto`): less where frames
// are dropped for want of time, more again where there would be time for it.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <string>

#include "capture/reconstruct/reconstructor.h"

namespace relievo {

struct Pace {
  Decoder decoder;
  int line_stride;  // of the rig's detection lines

  bool operator==(const Pace&) const = default;
};
/// For people: "quick, every second line".
std::string to_string(const Pace& pace);

/// Whether more frames are dropped than a few at once, or a small share of all for long. One thread. Pure.
class DropWatch {
 public:
  /// `burst`: frames that may be dropped beyond that share.
  explicit DropWatch(double burst) : burst_(burst) {}

  /// A frame was reconstructed after so many others were dropped.
  void add(std::uint64_t dropped);
  bool too_many() const { return beyond_ > burst_; }
  void forget() { beyond_ = 0; }

 private:
  double burst_;
  double beyond_ = 0;  // the share
};

/// Goes down where frames are dropped and take longer than the camera's period, or where too many are dropped
/// whatever they take: at once to the pace that should fit. Goes up a pace where that should fit by what
/// frames take. One that turns out too slow after all has to be waited for four times as long the next time,
/// unless frames take so much less than they did then that it fits. What later stages drop says nothing about
/// this one. One thread. Pure: the same times give the same paces.
class PaceControl {
 public:
  /// `lines`: the camera's detection lines, of which enough are to be left to see what is there.
  /// `frame_rate`: the camera's, by which paces are chosen; whether frames are dropped does not depend on it.
  PaceControl(int lines, double frame_rate);

  /// A frame was reconstructed at now(), which took the thread `ms`, after so many others were dropped for
  /// want of time. `now_ns`: monotonic.
  void add(std::int64_t now_ns, double ms, std::uint64_t dropped);
  /// For the next frame.
  Pace now() const;

 private:
  static constexpr std::size_t kPaces = 4, kRecent = 8;
  /// A pace that was too slow.
  struct Failed {
    double ms = 0;              // that frames took,
    double below_ms = 0;        // and at the next lower pace afterwards; 0: not known yet
    std::int64_t pause_ns = 0;  // before it is tried again,
    std::int64_t until_ns = 0;  // which is then
  };

  void down(std::int64_t now_ns, double ms);
  void up_if_it_fits(std::int64_t now_ns);
  void change_to(std::size_t pace);
  void begin_calm(std::int64_t now_ns);
  double typical_ms() const;

  const double period_ms_;
  std::size_t paces_ = 1;  // that there are to choose from
  std::size_t pace_ = 0;
  std::array<Failed, kPaces> failed_;
  std::int64_t climbed_ns_ = -1;  // to this pace; below 0: it was not climbed to

  // Since the pace changed:
  std::size_t frames_ = 0;
  std::array<double, kRecent> recent_ms_{};  // of the last frames that count
  std::size_t dropped_at_ = 0;               // frames_ when some were dropped last; 0: none
  DropWatch drops_;
  std::int64_t calm_from_ns_ = 0;  // since when none were dropped, and nothing was decided
  double calm_ms_ = 0;             // sum over the frames since
  std::size_t calm_frames_ = 0;
};

}  // namespace relievo
