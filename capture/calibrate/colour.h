// SPDX-License-Identifier: Apache-2.0
// Colour calibration (paper 4.4): the matrix M of Eq. 1 that turns captured into projected colours, by least
// squares (Eq. 2) over captures of a white target under each colour, black and white. Pure functions; any
// thread.
#pragma once

#include <array>
#include <optional>
#include <string>
#include <vector>

#include "base/image.h"
#include "base/pattern.h"
#include "base/result.h"
#include "base/rig.h"

namespace relievo {

/// One picture of the target. RGB, all of one size and exposure.
struct ColourCapture {
  std::string name;  // for messages, e.g. "100.png"
  Primary colour = 0;
  Image8 picture;
};

struct Roi {
  int x = 0, y = 0, width = 0, height = 0;
};

struct ColourOptions {
  std::optional<Roi> roi;              // of the white target; found where it is not given
  double saturated_share = 0.01;       // of the target's pixels at 254 or above in a channel: refused
  double dimmest_white = 50;           // of 255: brightest channel of the target under white; refused below
  double ambient_share = 0.25;         // of the white level, under black: refused above
  std::optional<double> camera_gamma;  // where it is known, 1..CameraResponse::kMostGamma; else told by light
};

/// A colour as it comes back: averaged over the target, and what its detection rests on.
struct ColourReport {
  Primary colour = 0;
  std::array<double, 3> captured{};   // mean RGB, of 255
  std::array<double, 3> estimated{};  // M * light, of 255; the colour itself is 0 or 255 a channel
  double residual = 0;                // RMS over the channels of estimated minus projected, of 255
  /// Of palette colours only: the least |D| over channels of the difference to the complement's capture, with
  /// the brightest calibrated channel scaled to 255 as the paper's decoder does (5.2); negative where a
  /// channel has the wrong sign.
  double weakest_difference = 0;
  double weakest_in_sigmas = 0;  // the same over the noise of one pixel's difference
  int weakest_channel = 0;       // 0 red, 1 green, 2 blue
};

struct ColourCalibration {
  /// Its gamma: as asked for, or that of the curve with which light adds up best, 1 where a straight response
  /// explains the captures about as well.
  CameraColours camera;
  std::vector<ColourReport> colours;
  double residual = 0;  // RMS over all colours and channels, of 255
  double noise = 0;     // of one captured channel at one pixel, of 255
  Roi target;           // the box around the pixels used
  std::size_t target_pixels = 0;
};

/// |D| below which the paper's decoder ignores a channel (5.2.2), of 255.
inline constexpr double kDetectionThreshold = 20;

/// A residual over this says that something is wrong with the captures, of 255; web/viewer's rig page has the
/// same figure.
inline constexpr double kMostResidual = 12;

/// Needs black, white and colours enough to determine M (three independent ones); several captures of one
/// colour are averaged. Fails, naming the picture and what to change, where one is saturated, under-exposed,
/// lit by something else, of another colour than it is named by (where six colours or more are there to
/// tell), or where no target is found.
Result<ColourCalibration> calibrate_colour(const std::vector<ColourCapture>& captures,
                                           const ColourOptions& options);

/// "100": digits R, G, B.
std::string primary_name(Primary colour);
std::optional<Primary> primary_of(const std::string& name);

}  // namespace relievo
