// SPDX-License-Identifier: Apache-2.0
#include "codec/texture_codec.h"

#include <array>
#include <utility>

#include "codec/jpeg_texture.h"
#include "codec/row_names.h"
#include "codec/texture_h264.h"
#include "codec/texture_png.h"
#include "codec/texture_webp.h"

namespace relievo {
namespace {

constexpr std::uint64_t kStillPixelsPerByte = 256;     // a JPEG's 64 pixels take 2 bits at least
constexpr std::uint64_t kVideoPixelsPerByte = 16'384;  // a picture like the one before takes a few bytes

/// A codec whose pictures are each by itself.
struct Still {
  Status (*append)(View8 picture, int quality, Bytes& out);
  Result<Image8> (*decode)(std::span<const std::uint8_t> bytes, std::uint32_t width, std::uint32_t height);
};

class StillEncoder final : public TextureEncoder {
 public:
  explicit StillEncoder(const Still& still) : still_(still) {}
  Result<bool> encode(View8 picture, const TextureEncodeOptions& options, Bytes& out) override {
    const std::size_t start = out.size();
    if (auto status = still_.append(picture, options.quality, out); !status) return status.error();
    const auto pixels =
        static_cast<std::uint64_t>(picture.width) * static_cast<std::uint64_t>(picture.height);
    out.resize(std::max(out.size(), start + pixels / kStillPixelsPerByte + 1));
    return true;
  }

 private:
  const Still& still_;
};

class StillDecoder final : public TextureDecoder {
 public:
  explicit StillDecoder(const Still& still) : still_(still) {}
  Status decode(std::span<const std::uint8_t> section, std::uint32_t width, std::uint32_t height,
                Image8& out) override {
    auto picture = still_.decode(section, width, height);
    if (!picture) return picture.error();
    out = std::move(*picture);
    return {};
  }

 private:
  const Still& still_;
};

constexpr Still kJpeg{append_jpeg, decode_jpeg};
constexpr Still kWebp{append_webp, decode_webp};
constexpr Still kPng{
    [](View8 picture, int, Bytes& out) { return append_png(picture, PngEffort::kFast, out); }, decode_png};

/// A codec is a row here.
struct Row {
  TextureCodec codec;
  std::string_view name;
  const Still* still;  // null: H.264
};
constexpr std::array kRows{Row{TextureCodec::kJpeg, "jpeg", &kJpeg}, Row{TextureCodec::kWebp, "webp", &kWebp},
                           Row{TextureCodec::kPng, "png", &kPng}, Row{TextureCodec::kH264, "h264", nullptr}};

const Row* row_of(TextureCodec codec) {
  for (const Row& row : kRows)
    if (row.codec == codec) return &row;
  return nullptr;
}

}  // namespace

std::unique_ptr<TextureEncoder> make_texture_encoder(TextureCodec codec) {
  const Row* row = row_of(codec);
  if (row == nullptr) return nullptr;
  if (row->still == nullptr) return make_h264_texture_encoder();
  return std::make_unique<StillEncoder>(*row->still);
}

std::unique_ptr<TextureDecoder> make_texture_decoder(TextureCodec codec) {
  const Row* row = row_of(codec);
  if (row == nullptr) return nullptr;
  if (row->still == nullptr) return make_h264_texture_decoder();
  return std::make_unique<StillDecoder>(*row->still);
}

Status check_texture_codec(TextureCodec codec, VideoEncoderKind kind) {
  const auto encoder = make_texture_encoder(codec);
  if (!encoder) return Error{"there is no texture codec " + texture_codec_name(codec)};
  const Image8 picture(640, 480, 3);  // hardware encoders take none much smaller
  Bytes unused;
  const auto alone = encoder->encode(picture.view(), {.encoder = kind}, unused);
  return alone ? Status() : Status(alone.error());
}

bool texture_is_key(TextureCodec codec, std::span<const std::uint8_t> section) {
  return codec != TextureCodec::kH264 || h264_texture_is_key(section);
}

std::uint64_t most_texture_pixels_per_byte(TextureCodec codec) {
  return codec == TextureCodec::kH264 ? kVideoPixelsPerByte : kStillPixelsPerByte;
}

std::string texture_codec_name(TextureCodec codec) {
  if (codec == TextureCodec::kNone) return "none";
  const Row* row = row_of(codec);
  return row != nullptr ? std::string(row->name) : std::to_string(static_cast<int>(codec));
}

std::optional<TextureCodec> texture_codec_named(std::string_view name) {
  for (const Row& row : kRows)
    if (row.name == name) return row.codec;
  return std::nullopt;
}

std::string texture_codec_names() {
  return names_of(kRows);
}

}  // namespace relievo
