// SPDX-License-Identifier: Apache-2.0
#include "codec/video_file.h"

#include <cstring>
#include <limits>
#include <string>

extern "C" {
#include <libavformat/avformat.h>
#include <libavutil/error.h>
#include <libavutil/mathematics.h>
}

#include "base/whole_file.h"
#include "codec/texture_h264.h"
#include "codec/video_unit.h"

namespace relievo {
namespace {

namespace fs = std::filesystem;

constexpr AVRational kTicks{1, 90'000};  // a second; what MP4 counts in, Matroska rounds to milliseconds
constexpr std::int64_t kLongestTicks = std::numeric_limits<std::int32_t>::max();  // of a picture in MP4: 6 h
constexpr std::int64_t kUsualTicks = 3000;  // of a picture after which none comes, and none came before

std::string text_of(int code) {
  constexpr int kMostErrno = 4095;
  if (const int error = AVUNERROR(code); error > 0 && error <= kMostErrno) return write_failure(error);
  char text[AV_ERROR_MAX_STRING_SIZE];
  return av_strerror(code, text, sizeof text) == 0 ? text : "error " + std::to_string(code);
}

struct FreePacket {
  void operator()(AVPacket* packet) const { av_packet_free(&packet); }
};

}  // namespace

struct VideoFile::State {
  fs::path file, unfinished;
  bool is_mp4;
  AVFormatContext* context = nullptr;
  AVStream* stream = nullptr;
  VideoFormat format;
  Bytes parameter_sets, unit;
  // The last picture, which is written when it is known how long it lasts.
  std::unique_ptr<AVPacket, FreePacket> packet{av_packet_alloc()};
  std::int64_t first_ns = 0, ticks = 0, duration_ticks = kUsualTicks;

  State(fs::path name, bool as_mp4)
      : file(std::move(name)), unfinished(unfinished_name(file)), is_mp4(as_mp4) {}
  State(const State&) = delete;
  State& operator=(const State&) = delete;
  ~State() {
    close();
    std::error_code ignored;
    fs::remove(unfinished, ignored);
  }
  int close() {
    if (context == nullptr) return 0;
    const int code = context->pb != nullptr ? avio_closep(&context->pb) : 0;
    avformat_free_context(context);
    context = nullptr;
    return code;
  }
  Error cannot(const std::string& why) const { return {"cannot write " + file.string() + ": " + why}; }
  Error cannot(int code) const { return cannot(text_of(code)); }

  Status begin() {
    if (const int code =
            avformat_alloc_output_context2(&context, nullptr, is_mp4 ? "mp4" : "matroska", nullptr);
        code < 0)
      return cannot(code);
    if (const int code = avio_open(&context->pb, unfinished.c_str(), AVIO_FLAG_WRITE); code < 0)
      return cannot(code);
    stream = avformat_new_stream(context, nullptr);
    if (stream == nullptr) return cannot(AVERROR(ENOMEM));
    stream->time_base = kTicks;
    AVCodecParameters& p = *stream->codecpar;
    p.codec_type = AVMEDIA_TYPE_VIDEO;
    p.codec_id = AV_CODEC_ID_H264;
    p.width = format.width;
    p.height = format.height;
    p.format = 0;  // AV_PIX_FMT_YUV420P; its range is said apart
    // As FORMAT.md, "Texture codec 4", has them.
    p.color_range = AVCOL_RANGE_JPEG;
    p.color_primaries = AVCOL_PRI_BT709;
    p.color_trc = AVCOL_TRC_IEC61966_2_1;
    p.color_space = AVCOL_SPC_SMPTE170M;
    p.chroma_location = AVCHROMA_LOC_CENTER;
    p.extradata =
        static_cast<std::uint8_t*>(av_mallocz(parameter_sets.size() + AV_INPUT_BUFFER_PADDING_SIZE));
    if (p.extradata == nullptr) return cannot(AVERROR(ENOMEM));
    std::memcpy(p.extradata, parameter_sets.data(), parameter_sets.size());
    p.extradata_size = static_cast<int>(parameter_sets.size());
    if (const int code = avformat_write_header(context, nullptr); code < 0) return cannot(code);
    return {};
  }

  Status write_last() {
    if (packet->data == nullptr) return {};
    packet->pts = packet->dts = ticks;
    packet->duration = duration_ticks;
    av_packet_rescale_ts(packet.get(), kTicks, stream->time_base);
    if (const int code = av_interleaved_write_frame(context, packet.get()); code < 0) return cannot(code);
    return {};
  }
};

VideoFile::VideoFile(std::unique_ptr<State> state) : state_(std::move(state)) {}
VideoFile::VideoFile(VideoFile&&) noexcept = default;
VideoFile& VideoFile::operator=(VideoFile&&) noexcept = default;
VideoFile::~VideoFile() = default;

Result<VideoFile> VideoFile::create(const fs::path& file) {
  if (!is_video_name(file)) return Error{file.string() + ": a video's name ends in .mp4 or .mkv"};
  auto target = where_to_write(file);
  if (!target) return target.error();
  av_log_set_level(AV_LOG_ERROR);
  return VideoFile(std::make_unique<State>(*std::move(target), file.extension() == ".mp4"));
}

Status VideoFile::check(std::span<const std::uint8_t> section, int width, int height) const {
  const State& s = *state_;
  const VideoFormat format = h264_texture_format(width, height);
  const auto unit = h264_access_unit(section);
  const auto is_key = check_access_unit(unit, format);
  if (!is_key) return is_key.error().in("texture");
  const bool is_first = s.context == nullptr;
  if (is_first && !*is_key) return Error{"the texture's video does not begin with a key frame"};
  if (is_first || !*is_key) return {};
  Bytes sets;
  append_parameter_sets(unit, sets);
  if (s.format == format && s.parameter_sets == sets) return {};
  return Error{"the texture's video begins anew with other settings: it does not fit one file as it is"};
}

Status VideoFile::add(std::span<const std::uint8_t> section, int width, int height, std::int64_t time_ns) {
  if (auto fits = check(section, width, height); !fits) return fits;
  State& s = *state_;
  const auto unit = h264_access_unit(section);
  const bool is_first = s.context == nullptr;
  if (is_first) {
    s.format = h264_texture_format(width, height);
    append_parameter_sets(unit, s.parameter_sets);
    s.first_ns = time_ns;
    if (auto status = s.begin(); !status) return status;
  }
  const std::int64_t ticks = av_rescale(time_ns - s.first_ns, kTicks.den, 1'000'000'000);
  if (!is_first) {
    if (ticks <= s.ticks) return Error{"a frame is not later than the one before it"};
    s.duration_ticks = ticks - s.ticks;
    if (s.is_mp4 && s.duration_ticks > kLongestTicks)
      return s.cannot("a gap of " + std::to_string(s.duration_ticks / kTicks.den / 3600) +
                      " h between two frames is longer than MP4 holds; a name that ends in .mkv holds it");
    if (auto status = s.write_last(); !status) return status;
  }
  s.ticks = ticks;
  s.unit.clear();
  append_lean_unit(unit, s.unit);
  if (const int code = av_new_packet(s.packet.get(), static_cast<int>(s.unit.size())); code < 0)
    return s.cannot(code);
  std::memcpy(s.packet->data, s.unit.data(), s.unit.size());
  s.packet->flags = *check_access_unit(unit, s.format) ? AV_PKT_FLAG_KEY : 0;
  return {};
}

Status VideoFile::finish() {
  State& s = *state_;
  if (s.context == nullptr) return Error{"there is no picture to write"};
  if (auto status = s.write_last(); !status) return status;
  if (const int code = av_write_trailer(s.context); code < 0) return s.cannot(code);
  if (const int code = s.close(); code < 0) return s.cannot(code);
  std::error_code failed;
  fs::rename(s.unfinished, s.file, failed);
  if (failed) return s.cannot(failed.message());
  return {};
}

}  // namespace relievo
