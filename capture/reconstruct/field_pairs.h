// SPDX-License-Identifier: Apache-2.0
// What a projection scheme's frames are to a decoder (paper 5.5): a slide's exposure and its complement's,
// taken as they are or made from white, and the picture of the scene in white light.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "base/image.h"
#include "base/parallel.h"
#include "base/pattern.h"
#include "base/rig.h"
#include "capture/camera_response.h"
#include "capture/source/field_source.h"

namespace relievo {

/// Reads the frames of one stream in order; keeps what a later frame needs of an earlier one. One thread.
class FieldPairs {
 public:
  FieldPairs(Scheme scheme, const Rig& rig);

  /// The frame as a slide and its complement, in light: `frame.light` itself, or under white-field one made
  /// of it (valid until the next call). Null where the frame was white (white-frame). The frame's size must
  /// be the rig's.
  const CapturedFrame* read(const SeenFrame& frame, WorkerPool& pool);

  /// The scene in white light where the scheme shows it, as of `frame`, captured as read last: under
  /// white-field its white field, under white-frame the last white frame. False where there is none, and the
  /// texture is to be made of the slide and its complement. `out` is reused where its size fits.
  bool white(const CapturedFrame& frame, Image8& out) const;
  /// When what white() gives was exposed, or else the frame read last.
  std::int64_t texture_time_ns() const { return texture_time_ns_; }

  /// Frames read before are not to be set against later ones.
  void forget();

  /// Textures so far: under white-frame the white frames, else the frames.
  std::uint64_t textures() const { return textures_; }

 private:
  bool is_white(const CapturedFrame& frame);
  const CapturedFrame* with_complement(const CapturedFrame& frame, WorkerPool& pool);
  std::array<float, 9> ambient_of_white(const CapturedFrame& frame) const;

  Scheme scheme_;
  std::array<double, 9> colour_matrix_;
  std::int64_t frame_ns_;
  std::int64_t texture_time_ns_ = 0;
  std::uint64_t textures_ = 0;
  std::vector<float> contrasts_;  // white-frame: of the last frames' two exposures, 0..1
  Image8 white_;  // white-frame: the last white frame, captured; white-field: the frame before, in light
  std::int64_t white_time_ns_ = 0;
  CapturedFrame made_;  // white-field
};

}  // namespace relievo
