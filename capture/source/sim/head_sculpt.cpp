// SPDX-License-Identifier: Apache-2.0
// The shapes here are by eye, after the usual proportions of a head of 23 cm. u: arc along the skin from the
// face's middle, positive to the head's +x; v: height, down; metres.
#include "capture/source/sim/head_sculpt.h"

#include <algorithm>
#include <cmath>
#include <iterator>

namespace relievo::sim {
namespace {

constexpr float kArc = 0.088f;       // metres of u a radian
constexpr float kLipLine = 0.0640f;  // v where the lips meet
constexpr float kEyeU = 0.0310f, kEyeV = -0.0030f;
constexpr float kMouthHalf = 0.0250f;

float square(float x) {
  return x * x;
}
float bump(float u, float v, float cu, float cv, float su, float sv) {
  return std::exp(-0.5f * (square((u - cu) / su) + square((v - cv) / sv)));
}

/// Cubic through the points, flat beyond the ends.
struct Knot {
  float at, value;
};
template <std::size_t n>
float curve(const Knot (&knots)[n], float x) {
  if (x <= knots[0].at) return knots[0].value;
  for (std::size_t i = 0; i + 1 < n; ++i) {
    if (x > knots[i + 1].at) continue;
    const auto slope = [&](std::size_t k) {
      if (k == 0 || k + 1 == n) return 0.0f;
      const float a = (knots[k].value - knots[k - 1].value) / (knots[k].at - knots[k - 1].at);
      const float b = (knots[k + 1].value - knots[k].value) / (knots[k + 1].at - knots[k].at);
      return a * b <= 0 ? 0.0f : 2 * a * b / (a + b);  // no overshoot
    };
    const float h = knots[i + 1].at - knots[i].at, t = (x - knots[i].at) / h, t2 = t * t, t3 = t2 * t;
    return knots[i].value * (2 * t3 - 3 * t2 + 1) + knots[i + 1].value * (3 * t2 - 2 * t3) +
           h * (slope(i) * (t3 - 2 * t2 + t) + slope(i + 1) * (t3 - t2));
  }
  return knots[n - 1].value;
}

// Half width and depth to the front of the head without its features.
constexpr Knot kWidth[] = {{-0.134f, 0.006f},  {-0.130f, 0.028f},  {-0.120f, 0.047f}, {-0.100f, 0.064f},
                           {-0.070f, 0.0755f}, {-0.035f, 0.0790f}, {0.000f, 0.0775f}, {0.030f, 0.0750f},
                           {0.055f, 0.0710f},  {0.080f, 0.0635f},  {0.098f, 0.0550f}, {0.110f, 0.0480f},
                           {0.122f, 0.0440f},  {0.150f, 0.0300f}};
constexpr Knot kFront[] = {{-0.134f, 0.006f},  {-0.130f, 0.032f},  {-0.120f, 0.054f}, {-0.100f, 0.075f},
                           {-0.070f, 0.0890f}, {-0.035f, 0.0940f}, {0.000f, 0.0890f}, {0.030f, 0.0885f},
                           {0.055f, 0.0900f},  {0.080f, 0.0865f},  {0.098f, 0.0840f}, {0.106f, 0.0790f},
                           {0.114f, 0.0660f},  {0.124f, 0.0520f},  {0.150f, 0.0300f}};

float skull(float angle, float v) {
  const float width = curve(kWidth, v), front = curve(kFront, v);
  const float s = std::abs(std::sin(angle)) / width, c = std::abs(std::cos(angle)) / front;
  // A rounded box rather than an ellipse: faces are flat in front.
  return std::pow(std::pow(s, 2.35f) + std::pow(c, 2.35f), -1 / 2.35f);
}

float nose(float u, float v) {
  const Knot ridge[] = {{-0.026f, 0.0f},   {-0.012f, 0.0030f}, {0.004f, 0.0100f},  {0.020f, 0.0180f},
                        {0.031f, 0.0235f}, {0.037f, 0.0215f},  {0.0425f, 0.0110f}, {0.048f, 0.0f}};
  const Knot half[] = {
      {-0.020f, 0.0070f}, {0.000f, 0.0062f}, {0.020f, 0.0078f}, {0.034f, 0.0098f}, {0.048f, 0.0090f}};
  const float w = curve(half, v);
  float h = curve(ridge, v) * std::exp(-std::pow(std::abs(u) / (1.35f * w), 2.2f));
  for (const float side : {-1.0f, 1.0f}) {
    h += 0.0095f * bump(u, v, side * 0.0135f, 0.0345f, 0.0048f, 0.0058f);  // wing
    h -= 0.0040f * bump(u, v, side * 0.0070f, 0.0432f, 0.0032f, 0.0020f);  // nostril
  }
  return h;
}

/// How far the upper lip's red reaches above the lip line, and the lower lip's below.
float upper_lip(float u) {
  const float x = std::abs(u) / kMouthHalf;
  if (x >= 1) return 0;
  return 0.0085f * std::pow(1 - x * x, 0.75f) * (1 - 0.22f * std::exp(-square(u / 0.0035f)));
}
float lower_lip(float u) {
  const float x = std::abs(u) / (0.93f * kMouthHalf);
  return x >= 1 ? 0 : 0.0100f * std::pow(1 - x * x, 0.65f);
}

float lips(float u, float v) {
  const float x = std::abs(u) / (kMouthHalf * 1.18f);
  const float across = x >= 1 ? 0 : std::pow(1 - x * x, 1.3f);
  float h = 0.0045f * across * std::exp(-0.5f * square((v - (kLipLine - 0.0042f)) / 0.0040f));
  h += 0.0058f * across * std::exp(-0.5f * square((v - (kLipLine + 0.0055f)) / 0.0043f));
  h -= 0.0040f * across * std::exp(-0.5f * square((v - kLipLine) / 0.0013f));
  h += 0.0040f * bump(u, v, 0, kLipLine, 0.034f, 0.020f);  // the arch of the teeth
  for (const float side : {-1.0f, 1.0f})
    h -= 0.0016f * bump(u, v, side * 0.0268f, kLipLine + 0.0005f, 0.0042f, 0.0038f);
  return h;
}

float features(float u, float v) {
  float h = nose(u, v) + lips(u, v);
  h -= 0.0016f * bump(u, v, 0, 0.0505f, 0.0030f, 0.0048f);   // philtrum
  h -= 0.0050f * bump(u, v, 0, 0.0815f, 0.0170f, 0.0050f);   // below the lower lip
  h += 0.0090f * bump(u, v, 0, 0.0965f, 0.0160f, 0.0095f);   // chin
  h += 0.0030f * bump(u, v, 0, -0.0650f, 0.0450f, 0.0250f);  // forehead
  h += 0.0025f * bump(u, v, 0, -0.0230f, 0.0120f, 0.0070f);  // between the brows
  for (const float side : {-1.0f, 1.0f}) {
    const float s = side * u;
    h += 0.0048f * bump(s, v, 0.0290f, -0.0245f, 0.0170f, 0.0062f);        // brow
    h -= 0.0125f * bump(s, v, kEyeU - 0.002f, kEyeV, 0.0145f, 0.0100f);    // socket
    h -= 0.0060f * bump(s, v, 0.0140f, kEyeV - 0.003f, 0.0055f, 0.0075f);  // its inner corner
    h += 0.0058f * bump(s, v, 0.0470f, 0.0190f, 0.0150f, 0.0120f);         // cheekbone
    h += 0.0030f * bump(s, v, 0.0270f, 0.0330f, 0.0095f, 0.0100f);         // cheek
    h -= 0.0030f * bump(s, v, 0.0480f, 0.0530f, 0.0140f, 0.0140f);         // hollow of the cheek
    // Fold from the wing of the nose to the corner of the mouth.
    const float along = clamp01((v - 0.036f) / 0.030f);
    const float fold = 0.0185f + 0.0135f * along;
    h -= 0.0012f * std::exp(-0.5f * square((s - fold) / 0.0042f)) * smoothstep(0.030f, 0.044f, v) *
         (1 - smoothstep(0.050f, 0.066f, v));
    // Ear: a raised shell.
    const float ear = std::pow(bump(s, v, 0.141f, 0.004f, 0.0120f, 0.0260f), 0.7f);
    h += 0.0210f * ear - 0.0100f * bump(s, v, 0.137f, 0.003f, 0.0050f, 0.0110f);
  }
  return h;
}

/// How far above the hairline, metres; negative on the face.
float above_hairline(float u, float v) {
  const float a = std::abs(u);
  const Knot line[] = {{0.0f, -0.0820f},   {0.030f, -0.0850f}, {0.055f, -0.0740f}, {0.074f, -0.0560f},
                       {0.088f, -0.0430f}, {0.102f, -0.0280f}, {0.110f, -0.0020f}, {0.116f, 0.0060f},
                       {0.122f, -0.0260f}, {0.132f, -0.0340f}, {0.150f, -0.0280f}, {0.162f, 0.0400f}};
  const float ragged = 0.0022f * smooth_noise(u * 700, 3.5f) + 0.0015f * smooth_noise(u * 1900, 9.5f);
  return curve(line, a) + ragged - v;
}

/// Strands: fine along u, long along the way the hair is combed.
float strands(float u, float v) {
  const float along = v + 0.35f * std::abs(u - 0.02f), across = u - 0.35f * v;
  return 0.55f * smooth_noise(across * 620, along * 70) +
         0.45f * smooth_noise(across * 1500 + 40, along * 130);
}

float skin_relief(float u, float v) {
  return 0.000015f * smooth_noise(u * 900, v * 900) + 0.00005f * smooth_noise(u * 300 + 7, v * 300);
}

Vec3 skin(float u, float v) {
  Vec3 c{0.735f, 0.555f, 0.455f};
  const float blotch = smooth_noise(u * 160 + 3, v * 160) * 0.6f + smooth_noise(u * 520, v * 520 + 9) * 0.4f;
  c = c * (1 + 0.035f * blotch);
  float red = 0.10f * bump(u, v, 0, 0.032f, 0.010f, 0.010f);  // tip of the nose
  for (const float side : {-1.0f, 1.0f}) red += 0.11f * bump(side * u, v, 0.040f, 0.026f, 0.016f, 0.013f);
  red += 0.05f * bump(u, v, 0, 0.098f, 0.014f, 0.010f);
  c = c * Vec3{1 + 0.25f * red, 1 - 0.9f * red, 1 - 0.9f * red};
  float shade = 0;  // thin skin about the eyes, nostrils, beneath the lip
  for (const float side : {-1.0f, 1.0f}) {
    shade += 0.16f * bump(side * u, v, kEyeU - 0.004f, kEyeV + 0.003f, 0.014f, 0.010f);
    shade += 0.72f * bump(side * u, v, 0.0072f, 0.0437f, 0.0032f, 0.0018f);
    shade += 0.12f * bump(side * u, v, 0.0190f, 0.0370f, 0.0018f, 0.0060f);
  }
  shade += 0.05f * smoothstep(0.075f, 0.1f, v);
  return c * (1 - std::min(shade, 0.8f));
}

Vec3 with_brows(Vec3 c, float u, float v, float raise) {
  for (const float side : {-1.0f, 1.0f}) {
    const float s = side * u;
    if (s < 0.008f || s > 0.058f) continue;
    const float x = (s - 0.010f) / 0.044f;  // 0 at the nose .. 1 at the temple
    const float middle = -0.0205f - 0.0075f * std::sin(2.2f * clamp01(x)) + 0.0048f * x * x - raise;
    const float thick = 0.0042f * (1 - 0.55f * clamp01(x));
    const float hairs = 0.55f + 0.45f * smooth_noise(s * 900 + v * 500, v * 260);
    const float cover = std::exp(-std::pow(std::abs(v - middle) / thick, 2.6f)) *
                        smoothstep(-0.03f, 0.06f, x) * (1 - smoothstep(0.88f, 1.04f, x));
    c = mix(c, {0.27f, 0.19f, 0.13f}, clamp01(cover * (0.55f + 0.5f * hairs)));
  }
  return c;
}

Vec3 with_lips(Vec3 c, float u, float v) {
  const float up = upper_lip(u), low = lower_lip(u);
  const float above = kLipLine - v, below = v - kLipLine;
  float cover = 0;
  if (up > 0 && above >= 0) cover = 1 - smoothstep(up - 0.0012f, up + 0.0006f, above);
  if (low > 0 && below > 0) cover = 1 - smoothstep(low - 0.0014f, low + 0.0008f, below);
  const float wrinkle = 1 + 0.05f * smooth_noise(u * 1100, v * 120);
  c = mix(c, Vec3{0.660f, 0.335f, 0.315f} * wrinkle, 0.85f * cover);
  const float line = std::abs(u) < kMouthHalf ? std::exp(-0.5f * square((v - kLipLine) / 0.0009f)) : 0;
  return mix(c, {0.26f, 0.12f, 0.11f}, 0.8f * line);
}

/// The eye within its lids: relief over the socket and colour. `s` grows outwards from the nose.
struct Eye {
  float relief;
  Vec3 albedo;
};
Eye eye(float s, float v, Vec3 around, const Expression& e, float side) {
  const float x = (s - kEyeU) / 0.0154f;  // -1 inner corner .. 1 outer corner
  const float lid_height = std::abs(x) < 1 ? 1 - x * x : 0;
  const float tilt = 0.0012f * x;  // outer corner a little higher
  const float open = 1 - e.blink;
  const float upper =
      kEyeV - tilt - 0.0072f * std::pow(lid_height, 0.75f) * open + 0.0030f * lid_height * (1 - open);
  const float lower = kEyeV - tilt + 0.0042f * lid_height;
  // The ball pushes the lids out.
  const float ball =
      0.0072f * std::exp(-0.5f * (square((s - kEyeU) / 0.0098f) + square((v - kEyeV) / 0.0080f)));
  Eye out{ball, around};
  const float lid_edge = std::exp(-0.5f * square((v - upper) / 0.0011f)) * smoothstep(0, 0.15f, lid_height);
  const float crease =
      std::exp(-0.5f *
               square((v - (kEyeV - tilt - 0.0115f * std::pow(lid_height + 0.02f, 0.6f))) / 0.0010f)) *
      smoothstep(0, 0.1f, lid_height);
  out.relief += 0.0010f * lid_edge - 0.0011f * crease;
  out.albedo = out.albedo * (1 - 0.22f * crease);
  if (lid_height > 0 && v > upper && v < lower) {
    const float depth = std::min(v - upper, lower - v);
    out.relief -= 0.0012f * smoothstep(0, 0.0012f, depth);
    const float ix = s - (kEyeU + side * 0.0045f * e.gaze_x), iy = v - (kEyeV - 0.0012f + 0.003f * e.gaze_y);
    const float r = std::sqrt(ix * ix + iy * iy);
    const float ring = std::atan2(iy, ix);
    Vec3 white = Vec3{0.74f, 0.71f, 0.68f} * (1 - 0.18f * x * x);
    white = mix(white, {0.70f, 0.46f, 0.42f}, smoothstep(0.75f, 1.0f, -x));  // the inner corner
    const Vec3 iris =
        mix(Vec3{0.30f, 0.37f, 0.36f}, Vec3{0.20f, 0.26f, 0.28f}, 0.5f + 0.5f * smooth_noise(ring * 9, 3));
    Vec3 c = mix(iris, white, smoothstep(0.0052f, 0.0059f, r));
    c = mix(c, {0.13f, 0.15f, 0.16f}, 0.7f * std::exp(-0.5f * square((r - 0.0054f) / 0.0005f)));
    c = mix({0.05f, 0.05f, 0.05f}, c, smoothstep(0.0020f, 0.0026f, r));
    const float shadow = 1 - 0.35f * (1 - smoothstep(0, 0.0030f, v - upper));  // of the upper lid
    out.albedo = mix(out.albedo, c * shadow, smoothstep(0, 0.0007f, depth));
  }
  const float lashes =
      std::exp(-0.5f * square((v - upper + 0.0003f) / 0.0008f)) * smoothstep(0.0f, 0.25f, lid_height);
  out.albedo = mix(out.albedo, {0.13f, 0.09f, 0.07f}, 0.85f * lashes);
  const float lower_lashes =
      std::exp(-0.5f * square((v - lower) / 0.0006f)) * smoothstep(0.0f, 0.3f, lid_height);
  out.albedo = mix(out.albedo, {0.45f, 0.28f, 0.23f}, 0.5f * lower_lashes);
  return out;
}

/// Bilinear between samples of the resting head.
template <typename T>
T sample(const CylinderMap& map, const std::vector<T>& values, float column, float row) {
  column = std::clamp(column, 0.0f, static_cast<float>(map.columns) - 1.001f);
  row = std::clamp(row, 0.0f, static_cast<float>(map.rows) - 1.001f);
  const int x = static_cast<int>(column), y = static_cast<int>(row);
  const float u = column - static_cast<float>(x), v = row - static_cast<float>(y);
  const T* a = &values[map.at(x, y)];
  const T* b = a + map.columns;
  const T top = a[0] + (a[1] - a[0]) * u, low = b[0] + (b[1] - b[0]) * u;
  return top + (low - top) * v;
}

/// The opened mouth: where the resting skin went, and what shows in the gap.
struct Mouth {
  explicit Mouth(const Expression& e)
      : gap(0.0165f * e.jaw),
        half(kMouthHalf * (1 - 0.22f * e.round + 0.08f * e.smile)),
        smile(0.0045f * e.smile),
        push(0.0035f * e.round) {}

  float opening(float u) const {
    const float x = std::abs(u) / (0.92f * half);
    return x < 1 ? std::pow(1 - x * x, 1.15f) : 0;
  }
  /// How far the skin that rests at v, below the lip line, is pulled down.
  float drop(float opening_here, float chin, float v) const {
    const float at_lip = 0.84f * opening_here, at_chin = 0.80f * chin;
    const float t = smoothstep(kLipLine, kLipLine + 0.022f, v);
    return gap * (at_lip + (at_chin - at_lip) * t) * (1 - smoothstep(0.103f, 0.148f, v));
  }

  float gap, half, smile, push;
};

}  // namespace

HeadSculpt::HeadSculpt() {
  rest_.angle_limit = 2.45f;
  rest_.top_m = -0.134f;
  rest_.bottom_m = 0.150f;
  rest_.gloss = 0.035f;
  rest_.resize(660, 432);
  for (int row = 0; row < rest_.rows; ++row) {
    const float v = rest_.height(row);
    for (int column = 0; column < rest_.columns; ++column) {
      const float angle = rest_.angle(column), u = kArc * angle;
      const float above = above_hairline(u, v), hair = smoothstep(-0.0035f, 0.0035f, above);
      const float strand = strands(u, v);
      const float top = 1 - smoothstep(-0.134f, -0.115f, v);  // features fade where the radius does
      float r = skull(angle, v) + (1 - hair) * (features(u, v) + skin_relief(u, v));
      r += hair * (0.0012f + 0.0105f * smoothstep(0.0f, 0.034f, above) + 0.0011f * strand) * (1 - 0.7f * top);
      rest_.radius_m[rest_.at(column, row)] = r;
      const Vec3 locks = Vec3{0.330f, 0.235f, 0.165f} * (1 + 0.34f * strand);
      Vec3 c = with_lips(skin(u, v), u, v);
      c = mix(c, locks, hair);
      rest_.albedo[rest_.at(column, row)] = c;
    }
  }
}

std::shared_ptr<const CylinderMap> make_bust() {
  const Knot width[] = {{0.080f, 0.0490f}, {0.130f, 0.0535f}, {0.150f, 0.0570f}, {0.165f, 0.0650f},
                        {0.178f, 0.0850f}, {0.192f, 0.1250f}, {0.206f, 0.1620f}, {0.225f, 0.1900f},
                        {0.260f, 0.2120f}, {0.330f, 0.2200f}};
  const Knot front[] = {{0.080f, 0.0400f}, {0.130f, 0.0460f}, {0.155f, 0.0490f}, {0.175f, 0.0560f},
                        {0.195f, 0.0690f}, {0.225f, 0.0860f}, {0.270f, 0.1030f}, {0.330f, 0.1120f}};
  auto bust = std::make_shared<CylinderMap>();
  bust->angle_limit = 2.2f;
  bust->top_m = 0.080f;
  bust->bottom_m = 0.330f;
  bust->gloss = 0.01f;
  bust->resize(640, 320);
  for (int row = 0; row < bust->rows; ++row) {
    const float v = bust->height(row);
    for (int column = 0; column < bust->columns; ++column) {
      const float angle = bust->angle(column), u = 0.06f * angle;
      const float s = std::abs(std::sin(angle)) / curve(width, v),
                  c = std::abs(std::cos(angle)) / curve(front, v);
      float r = 1 / std::sqrt(s * s + c * c);
      float neck = 0.0030f * bump(u, v, 0, 0.1380f, 0.0100f, 0.0110f);  // larynx
      for (const float side : {-1.0f, 1.0f}) {
        neck += 0.0032f * std::exp(-0.5f * square((side * u - 0.016f - 0.45f * (0.165f - v)) / 0.0075f));
      }
      // A round neckline with a ribbed collar.
      const float line = 0.1700f - 0.0140f * (1 - std::cos(angle));
      const float cloth = smoothstep(-0.0010f, 0.0010f, v - line);
      const float collar = cloth * (1 - smoothstep(0.0120f, 0.0150f, v - line));
      const float ribs = std::sin(angle * 150);
      const float knit =
          smooth_noise(angle * 60, v * 700) * 0.6f + smooth_noise(angle * 25 + 3, v * 150) * 0.4f;
      r += (1 - cloth) * (neck + skin_relief(u, v)) + cloth * (0.0040f + 0.0004f * knit) +
           collar * (0.0022f + 0.0004f * ribs);
      bust->radius_m[bust->at(column, row)] = r;
      const Vec3 wool = Vec3{0.275f, 0.395f, 0.500f} * (1 + 0.13f * knit + 0.06f * collar * ribs);
      const Vec3 throat = Vec3{0.700f, 0.520f, 0.425f} * (1 + 0.03f * smooth_noise(u * 300, v * 300) -
                                                          0.10f * smoothstep(0.0f, 0.02f, 0.125f - v));
      bust->albedo[bust->at(column, row)] = mix(throat, wool, cloth);
    }
  }
  return bust;
}

std::shared_ptr<const CylinderMap> HeadSculpt::at(const Expression& e) const {
  auto map = std::make_shared<CylinderMap>(rest_);
  const auto columns = [&](float u0, float u1, auto&& each) {
    const int first = std::max(0, static_cast<int>(map->column_of(u0 / kArc)));
    const int last = std::min(map->columns - 1, static_cast<int>(map->column_of(u1 / kArc)) + 1);
    for (int column = first; column <= last; ++column) each(column, kArc * map->angle(column));
  };
  const auto rows = [&](float v0, float v1, auto&& each) {
    const int first = std::max(0, static_cast<int>(map->row_of(v0)));
    const int last = std::min(map->rows - 1, static_cast<int>(map->row_of(v1)) + 1);
    for (int row = first; row <= last; ++row) each(row, map->height(row));
  };

  // Mouth and jaw: the resting skin, moved. What depends on the column alone is worked out once.
  const Mouth mouth(e);
  struct Across {
    float opening, chin, near;
  };
  std::vector<Across> across(static_cast<std::size_t>(map->columns));
  columns(-0.115f, 0.115f, [&](int column, float u) {
    across[static_cast<std::size_t>(column)] = {
        mouth.opening(u), std::exp(-0.5f * square(u / 0.050f)) * (1 - smoothstep(0.09f, 0.113f, std::abs(u))),
        std::exp(-0.5f * square(u / 0.030f))};
  });
  rows(0.036f, 0.1495f, [&](int row, float v) {
    const float near_row = std::exp(-0.5f * square((v - kLipLine) / 0.016f));
    const float fade = smoothstep(0.036f, 0.046f, v);
    const float jaw_back =
        0.0050f * e.jaw * smoothstep(kLipLine, 0.10f, v) * (1 - smoothstep(0.105f, 0.145f, v));
    columns(-0.115f, 0.115f, [&](int column, float u) {
      const std::size_t at = map->at(column, row);
      const Across& a = across[static_cast<std::size_t>(column)];
      const float near_mouth = a.near * near_row;
      const float stretched = u * (1 + near_mouth * (kMouthHalf / mouth.half - 1));
      const float skin_v = v + mouth.smile * square(u / kMouthHalf) * near_mouth;
      const float top = kLipLine - 0.16f * mouth.gap * a.opening;
      const float bottom = kLipLine + mouth.drop(a.opening, a.chin, kLipLine);
      float lifted = skin_v;
      if (skin_v >= bottom) {
        float source = skin_v;
        for (int i = 0; i < 6; ++i)
          source = skin_v - mouth.drop(a.opening, a.chin, std::max(source, kLipLine));
        lifted = std::max(source, kLipLine);
      } else if (skin_v <= top && top < kLipLine) {
        lifted += (kLipLine - top) * std::exp(-0.5f * square((v - top) / 0.010f));
      }
      const float column_from = rest_.column_of(stretched / kArc),
                  row_from = rest_.row_of(v + (lifted - v) * fade);
      float r = sample(rest_, rest_.radius_m, column_from, row_from);
      Vec3 c = sample(rest_, rest_.albedo, column_from, row_from);
      r += mouth.push * near_mouth - jaw_back * a.chin;
      const float opening = bottom - top;
      if (opening > 1e-5f && skin_v > top && skin_v < bottom) {
        const float middle = 0.5f * (top + bottom), depth = 0.5f * opening - std::abs(skin_v - middle);
        const float inside = smoothstep(0, 0.0016f, depth) * clamp01(opening / 0.003f);
        const float tooth_end = top + std::min(0.0075f, 0.62f * opening);
        const float teeth = (1 - smoothstep(tooth_end - 0.0010f, tooth_end + 0.0004f, skin_v)) *
                            (1 - smoothstep(0.75f, 1.0f, std::abs(u) / (0.9f * mouth.half)));
        const float gaps = 0.10f * std::exp(-square(std::sin(u * 420) / 0.18f));
        const Vec3 tongue =
            mix(Vec3{0.20f, 0.09f, 0.085f}, Vec3{0.44f, 0.20f, 0.19f}, smoothstep(middle, bottom, skin_v));
        c = mix(c, mix(tongue, Vec3{0.76f, 0.73f, 0.66f} * (1 - gaps), teeth), inside);
        r -= inside * (0.0060f + 0.0060f * (1 - teeth));
      }
      map->radius_m[at] = r;
      map->albedo[at] = c;
    });
  });

  // Eyes and brows.
  const float raise = 0.0040f * e.brow;
  rows(-0.042f, 0.016f, [&](int row, float v) {
    columns(-0.062f, 0.062f, [&](int column, float u) {
      const std::size_t at = map->at(column, row);
      const float side = u < 0 ? -1.0f : 1.0f, s = std::abs(u);
      const Vec3 around = with_brows(map->albedo[at], u, v, raise);
      const Eye it = eye(s, v, around, e, side);
      const float keep = 1 - smoothstep(0.056f, 0.062f, s);
      map->radius_m[at] += it.relief * keep;
      map->albedo[at] = mix(map->albedo[at], it.albedo, keep);
    });
  });
  return map;
}

}  // namespace relievo::sim
