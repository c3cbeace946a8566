// SPDX-License-Identifier: Apache-2.0
#include "codec/texture_h264.h"

#include <turbojpeg.h>

#include <algorithm>
#include <array>
#include <optional>
#include <string>
#include <thread>
#include <utility>

#include "base/fit_image.h"
#include "codec/byte_io.h"
#include "codec/video_coder.h"

namespace relievo {
namespace {

constexpr std::size_t kHeadBytes = 4;
constexpr std::uint32_t kNothing = 0;  // what a picture that decodes alone builds on
constexpr int kLeastSide = 16;

struct Destroy {
  void operator()(void* handle) const { tjDestroy(handle); }
};
using Handle = std::unique_ptr<void, Destroy>;

/// The id by which the next section names this one.
std::uint32_t id_of(std::span<const std::uint8_t> section) {
  return std::max(fnv1a(section), kNothing + 1);
}

std::uint32_t builds_on(std::span<const std::uint8_t> section) {
  return ByteReader(section).read<std::uint32_t>();
}

/// H.264 has no odd sides with colour, and none below a macroblock's.
int coded_side(int side) {
  return std::max(kLeastSide, side + side % 2);
}

/// The picture with its last column and row repeated.
Image8 enlarged(View8 picture, int width, int height) {
  Image8 out(width, height, picture.channels);
  const std::size_t pixel = static_cast<std::size_t>(picture.channels);
  for (int y = 0; y < height; ++y) {
    const std::uint8_t* from = picture.row(std::min(y, picture.height - 1));
    for (int x = 0; x < width; ++x)
      std::copy_n(from + static_cast<std::size_t>(std::min(x, picture.width - 1)) * pixel, pixel,
                  out.row(y) + static_cast<std::size_t>(x) * pixel);
  }
  return out;
}

/// A picture as 4:2:0, full range, BT.601, in planes of its size.
Status to_planes(View8 picture, const VideoPlanes& to) {
  if (picture.channels == 1) {
    const auto width = static_cast<std::size_t>(picture.width);
    for (int y = 0; y < picture.height; ++y)
      std::copy_n(picture.row(y), width, to.planes[0] + y * to.stride_bytes[0]);
    for (const std::size_t p : {1U, 2U})
      for (int y = 0; y < picture.height / 2; ++y)
        std::fill_n(to.planes[p] + y * to.stride_bytes[p], width / 2, std::uint8_t{128});
    return {};
  }
  thread_local const Handle handle(tjInitCompress());
  std::array<unsigned char*, 3> planes = to.planes;
  std::array<int, 3> strides{static_cast<int>(to.stride_bytes[0]), static_cast<int>(to.stride_bytes[1]),
                             static_cast<int>(to.stride_bytes[2])};
  if (!handle ||
      tjEncodeYUVPlanes(handle.get(), picture.data, picture.width, static_cast<int>(picture.stride),
                        picture.height, TJPF_RGB, planes.data(), strides.data(), TJSAMP_420, 0) != 0)
    return Error{std::string("texture cannot be turned into luma and chroma: ") +
                 tjGetErrorStr2(handle.get())};
  return {};
}

Status to_rgb(const VideoView& view, Image8& out) {
  thread_local const Handle handle(tjInitDecompress());
  std::array<const unsigned char*, 3> planes = view.planes;
  const std::array<int, 3> strides{static_cast<int>(view.stride_bytes[0]),
                                   static_cast<int>(view.stride_bytes[1]),
                                   static_cast<int>(view.stride_bytes[2])};
  if (!handle ||
      tjDecodeYUVPlanes(handle.get(), planes.data(), strides.data(), TJSAMP_420, out.data(), out.width(),
                        static_cast<int>(out.stride()), out.height(), TJPF_RGB, 0) != 0)
    return Error{std::string("texture cannot be turned into RGB: ") + tjGetErrorStr2(handle.get())};
  return {};
}

/// The quickest has two thirds of the time, at both ends, and more bytes: for 1920x1080 at 60 Hz, where there
/// are 17 ms for everything, and not at 30.
VideoSpeed speed_for(const VideoFormat& format, double rate_hz) {
  constexpr double kMany = 90e6;  // pixels a second
  return format.width * format.height * rate_hz < kMany ? VideoSpeed::kSuperfast : VideoSpeed::kUltrafast;
}

/// Streams in a hurry are coded in several slices at once where there are processors to spare.
int slices_for(VideoSpeed speed) {
  constexpr int kProcessorsEach = 4, kMost = 4;
  if (speed != VideoSpeed::kUltrafast) return 1;
  return std::clamp(static_cast<int>(std::thread::hardware_concurrency()) / kProcessorsEach, 1, kMost);
}

class Encoder final : public TextureEncoder {
 public:
  Result<bool> encode(View8 picture, const TextureEncodeOptions& options, Bytes& out) override {
    if (picture.channels != 3 && picture.channels != 1)
      return Error{"texture has " + std::to_string(picture.channels) + " channels, not 3 (RGB) or 1 (grey)"};
    const VideoFormat format = h264_texture_format(picture.width, picture.height);
    if (!video_ || format_ != format || encoder_ != options.encoder) {
      const VideoSpeed speed = speed_for(format, options.rate_hz);
      auto made = VideoEncoder::create(format, speed, options.encoder, slices_for(speed));
      if (!made) return made.error();
      video_.emplace(std::move(*made));
      format_ = format;
      encoder_ = options.encoder;
    }
    Image8 larger;
    if (format.width != picture.width || format.height != picture.height) {
      larger = enlarged(picture, format.width, format.height);
      picture = larger.view();
    }
    const auto planes = video_->next_picture();
    if (!planes) return planes.error();
    if (auto status = to_planes(picture, *planes); !status) return status.error();
    const std::size_t start = out.size();
    append(out, last_);
    const auto key = video_->encode({.rate_factor = rate_factor(options.quality), .key = options.key}, out);
    if (!key) {
      out.resize(start);
      return key.error();
    }
    if (*key) put(out, start, kNothing);
    const auto pixels = static_cast<std::uint64_t>(format.width) * static_cast<std::uint64_t>(format.height);
    out.resize(std::max(out.size(), start + pixels / most_texture_pixels_per_byte(TextureCodec::kH264) + 1));
    last_ = id_of(std::span(out).subspan(start));
    return *key;
  }

  std::string take_notice() override { return video_ ? video_->take_notice() : std::string(); }

 private:
  /// About the error of a JPEG of that quality.
  static double rate_factor(int quality) { return 51 - 0.35 * quality; }

  std::optional<VideoEncoder> video_;
  VideoFormat format_;
  VideoEncoderKind encoder_{};
  std::uint32_t last_ = kNothing;
};

class Decoder final : public TextureDecoder {
 public:
  Status decode(std::span<const std::uint8_t> section, std::uint32_t width, std::uint32_t height,
                Image8& out) override {
    const auto view = take(section, width, height);
    if (!view) return view.error();
    const int columns = static_cast<int>(width);
    const int rows = static_cast<int>(height);
    fit_image(columns, rows, 3, out);
    return to_rgb(*view, out);
  }

  Status remember(std::span<const std::uint8_t> section, std::uint32_t width, std::uint32_t height) override {
    const auto view = take(section, width, height);
    return view ? Status() : Status(view.error());
  }

  bool can_decode(std::span<const std::uint8_t> section) const override {
    return section.size() > kHeadBytes && (builds_on(section) == kNothing || builds_on(section) == last_);
  }

 private:
  Result<VideoView> take(std::span<const std::uint8_t> section, std::uint32_t width, std::uint32_t height) {
    if (section.size() <= kHeadBytes) return Error{"texture is cut short"};
    if (!can_decode(section))
      return Error{"texture builds on a picture that is not there: wait for the next key frame"};
    constexpr std::uint32_t kFarTooLarge = 65'536;  // checked exactly with the rest
    const VideoFormat format = h264_texture_format(static_cast<int>(std::min(width, kFarTooLarge)),
                                                   static_cast<int>(std::min(height, kFarTooLarge)));
    if (!video_) {
      auto made = VideoDecoder::create();
      if (!made) return made.error();
      video_.emplace(std::move(*made));
    }
    const auto unit = section.subspan(kHeadBytes);
    const bool says_alone = builds_on(section) == kNothing;
    last_ = kNothing;
    const auto alone = check_access_unit(unit, format);
    if (!alone) return alone.error().in("texture");
    if (*alone != says_alone) return Error{"texture does not agree with itself whether it decodes alone"};
    const auto view = video_->decode(unit, format);
    if (!view) return view.error().in("texture");
    last_ = id_of(section);
    return *view;
  }

  std::optional<VideoDecoder> video_;
  std::uint32_t last_ = kNothing;  // the id of the picture that video_ has
};

}  // namespace

std::unique_ptr<TextureEncoder> make_h264_texture_encoder() {
  return std::make_unique<Encoder>();
}
std::unique_ptr<TextureDecoder> make_h264_texture_decoder() {
  return std::make_unique<Decoder>();
}

std::span<const std::uint8_t> h264_access_unit(std::span<const std::uint8_t> section) {
  return section.subspan(std::min(section.size(), kHeadBytes));
}

VideoFormat h264_texture_format(int width, int height) {
  return {.width = coded_side(width), .height = coded_side(height)};
}

bool h264_texture_is_key(std::span<const std::uint8_t> section) {
  return section.size() > kHeadBytes && builds_on(section) == kNothing;
}

}  // namespace relievo
