// SPDX-License-Identifier: Apache-2.0
// Images: interleaved rows, top row first. Pixel convention: the centre of the first pixel is (0, 0).
#pragma once

#include <cassert>
#include <cstddef>
#include <cstdint>
#include <vector>

namespace relievo {

/// A view of rows that somebody else owns. `stride` is in elements, so a field of an interlaced picture is a
/// view of every second row.
template <typename T>
struct ImageView {
  const T* data = nullptr;
  int width = 0;
  int height = 0;
  int channels = 0;
  std::ptrdiff_t stride = 0;

  const T* row(int y) const {
    assert(y >= 0 && y < height);
    return data + y * stride;
  }
  bool empty() const { return width == 0 || height == 0; }

  /// Every second row from `first` (0 or 1): one field of an interlaced picture.
  ImageView field(int first) const {
    return {data + first * stride, width, (height - first + 1) / 2, channels, stride * 2};
  }
};

/// Owns width * height * channels elements. Move-only, since pictures are large; clone() where a copy is
/// meant.
template <typename T>
class Image {
 public:
  Image() = default;
  Image(int width, int height, int channels)
      : width_(width),
        height_(height),
        channels_(channels),
        data_(static_cast<std::size_t>(width) * static_cast<std::size_t>(height) *
              static_cast<std::size_t>(channels)) {}
  Image(Image&&) = default;
  Image& operator=(Image&&) = default;

  Image clone() const { return Image(*this); }

  int width() const { return width_; }
  int height() const { return height_; }
  int channels() const { return channels_; }
  bool empty() const { return data_.empty(); }
  std::size_t size() const { return data_.size(); }
  std::ptrdiff_t stride() const { return static_cast<std::ptrdiff_t>(width_) * channels_; }

  T* data() { return data_.data(); }
  const T* data() const { return data_.data(); }
  T* row(int y) {
    assert(y >= 0 && y < height_);
    return data_.data() + y * stride();
  }
  const T* row(int y) const {
    assert(y >= 0 && y < height_);
    return data_.data() + y * stride();
  }

  ImageView<T> view() const { return {data_.data(), width_, height_, channels_, stride()}; }

 private:
  Image(const Image&) = default;

  int width_ = 0;
  int height_ = 0;
  int channels_ = 0;
  std::vector<T> data_;
};

using Image8 = Image<std::uint8_t>;  // RGB or grey, 0..255
using ImageF = Image<float>;
using View8 = ImageView<std::uint8_t>;

}  // namespace relievo
