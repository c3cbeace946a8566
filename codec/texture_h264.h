// SPDX-License-Identifier: Apache-2.0
// Texture codec 4: a picture of an H.264 stream, with the id of the picture it builds on.
#pragma once

#include <cstdint>
#include <memory>
#include <span>

#include "codec/texture_codec.h"
#include "codec/video_unit.h"

namespace relievo {

/// At most 8192 pixels a side and 2^24 in all. Every encode() fails in builds without H.264, saying so; so
/// does every decode().
std::unique_ptr<TextureEncoder> make_h264_texture_encoder();
std::unique_ptr<TextureDecoder> make_h264_texture_decoder();

/// The access unit of a section, and the format of its pictures, of that size as frames declare it. Any
/// bytes; nothing is checked.
std::span<const std::uint8_t> h264_access_unit(std::span<const std::uint8_t> section);
VideoFormat h264_texture_format(int width, int height);

/// Whether the section builds on no other. Any bytes.
bool h264_texture_is_key(std::span<const std::uint8_t> section);

}  // namespace relievo
