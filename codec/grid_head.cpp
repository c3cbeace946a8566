// SPDX-License-Identifier: Apache-2.0
#include "codec/grid_head.h"

#include <algorithm>
#include <string>

#include "base/lens.h"
#include "codec/frame_layout.h"

namespace relievo {
namespace {

constexpr std::uint8_t kKey = 1, kSigmas = 2, kInterpolated = 4, kTwice = 8;
constexpr std::uint8_t kCameraDistorts = 1, kProjectorDistorts = 2;
constexpr int kMostPixels = 16384;  // of a picture's side
constexpr int kMostStepBits = 8;
constexpr std::int32_t kMostSpacing = 1 << 15;

void write_model(const PinholeModel& model, bool distorts, Bytes& out) {
  append(out, static_cast<std::uint16_t>(model.width));
  append(out, static_cast<std::uint16_t>(model.height));
  for (const std::size_t i : {0, 1, 2, 4, 5}) append(out, static_cast<float>(model.matrix[i]));
  if (!distorts) return;
  for (const double k : model.distortion) append(out, static_cast<float>(k));
}

PinholeModel read_model(ByteReader& in, bool distorts) {
  PinholeModel model;
  model.width = in.read<std::uint16_t>();
  model.height = in.read<std::uint16_t>();
  for (const std::size_t i : {0, 1, 2, 4, 5}) model.matrix[i] = in.read<float>();
  model.matrix[8] = 1;
  if (distorts)
    for (double& k : model.distortion) k = in.read<float>();
  return model;
}

void write_calibration(const GridCalibration& c, Bytes& out) {
  const bool camera = distorts(c.camera);
  const bool projector = distorts(c.projector);
  append(out,
         static_cast<std::uint8_t>((camera ? kCameraDistorts : 0) | (projector ? kProjectorDistorts : 0)));
  append(out, static_cast<std::uint8_t>(c.line_step_px));
  write_model(c.camera, camera, out);
  write_model(c.projector, projector, out);
  for (const double x : c.projector_from_camera_rotation) append(out, static_cast<float>(x));
  for (const double x : c.projector_from_camera_translation) append(out, static_cast<float>(x));
}

bool usable(const PinholeModel& m) {
  return m.width > 0 && m.width <= kMostPixels && m.height > 0 && m.height <= kMostPixels &&
         std::ranges::all_of(m.matrix, fits_rig) && std::ranges::all_of(m.distortion, fits_rig) &&
         has_focal_lengths(m);
}

Status read_calibration(ByteReader& in, GridHead& head) {
  GridCalibration& c = head.calibration;
  const auto flags = in.read<std::uint8_t>();
  c.line_step_px = in.read<std::uint8_t>();
  c.camera = read_model(in, (flags & kCameraDistorts) != 0);
  c.projector = read_model(in, (flags & kProjectorDistorts) != 0);
  for (double& x : c.projector_from_camera_rotation) x = in.read<float>();
  for (double& x : c.projector_from_camera_translation) x = in.read<float>();
  c.stripes = head.boundaries + 1;
  if (!in.ok() || flags > 3 || c.line_step_px < 1 || !usable(c.camera) || !usable(c.projector) ||
      c.lines() * (head.twice ? 2 : 1) != head.lines ||
      !std::ranges::all_of(c.projector_from_camera_rotation, fits_rig) ||
      !std::ranges::all_of(c.projector_from_camera_translation, fits_rig))
    return Error{"grid has a calibration that no rig can have"};
  return {};
}

}  // namespace

void write_grid_fields(const GridHead& head, Bytes& out) {
  append(out,
         static_cast<std::uint8_t>((head.is_key ? kKey : 0) | (head.has_sigmas ? kSigmas : 0) |
                                   (head.has_interpolated ? kInterpolated : 0) | (head.twice ? kTwice : 0)));
  append(out, static_cast<std::uint8_t>(head.step_bits));
  append(out, static_cast<std::uint16_t>(head.boundaries));
  append(out, static_cast<std::uint16_t>(head.lines));
  append(out, static_cast<std::uint16_t>(head.slice_lines));
  const GridModel& m = head.model;
  for (const std::int16_t w : {m.slope1, m.slope2, m.slope3, m.key, m.key_change}) append(out, w);
  append(out, m.limit);
  append(out, m.spacing);
  append(out, head.step_mm);
  if (head.is_key) {
    write_calibration(head.calibration, out);
  } else {
    append(out, head.key);
  }
}

void write_grid_head(const GridHead& head, const Bytes& tables, Bytes& out) {
  write_grid_fields(head, out);
  append(out, static_cast<std::uint16_t>(tables.size()));
  append_bytes(out, tables);
}

Status read_grid_fields(ByteReader& in, GridHead& head) {
  const auto flags = in.read<std::uint8_t>();
  head.is_key = (flags & kKey) != 0;
  head.has_sigmas = (flags & kSigmas) != 0;
  head.has_interpolated = (flags & kInterpolated) != 0;
  head.twice = (flags & kTwice) != 0;
  head.step_bits = in.read<std::uint8_t>();
  head.boundaries = in.read<std::uint16_t>();
  head.lines = in.read<std::uint16_t>();
  head.slice_lines = in.read<std::uint16_t>();
  GridModel& m = head.model;
  bool fair = true;
  for (std::int16_t* w : {&m.slope1, &m.slope2, &m.slope3, &m.key, &m.key_change}) {
    *w = in.read<std::int16_t>();
    fair = fair && *w >= -GridModel::kMostWeight && *w <= GridModel::kMostWeight;
  }
  m.limit = in.read<std::uint16_t>();
  m.spacing = in.read<std::int32_t>();
  head.step_mm = in.read<float>();
  if (!in.ok()) return Error{"grid is cut short"};
  if (flags > (kKey | kSigmas | kInterpolated | kTwice))
    return Error{"grid has flags that this version does not know: update relievo"};
  if (!fair || m.limit > GridModel::kMostLimit || m.spacing < -kMostSpacing || m.spacing > kMostSpacing)
    return Error{"grid has a prediction out of bounds"};
  if (head.boundaries < 1 || head.boundaries > kMostGridSide || head.lines < 1 ||
      head.lines > kMostGridSide || (head.twice && head.lines % 2 != 0) || head.slice_lines < 1 ||
      head.slice_lines > head.lines || head.step_bits > kMostStepBits)
    return Error{"grid has a size out of bounds"};
  if (head.is_key) {
    if (auto status = read_calibration(in, head); !status) return status;
  } else {
    head.key = in.read<std::uint32_t>();
  }
  return {};
}

Result<GridLayout> read_grid_layout(std::span<const std::uint8_t> coded) {
  GridLayout layout;
  GridHead& head = layout.head;
  ByteReader in(coded);
  if (auto status = read_grid_fields(in, head); !status) return status.error();
  layout.tables = in.take(in.read<std::uint16_t>());
  const int slices = (head.lines + head.slice_lines - 1) / head.slice_lines;
  const auto sizes = in.take(static_cast<std::uint64_t>(slices) * 4);
  if (!in.ok()) return Error{"grid is cut short"};
  ByteReader size(sizes);
  layout.slices.reserve(static_cast<std::size_t>(slices));
  for (int s = 0; s < slices; ++s) layout.slices.push_back(in.take(size.read<std::uint32_t>()));
  if (!in.ok()) return Error{"grid is cut short"};
  const auto padding = in.take(in.remaining());
  if (std::ranges::any_of(padding, [](std::uint8_t b) { return b != 0; }))
    return Error{"grid has bytes behind its end"};
  return layout;
}

Result<GridHead> read_grid_head(std::span<const std::uint8_t> coded) {
  auto layout = read_grid_layout(coded);
  if (!layout) return layout.error();
  return layout->head;
}

std::size_t least_grid_bytes(const StripeGrid& grid) {
  const auto places = static_cast<std::uint64_t>(grid.boundaries) * static_cast<std::uint64_t>(grid.lines);
  return std::max<std::size_t>(grid.vertices / kMostGridVerticesPerByte + 1, places / kMostPlacesPerByte + 1);
}

GridId grid_id(std::span<const std::uint8_t> coded) {
  return fnv1a(coded);
}

}  // namespace relievo
