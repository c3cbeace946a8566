// SPDX-License-Identifier: Apache-2.0
// A surface on the grid of detection lines and stripe boundaries: one whole number a vertex, its column in
// the picture. With the rig's calibration that is all there is to know of its geometry (codec/FORMAT.md).
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "base/frame3d.h"
#include "base/pattern.h"
#include "base/result.h"
#include "base/rig.h"

namespace relievo {

/// How many lines and how many boundaries a grid may have.
inline constexpr int kMostGridSide = 16384;

/// What turns columns into points. Numbers are those on the wire, binary32.
struct GridCalibration {
  PinholeModel camera, projector;
  std::array<double, 9> projector_from_camera_rotation{};
  std::array<double, 3> projector_from_camera_translation{};  // metres
  int stripes = 0;
  int line_step_px = 1;  // rows of the camera from line to line

  int boundaries() const { return stripes - 1; }
  int lines() const { return (camera.height + line_step_px - 1) / line_step_px; }
  bool operator==(const GridCalibration& other) const;
};

/// Rounded to what is sent.
GridCalibration grid_calibration(const Rig& rig, const Pattern& pattern);

/// Which triangles a cell holds: bit c says that there is the one without corner c. Corners run
/// counter-clockwise as the camera sees them: 0 upper left, 1 lower left, 2 lower right, 3 upper right.
namespace grid_cell {
constexpr std::uint8_t kStraight = 1U << 3 | 1U << 1;  // both triangles, on the diagonal from 0 to 2
constexpr std::uint8_t kTurned = 1U << 0 | 1U << 2;    // both, from 1 to 3
}  // namespace grid_cell

/// Rows are lines, top first; see at(). Around them lies a margin that holds nothing, so that neighbours can
/// be asked for without a test. A line may see a boundary twice, on a front object and on the wall behind:
/// `twice`, and the picture's lines come once more below, with the second places.
struct StripeGrid {
  static constexpr std::int32_t kAbsent = -(1 << 30);
  static constexpr int kMargin = 8;

  int boundaries = 0;
  int lines = 0;                           // all of them: even where `twice`
  bool twice = false;                      // line picture_lines() + l is line l of the picture again
  int step_bits = 4;                       // a column is `columns` / 2^step_bits pixels
  std::vector<std::int32_t> columns;       // kAbsent: no vertex
  std::vector<std::uint8_t> cells;         // triangles between this place and the one right below (grid_cell)
  std::vector<std::uint8_t> sigmas;        // codes of the columns' standard deviations; empty: not known
  std::vector<std::uint8_t> interpolated;  // 0 or 1; empty: all measured
  std::uint32_t vertices = 0;
  std::uint32_t triangles = 0;

  int picture_lines() const { return twice ? lines / 2 : lines; }
  int stride() const { return (boundaries + 7) / 8 * 8 + 2 * kMargin; }
  std::size_t at(int line, int boundary) const {
    return static_cast<std::size_t>(line) * static_cast<std::size_t>(stride()) +
           static_cast<std::size_t>(boundary + kMargin);
  }
  /// Empty, of that size; memory is reused.
  void reset(int boundaries_, int lines_, int step_bits_, bool twice_ = false);
};

/// Whether there are triangles between the picture's last line and its first line again, which no grid has.
bool joins_halves(const StripeGrid& grid);

/// Second places that are copies of the first ones there (codec/FORMAT.md, "From the grid to a surface"), by
/// StripeGrid::at(): those with the same column, so before columns are moved.
std::vector<std::size_t> copies_of(const StripeGrid& grid);

/// Once columns have been moved: those copies are copies again, of sigmas too, and `tolerance`
/// (GridEncoder::encode) lets neither them nor what they are copies of be moved apart.
void keep_copies(std::span<const std::size_t> copies, StripeGrid& grid, std::vector<std::uint8_t>& tolerance);

/// Standard deviation of a column of `sigma_px` once it is rounded to multiples of `step_px`. Not known (0)
/// stays so.
float sigma_of_rounded_px(float sigma_px, float step_px);
/// Steps of a quarter octave from a ten-thousandth of a pixel; 0: not known.
std::uint8_t sigma_px_code(float sigma_px);
float sigma_px_of_code(std::uint8_t code);

/// The diagonal of a cell that holds both triangles: the one between the boundaries that are nearer in the
/// picture, `spacing` being a stripe's usual width. Columns of the corners.
inline bool straight_diagonal(std::int32_t c0, std::int32_t c1, std::int32_t c2, std::int32_t c3,
                              std::int32_t spacing) {
  const std::int32_t falling = c2 - c0 - spacing;
  const std::int32_t rising = c3 - c1 - spacing;
  return (falling < 0 ? -falling : falling) <= (rising < 0 ? -rising : rising);
}

struct ToGrid {
  int step_bits = 4;
  bool with_quality = false;
  bool twice = false;  // also where there are no second places: to be as large as a key grid with them
};

/// Whether it has second places, on a picture of so many lines.
bool has_second_places(const Surface& surface, int lines);

/// Fails where the surface does not lie on such a grid (no places, two vertices at one, triangles across
/// cells), which has to be sent as a mesh, and where a position is not finite. The surface must pass
/// check_counts(). `with_quality`: sigmas and marks of interpolation too. Vertices so
/// far away that half a step may turn them behind the camera are left out with their triangles.
///
/// Second places (GridPoint::line from calibration.lines() on) come after all first ones, and the triangles
/// on them after all others. First places that are corners of those are there as second places too: copies,
/// which count as vertices of the grid.
Status to_grid(const Surface& surface, const GridCalibration& calibration, const ToGrid& options,
               StripeGrid& out);

}  // namespace relievo
