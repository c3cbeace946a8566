// SPDX-License-Identifier: Apache-2.0
#include "capture/reconstruct/texture.h"

#include <algorithm>

#include "base/fit_image.h"
#include "capture/reconstruct/rows.h"

namespace relievo {

namespace {

/// `add` gets each row, the two of the other exposure beside it, how many samples they have, and where to.
template <typename Add>
void add_all(const CapturedFrame& frame, WorkerPool& pool, Image8& out, const Add& add) {
  const View8 picture = frame.picture.view();
  const int height = picture.height;
  const int samples = picture.width * 3;
  fit_image(picture.width, height, 3, out);
  pool.for_ranges(height, [&](int begin, int end, int) {
    for (int y = begin; y < end; ++y) {
      if (frame.scan == Scan::kProgressive) {
        const std::uint8_t* other = frame.complement.row(y);
        add(picture.row(y), other, other, samples, out.row(y));
      } else if (height == 1) {  // there is no other field
        std::copy_n(picture.row(y), samples, out.row(y));
      } else {
        // Rows above and below are of the other field; at the picture's edge the one there is serves for
        // both.
        add(picture.row(y), picture.row(y > 0 ? y - 1 : y + 1), picture.row(y + 1 < height ? y + 1 : y - 1),
            samples, out.row(y));
      }
    }
  });
}

}  // namespace

void add_fields(const CapturedFrame& frame, WorkerPool& pool, Image8& out) {
  add_all(frame, pool, out, row_kernels().add_rows);
}

void add_fields(const CapturedFrame& frame, const CameraResponse& response, WorkerPool& pool, Image8& out) {
  if (response.is_straight()) return add_fields(frame, pool, out);
  add_all(frame, pool, out,
          [&](const std::uint8_t* own, const std::uint8_t* above, const std::uint8_t* below, int samples,
              std::uint8_t* to) {
            for (int i = 0; i < samples; ++i) {
              const float other = 0.5F * (response.light_of(above[i]) + response.light_of(below[i]));
              to[i] = response.value_of(response.light_of(own[i]) + other);
            }
          });
}

void copy_picture(const Image8& from, Image8& to) {
  fit_image(from.width(), from.height(), from.channels(), to);
  std::copy_n(from.data(), from.size(), to.data());
}

}  // namespace relievo
