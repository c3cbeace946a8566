// SPDX-License-Identifier: Apache-2.0
#include "capture/reconstruct/step_keeping.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <numbers>

#include "capture/pattern/schedule.h"
#include "capture/reconstruct/join_exposures.h"
#include "capture/reconstruct/texture.h"

namespace relievo {
namespace {

constexpr int kColumns = 64;  // samples of a picture
constexpr int kRows = 48;
constexpr float kStandsOut = 12;    // of 255: differences below may be noise
constexpr int kLeastSamples = 300;  // that stand out
constexpr float kLeastCoherent = 0.6F;
constexpr float kMixed = 0.2F;    // of an exposure under another slide than the rest: no code is safe
constexpr int kLongUnknown = 60;  // frames, after which the last known phase tells nothing

constexpr float kPi = std::numbers::pi_v<float>;

constexpr std::size_t kDriftSamples = 300;
constexpr std::size_t kLeastDriftSamples = 12;
constexpr double kLeastDriftTime_s = 0.3;

float towards_whole(float phase) {
  return phase - std::round(phase);
}

}  // namespace

StepKeeper::StepKeeper(const Pattern& pattern, const Rig& rig)
    : active_(pattern.slides == 2 &&
              (pattern.scheme == Scheme::kComplementary || pattern.scheme == Scheme::kWhiteField)),
      // Slides s = +-1 in each pixel: 1 1' 2 2' is a, -a, b, -b, whose transform of period 4 is (1 + i)(a -
      // b); 1 W 2 W is a, 1, b, 1: a - b. Squared, the sign of a - b is gone.
      reference_(pattern.scheme == Scheme::kWhiteField ? 0 : kPi / 2),
      frame_ns_(std::llround(1e9 / rig.frame_rate)) {}

void StepKeeper::sample(const CapturedFrame& frame) {
  const int width = frame.picture.width();
  const int height = frame.picture.height();
  const bool interlaced = frame.scan == Scan::kInterlaced;
  for (int half = 0; half < 2; ++half) {
    Samples& out = now_[half];
    out.clear();
    const Image8& picture =
        !interlaced || half == 0 ? (half == 0 ? frame.picture : frame.complement) : frame.picture;
    const bool between = interlaced && first_row(frame.field_order, half) == 1;
    for (int j = 0; j < kRows; ++j) {
      // An even row; the other field has the rows above and below it.
      const int y = std::min(j * height / kRows / 2 * 2, height - 1);
      const std::uint8_t* above = picture.row(between ? std::max(1, y - 1) : y);
      const std::uint8_t* below = picture.row(between ? std::min(y + 1, height - 1) : y);
      for (int i = 0; i < kColumns; ++i) {
        const int x = 3 * ((2 * i + 1) * width / (2 * kColumns));
        for (int c = 0; c < 3; ++c)
          out.push_back(0.5F * (static_cast<float>(above[x + c]) + static_cast<float>(below[x + c])));
      }
    }
  }
}

/// With x the four exposures less their mean, X = x0 - i x1 - x2 + i x3 is, for an exposure that begins at
/// phase j + m, (a - b) times i^j ((1 - m) + i m) and the schedule's own factor. Albedo, ambient light and
/// every constant cancel, and noise adds nothing to the mean of X^2.
std::optional<float> StepKeeper::estimate() const {
  float sum_re = 0;
  float sum_im = 0;
  float sum = 0;
  int count = 0;
  for (std::size_t i = 0; i < now_[0].size(); ++i) {
    const float re = before_[0][i] - now_[0][i];
    const float im = now_[1][i] - before_[1][i];
    const float size = std::sqrt(re * re + im * im);
    if (size < kStandsOut) continue;
    sum_re += (re * re - im * im) / size;
    sum_im += 2 * re * im / size;
    sum += size;
    ++count;
  }
  if (count < kLeastSamples || std::hypot(sum_re, sum_im) < kLeastCoherent * sum) return std::nullopt;
  float angle =
      (std::atan2(sum_im, sum_re) - reference_) / 2;  // of i^j ((1 - m) + i m), half a turn undecided
  while (angle < 0) angle += kPi;
  while (angle >= kPi) angle -= kPi;
  const float whole = angle >= kPi / 2 ? 1 : 0;
  const float t = angle - whole * kPi / 2;
  return whole + std::sin(t) / (std::sin(t) + std::cos(t));
}

const CapturedFrame* StepKeeper::read(const CapturedFrame& frame) {
  report_ = {};
  if (!active_) return late_ ? regroup_and_keep(frame) : &frame;
  sample(frame);
  const bool follows = before_time_ns_ && frame.time_ns - *before_time_ns_ > frame_ns_ / 2 &&
                       frame.time_ns - *before_time_ns_ < frame_ns_ * 3 / 2;
  if (follows) report_.phase = estimate();
  std::swap(now_, before_);
  before_time_ns_ = frame.time_ns;
  if (report_.phase) {
    phase_ = report_.phase;
    unknown_ = 0;
  } else if (++unknown_ > kLongUnknown) {
    phase_.reset();
  }

  report_.mixed = phase_ && std::fabs(towards_whole(*phase_)) > kMixed;
  if (report_.mixed) {
    settled_ = false;
    keep_second(frame);  // the next frame may be the first of a field's delay
    return nullptr;
  }
  const bool late = phase_ ? std::lround(*phase_) % 2 == 1 : late_;
  // A drift passes through mixed exposures; what jumps may be one frame's error, from motion about a lost
  // frame.
  if (late != late_ && settled_) {
    settled_ = false;
    keep_second(frame);
    return nullptr;
  }
  settled_ = report_.phase.has_value();
  report_.restarted = late != late_;
  late_ = late;
  if (late_) return regroup_and_keep(frame);
  if (!settled_) keep_second(frame);  // the next frame may tell that this one is late
  return &frame;
}

void StepKeeper::exchange(const CapturedFrame& frame) {
  late_ = !late_;
  keep_second(frame);
}

const CapturedFrame* StepKeeper::regroup_and_keep(const CapturedFrame& frame) {
  const CapturedFrame* out = regroup(frame);
  keep_second(frame);
  return out;
}

void StepKeeper::keep_second(const CapturedFrame& frame) {
  copy_picture(frame.scan == Scan::kInterlaced ? frame.picture : frame.complement, second_);
  second_time_ns_ = frame.time_ns;
}

const CapturedFrame* StepKeeper::regroup(const CapturedFrame& frame) {
  if (!second_time_ns_ || frame.time_ns - *second_time_ns_ >= frame_ns_ * 3 / 2 ||
      frame.time_ns <= *second_time_ns_)
    return nullptr;
  made_.number = frame.number;
  made_.time_ns = *second_time_ns_ + frame_ns_ / 2;
  join_exposures(second_, frame, made_);
  report_.regrouped = true;
  return &made_;
}

void StepDrift::add(std::int64_t time_ns, float phase) {
  // The nearest phase to the last one, of those that look alike.
  const double now = added_ == 0 ? static_cast<double>(phase)
                                 : last_ + std::remainder(static_cast<double>(phase) - last_, 2.0);
  last_ = now;
  const Sample sample{static_cast<double>(time_ns) * 1e-9, now};
  if (samples_.size() < kDriftSamples) {
    samples_.push_back(sample);
  } else {
    samples_[added_ % kDriftSamples] = sample;
  }
  ++added_;
}

std::optional<double> StepDrift::per_second() const {
  if (samples_.size() < kLeastDriftSamples) return std::nullopt;
  double time = 0;
  double phase = 0;
  for (const Sample& s : samples_) {
    time += s.time_s;
    phase += s.phase;
  }
  const auto n = static_cast<double>(samples_.size());
  time /= n;
  phase /= n;
  double square = 0;
  double product = 0;
  for (const Sample& s : samples_) {
    square += (s.time_s - time) * (s.time_s - time);
    product += (s.time_s - time) * (s.phase - phase);
  }
  if (square < n * kLeastDriftTime_s * kLeastDriftTime_s / 12) return std::nullopt;
  return product / square;
}

std::string step_advice(float phase, std::optional<double> drift_per_second, double frame_rate) {
  constexpr double kDrifts = 0.02;  // exposures a second: less takes minutes to matter
  char text[400];
  if (drift_per_second && std::fabs(*drift_per_second) > kDrifts) {
    std::snprintf(
        text, sizeof text,
        "projector and camera are not in step: they drift by %.2f fields a second, so every %.1f s exposures "
        "lie across slide changes; lock the camera to the projector (genlock), set both to the same rate, or "
        "shorten the exposure",
        *drift_per_second, 1 / std::fabs(*drift_per_second));
    return text;
  }
  const float beyond = towards_whole(phase);
  const double field_ms = 500 / frame_rate;
  if (beyond > 0) {
    std::snprintf(text, sizeof text,
                  "exposures end %.0f %% after the slide has changed: shorten them to %.0f %% of what they "
                  "are, or begin "
                  "them earlier (a field is %.1f ms)",
                  static_cast<double>(100 * beyond), static_cast<double>(100 * (1 - beyond)), field_ms);
  } else {
    std::snprintf(
        text, sizeof text,
        "exposures begin %.0f %% before the slide changes: begin them later by that part of an exposure (a "
        "field is %.1f ms)",
        static_cast<double>(-100 * beyond), field_ms);
  }
  return text;
}

}  // namespace relievo
