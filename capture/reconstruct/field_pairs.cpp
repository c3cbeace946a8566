// SPDX-License-Identifier: Apache-2.0
#include "capture/reconstruct/field_pairs.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <cstdlib>

#include "base/fit_image.h"
#include "capture/pattern/schedule.h"
#include "capture/reconstruct/texture.h"

namespace relievo {
namespace {

// White frames. Contrast is that of two exposures: a slide and its complement differ wherever the projector
// reaches, two exposures under white only by noise and motion.
constexpr float kWhiteShare = 0.5F;      // of the greatest contrast of late: what has less is white
constexpr float kLeastContrast = 0.03F;  // what has less is white whatever came before
constexpr std::size_t kLate = 6;         // frames

// Ambient light under white-field.
constexpr int kSampleColumns = 3;
constexpr int kSampleRows = 4;
constexpr float kDark = 0.15F;  // of the brightest white: darker places say nothing
constexpr int kBins = 128;      // of a channel's share of what white shows

/// The rows of one field over the whole picture: the rows between are the mean of those above and below.
void spread_field(const View8& field, int first, int height, Image8& out) {
  fit_image(field.width, height, 3, out);
  const int samples = field.width * 3;
  for (int y = 0; y < height; ++y) {
    std::uint8_t* to = out.row(y);
    const int line = (y - first) / 2;
    if (y >= first && (y - first) % 2 == 0) {
      std::copy_n(field.row(line), samples, to);
      continue;
    }
    const int above_line = y < first ? 0 : line;
    const std::uint8_t* above = field.row(above_line);
    const std::uint8_t* below = field.row(std::min(y < first ? 0 : line + 1, field.height - 1));
    for (int i = 0; i < samples; ++i) to[i] = static_cast<std::uint8_t>((above[i] + below[i] + 1) / 2);
  }
}

std::uint8_t clamp_byte(float v) {
  return static_cast<std::uint8_t>(std::clamp(v + 0.5F, 0.F, 255.F));
}

}  // namespace

FieldPairs::FieldPairs(Scheme scheme, const Rig& rig)
    : scheme_(scheme), colour_matrix_(rig.colour_matrix), frame_ns_(std::llround(1e9 / rig.frame_rate)) {}

const CapturedFrame* FieldPairs::read(const SeenFrame& seen, WorkerPool& pool) {
  const CapturedFrame& frame = seen.light;
  if (scheme_ == Scheme::kWhiteFrame) {
    if (is_white(frame)) {
      copy_picture(seen.captured.picture, white_);
      white_time_ns_ = texture_time_ns_ = frame.time_ns;
      ++textures_;
      return nullptr;
    }
    if (white_.empty()) texture_time_ns_ = frame.time_ns;
    return &frame;
  }
  ++textures_;
  texture_time_ns_ = frame.time_ns;
  if (scheme_ != Scheme::kWhiteField) return &frame;
  texture_time_ns_ += frame_ns_ / 2;
  return with_complement(frame, pool);
}

bool FieldPairs::white(const CapturedFrame& frame, Image8& out) const {
  if (scheme_ == Scheme::kWhiteFrame && !white_.empty()) {
    copy_picture(white_, out);
    return true;
  }
  if (scheme_ != Scheme::kWhiteField) return false;
  if (frame.scan == Scan::kProgressive) {
    copy_picture(frame.complement, out);
  } else {
    spread_field(frame.complement_field(), first_row(frame.field_order, 1), frame.picture.height(), out);
  }
  return true;
}

void FieldPairs::forget() {
  white_ = {};
  contrasts_.clear();
}

bool FieldPairs::is_white(const CapturedFrame& frame) {
  const View8 first = frame.slide_field();
  const View8 second = frame.complement_field();
  std::int64_t apart = 0;
  std::int64_t sum = 0;
  for (int y = 0; y < std::min(first.height, second.height); y += kSampleRows) {
    const std::uint8_t* a = first.row(y);
    const std::uint8_t* b = second.row(y);
    for (int i = 0; i < 3 * first.width; i += kSampleColumns) {
      apart += std::abs(a[i] - b[i]);
      sum += a[i] + b[i];
    }
  }
  const float contrast = sum > 0 ? static_cast<float>(apart) / static_cast<float>(sum) : 0;
  if (contrasts_.size() == kLate) contrasts_.erase(contrasts_.begin());
  contrasts_.push_back(contrast);
  return contrast < kLeastContrast ||
         contrast < kWhiteShare * *std::max_element(contrasts_.begin(), contrasts_.end());
}

/// Ambient light adds to a slide's exposure as to white's, so that what is missing to white is darker than
/// the complement's exposure would be, and zero crossings shift. Where a slide leaves a channel dark, ambient
/// light is all there is: the ratio to white that most dark places have, per calibrated channel, gives it.
/// Returned as a matrix: captured ambient light of captured white.
std::array<float, 9> FieldPairs::ambient_of_white(const CapturedFrame& frame) const {
  using Matrix = Eigen::Matrix<float, 3, 3, Eigen::RowMajor>;
  const Matrix m =
      Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(colour_matrix_.data()).cast<float>();
  const View8 slide = frame.slide_field();
  const View8 white = frame.complement_field();
  const auto colour = [&](const View8& view, int x, int y) {
    const std::uint8_t* p = view.row(y) + 3 * x;
    return Eigen::Vector3f(m * Eigen::Vector3f(p[0], p[1], p[2]));
  };
  const int rows = std::min(slide.height, white.height);
  float brightest = 0;
  for (int y = 0; y < rows; y += kSampleRows)
    for (int x = 0; x < white.width; x += kSampleColumns)
      brightest = std::max(brightest, colour(white, x, y).maxCoeff());
  std::array<std::array<std::uint32_t, kBins>, 3> histograms{};
  for (int y = 0; y < rows; y += kSampleRows) {
    for (int x = 0; x < white.width; x += kSampleColumns) {
      const Eigen::Vector3f w = colour(white, x, y);
      if (w.minCoeff() < kDark * brightest) continue;
      const Eigen::Vector3f share = colour(slide, x, y).cwiseQuotient(w);
      for (int c = 0; c < 3; ++c) {
        const float place = (share[c] + 0.25F) * (kBins / 1.5F);  // -0.25 .. 1.25
        if (!(place >= 0 && place < kBins)) continue;             // nor where all is black
        ++histograms[static_cast<std::size_t>(c)][static_cast<std::size_t>(place)];
      }
    }
  }
  Eigen::Vector3f ambient;
  for (int c = 0; c < 3; ++c) {
    const auto& h = histograms[static_cast<std::size_t>(c)];
    // The peak of the lower half, as the mean over the bins around it.
    constexpr int kAround = 2;
    std::uint32_t most = 0;
    float sum = 0;
    for (int i = kAround; i < kBins / 2; ++i) {
      std::uint32_t count = 0;
      float moment = 0;
      for (int k = i - kAround; k <= i + kAround; ++k) {
        const std::uint32_t n = h[static_cast<std::size_t>(k)];
        count += n;
        moment += static_cast<float>(n) * (static_cast<float>(k) + 0.5F);
      }
      if (count <= most) continue;
      most = count;
      sum = moment;
    }
    const float place = most > 0 ? sum / static_cast<float>(most) : kBins / 6.F;
    ambient[c] = std::clamp(place * (1.5F / kBins) - 0.25F, 0.F, 0.5F);
  }
  const Matrix of_captured = m.inverse() * ambient.asDiagonal() * m;
  std::array<float, 9> out{};
  Eigen::Map<Matrix>(out.data()) = of_captured;
  return out;
}

/// "The difference between the full white and the color patterns give the missing complementary slide" (5.5).
/// White is the mean of the fields before and after the slide's, so that what moves is in the middle of its
/// way as the slide saw it; after a lost frame the one after it alone.
const CapturedFrame* FieldPairs::with_complement(const CapturedFrame& frame, WorkerPool& pool) {
  const std::array<float, 9> k = ambient_of_white(frame);
  const bool progressive = frame.scan == Scan::kProgressive;
  const Image8& picture = progressive ? frame.complement : frame.picture;  // the white rows are in
  const bool before =
      !white_.empty() && frame.time_ns > white_time_ns_ && frame.time_ns - white_time_ns_ < frame_ns_ * 3 / 2;
  const int width = picture.width();
  const int height = picture.height();
  made_.number = frame.number;
  made_.time_ns = frame.time_ns;
  made_.scan = frame.scan;
  made_.field_order = frame.field_order;
  copy_picture(frame.picture, made_.picture);
  if (progressive) fit_image(width, height, 3, made_.complement);
  Image8& out = progressive ? made_.complement : made_.picture;
  const int first = progressive ? 0 : first_row(frame.field_order, 1);
  const int step = progressive ? 1 : 2;
  const int lines = (height - first + step - 1) / step;
  pool.for_ranges(lines, [&](int begin, int end, int) {
    for (int line = begin; line < end; ++line) {
      const int y = first + line * step;
      const std::uint8_t* now = picture.row(y);
      const std::uint8_t* earlier = before ? white_.row(y) : now;
      // The slide where white was seen: its own row, or the mean of the rows above and below.
      const int up = progressive ? y : y > 0 ? y - 1 : y + 1;
      const int down = progressive ? y : y + 1 < height ? y + 1 : y - 1;
      const std::uint8_t* above = frame.picture.row(up);
      const std::uint8_t* below = frame.picture.row(down);
      std::uint8_t* to = out.row(y);
      for (int x = 0; x < 3 * width; x += 3) {
        float w[3];
        for (int c = 0; c < 3; ++c) w[c] = 0.5F * static_cast<float>(now[x + c] + earlier[x + c]);
        for (int c = 0; c < 3; ++c) {
          const float ambient = k[static_cast<std::size_t>(3 * c)] * w[0] +
                                k[static_cast<std::size_t>(3 * c + 1)] * w[1] +
                                k[static_cast<std::size_t>(3 * c + 2)] * w[2];
          const float slide = 0.5F * static_cast<float>(above[x + c] + below[x + c]);
          to[x + c] = clamp_byte(w[c] - slide + ambient);
        }
      }
    }
  });
  copy_picture(picture, white_);
  white_time_ns_ = frame.time_ns;
  return &made_;
}

}  // namespace relievo
