// SPDX-License-Identifier: Apache-2.0
#include <linux/videodev2.h>

#include "capture/source/v4l2/capture_format.h"

namespace relievo::v4l2 {
namespace {

/// As V4L2 defines it where the driver says "default".
std::uint32_t default_encoding(std::uint32_t colorspace) {
  switch (colorspace) {
    case V4L2_COLORSPACE_REC709:
    case V4L2_COLORSPACE_DCI_P3:
      return V4L2_YCBCR_ENC_709;
    case V4L2_COLORSPACE_BT2020:
      return V4L2_YCBCR_ENC_BT2020;
    case V4L2_COLORSPACE_SMPTE240M:
      return V4L2_YCBCR_ENC_SMPTE240M;
    default:
      return V4L2_YCBCR_ENC_601;
  }
}

}  // namespace

Result<YcbcrCoding> coding_of(std::uint32_t colorspace, std::uint32_t ycbcr_enc, std::uint32_t quantization,
                              bool ycbcr) {
  if (ycbcr_enc == V4L2_YCBCR_ENC_DEFAULT) ycbcr_enc = default_encoding(colorspace);
  YcbcrCoding coding;
  switch (ycbcr ? ycbcr_enc : std::uint32_t{V4L2_YCBCR_ENC_601}) {
    case V4L2_YCBCR_ENC_601:
    case V4L2_YCBCR_ENC_XV601:
    case 5:  // V4L2_YCBCR_ENC_SYCC of older drivers: the same
      break;
    case V4L2_YCBCR_ENC_709:
    case V4L2_YCBCR_ENC_XV709:
      coding = {.kr = 0.2126, .kb = 0.0722};
      break;
    case V4L2_YCBCR_ENC_BT2020:
      coding = {.kr = 0.2627, .kb = 0.0593};
      break;
    case V4L2_YCBCR_ENC_SMPTE240M:
      coding = {.kr = 0.212, .kb = 0.087};
      break;
    default:
      return Error{"the driver codes colours as Y'CbCr number " + std::to_string(ycbcr_enc) +
                   ", which is not known here: ask for an RGB format with --format"};
  }
  if (quantization == V4L2_QUANTIZATION_DEFAULT) {
    const bool full = !ycbcr || colorspace == V4L2_COLORSPACE_JPEG;
    coding.full_range = full;
  } else {
    coding.full_range = quantization == V4L2_QUANTIZATION_FULL_RANGE;
  }
  return coding;
}

}  // namespace relievo::v4l2
