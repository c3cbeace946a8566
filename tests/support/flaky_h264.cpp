// SPDX-License-Identifier: Apache-2.0
// A hardware encoder that opens and then fails, on a machine without any: in front of libavcodec's functions,
// linked into a test or preloaded into a program, it has "h264_v4l2m2m" be libx264 and fail as the
// environment says, which is read each time:
//   FLAKY_H264_PICTURES=N  each one opened takes N pictures and no more
//   FLAKY_H264_OPENS=N     so many open, then none does
//   FLAKY_H264_KEYS=0      pictures are of the kinds it likes, whatever it is asked for
#include <dlfcn.h>

extern "C" {
#include <libavcodec/avcodec.h>
#include <libavutil/opt.h>
}

#include <cstdlib>
#include <cstring>
#include <limits>
#include <map>
#include <mutex>
#include <string>

namespace {

thread_local bool is_next = false;  // what is opened next is one of these
std::mutex mutex;
std::map<const AVCodecContext*, int> pictures;  // taken so far, by each of these
int opened = 0;

int told(const char* name) {
  const char* text = std::getenv(name);
  return text == nullptr ? std::numeric_limits<int>::max() : std::atoi(text);
}

template <class Function>
Function* real(const char* name) {
  return reinterpret_cast<Function*>(dlsym(RTLD_NEXT, name));
}

}  // namespace

extern "C" {

const AVCodec* avcodec_find_encoder_by_name(const char* name) {
  static const auto find = real<decltype(avcodec_find_encoder_by_name)>("avcodec_find_encoder_by_name");
  is_next = name != nullptr && std::strcmp(name, "h264_v4l2m2m") == 0;
  return find(is_next ? "libx264" : name);
}

int avcodec_open2(AVCodecContext* codec, const AVCodec* found, AVDictionary** options) {
  static const auto open = real<decltype(avcodec_open2)>("avcodec_open2");
  const std::lock_guard lock(mutex);
  pictures.erase(codec);  // the address of one that is gone
  if (!is_next) return open(codec, found, options);
  is_next = false;
  if (opened >= told("FLAKY_H264_OPENS")) return AVERROR(EBUSY);
  ++opened;
  av_opt_set(codec->priv_data, "preset", "superfast", 0);
  av_opt_set(codec->priv_data, "tune", "zerolatency", 0);
  av_opt_set_int(codec->priv_data, "forced-idr", 1, 0);
  pictures[codec] = 0;
  return open(codec, found, options);
}

int avcodec_send_frame(AVCodecContext* codec, const AVFrame* picture) {
  static const auto send = real<decltype(avcodec_send_frame)>("avcodec_send_frame");
  {
    const std::lock_guard lock(mutex);
    const auto at = pictures.find(codec);
    if (at != pictures.end()) {
      if (++at->second > told("FLAKY_H264_PICTURES")) return AVERROR(EIO);
      if (told("FLAKY_H264_KEYS") == 0 && picture != nullptr)
        const_cast<AVFrame*>(picture)->pict_type = AV_PICTURE_TYPE_NONE;
    }
  }
  return send(codec, picture);
}

}  // extern "C"
