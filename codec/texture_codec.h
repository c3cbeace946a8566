// SPDX-License-Identifier: Apache-2.0
// Ways to send a texture behind one interface, and the table of them; what their bytes are, FORMAT.md says.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>

#include "base/image.h"
#include "base/result.h"
#include "base/stream.h"
#include "codec/frame3d_codec.h"
#include "codec/video_encoder_kind.h"

namespace relievo {

struct TextureEncodeOptions {
  int quality = 80;                                    // 1..100; lossless codecs do not look at it
  bool key = false;                                    // must decode alone
  VideoEncoderKind encoder = VideoEncoderKind::kAuto;  // of H.264; another one begins with a key picture
  double rate_hz = 0;  // pictures a second, of one stream always as many; 0: nobody waits for them
};

/// Of one stream: the pictures of a codec may build on each other. One thread at a time.
class TextureEncoder {
 public:
  virtual ~TextureEncoder() = default;
  /// Appends the section of an RGB (3 channels) or grey (1) picture to `out`; true: it decodes alone. Fails
  /// on a picture larger than the codec takes. The same pictures in the same order give the same bytes on
  /// one machine, but of hardware encoders.
  virtual Result<bool> encode(View8 picture, const TextureEncodeOptions& options, Bytes& out) = 0;
  /// What a log should say, once, of the pictures encoded so far: VideoEncoder::take_notice(). Else empty.
  virtual std::string take_notice() { return {}; }
};

/// Of one stream. One thread at a time. Any bytes: they give an error, never a crash, a hang or memory beyond
/// what the declared size takes.
class TextureDecoder {
 public:
  virtual ~TextureDecoder() = default;
  /// RGB, into the memory of `out` where that fits. Fails unless the picture is of exactly this size.
  virtual Status decode(std::span<const std::uint8_t> section, std::uint32_t width, std::uint32_t height,
                        Image8& out) = 0;
  /// Takes in what others may build on and nobody needs to see.
  virtual Status remember(std::span<const std::uint8_t>, std::uint32_t, std::uint32_t) { return {}; }
  /// Whether what the section builds on, if anything, was the last one decoded here.
  virtual bool can_decode(std::span<const std::uint8_t>) const { return true; }
};

/// Nothing for kNone and codecs that this version does not know.
std::unique_ptr<TextureEncoder> make_texture_encoder(TextureCodec codec);
std::unique_ptr<TextureDecoder> make_texture_decoder(TextureCodec codec);

/// Fails where this build or machine cannot encode it, saying why: better known before a stream begins.
Status check_texture_codec(TextureCodec codec, VideoEncoderKind encoder = VideoEncoderKind::kAuto);

/// Whether a section of this codec needs none before it. Looks at its first bytes alone.
bool texture_is_key(TextureCodec codec, std::span<const std::uint8_t> section);

/// Pixels that a byte of a section may stand for; writers fill up with zeros.
std::uint64_t most_texture_pixels_per_byte(TextureCodec codec);

/// "jpeg", "webp", "png", "h264", "none", or the number of one that this version does not know.
std::string texture_codec_name(TextureCodec codec);
/// Nothing where there is none of that name; "none" is none.
std::optional<TextureCodec> texture_codec_named(std::string_view name);
/// "jpeg, webp, png or h264": for messages and help.
std::string texture_codec_names();

}  // namespace relievo
