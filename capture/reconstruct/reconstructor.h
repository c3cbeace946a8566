// SPDX-License-Identifier: Apache-2.0
// The whole of paper sections 5.2 to 5.5: camera frames in, surfaces out, by the pattern's scheme.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string_view>

#include "base/filter_counts.h"
#include "base/frame3d.h"
#include "base/pattern.h"
#include "base/result.h"
#include "base/rig.h"
#include "capture/reconstruct/step_keeping.h"
#include "capture/reconstruct/surface_builder_options.h"
#include "capture/source/field_source.h"

namespace relievo {

enum class Decoder {
  kOrdered,  // by the sequence's order along and across lines (capture/reconstruct/sequence.h)
  kQuick,  // the same with less care, for live use where time is short (capture/reconstruct/quick_sequence.h)
  kPaper,  // as the paper writes it (5.2, 5.3), no piece too small for it: the readable reference
};

/// "ordered", "quick" or "paper".
std::string_view decoder_name(Decoder decoder);
/// Nothing where no decoder is called so.
std::optional<Decoder> decoder_named(std::string_view name);

struct ReconstructOptions {
  Decoder decoder = Decoder::kOrdered;
  int threads = 1;  // 1 is the serial reference; more give the same result
  bool texture = true;
  int line_stride = 1;  // 2: every second detection line alone, for half the time; 4: every fourth
  SurfaceBuilderOptions surface;
};

/// Milliseconds of each stage of the last frame, and what each decided.
struct ReconstructReport {
  static constexpr double kNotableExcess = 0.03;  // what more costs is not all taken out

  double detect_ms = 0, match_ms = 0, triangulate_ms = 0, surface_ms = 0, texture_ms = 0;
  std::size_t boundaries = 0;  // detected in this frame
  std::size_t matched = 0;     // of which decoded with the frame before
  int slide = 0;               // as which the frame was decoded, from 0
  FilterCounts filters;        // what each filter did
  StepReport step;             // of projector and camera; a frame of mixed exposures is dropped
  double slide_excess = 0;     // of brightness, over the complement's exposure: taken out (field_balance.h)
  bool white = false;          // this frame was white and gave texture alone (scheme white-frame)
  bool exchanged = false;      // frames decode far better with their exposures exchanged (exposure_doubt.h)
  bool same_slide = false;     // this frame shows the slide of the one before: a frame was dropped (5.2.3)
};

/// One stream's decoder: holds the frame before. One thread at a time.
class Reconstructor {
 public:
  /// Of a projector that is turned either way up. Fails where rig and pattern do not fit (see read_pattern
  /// for what a valid pattern is, and upright()).
  static Result<Reconstructor> create(const Rig& rig, const Pattern& pattern,
                                      const ReconstructOptions& options);
  Reconstructor(Reconstructor&&) noexcept;
  Reconstructor& operator=(Reconstructor&&) noexcept;
  ~Reconstructor();

  /// The surface this frame completes with the last one under the other slide: the frame before, unless
  /// frames were dropped (5.2.3). Nothing until both slides were seen, for a white frame, and where each
  /// exposure is under two slides (report().step). Fails where the frame's size is not the rig's.
  Result<std::optional<Frame3D>> add(const CapturedFrame& frame);

  /// Looks at a frame that is to give no surface, in the time of report().detect_ms, so that the next one has
  /// the other slide close by: where frames were dropped for want of time, the last one under it can lie far
  /// back, and what moves is then decoded with something else. Fails as add() does.
  Status observe(const CapturedFrame& frame);

  /// Takes back a surface that nobody needs any more, so that a later one is made in its memory. A stream
  /// whose frames all come back allocates nothing once it is warm. Any thread.
  void recycle(Frame3D&& used);

  /// What else the last add() completed, in order of time: under white-field the surface of the frame itself,
  /// add() having given the one half way from the frame before. Nothing when there is no more.
  std::optional<Frame3D> next();

  /// What GridPoints refer to: upright() of what create() was given. As long as this decoder.
  const Rig& rig() const;
  const Pattern& pattern() const;

  /// Textures made so far: fewer than surfaces under white-frame, half as many under white-field.
  std::uint64_t textures() const;

  /// Of the last add() or observe().
  const ReconstructReport& report() const;

  /// What the last add() decoded: a slide and its complement, of the frame itself or made of it as the scheme
  /// and projector and camera out of step need, in light (CameraResponse). Null where it decoded nothing.
  /// Valid until the next add(), as long as the frame that it was given.
  const CapturedFrame* decoded() const;

 private:
  struct State;
  explicit Reconstructor(std::unique_ptr<State> state);
  std::unique_ptr<State> state_;
};

}  // namespace relievo
