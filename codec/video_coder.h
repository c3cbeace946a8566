// SPDX-License-Identifier: Apache-2.0
// H.264 of planar pictures, without delay: one picture in, one access unit out. Encoders are libavcodec's:
// libx264, or the hardware's; a build without libavcodec (RELIEVO_VIDEO=OFF) says so where one is created.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <string>

#include "base/result.h"
#include "base/stream.h"
#include "codec/video_encoder_kind.h"
#include "codec/video_unit.h"

namespace relievo {

/// Planes that somebody else owns: luma, and of 4:2:0 blue and red difference, half as wide and high. A
/// sample of 8 bits is a byte, of 10 bits a native uint16_t of 0..1023.
struct VideoView {
  std::array<const std::uint8_t*, 3> planes{};
  std::array<std::ptrdiff_t, 3> stride_bytes{};  // may be below 0
};

/// The same, to be written.
struct VideoPlanes {
  std::array<std::uint8_t*, 3> planes{};
  std::array<std::ptrdiff_t, 3> stride_bytes{};
};

/// Of libx264: each takes more time, and fewer bytes, than the one before.
enum class VideoSpeed : std::uint8_t { kUltrafast, kSuperfast, kVeryfast };

/// What may change from picture to picture.
struct VideoPictureOptions {
  double rate_factor = 23;  // 1 (finest) .. 51 (coarsest), clamped: libx264's CRF
  bool key = false;  // an IDR picture, with its parameter sets; the first one is, whatever is said here
};

/// One stream. No B pictures, no lookahead, no SEI; of x264, the same pictures give the same bytes. Hardware
/// encoders begin anew, with a key picture, where the quality changes. One thread at a time.
class VideoEncoder {
 public:
  /// Fails on a format that is no VideoFormat (see there), and without that H.264 encoder. x264 codes so many
  /// `slices` of a picture on a thread each; it needs a few more bytes for more of them.
  static Result<VideoEncoder> create(const VideoFormat& format, VideoSpeed speed = VideoSpeed::kSuperfast,
                                     VideoEncoderKind kind = VideoEncoderKind::kX264, int slices = 1);
  VideoEncoder(VideoEncoder&&) noexcept;
  VideoEncoder& operator=(VideoEncoder&&) noexcept;
  ~VideoEncoder();

  /// Appends one access unit, Annex B, to `out`; true: an IDR picture, which decodes alone. Every other one
  /// needs the picture encoded before it. After an error the next picture is an IDR picture. Where a hardware
  /// encoder fails, does not open anew, or gives what decoders would not take, libx264 codes this picture, as
  /// an IDR picture, and all that follow.
  Result<bool> encode(const VideoView& picture, const VideoPictureOptions& options, Bytes& out);

  /// The same without a copy: what was put into the planes that next_picture() gave last, which are the
  /// encoder's, hold anything before, and are valid until encode().
  Result<VideoPlanes> next_picture();
  Result<bool> encode(const VideoPictureOptions& options, Bytes& out);

  /// What a log should say of it, once: that another encoder than the one asked for makes the pictures from
  /// now on, and why. Else empty.
  std::string take_notice();

 private:
  struct State;
  explicit VideoEncoder(std::unique_ptr<State> state);
  std::unique_ptr<State> state_;
};

/// One stream. One thread at a time.
class VideoDecoder {
 public:
  /// Fails without an H.264 decoder.
  static Result<VideoDecoder> create();
  VideoDecoder(VideoDecoder&&) noexcept;
  VideoDecoder& operator=(VideoDecoder&&) noexcept;
  ~VideoDecoder();

  /// One access unit as check_access_unit() wants it. The planes are the decoder's and stay until its next
  /// call. Any bytes: memory is spent for pictures of `format` alone. Fails on what is damaged (nothing is
  /// concealed), and after an error on everything up to the next IDR picture. That a picture which is no IDR
  /// follows the one it builds on is for the caller to see to.
  Result<VideoView> decode(std::span<const std::uint8_t> unit, const VideoFormat& format);

 private:
  struct State;
  explicit VideoDecoder(std::unique_ptr<State> state);
  std::unique_ptr<State> state_;
};

}  // namespace relievo
