// SPDX-License-Identifier: Apache-2.0
// The simulated rig: casts a ray a pixel and lights it with the projector's stripes.
#pragma once

#include <array>
#include <atomic>
#include <cstdint>
#include <memory>
#include <optional>
#include <vector>

#include "base/image.h"
#include "base/pattern.h"
#include "base/rig.h"
#include "capture/camera_response.h"
#include "capture/pattern/schedule.h"
#include "capture/source/sim/scene.h"
#include "capture/source/sim/sim_options.h"
#include "capture/source/sim/stripe_light.h"

namespace relievo::sim {

/// The rig that films a scene with these options.
Rig make_rig(const SimOptions& options, const SceneView& view);

/// One camera frame as rendered.
struct RenderedFrame {
  Image8 picture, complement;  // complement: progressive only
  ImageF truth;                // depth along z in metres, 0 = none; where asked for
};

/// Immutable: any number of threads may render at once.
class Renderer {
 public:
  Renderer(const SimOptions& options, const Rig& rig, const Pattern& pattern,
           std::shared_ptr<const Scene> scene);

  /// Camera frame `index`, lost ones counted: it shows what the pattern's
  /// scheme has for it (capture/pattern/schedule.h). Each field is rendered at its
  /// own time, half a frame apart. The truth is of the first field's time, where lines of geometry lie: on
  /// even rows, whichever field is first; on odd rows of the second's. A progressive truth is of the first
  /// picture's. The same index gives the same bytes on every thread. Nothing where `stop` is set meanwhile:
  /// a row later at most, since a frame may take seconds.
  std::optional<RenderedFrame> render(std::uint64_t index, bool with_truth,
                                      const std::atomic<bool>& stop) const;
  RenderedFrame render(std::uint64_t index, bool with_truth) const;

 private:
  struct Row;
  struct Placed;
  /// What the projector shows during a part of an exposure.
  struct Glow {
    const StripeLight* stripes;
    Light light;
    float share;  // of the exposure's time
  };
  /// The rays of a pixel: through its middle, and by how much they change to the next pixel's.
  struct Footprint {
    Vec3 middle, across, down;
    Vec3 at(float right, float low) const { return middle + across * right + down * low; }
  };
  struct Field {
    std::array<Glow, 2> glows;  // the second of share 0 where one slide is shown all the time
    double time_s;
    int first_row, row_step;
    std::uint64_t noise_key;
    float ambient;  // times its mean
  };

  std::array<Glow, 2> glows(std::uint64_t field) const;
  float ambient_at(double time_s) const;
  /// Rows of `out` and `truth`, those of which are not null.
  void render_field(const Field& field, Image8* out, ImageF* truth, const std::atomic<bool>& stop) const;
  void trace_row(const std::vector<Placed>& shapes, const Field& field, int y, Row& row) const;
  static const Placed* meet(const std::vector<Placed>& shapes, Vec3 direction, Hit& hit);
  static bool is_mixed(const std::vector<Placed>& shapes, const Footprint& pixel, const Placed* seen,
                       const Hit& hit);
  Vec3 mixture(const std::vector<Placed>& shapes, const Field& field, const Footprint& pixel) const;
  /// In the projector's channels: the surface's colour acts on the light, before the camera mixes channels.
  Vec3 reflected(const std::vector<Placed>& shapes, const Placed& seen, const Hit& hit, const Field& field,
                 Vec3 direction, Vec3 direction_step) const;
  void blur_chroma(Row& row) const;
  void quantise(const Row& row, std::uint64_t noise_key, std::uint8_t* out) const;

  SimOptions options_;
  Rig rig_;
  std::shared_ptr<const Scene> scene_;
  Pattern pattern_;
  std::vector<StripeLight> lights_;  // one a slide
  std::vector<Vec3> rays_;           // one a pixel, z = 1
  CameraResponse response_;
  Mat3 camera_colour_from_projected_;  // crosstalk, inverse of Eq. 1's M
  Mat3 projector_from_camera_;
  Vec3 projector_translation_, projector_centre_;
  bool projector_distorts_ = false;
  float exposure_ = 0;                // 8-bit value of white albedo facing the projector at 1 m, times m^2
  float ambient_value_ = 0;           // 8-bit value of white albedo in ambient light
  std::vector<float> chroma_kernel_;  // one side, centre first
  std::vector<float> noise_;          // normal deviates times sigma
};

}  // namespace relievo::sim
