// SPDX-License-Identifier: Apache-2.0
#include "capture/source/sim/renderer.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace relievo::sim {
namespace {

constexpr std::size_t kNoiseValues = 1 << 16;
constexpr float kWhite = 230;  // 8-bit value of white at working distance

std::uint64_t scramble(std::uint64_t x) {  // splitmix64
  x += 0x9E3779B97F4A7C15u;
  x = (x ^ (x >> 30)) * 0xBF58476D1CE4E5B9u;
  x = (x ^ (x >> 27)) * 0x94D049BB133111EBu;
  return x ^ (x >> 31);
}

/// Normal deviates by Box and Muller: the library's distributions differ between libraries.
std::vector<float> normal_deviates(std::uint32_t seed, double sigma) {
  std::vector<float> out(kNoiseValues);
  std::uint64_t state = scramble(seed);
  const auto uniform = [&] {
    state = scramble(state);
    return (static_cast<double>(state >> 11) + 0.5) * 0x1p-53;
  };
  for (std::size_t i = 0; i < out.size(); i += 2) {
    const double r = sigma * std::sqrt(-2 * std::log(uniform())), a = 2 * std::numbers::pi * uniform();
    out[i] = static_cast<float>(r * std::cos(a));
    out[i + 1] = static_cast<float>(r * std::sin(a));
  }
  return out;
}

/// Brown-Conrady: the distorted image of the undistorted normalised point.
template <typename T>
void distort(const std::array<double, 5>& k, T& x, T& y) {
  const T r2 = x * x + y * y;
  const T radial = 1 + r2 * (static_cast<T>(k[0]) + r2 * (static_cast<T>(k[1]) + r2 * static_cast<T>(k[4])));
  const T p1 = static_cast<T>(k[2]), p2 = static_cast<T>(k[3]);
  const T dx = x * radial + 2 * p1 * x * y + p2 * (r2 + 2 * x * x);
  y = y * radial + p1 * (r2 + 2 * y * y) + 2 * p2 * x * y;
  x = dx;
}

bool distorts(const PinholeModel& model) {
  return std::any_of(model.distortion.begin(), model.distortion.end(), [](double k) { return k != 0; });
}

/// The ray of each pixel's centre: the distortion inverted by fixed-point steps.
std::vector<Vec3> pixel_rays(const PinholeModel& camera) {
  std::vector<Vec3> rays;
  rays.reserve(static_cast<std::size_t>(camera.width) * static_cast<std::size_t>(camera.height));
  const bool bent = distorts(camera);
  for (int v = 0; v < camera.height; ++v) {
    for (int u = 0; u < camera.width; ++u) {
      const double tx = (u - camera.cx()) / camera.fx(), ty = (v - camera.cy()) / camera.fy();
      double x = tx, y = ty;
      for (int i = 0; bent && i < 30; ++i) {
        double dx = x, dy = y;
        distort(camera.distortion, dx, dy);
        x += tx - dx;
        y += ty - dy;
      }
      rays.push_back({static_cast<float>(x), static_cast<float>(y), 1});
    }
  }
  return rays;
}

Mat3 inverse(const std::array<double, 9>& m) {
  const auto minor = [&](std::size_t a, std::size_t b, std::size_t c, std::size_t d) {
    return m[a] * m[d] - m[b] * m[c];
  };
  const double det = m[0] * minor(4, 5, 7, 8) - m[1] * minor(3, 5, 6, 8) + m[2] * minor(3, 4, 6, 7);
  const double adjugate[9] = {minor(4, 5, 7, 8),  -minor(1, 2, 7, 8), minor(1, 2, 4, 5),
                              -minor(3, 5, 6, 8), minor(0, 2, 6, 8),  -minor(0, 2, 3, 5),
                              minor(3, 4, 6, 7),  -minor(0, 1, 6, 7), minor(0, 1, 3, 4)};
  Mat3 out;
  for (std::size_t i = 0; i < 9; ++i) out.m[i] = static_cast<float>(adjugate[i] / det);
  return out;
}

/// What of an image, in normalised coordinates, a shape can reach.
struct Window {
  float left, right, top, bottom;
  bool contains(float x, float y) const { return x >= left && x <= right && y >= top && y <= bottom; }
};

constexpr float kEverywhere = 1e9f;

/// Of a sphere seen from the origin along z.
Window window_of(Vec3 centre, float radius) {
  if (!(radius < 1e6f) || centre.z < 1.05f * radius)
    return {-kEverywhere, kEverywhere, -kEverywhere, kEverywhere};
  const auto limits = [&](float across, float& low, float& high) {
    const float middle = std::atan2(across, centre.z);
    const float half = std::asin(std::min(1.0f, radius / std::hypot(across, centre.z)));
    low = middle - half < -1.5f ? -kEverywhere : std::tan(middle - half) - 1e-4f;
    high = middle + half > 1.5f ? kEverywhere : std::tan(middle + half) + 1e-4f;
  };
  Window w{};
  limits(centre.x, w.left, w.right);
  limits(centre.y, w.top, w.bottom);
  return w;
}

}  // namespace

Rig make_rig(const SimOptions& o, const SceneView& view) {
  Rig rig;
  rig.scan = o.scan;
  rig.field_order = o.field_order;
  rig.frame_rate = o.rate;
  // Wide pictures: between keeping the width in view and keeping the height.
  const double f = view.camera_f_px * 0.5 * (o.width / 640.0 + o.height / 480.0);
  const double fp = view.projector_f_px * 0.5 * (o.projector_width / 1024.0 + o.projector_height / 768.0);
  rig.camera = {o.width, o.height, {f, 0, (o.width - 1) / 2.0, 0, f, (o.height - 1) / 2.0, 0, 0, 1}, {}};
  rig.projector = {o.projector_width,
                   o.projector_height,
                   {fp, 0, (o.projector_width - 1) / 2.0, 0, fp, (o.projector_height - 1) / 2.0, 0, 0, 1},
                   {}};
  const double k = o.distortion;
  rig.camera.distortion = {-0.22 * k, 0.12 * k, 0.0008 * k, -0.0012 * k, -0.02 * k};
  rig.projector.distortion = {-0.05 * k, 0.08 * k, -0.0010 * k, 0.0006 * k, 0.01 * k};
  // The projector stands to the side, a little higher, and turns in until both axes cross at the working
  // distance; then it turns about its own.
  const double baseline_m = o.baseline * view.baseline_m;
  const double angle = std::atan2(baseline_m, view.distance_m), c = std::cos(angle), s = std::sin(angle);
  const double roll = o.roll * std::numbers::pi / 180, rc = std::cos(roll), rs = std::sin(roll);
  rig.projector_from_camera_rotation = {rc * c, -rs, rc * s, rs * c, rc, rs * s, -s, 0, c};
  const double right = -c * baseline_m, down = -0.075 * std::fabs(baseline_m);
  rig.projector_from_camera_translation = {rc * right - rs * down, rs * right + rc * down, s * baseline_m};
  // A camera's usual crosstalk; each row adds up to one, so that white stays white.
  const std::array<double, 9> seen = {0.86, 0.11, 0.03, 0.13, 0.78, 0.09, 0.03, 0.15, 0.82};
  std::array<double, 9> mixed{};
  for (std::size_t i = 0; i < 9; ++i) mixed[i] = (i % 4 == 0 ? 1 - o.crosstalk : 0) + o.crosstalk * seen[i];
  const Mat3 matrix = inverse(mixed);
  for (std::size_t i = 0; i < 9; ++i) rig.colour_matrix[i] = static_cast<double>(matrix.m[i]);
  rig.camera_gamma = o.gamma;
  return rig;
}

/// One line of the picture in linear 8-bit units, planes one after another.
struct Renderer::Row {
  explicit Row(int width)
      : rgb{std::vector<float>(static_cast<std::size_t>(width)),
            std::vector<float>(static_cast<std::size_t>(width)),
            std::vector<float>(static_cast<std::size_t>(width))},
        depth(static_cast<std::size_t>(width)),
        scratch(static_cast<std::size_t>(width)) {}
  std::vector<float> rgb[3], depth, scratch;
};

/// A shape and what of both images it can reach.
struct Renderer::Placed {
  std::shared_ptr<const Shape> shape;
  Window camera, projector;
};

Renderer::Renderer(const SimOptions& options, const Rig& rig, const Pattern& pattern,
                   std::shared_ptr<const Scene> scene)
    : options_(options),
      rig_(rig),
      scene_(std::move(scene)),
      pattern_(pattern),
      rays_(pixel_rays(rig.camera)),
      response_(rig.camera_gamma) {
  for (int slide = 0; slide < pattern.slides; ++slide) {
    lights_.emplace_back(pattern, slide, rig.projector.width, options.defocus);
  }
  camera_colour_from_projected_ = inverse(rig.colour_matrix);
  for (std::size_t i = 0; i < 9; ++i) {
    projector_from_camera_.m[i] = static_cast<float>(rig.projector_from_camera_rotation[i]);
  }
  const auto& t = rig.projector_from_camera_translation;
  projector_translation_ = {static_cast<float>(t[0]), static_cast<float>(t[1]), static_cast<float>(t[2])};
  projector_centre_ = projector_from_camera_.back(projector_translation_) * -1.0f;
  projector_distorts_ = distorts(rig.projector);
  const auto distance = static_cast<float>(scene_->view().distance_m);
  exposure_ = kWhite * static_cast<float>(options.exposure) * distance * distance;
  ambient_value_ = kWhite * static_cast<float>(options.exposure * options.ambient);
  if (options.chroma > 0) {
    const int reach = static_cast<int>(std::ceil(3 * options.chroma));
    float sum = 0;
    for (int i = 0; i <= reach; ++i) {
      chroma_kernel_.push_back(
          static_cast<float>(std::exp(-0.5 * i * i / (options.chroma * options.chroma))));
      sum += chroma_kernel_.back() * (i ? 2.0f : 1.0f);
    }
    for (float& w : chroma_kernel_) w /= sum;
  }
  if (options.noise > 0) noise_ = normal_deviates(options.seed, options.noise);
}

RenderedFrame Renderer::render(std::uint64_t index, bool with_truth) const {
  return *render(index, with_truth, false);
}

std::optional<RenderedFrame> Renderer::render(std::uint64_t index, bool with_truth,
                                              const std::atomic<bool>& stop) const {
  const bool interlaced = rig_.scan == Scan::kInterlaced;
  RenderedFrame frame;
  const int width = rig_.camera.width, height = rig_.camera.height;
  frame.picture = Image8(width, height, 3);
  if (!interlaced) frame.complement = Image8(width, height, 3);
  if (with_truth) frame.truth = ImageF(width, height, 1);
  ImageF* truth = with_truth ? &frame.truth : nullptr;
  for (const int half : {0, 1}) {
    const double time_s = (static_cast<double>(index) + 0.5 * half) / rig_.frame_rate;
    const std::uint64_t number = 2 * index + static_cast<unsigned>(half);
    Field field{glows(number),      time_s, interlaced ? first_row(rig_.field_order, half) : 0,
                interlaced ? 2 : 1, number, ambient_at(time_s)};
    const bool has_truth = interlaced || half == 0;
    const bool truth_beside = interlaced && field.first_row != half;
    render_field(field, has_truth ? &frame.picture : &frame.complement,
                 has_truth && !truth_beside ? truth : nullptr, stop);
    if (truth == nullptr || !truth_beside) continue;
    field.first_row = half;
    render_field(field, nullptr, truth, stop);
  }
  if (stop) return std::nullopt;
  return frame;
}

/// Of camera field `field`, counted from the first: the slide at its beginning, and the next one where that
/// comes before the exposure's end.
std::array<Renderer::Glow, 2> Renderer::glows(std::uint64_t field) const {
  const double field_s = 0.5 / rig_.frame_rate;
  const double begin = static_cast<double>(field) * (1 + options_.drift * field_s) + options_.phase;
  const double slot = std::floor(begin);
  const double beyond = std::max(0.0, begin + options_.shutter - (slot + 1)) / options_.shutter;
  const auto glow = [&](double place, double share) {
    const double cycle = 2.0 * cycle_frames(pattern_);
    const auto in_cycle = static_cast<std::uint64_t>(place - cycle * std::floor(place / cycle));
    const Exposure exposure = shown(pattern_, in_cycle / 2, static_cast<int>(in_cycle % 2));
    return Glow{&lights_[static_cast<std::size_t>(exposure.slide)], exposure.light,
                static_cast<float>(share)};
  };
  constexpr double kLeast = 1e-6;
  if (beyond < kLeast) return {glow(slot, 1), glow(slot, 0)};
  return {glow(slot, 1 - beyond), glow(slot + 1, beyond)};
}

/// Of an exposure that begins then, times its mean: lamps shine twice a period of the mains.
float Renderer::ambient_at(double time_s) const {
  constexpr double kTurn_s = 2 * std::numbers::pi * 2 * 50;
  const double exposure_s = options_.shutter * 0.5 / rig_.frame_rate;
  const double middle = kTurn_s * (time_s + exposure_s / 2);
  const double half = kTurn_s * exposure_s / 2;
  return static_cast<float>(1 + options_.flicker * std::sin(middle) * std::sin(half) / half);
}

void Renderer::render_field(const Field& field, Image8* out, ImageF* truth,
                            const std::atomic<bool>& stop) const {
  const double period_s = options_.period / rig_.frame_rate;
  const double turns = field.time_s / period_s;
  std::vector<Placed> shapes;
  for (auto& shape : scene_->at(turns - std::floor(turns), period_s)) {
    const Sphere bound = shape->bound();
    const Vec3 from_projector = projector_from_camera_ * bound.centre + projector_translation_;
    shapes.push_back(
        {std::move(shape), window_of(bound.centre, bound.radius), window_of(from_projector, bound.radius)});
  }
  Row row(rig_.camera.width);
  for (int y = field.first_row; y < rig_.camera.height && !stop; y += field.row_step) {
    trace_row(shapes, field, y, row);
    if (out != nullptr) {
      if (!chroma_kernel_.empty()) blur_chroma(row);
      quantise(row, scramble(field.noise_key * 65536 + static_cast<unsigned>(y)), out->row(y));
    }
    if (truth != nullptr) std::copy(row.depth.begin(), row.depth.end(), truth->row(y));
  }
}

void Renderer::trace_row(const std::vector<Placed>& shapes, const Field& field, int y, Row& row) const {
  const auto width = static_cast<std::size_t>(rig_.camera.width);
  const Vec3* rays = &rays_[static_cast<std::size_t>(y) * width];
  const Vec3* above = &rays_[static_cast<std::size_t>(std::max(y - 1, 0)) * width];
  const int next = std::min(y + 1, rig_.camera.height - 1);
  const Vec3* below = &rays_[static_cast<std::size_t>(next) * width];
  const float lines = 1 / static_cast<float>(std::max(next - std::max(y - 1, 0), 1));
  for (std::size_t x = 0; x < width; ++x) {
    const std::size_t left = x ? x - 1 : 0, right = std::min(x + 1, width - 1);
    const Footprint pixel{rays[x], (rays[right] - rays[left]) * (1 / static_cast<float>(right - left)),
                          (below[x] - above[x]) * lines};
    Hit hit;
    const Placed* seen = meet(shapes, pixel.middle, hit);
    Vec3 value;
    if (options_.rays > 1 && is_mixed(shapes, pixel, seen, hit)) {
      value = mixture(shapes, field, pixel);
    } else if (seen) {
      value = reflected(shapes, *seen, hit, field, pixel.middle, pixel.across);
    }
    value = camera_colour_from_projected_ * value;
    row.rgb[0][x] = value.x;
    row.rgb[1][x] = value.y;
    row.rgb[2][x] = value.z;
    row.depth[x] = seen ? hit.depth : 0;
  }
}

/// The nearest; null: nothing is there.
const Renderer::Placed* Renderer::meet(const std::vector<Placed>& shapes, Vec3 direction, Hit& hit) {
  const Placed* seen = nullptr;
  for (const Placed& placed : shapes) {
    if (placed.camera.contains(direction.x, direction.y) && placed.shape->hit(direction, hit)) seen = &placed;
  }
  return seen;
}

/// Whether a corner of the pixel sees another shape than its middle, or another face of it.
bool Renderer::is_mixed(const std::vector<Placed>& shapes, const Footprint& pixel, const Placed* seen,
                        const Hit& hit) {
  constexpr float kSameFace = 0.95f;  // cosine between the normals
  for (const float across : {-0.5f, 0.5f}) {
    for (const float down : {-0.5f, 0.5f}) {
      const Vec3 direction = pixel.at(across, down);
      Hit other_hit;
      const Placed* other = meet(shapes, direction, other_hit);
      if (other != seen) return true;
      if (seen != nullptr && dot(seen->shape->material(pixel.middle, hit).normal,
                                 other->shape->material(direction, other_hit).normal) < kSameFace) {
        return true;
      }
    }
  }
  return false;
}

/// The mean over the pixel.
Vec3 Renderer::mixture(const std::vector<Placed>& shapes, const Field& field, const Footprint& pixel) const {
  const int rays = options_.rays;
  const float step = 1 / static_cast<float>(rays);
  Vec3 sum{0, 0, 0};
  for (int k = 0; k < rays * rays; ++k) {
    const Vec3 direction = pixel.at((static_cast<float>(k % rays) + 0.5f) * step - 0.5f,
                                    (static_cast<float>(k / rays) + 0.5f) * step - 0.5f);
    Hit hit;
    const Placed* seen = meet(shapes, direction, hit);
    if (seen) sum = sum + reflected(shapes, *seen, hit, field, direction, pixel.across * step);
  }
  return sum * (step * step);
}

Vec3 Renderer::reflected(const std::vector<Placed>& shapes, const Placed& seen, const Hit& hit,
                         const Field& field, Vec3 direction, Vec3 direction_step) const {
  const Material material = seen.shape->material(direction, hit);
  const Vec3 point = direction * hit.depth;
  const Vec3 albedo = material.albedo * static_cast<float>(options_.albedo);
  // Ambient: a little more from above (y points down).
  Vec3 value = albedo * (ambient_value_ * field.ambient * (0.75f - 0.25f * material.normal.y));

  const Vec3 to_light = projector_centre_ - point;
  const float facing = dot(material.normal, to_light);
  const Vec3 q = projector_from_camera_ * point + projector_translation_;
  if (facing <= 0 || q.z <= 0) return value;
  const float px = q.x / q.z, py = q.y / q.z;
  const PinholeModel& projector = rig_.projector;
  const auto fx = static_cast<float>(projector.fx()), cx = static_cast<float>(projector.cx());
  float dx = px, dy = py;
  if (projector_distorts_) distort(projector.distortion, dx, dy);
  const float u = fx * dx + cx,
              v = static_cast<float>(projector.fy()) * dy + static_cast<float>(projector.cy());
  if (u < -0.5f || u > static_cast<float>(projector.width) - 0.5f || v < -0.5f ||
      v > static_cast<float>(projector.height) - 0.5f) {
    return value;
  }
  for (const Placed& placed : shapes) {
    if (placed.projector.contains(px, py) && placed.shape->blocks(point, projector_centre_)) return value;
  }

  constexpr float kGrazing = 1e-6f;  // below it the footprint is wider than kWidest, or has no end at all
  // The pixel's footprint on the tangent plane, as an interval of projector columns.
  const float along = dot(material.normal, direction);
  const float slope =
      dot(material.normal, direction_step) / std::copysign(std::max(std::abs(along), kGrazing), along);
  const Vec3 half_step = (direction_step - direction * slope) * (0.5f * hit.depth);
  const Vec3 half_q = projector_from_camera_ * half_step;
  const auto column = [&](Vec3 p) {
    float x = p.x / p.z, y = p.y / p.z;
    if (projector_distorts_) distort(projector.distortion, x, y);
    return fx * x + cx;
  };
  constexpr float kWidest = 24;  // projector columns to one side: grazing surfaces are dim mixtures anyway
  const float u0 = std::clamp(column(q - half_q), u - kWidest, u + kWidest);
  const float u1 = std::clamp(column(q + half_q), u - kWidest, u + kWidest);
  Vec3 projected{0, 0, 0};
  for (const Glow& glow : field.glows) {
    if (glow.share == 0) continue;
    Vec3 shown_now{1, 1, 1};
    if (glow.light != Light::kWhite) {
      shown_now = glow.stripes->mean(u0, u1);
      if (glow.light == Light::kComplement) shown_now = Vec3{1, 1, 1} - shown_now;
    }
    projected = projected + shown_now * glow.share;
  }

  const float r2 = dot(to_light, to_light), inverse_r = 1 / std::sqrt(r2);
  const float cosine = facing * inverse_r;
  value = value + albedo * projected * (exposure_ * cosine / r2);
  const float gloss = material.gloss * static_cast<float>(options_.gloss);
  if (gloss > 0) {
    const Vec3 halfway = unit(to_light * inverse_r - direction * (1 / length(direction)));
    const float h = std::max(0.0f, dot(halfway, material.normal));
    const float h4 = h * h * h * h, h16 = h4 * h4 * h4 * h4;
    value = value + projected * (exposure_ / r2 * gloss * h16 * h16);  // Blinn and Phong, exponent 32
  }
  return value;
}

void Renderer::blur_chroma(Row& row) const {
  // NTSC: luma keeps its bandwidth, the two chroma signals lose most of theirs. With the colour differences
  // R-Y and B-Y blurred alike, the axes I and Q need not be told apart.
  const auto width = static_cast<int>(row.depth.size());
  const int reach = static_cast<int>(chroma_kernel_.size()) - 1;
  float* r = row.rgb[0].data();
  float* g = row.rgb[1].data();
  float* b = row.rgb[2].data();
  for (int x = 0; x < width; ++x) {
    const float y = 0.299f * r[x] + 0.587f * g[x] + 0.114f * b[x];
    r[x] -= y;
    b[x] -= y;
    g[x] = y;
  }
  for (float* plane : {r, b}) {
    float* out = row.scratch.data();
    for (int x = 0; x < width; ++x) out[x] = plane[x] * chroma_kernel_[0];
    for (int i = 1; i <= reach; ++i) {
      const float w = chroma_kernel_[static_cast<std::size_t>(i)];
      for (int x = 0; x < std::min(i, width); ++x)
        out[x] += w * (plane[0] + plane[std::min(x + i, width - 1)]);
      for (int x = i; x < width - i; ++x) out[x] += w * (plane[x - i] + plane[x + i]);
      for (int x = std::max(width - i, i); x < width; ++x) out[x] += w * (plane[x - i] + plane[width - 1]);
    }
    std::copy_n(out, width, plane);
  }
  for (int x = 0; x < width; ++x) {
    const float y = g[x];
    g[x] = y - (0.299f * r[x] + 0.114f * b[x]) * (1 / 0.587f);
    r[x] += y;
    b[x] += y;
  }
}

void Renderer::quantise(const Row& row, std::uint64_t noise_key, std::uint8_t* out) const {
  const std::size_t width = row.depth.size();
  for (std::size_t c = 0; c < 3; ++c) {
    const float* in = row.rgb[c].data();
    const std::size_t start = (noise_key >> (16 * c)) & (kNoiseValues - 1);
    for (std::size_t x = 0; x < width; ++x) {
      const float noise = noise_.empty() ? 0 : noise_[(start + x) & (kNoiseValues - 1)];
      out[3 * x + c] = response_.value_of(in[x] + noise);
    }
  }
}

}  // namespace relievo::sim
