// SPDX-License-Identifier: Apache-2.0
// What can be asked of the simulator: "SCENE[,key=value...]".
#pragma once

#include <cstdint>
#include <string>

#include "base/pattern.h"
#include "base/result.h"
#include "base/rig.h"
#include "capture/pattern/bcsl.h"

namespace relievo::sim {

/// Defaults follow the paper's system: NTSC, 90 stripes of a (6,2) code.
struct SimOptions {
  std::string scene = "face";
  int width = 640, height = 480;  // camera pixels
  Scan scan = Scan::kInterlaced;
  FieldOrder field_order = FieldOrder::kTop;
  double rate = 29.97;  // frames a second
  int frames = 0;       // frames of one pass; 0: one period
  int period = 80;  // frames until all motion repeats; a looped source renders these once. 84 of white-frame
  int drop = 0;     // every n-th camera frame is lost; 0: none

  int projector_width = 1024, projector_height = 768;
  Scheme scheme = Scheme::kComplementary;
  int base = 6, slides = 2, stripes = 90;  // slides is 1 under the scheme one-slide
  int first = 0;                           // first stripe within the code's path
  CodePath path = CodePath::kClear;

  // A projector without genlock, in fields of the camera: how far the shown slide's time has gone when frame
  // 0's first exposure begins, and how much the projector gains each second. An exposure across a slide
  // change mixes both.
  double phase = 0;
  double drift = 0;
  double shutter = 1;  // exposure, of a field

  double noise = 1.2;      // sigma, of 255
  double chroma = 1.0;     // sigma of the chroma blur along a line, camera pixels
  double defocus = 0.7;    // sigma of the projector's blur, projector pixels
  double ambient = 0.04;   // light that is not the projector's, of its white
  double flicker = 0;      // of the ambient light, by how much it comes and goes on mains of 50 Hz
  double gloss = 1.0;      // times each material's own gloss
  double albedo = 1.0;     // times each material's own albedo: dark scenes
  double crosstalk = 1.0;  // 0: the camera sees the projector's primaries as they are
  double gamma = 1.0;      // of the camera: CameraColours
  double exposure = 1.0;   // times the exposure that puts white at working distance to 230
  int rays = 1;  // of a pixel, each way, where shapes and their faces meet; 1: one through its middle alone
  double distortion = 0.0;  // times the lens distortion of a cheap camera and projector
  double baseline = 1.0;    // times the scene's own; below 0: the projector stands to the camera's left
  double roll = 0.0;        // degrees by which the projector is turned about its axis
  std::uint32_t seed = 1;
};

/// Errors name the key or value and list the valid ones.
Result<SimOptions> parse_sim_options(const std::string& spec);

/// One line a key: name, range, default. For help texts.
std::string sim_options_help();

}  // namespace relievo::sim
