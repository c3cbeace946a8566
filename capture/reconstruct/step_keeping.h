// SPDX-License-Identifier: Apache-2.0
// Projector and camera in step (paper 4.3, 5.2.3, and beyond): without genlock an exposure begins anywhere in
// a slide's time. Where it begins is told from the pictures: an exposure under two slides is their mean, and
// over four exposures in a row (two frames) everything but the slides cancels.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "base/pattern.h"
#include "base/rig.h"
#include "capture/source/field_source.h"

namespace relievo {

/// Of one frame. A phase of 0 is in step: the first exposure is under a slide alone. 0.3: 0.3 of it is under
/// what comes next. 1: it is under the slide's complement, and the second one under the next slide.
struct StepReport {
  std::optional<float> phase;  // 0..2, in exposures; nothing: too dark, too much motion, or a frame was lost
  bool mixed = false;          // dropped: each exposure is under two slides
  bool regrouped = false;      // the frame was made of the last frame's second and this one's first exposure
  bool restarted = false;      // what was seen before is not to be set against this frame
};

/// Reads the frames of one stream in order. One thread.
class StepKeeper {
 public:
  StepKeeper(const Pattern& pattern, const Rig& rig);

  /// The frame whose first exposure is under a slide: `frame` itself, one made of the last frame's second and
  /// this one's first exposure (valid until the next call), or null: exposures are mixed, or what would be
  /// needed was lost. Schemes other than complementary and white-field, and single slides until exchange(),
  /// are taken as they are. The frame's size must be the rig's.
  const CapturedFrame* read(const CapturedFrame& frame);

  /// Of single slides, in which pictures do not tell: with the frame after `frame`, which was read last, it
  /// is the other exposure that shows the slide.
  void exchange(const CapturedFrame& frame);

  const StepReport& report() const { return report_; }

 private:
  using Samples = std::vector<float>;  // of one exposure, at the same places of the scene in each

  void sample(const CapturedFrame& frame);
  std::optional<float> estimate() const;
  void keep_second(const CapturedFrame& frame);
  const CapturedFrame* regroup(const CapturedFrame& frame);
  const CapturedFrame* regroup_and_keep(const CapturedFrame& frame);

  bool active_;
  float reference_;  // angle of a phase of 0
  std::int64_t frame_ns_;
  StepReport report_;
  Samples now_[2], before_[2];
  std::optional<std::int64_t> before_time_ns_;
  std::optional<float> phase_;  // the last one known
  int unknown_ = 0;             // frames since
  bool late_ = false;           // by an exposure: frames are regrouped
  bool settled_ = false;        // the last frame was known to be so
  Image8 second_;               // interlaced: the last picture; progressive: its second one
  std::optional<std::int64_t> second_time_ns_;
  CapturedFrame made_;
};

/// How camera and projector drift against each other, from the phases of frames.
class StepDrift {
 public:
  void add(std::int64_t time_ns, float phase);

  /// Exposures a second that the projector gains; nothing while too little is known. Good to a few per cent
  /// where exposures last as long as slides; shorter ones hide small drifts and double others.
  std::optional<double> per_second() const;

 private:
  struct Sample {
    double time_s, phase;
  };
  std::vector<Sample> samples_;  // ring
  std::size_t added_ = 0;
  double last_ = 0;  // unwrapped
};

/// What a person should do about frames that are dropped for their mixed exposures.
std::string step_advice(float phase, std::optional<double> drift_per_second, double frame_rate);

}  // namespace relievo
